"""The layout of the viewer: strip that follows the ego, close-ups, errors, actions, events, summary.

```
+------------------------------------------------------------+
| overview: follows the ego, 2 s trails                       |
+------------------------------+-----------------------------+
| close-up by kind | by object | errors | GOSPA | focus | ... |
| | association of each tracker|                              |
| | smoothed tracks            |                              |
+------------------+-----------+---------+-------------------+
| action, speed    | events   | worst moments | legend | ...  |
+------------------+----------+-------------------------------+
```

On compact roads (crossings, roundabouts) the overview stands beside the close-up instead. Where a tracker mixes motion
models, another page beside the errors shows the probability of each for the vehicle in focus. The page of the focus has
a page of its own for each of some vehicles, the one in focus first.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import VisualizerComponentMapping

from sensors.origin import KINDS
from testbed.evaluation.metric import METRICS
from testbed.log import palette, paths
from testbed.log.modes import Modes
from testbed.log.record import RoadGeometry, RunMeta
from testbed.log.road_shape import AHEAD, BEHIND, fixed_middle, road_shape, road_span

TRAIL = 2.0  # [s]
BACKGROUND = palette.rgb(palette.GROUND)
CLOSE = (-22.0, 48.0, -16.0, 16.0)  # [m] close-up: behind and before the ego, left and right of it on the screen
HALF = {"strip": 12.0, "long": 22.0}  # [m] the overview shows at least this far to the sides
MARGIN = 8.0  # [m] around a map that is shown whole, for the ids of tracks below its lowest lane
AROUND, CLOSE_AROUND = 65.0, 26.0  # [m] overview and close-up on compact roads, where traffic comes from all sides

ERRORS = ("gwd", "nees_position", "position", "velocity", "heading_deg", "length")
GOSPA = ("gospa", "localisation", "missed", "false", "unassigned", "ghosts")
FOCUS = ("gwd", "position", "velocity", "heading_deg")
MOTION = ("velocity", "heading_deg")  # errors beside the probabilities of motion models

Metrics = Mapping[str, Sequence[str]]  # tracker -> names of the metrics it has


def title(metric: str) -> str:
    """Title of the plot of a metric: with its unit, or its name where the log has another one."""
    return METRICS[metric].title if metric in METRICS else metric


def layout(
    meta: RunMeta,
    metrics: Metrics,
    focus: Sequence[int],
    road: RoadGeometry,
    full: bool,
    modes: Modes = MappingProxyType({}),
    in_front: bool = False,
) -> rrb.Blueprint:
    """The layout of all views; without geometry (`full` false) plots take the place of the scenes.

    `focus` has the objects with a page of their own, the one to be shown first; `in_front` opens these pages.
    """
    plots = _plots(meta, metrics, focus, modes, in_front)
    shape = road_shape(road)
    if not full:
        rows, shares = [plots], [2.4]
    elif shape == "compact":
        columns = rrb.Horizontal(_overview(meta, shape, road), _closeups(meta, shape), plots, column_shares=[4, 5, 5])
        rows, shares = [columns], [2.4]
    else:
        closer = rrb.Horizontal(_closeups(meta, shape), plots, column_shares=[5, 4])
        rows, shares = [_overview(meta, shape, road), closer], [0.62 if shape == "strip" else 1.0, 1.8]
    return arranged([*rows, _bottom()], [*shares, 1.0])


def arranged(rows: Sequence[Any], shares: Sequence[float]) -> rrb.Blueprint:
    """Rows of views of which each has its share of the height; of the viewer's own panels only the time is there."""
    return rrb.Blueprint(
        rrb.Vertical(*rows, row_shares=shares),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TopPanel(state="expanded"),
        rrb.TimePanel(state="collapsed", timeline=paths.TIME),
        auto_layout=False,
        auto_views=False,
    )


def _scene(
    name: str,
    bounds: tuple[float, float, float, float],
    hide: Sequence[str] = (),
    overrides: dict | None = None,
    show: Sequence[str] = (),
    origin: str = paths.FOLLOW,
) -> rrb.Spatial2DView:
    x0, x1, y0, y1 = bounds
    return rrb.Spatial2DView(
        origin=f"/{origin}",
        contents=["+ /world/**", *(f"- /{path}" for path in (f"{paths.SMOOTHED}/**", *hide) if path not in show)],
        name=name,
        visual_bounds=rrb.VisualBounds2D(x_range=[x0, x1], y_range=[y0, y1]),
        background=BACKGROUND,
        overrides=overrides,
    )


