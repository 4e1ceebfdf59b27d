"""The log of two drives of one seed side by side on one timeline: a scene each, and their curves over each other.

Entities of a drive stand below its name; below that they are those of `paths`. Both drives are complete before the log
is written, so there is nothing that an interruption could leave behind.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from testbed.frame import TRUTH, Frame
from testbed.log import layers, palette, paths, road_shape
from testbed.log.blueprint import BACKGROUND, arranged
from testbed.log.record import RoadGeometry
from testbed.log.stream import Block, Stream
from testbed.log.styles import road_layers, scene_styles, tracker_styles

CURVES = "drive"  # entities of the curves: drive/CURVE/NAME of the drive
TRACKS = "tracks"  # what the tracker of every drive is called in its paths
BOUNDS = (-60.0, 130.0, -14.0, 14.0)  # [m] of a scene: behind and before the ego, left and right on the screen


class LoggedDrive(NamedTuple):
    """One of the two drives."""

    name: str  # part of its paths
    title: str
    frames: Sequence[Frame]
    curves: Mapping[str, NDArray]  # title with unit -> (F,) value at each frame; the same titles in both drives
    events: Sequence[tuple[float, str]]  # time [s] and text


def write_pair(path: Path, run_id: str, drives: Sequence[LoggedDrive], road: RoadGeometry, summary: str) -> None:
    """Write the log (.rrd) of drives, shown from top to bottom, with a summary in markdown.

    `run_id` must be unique: viewers merge recordings of one id. Raises OSError, in one sentence, where it cannot be
    written.
    """
    stream = Stream(path, run_id, _layout(drives))
    for place, drive in enumerate(drives):
        for entity, data in (*road_layers(road), *scene_styles(), *tracker_styles(0, TRACKS)):
            stream.static(f"{drive.name}/{entity}", data)
        for title in drive.curves:
            line = rr.SeriesLines(colors=palette.tracker(place), names=drive.title, widths=1.3)
            stream.static(_curve(title, drive), line)
    stream.static(paths.SUMMARY, rr.TextDocument(summary, media_type="text/markdown"))
    block: Block = {}
    for drive in drives:
        _add(block, drive, road_shape.strip_middle(road))
    stream.send(block)
    stream.close()


def _curve(title: str, drive: LoggedDrive) -> str:
    word = title.split(" [")[0].replace(" ", "_")
    return f"{CURVES}/{paths.part(word)}/{paths.part(drive.name)}"


def _add(block: Block, drive: LoggedDrive, middle: float | None) -> None:

    def put(entity: str, step: int, ns: int, row: layers.Row) -> None:
        block.setdefault((entity, tuple(row)), []).append((step, ns, row))

    action = None
    for k, frame in enumerate(drive.frames):
        when = frame.step, round(frame.time * 1e9)
        for entity, row in _geometry(frame, middle).items():
            put(f"{drive.name}/{entity}", *when, row)
        for title, values in drive.curves.items():
            put(_curve(title, drive), *when, layers.scalar_row(float(values[k])))
        speed = float(np.hypot(*frame.scene.ego.velocity))
        put(paths.EGO_SPEED if drive.name != TRUTH else f"{TRUTH}/{paths.EGO_SPEED}", *when, layers.scalar_row(speed))
        if frame.action != action:
            action = frame.action
            put(f"{drive.name}/{paths.EGO_ACTION}", *when, {"StateChange:state": [action]})
    steps = [frame.step for frame in drive.frames]
    times = np.array([frame.time for frame in drive.frames])
    for time, text in drive.events:
        k = min(int(np.searchsorted(times, time - 1e-6)), len(steps) - 1)
        line: layers.Row = {"TextLog:text": [f"{drive.title}: {text}"], "TextLog:level": ["INFO"]}
        put(paths.EVENTS, steps[k], round(float(times[k]) * 1e9), line)


def _geometry(frame: Frame, middle: float | None) -> layers.Rows:
    tracks, info = next(iter(frame.outputs.values()))
    rows = layers.scene_rows(frame.scene, middle) | layers.plan_rows(frame.plan)
    return rows | layers.tracker_rows(TRACKS, tracks, info)


def _layout(drives: Sequence[LoggedDrive]) -> rrb.Blueprint:
    """A scene each, below them the curves, the actions, the events and the summary."""
    x0, x1, y0, y1 = BOUNDS
    bounds = rrb.VisualBounds2D(x_range=[x0, x1], y_range=[y0, y1])
    scenes = [
        rrb.Spatial2DView(
            origin=f"/{d.name}/{paths.FOLLOW}", contents=[f"+ /{d.name}/world/**"], name=d.title,
            visual_bounds=bounds, background=BACKGROUND,
        )
        for d in drives
    ]  # fmt: skip
    titles = dict.fromkeys(title for d in drives for title in d.curves)
    plots = [
        rrb.TimeSeriesView(
            origin="/", contents=[f"+ /{_curve(title, d)}" for d in drives], name=title,
            plot_legend=rrb.PlotLegend(visible=k == 0),
        )
        for k, title in enumerate(titles)
    ]  # fmt: skip
    actions = [rrb.StateTimelineView(origin=f"/{d.name}/{paths.EGO_ACTION}", name=f"Action: {d.title}") for d in drives]
    words = rrb.Vertical(
        rrb.TextLogView(origin=f"/{paths.EVENTS}", name="Events"),
        rrb.TextDocumentView(origin=f"/{paths.SUMMARY}", name="Summary"),
    )
    below = rrb.Horizontal(rrb.Grid(*plots), rrb.Vertical(*actions), words, column_shares=[5, 3, 3])
    return arranged([*scenes, below], [*[1.0] * len(scenes), 2.0])
