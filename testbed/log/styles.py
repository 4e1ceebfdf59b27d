"""Static data of a log: colours and sizes of every layer, the road, the fields of view, the names of the curves."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import rerun as rr

from sensors.origin import KINDS
from testbed.log import palette, paths
from testbed.log.layers import dashes, fields_of_view
from testbed.log.record import RoadGeometry
from testbed.log.text import RINGS
from trackers.geometry import unit
from trackers.scan import SensorModel

Static = tuple[str, rr.AsComponents]
RISK_CURVES = (  # name and colour of each of `paths.RISK`
    ("time to collision [s]", palette.tracker(1)),
    ("braking needed [m/s^2]", palette.tracker(0)),
    ("braking [m/s^2]", palette.EGO),
)


def road_layers(road: RoadGeometry) -> Iterator[Static]:
    """The road: wide lines for lanes, since a 2D view cannot fill polygons."""
    yield (
        paths.ROAD_SURFACE,
        rr.LineStrips2D(_lines(road.surface), radii=road.half_width or None, colors=palette.SURFACE, draw_order=-20),
    )
    yield paths.ROAD_EDGES, rr.LineStrips2D(_lines(road.edges), radii=0.1, colors=palette.EDGE, draw_order=-18)
    marks = [dash for line in road.lane_lines for dash in dashes(line)]
    yield paths.ROAD_LANES, rr.LineStrips2D(_lines(marks), radii=0.06, colors=palette.LANE, draw_order=-19)


def _lines(lines: Sequence[np.ndarray]) -> list[np.ndarray]:
    return [np.asarray(line, np.float32) for line in lines]


def scene_styles() -> Iterator[Static]:
    """Truth, detections and the ego."""
    lines, arrows, points = rr.LineStrips2D.from_fields, rr.Arrows2D.from_fields, rr.Points2D.from_fields
    yield paths.WALLS, lines(radii=0.12, colors=palette.WALL, draw_order=-17)
    yield paths.TRUTH_CONTOUR, lines(radii=0.06, draw_order=50, show_labels=False)  # colours by visible share
    yield paths.TRUTH_HEADING, arrows(radii=0.04, draw_order=50)
    yield paths.TRUTH_NAMES, points(radii=0.01, show_labels=True, draw_order=70)
    yield paths.TRUTH_EGO, lines(radii=0.14, colors=palette.EGO, draw_order=2)
    yield paths.EGO_PLAN, lines(radii=0.12, colors=palette.PLAN, draw_order=-5)
    for kind in KINDS:
        radius = 0.11 if kind in ("clutter", "static") else 0.15  # of what a track may live on, ghosts too
        yield paths.detections(kind), points(radii=radius, colors=palette.DETECTION[kind], draw_order=60)


def tracker_styles(index: int, name: str) -> Iterator[Static]:
    """One colour a tracker.

    Later trackers lie thinner on earlier ones, and the truth thinnest on top: where they agree all stay visible.
    """
    color = palette.tracker(index)
    lines, order = rr.LineStrips2D.from_fields, 20 + index
    yield paths.tracker(name, "extent"), lines(radii=max(0.08, 0.14 - 0.03 * index), colors=color, draw_order=order)
    yield paths.tracker(name, "tentative"), lines(radii=0.03, colors=color, draw_order=order)
    yield paths.tracker(name, "covariance"), lines(radii=0.04, colors=color, draw_order=order)
    yield paths.tracker(name, "heading"), rr.Arrows2D.from_fields(radii=0.05, colors=color, draw_order=order)
    points = rr.Points2D.from_fields
    yield paths.tracker(name, "center"), points(radii=0.1, colors=color, show_labels=False, draw_order=order + 10)
    yield paths.tracker(name, "label"), points(radii=0.01, colors=color, show_labels=True, draw_order=order + 10)
    yield paths.smoothed(name, "extent"), lines(radii=0.1, colors=color, draw_order=order)
    yield paths.smoothed(name, "path"), lines(radii=0.05, colors=color, draw_order=order - 10)


def change_styles(index: int, name: str) -> Iterator[Static]:
    """A contour that has changed: before in grey, after in the colour of its tracker."""
    colors = (palette.BEFORE, palette.tracker(index))
    for layer, color, radius in zip(paths.CHANGE_LAYERS, colors, (0.05, 0.09), strict=True):
        yield paths.tracker(name, layer), rr.LineStrips2D.from_fields(radii=radius, colors=color, draw_order=40 + index)


def _rings() -> Iterator[Static]:
    angle = np.linspace(0.0, 2 * np.pi, 97)
    rings = [np.array(r * unit(angle), np.float32) for r in RINGS]
    yield paths.RINGS, rr.LineStrips2D(rings, radii=0.04, colors=palette.RING, draw_order=-16)
    names = [f"{r:g} m" for r in RINGS]
    yield (
        paths.RING_LABELS,
        rr.Points2D([[r, 0.0] for r in RINGS], radii=0.01, labels=names, show_labels=True, colors=palette.BEFORE),
    )


def styles(
    trackers: tuple[str, ...],
    metrics: Mapping[str, Sequence[str]],
    road: RoadGeometry,
    sensors: tuple[SensorModel, ...],
    full: bool,
) -> Iterator[Static]:
    """Everything static of a run; without geometry (`full` false) the curves only."""
    if full:
        yield from road_layers(road)
        yield from scene_styles()
        sectors = _lines(fields_of_view(sensors))
        yield paths.RADAR_FOV, rr.LineStrips2D(sectors, radii=0.05, colors=palette.FOV, draw_order=-15)
        yield from _rings()
        for index, name in enumerate(trackers):
            yield from tracker_styles(index, name)
    for index, name in enumerate(trackers):
        for metric in metrics.get(name, ()):
            curve = rr.SeriesLines(colors=palette.tracker(index), names=name, widths=1.3)
            yield paths.metric(metric, name), curve
    yield paths.EGO_SPEED, rr.SeriesLines(colors=palette.EGO, names="ego", widths=1.3)
    for path, (name, color) in zip(paths.RISK, RISK_CURVES, strict=True):
        yield path, rr.SeriesLines(colors=color, names=name, widths=1.3)