def _overview(meta: RunMeta, shape: str, road: RoadGeometry) -> rrb.Spatial2DView:
    """The traffic around the ego; dots show where each track was during the last seconds."""
    recent = rrb.VisibleTimeRanges(
        timeline=paths.TIME,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-TRAIL),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    trails: dict = {}
    for i, name in enumerate(meta.trackers):
        dots = rr.Points2D.from_fields(colors=palette.tracker(i), radii=0.16, show_labels=False)
        trails[f"/{paths.tracker(name, 'center')}"] = [dots.visualizer(), recent]
    hide = [
        paths.RADAR_FOV,
        paths.RING_LABELS,
        *(paths.tracker(n, layer) for n in meta.trackers for layer in ("covariance", "heading")),
    ]
    bounds = (-AROUND, AROUND, -AROUND, AROUND)
    if shape != "compact":
        half = HALF[shape]
        if (span := road_span(road)) is not None and fixed_middle(road)[1] is not None:
            half = max(12.0, float(span[1, 1] - span[0, 1]) / 2 + MARGIN)
        bounds = (-BEHIND, AHEAD, -half, half)
    return _scene(f"Overview (follows the ego, {TRAIL:g} s trails)", bounds, hide, trails, origin=paths.OVERVIEW)


def _closeups(meta: RunMeta, shape: str) -> rrb.Tabs:
    r = CLOSE_AROUND
    bounds = (-r, r, -r, r) if shape == "compact" else CLOSE
    pages = [_scene("Close-up: by kind", bounds), _scene("By object", bounds, overrides=_by_object())]
    for name in meta.trackers:
        others = [f"world/trackers/{paths.plain(other)}/**" for other in meta.trackers if other != name]
        pages.append(_scene(f"Only {name}: association", bounds, others, _by_owner(name)))
    pages.append(_scene("Smoothed", bounds, _tracked(meta), show=[f"{paths.SMOOTHED}/**"]))
    return rrb.Tabs(*pages, active_tab=0)


def _tracked(meta: RunMeta) -> list[str]:
    layers = [layer for layer in (*paths.TRACKER_LAYERS, *paths.CHANGE_LAYERS) if layer not in ("center", "label")]
    return [paths.tracker(name, layer) for name in meta.trackers for layer in layers]


def _by_object() -> dict:
    points = rr.Points2D.from_fields(radii=0.17)
    overrides = {
        f"/{paths.detections(kind)}": points.visualizer(mappings=[_source("Points2D:colors", "radar:object_color")])
        for kind in KINDS
    }
    outlines = rr.LineStrips2D.from_fields(radii=0.08)
    mapping = _source("LineStrips2D:colors", "truth:object_color")
    return overrides | {f"/{paths.TRUTH_CONTOUR}": outlines.visualizer(mappings=[mapping])}


def _by_owner(name: str) -> dict:
    """Tracks in colours of their own, and detections in the colour of the track that they were assigned to."""
    points, color = rr.Points2D.from_fields(radii=0.17), f"radar:owner_color_{paths.plain(name)}"
    overrides = {
        f"/{paths.detections(kind)}": points.visualizer(mappings=[_source("Points2D:colors", color)]) for kind in KINDS
    }
    boxes = rr.LineStrips2D.from_fields(radii=0.12)
    mapping = _source("LineStrips2D:colors", "track:color")
    named = rr.Points2D.from_fields(radii=0.01, show_labels=True)
    return overrides | {
        f"/{paths.tracker(name, 'extent')}": boxes.visualizer(mappings=[mapping]),
        f"/{paths.tracker(name, 'label')}": [named.visualizer()],
    }


def _source(target: str, component: str) -> VisualizerComponentMapping:
    """Draw `target` from a component of ours; the only use of this interface of rerun, which may still change."""
    return VisualizerComponentMapping(target=target, source_kind="SourceComponent", source_component=component)


def _plots(meta: RunMeta, metrics: Metrics, focus: Sequence[int], modes: Modes, in_front: bool) -> rrb.Tabs:
    known = list(dict.fromkeys(name for names in metrics.values() for name in names))
    rest = [name for name in known if name not in ERRORS + GOSPA]
    pages: list = []
    active = 0
    for name, chosen in (("Errors (mean over tracks)", ERRORS), ("GOSPA and counts", GOSPA), ("More", rest)):
        views = [_plot(metric, meta, metrics) for metric in chosen if metric in known]
        if views:
            pages.append(rrb.Grid(*views, grid_columns=2, name=name))
    if focus:
        active = len(pages) if in_front else 0
        pages.append(rrb.Tabs(*(_focus(meta, metrics, key) for key in focus), name="Focus", active_tab=0))
        if any(modes.values()):
            pages.append(_motion(meta, metrics, focus[0], modes))
        pages.append(rrb.TextDocumentView(origin=f"/{paths.OBJECTS}", name="Objects"))
    if not pages:  # a recording without truth
        pages.append(rrb.TextDocumentView(origin=f"/{paths.CONFIG}", name="No truth, no errors"))
    return rrb.Tabs(*pages, active_tab=active)


def _plot(metric: str, meta: RunMeta, metrics: Metrics) -> rrb.TimeSeriesView:
    series = [f"+ /{paths.metric(metric, name)}" for name in meta.trackers if metric in metrics[name]]
    return rrb.TimeSeriesView(origin="/", contents=series, name=title(metric), plot_legend=_legend(metric == "gwd"))


def _legend(visible: bool = True) -> rrb.PlotLegend:
    return rrb.PlotLegend(corner=rrb.Corner2D.RightTop, visible=visible)


def _focus(meta: RunMeta, metrics: Metrics, focus: int) -> rrb.Vertical:
    """Errors of one object, and its numbers of detections, measured and expected."""
    views = _errors_of(meta, metrics, focus, FOCUS)
    seen = f"/{paths.of_object(focus, paths.SEEN)}"
    got = _series("radar:detections", palette.DETECTION["contour"], "detections")
    expected = _series("radar:expected", palette.TRUTH, "expected")
    views.append(_series_view(f"{paths.vehicle(focus)}: detections", {seen: [got, expected]}, True))
    return rrb.Vertical(*views, name=paths.vehicle(focus))


def _motion(meta: RunMeta, metrics: Metrics, focus: int, modes: Modes) -> rrb.Vertical:
    """Probabilities of motion models for one object, a plot for each tracker that mixes some, and errors below."""
    views = []
    for name in meta.trackers:
        if lines := [_series(f"mode:{mode}", palette.mode(k), mode) for k, mode in enumerate(modes.get(name, ()))]:
            series = {f"/{paths.of_object(focus, name)}": lines}
            views.append(_series_view(f"{paths.vehicle(focus)}: motion model of {name} [probability]", series, True))
    views += _errors_of(meta, metrics, focus, MOTION)
    return rrb.Vertical(*views, name=f"Motion: {paths.vehicle(focus)}")


def _errors_of(meta: RunMeta, metrics: Metrics, focus: int, chosen: Sequence[str]) -> list[rrb.TimeSeriesView]:
    """Errors of all trackers about one object, a plot each; a legend in the first."""
    known = [metric for metric in chosen if any(metric in names for names in metrics.values())]
    views = []
    for metric in known:
        series = {
            f"/{paths.of_object(focus, name)}": _series(f"metrics:{metric}", palette.tracker(i), name)
            for i, name in enumerate(meta.trackers)
        }
        views.append(_series_view(f"{paths.vehicle(focus)}: {title(metric)}", series, metric == known[0]))
    return views


def _series(component: str, color: int, name: str) -> rrb.Visualizer:
    line = rr.SeriesLines.from_fields(colors=color, names=name, widths=1.3)
    return line.visualizer(mappings=[_source("Scalars:scalars", component)])


def _series_view(name: str, series: dict, legend: bool) -> rrb.TimeSeriesView:
    contents = [f"+ {path}" for path in series]
    return rrb.TimeSeriesView(origin="/", contents=contents, name=name, overrides=series, plot_legend=_legend(legend))


def _bottom() -> rrb.Horizontal:
    columns = rrb.TextLogColumns(timeline_columns=[paths.TIME], text_log_columns=["LogLevel", "Body"])
    levels = rrb.TextLogRows(filter_by_log_level=["INFO", "WARN", "ERROR"])
    ego = rrb.Vertical(
        rrb.StateTimelineView(origin=f"/{paths.EGO_ACTION}", name="Ego action"),
        rrb.Tabs(
            rrb.TimeSeriesView(origin=f"/{paths.EGO_SPEED}", name="Ego speed [m/s]", plot_legend=_legend(False)),
            rrb.TimeSeriesView(origin="/ego/risk", name="Risk ahead, braking", plot_legend=_legend()),
            active_tab=0,
        ),
    )
    pages = rrb.Tabs(
        rrb.TextDocumentView(origin=f"/{paths.MOMENTS}", name="Worst moments"),
        rrb.TextDocumentView(origin=f"/{paths.LEGEND}", name="Legend"),
        rrb.TextDocumentView(origin=f"/{paths.SUMMARY}", name="Run summary"),
        rrb.TextDocumentView(origin=f"/{paths.CONFIG}", name="Config"),
        active_tab=0,
    )
    events = rrb.TextLogView(origin=f"/{paths.EVENTS}", name="Events", columns=columns, rows=levels)
    return rrb.Horizontal(ego, events, pages, column_shares=[4, 4, 5])
