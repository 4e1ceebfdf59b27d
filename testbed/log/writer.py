"""The review log of one run: takes frames and their scores, keeps a block of them, writes it every few steps.

A run that is killed loses at most the block that was not yet written. rerun is imported when the file is opened, so
that a run without a log never pays for it.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np

from sensors.scene import Objects
from testbed.frame import Frame, FrameScore
from testbed.log import layers, palette, paths, road_shape
from testbed.log.modes import modes_of
from testbed.log.record import RoadGeometry, RunMeta, SmoothedTracks
from testbed.log.text import (
    Table,
    Value,
    config_text,
    flat_properties,
    flat_summary,
    legend_text,
    moments_text,
    objects_text,
    summary_text,
    unfinished_text,
)
from trackers.multi.tracks import NO_TRACK, Event, StepInfo, Tracks
from trackers.scan import SensorModel

if TYPE_CHECKING:
    from testbed.log.stream import Block, Stream

Summary = Mapping[str, Value | Mapping[str, Value]]
Scores = Mapping[str, FrameScore]  # by name of the tracker, in the order of the run
LogEvents = Iterable[tuple[str, str]]  # severity, text

SEVERITIES = ("DEBUG", "INFO", "WARN", "ERROR")
PAGES = 3  # objects with a page of their own
CHANGE_SHOWN = 10**9  # [ns] a contour that has changed is drawn so long, where the track was


class RunLog:
    """Log of one run in `path` (.rrd), opened at the first step; use as a context manager.

    Args:
        path: file to write; its directory is made, an older file is replaced when the log is closed. Until then the log
            is `file`, beside it.
        meta: what identifies the run; `run_id` must be unique, viewers merge recordings of one id.
        level: "full" with all geometry, "metrics" with numbers and events only.
        every: steps in a block; a run that is killed loses at most the last block.
        focus: object whose errors have a page of their own until `tables` says which had the worst moments; without it
            the one nearest to the ego at the first step.
    """

    def __init__(
        self,
        path: str | Path,
        meta: RunMeta,
        *,
        level: Literal["full", "metrics"] = "full",
        every: int = 15,
        focus: int | None = None,
    ) -> None:
        if level not in ("full", "metrics"):
            raise ValueError(f"level must be 'full' or 'metrics', got {level!r}; make none where there is to be no log")
        if every < 1:
            raise ValueError(f"every must be at least 1 step, got {every}")
        if len({paths.plain(name) for name in meta.trackers}) < len(meta.trackers):
            raise ValueError(
                f"trackers {', '.join(meta.trackers)} have one name in a log, where only letters, digits, '_', '-' and "
                "'.' count; run them apart"
            )
        self.path = Path(path)
        self.file: Path | None = None  # where the file lies now
        self.meta = meta
        self._level, self._every, self._focus = level, every, focus
        self._shown: tuple[int, ...] = ()  # objects with a page of their own
        self._asked: int | None = None  # by `focus_on`
        self._modes = modes_of(meta.trackers)
        self._road, self._middle = RoadGeometry(), road_shape.strip_middle(RoadGeometry())
        self._sensors: tuple[SensorModel, ...] = ()
        self._metrics: dict[str, tuple[str, ...]] = {}
        self._stream: Stream | None = None
        self._stopped = False  # by the first error of the disk
        self._closed = False
        self._written = 0  # [ns] time of the last step in the file
        self._block: Block = {}
        self._waiting = 0
        self._step, self._time = -1, 0
        self._action: str | None = None
        self._actions: list[str] = []
        self._walls: np.ndarray | None = None
        self._tracked: layers.Rows = {}  # errors of objects with a track at the last step
        self._known: dict[int, str] = {}
        self._changed: dict[str, int] = {}  # [ns] when a contour of a tracker changed, -1 once it went
        self._confirmed: dict[str, set[int]] = {name: set() for name in meta.trackers}

    def static(self, road: RoadGeometry, sensors: tuple[SensorModel, ...]) -> None:
        """Take the road and the radars; call before the first step."""
        if self._stream is not None:
            raise ValueError(f"static must be called before the first step of the log {self.path}")
        if len(road.surface) != len(road.half_width):
            raise ValueError(
                f"road.half_width must have one entry per surface line, got {len(road.half_width)} "
                f"for {len(road.surface)} lines"
            )
        self._road, self._sensors = road, tuple(sensors)
        self._middle = road_shape.strip_middle(road)

    def step(self, frame: Frame, scores: Scores, events: LogEvents = (), risk: Sequence[float] = ()) -> None:
        """Take one frame with the score of each tracker of the run, and numbers of `paths.RISK`; arrays are copied.

        Raises ValueError for a closed log, a step that does not grow, or scores of other trackers, and OSError where
        the file cannot be written; what follows is then ignored.
        """
        self._check(frame, scores)
        if self._stopped:
            return
        self._step, self._time = frame.step, round(frame.time * 1e9)
        if self._stream is None:
            self._open(frame, scores)
        if self._level == "full":
            self._geometry(frame)
        self._numbers(frame, scores)
        for path, value in zip(paths.RISK, risk, strict=False):
            self._put(path, layers.scalar_row(value))
        for name in self.meta.trackers:
            self._decisions(name, *frame.outputs[name])
        for severity, text in events:
            self.event(severity, text)
        self._waiting += 1
        if self._waiting >= self._every:
            self._send()

    def smoothed(self, name: str, smoothed: SmoothedTracks) -> None:
        """Write the smoothed tracks of one tracker at the times of their frames, which lie in the past."""
        if self._level != "full" or self._stream is None or self._stopped or len(smoothed.step) == 0:
            return
        when = list(zip(smoothed.step.tolist(), np.rint(smoothed.time * 1e9).astype(int).tolist(), strict=True))
        rows, way = layers.smoothed_extents(smoothed), layers.smoothed_paths(smoothed)
        extents = [(*t, row) for t, row in zip(when, rows, strict=True)]
        self._write(
            {
                (paths.smoothed(name, "extent"), tuple(rows[0])): extents,
                (paths.smoothed(name, "path"), tuple(way)): [(*when[0], way)],
            }
        )

    def focus_on(self, key: int) -> None:
        """Give an object the first of the pages of single objects, from the call of `tables` on."""
        self._asked = key

    def event(self, level: str, text: str) -> None:
        """Write a line at the time of the last step; level is one of `SEVERITIES`."""
        if level not in SEVERITIES:
            raise ValueError(f"event level must be one of {', '.join(SEVERITIES)}, got {level!r}")
        if self._closed:
            raise ValueError(f"the log {self.path} is closed; no event can follow")
        self._put(paths.EVENTS, {"TextLog:text": [text], "TextLog:level": [level]})

    def tables(self, moments: Sequence[Table], objects: Sequence[Table]) -> None:
        """Write the pages of the worst moments and of the objects, and both as JSON in the property "tables".

        From now on the objects of the worst moments have a page each, the one that was asked for first.
        """
        if self._stream is None or self._stopped or self._closed:
            return
        self._write_text(paths.MOMENTS, moments_text(moments))
        self._write_text(paths.OBJECTS, objects_text(objects))
        self._stream.property("tables", {"moments": json.dumps(moments), "objects": json.dumps(objects)})
        known = {*self._known, *(int(row["object"]) for row in objects if row["object"] is not None)}
        if self._asked is not None and self._asked not in known:
            there = ", ".join(map(str, sorted(known))) or "none"
            self.event("WARN", f"there was no veh_{self._asked:02d} to focus on; vehicles: {there}")
            self._asked = None
        wanted = in_focus(self._asked, moments)
        if wanted and wanted != self._shown:
            self._shown = wanted
            self._stream.blueprint(self._layout())

    def close(self, summary: Summary | None = None, replace: bool = True) -> None:
        """Write the rest and the summary, facts of the run and metrics by tracker, once; later calls do nothing.

        Without `replace` the file keeps the name of an unfinished one. Raises OSError where the end cannot be written,
        or does not read back as complete.
        """
        if self._closed:
            return
        flat = flat_summary(summary or {})
        if self._stream is None:
            self._open()
        try:
            self._send()
            if summary is not None and not self._stopped:
                self._write_text(paths.SUMMARY, summary_text(self.meta, summary))
                if flat:
                    self._out.property("summary", flat)
        finally:
            self._finish(replace)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if error is not None and self._stream is None:
            self._closed = True  # no step was logged: leave no file
        if error is not None and not self._closed:
            reason = f": {error}" if str(error) else ""
            self.event("ERROR", f"the run ended with {type(error).__name__}{reason}")
        self.close()

    # -- opening and sending ------------------------------------------------------------------------------------

    def _check(self, frame: Frame, scores: Scores) -> None:
        if self._closed:
            raise ValueError(f"the log {self.path} is closed; open a new RunLog for another run")
        if frame.step <= self._step:
            raise ValueError(f"frame.step must grow, got {frame.step} after {self._step}; one RunLog holds one run")
        if tuple(scores) != self.meta.trackers:
            raise ValueError(f"scores must have the trackers of the run {self.meta.trackers}, got {tuple(scores)}")

    def _open(self, first: Frame | None = None, scores: Scores = MappingProxyType({})) -> None:
        from testbed.log.stream import Stream
        from testbed.log.styles import styles

        self._metrics = metrics = {name: tuple(score.mean) for name, score in scores.items()}
        self._shown = _focus(self._focus, first) if first else ()
        self._stream = Stream(self.path, self.meta.run_id, self._layout())
        self.file = self._stream.path
        self._stream.property("run", flat_properties(self.meta))
        self._write_text(paths.CONFIG, config_text(self.meta))
        for page in (paths.SUMMARY, paths.MOMENTS, paths.OBJECTS):
            self._write_text(page, unfinished_text(self.meta))
        self._write_text(paths.LEGEND, legend_text(self.meta.trackers))
        for path, data in styles(self.meta.trackers, metrics, self._road, self._sensors, self._level == "full"):
            self._stream.static(path, data)

    @property
    def _out(self) -> "Stream":
        assert self._stream is not None
        return self._stream

    def _layout(self) -> Any:
        from testbed.log.blueprint import layout

        return layout(self.meta, self._metrics, self._shown, self._road, self._level == "full", self._modes)

    def _write_text(self, path: str, markdown: str) -> None:
        import rerun as rr

        self._out.static(path, rr.TextDocument(markdown, media_type="text/markdown"))

    def _put(self, path: str, row: layers.Row) -> None:
        entry = (max(self._step, 0), self._time, row)
        self._block.setdefault((path, tuple(row)), []).append(entry)

    def _send(self) -> None:
        if not self._stopped:
            block, self._block, self._waiting = self._block, {}, 0
            self._write(block)
            self._written = self._time

    def _write(self, block: "Block") -> None:
        """Send a block; the first error of the disk stops the log, which then ends with the block before."""
        try:
            self._out.send(block)
        except OSError as error:
            self._stopped = True
            raise self._ending(error) from error

    def _finish(self, replace: bool) -> None:
        self._closed = True
        try:
            self._out.close(replace)
        except OSError as error:
            raise self._ending(error) from error
        finally:
            self.file = self._out.path
        if not self._stopped and not _is_whole(self.file):
            raise OSError(f"the log {self.file} does not read back; delete it and run again")

    def _ending(self, error: OSError) -> OSError:
        return OSError(f"{error}; it ends at {self._written / 1e9:.1f} s")

    # -- one frame ----------------------------------------------------------------------------------------------

    def _geometry(self, frame: Frame) -> None:
        rows = (
            layers.scene_rows(frame.scene, self._middle, frame.origin.visible)
            | layers.overview_row(road_shape.overview_at(self._road, frame.scene.ego.pose[:2]))
            | layers.plan_rows(frame.plan)
            | layers.detection_rows(frame, self.meta.trackers)
        )
        for index, name in enumerate(self.meta.trackers):
            tracks, info = frame.outputs[name]
            rows |= layers.tracker_rows(name, tracks, info, self._modes[name], index)
            rows |= self._changes(name, tracks, info)
        if self._walls is None or not np.array_equal(self._walls, frame.scene.walls):
            self._walls = np.array(frame.scene.walls)
            rows |= layers.wall_rows(self._walls)
        for path, row in rows.items():
            self._put(path, row)
        self._name_objects(frame.scene.objects)

    def _changes(self, name: str, tracks: Tracks, info: StepInfo) -> layers.Rows:
        """Contours that changed in this frame; they are removed after `CHANGE_SHOWN`."""
        if rows := layers.change_rows(name, tracks, info):
            if name not in self._changed:
                self._style_changes(name)
            self._changed[name] = self._time
            return rows
        since = self._changed.get(name)
        if since is None or since < 0 or self._time - since < CHANGE_SHOWN:
            return {}
        self._changed[name] = -1
        return layers.no_change_rows(name)

    def _style_changes(self, name: str) -> None:
        from testbed.log.styles import change_styles

        for path, data in change_styles(self.meta.trackers.index(name), name):
            self._out.static(path, data)

    def _numbers(self, frame: Frame, scores: Scores) -> None:
        rows = layers.object_rows(frame, scores, self._modes)
        lost = {path: layers.gap_row(row) for path, row in self._tracked.items() if path not in rows}
        self._tracked = {path: row for path, row in rows.items() if "metrics:track_id" in row}
        rows |= lost
        for name, score in scores.items():
            rows |= layers.metric_rows(name, score)
        speed = round(float(np.hypot(*frame.scene.ego.velocity)), 6)  # rounding errors would fill the plot
        rows[paths.EGO_SPEED] = layers.scalar_row(speed)
        if frame.action != self._action:
            self._action = frame.action
            self._color_actions(frame.action)
            rows[paths.EGO_ACTION] = {"StateChange:state": [frame.action]}
        for path, row in rows.items():
            self._put(path, row)

    def _color_actions(self, action: str) -> None:
        """Give a new action its colour in the lane of actions."""
        import rerun as rr

        if action not in self._actions:
            self._actions.append(action)
            colors = np.array([palette.action(name) for name in self._actions], np.uint32)
            self._out.static(paths.EGO_ACTION, rr.StateConfiguration(values=self._actions, colors=colors))

    def _decisions(self, name: str, tracks: Tracks, info: StepInfo) -> None:
        confirmed = self._confirmed[name]
        for event in info.events:
            which = "scan" if event.track == NO_TRACK else f"track {event.track}"
            self.event(_level(event, event.track in confirmed), f"{name}: {which} {event.kind}, {event.reason}")
        confirmed |= set(tracks.id[tracks.confirmed].tolist())

    def _name_objects(self, objects: Objects) -> None:
        import rerun as rr

        new = {int(i): kind for i, kind in zip(objects.id, objects.kind, strict=True) if i not in self._known}
        if new:
            self._known |= new
            own = {i: f" ({name})" for i, name in self.meta.names.items()}
            labels = {i: f"{paths.vehicle(i)}{own.get(i, '')} {kind}" for i, kind in self._known.items()}
            names = [rr.AnnotationInfo(i + 1, label) for i, label in labels.items()]
            self._out.static(paths.TRUTH_CONTOUR, rr.AnnotationContext(names))


def _level(event: Event, confirmed: bool) -> str:
    """WARN for detections left out, INFO for reported tracks that end, DEBUG for births and for other ends.

    A track that ends while its vehicle is in view is an event "lost" of its own, a warning.
    """
    if event.kind in ("implausible", "crowded", "skipped"):
        return "WARN"
    if event.kind == "died":
        return "INFO" if confirmed else "DEBUG"
    return "DEBUG" if event.kind == "born" else "INFO"


def _is_whole(log: Path) -> bool:
    from testbed.log.reader import complete

    try:
        return complete(log)
    except RuntimeError:
        return False


def in_focus(asked: int | None, moments: Sequence[Table]) -> tuple[int, ...]:
    """The objects with a page of their own: the one asked for, then those of the worst moments."""
    worst = [int(m["object"]) for m in moments if m["object"] is not None]
    return tuple(dict.fromkeys(worst if asked is None else [asked, *worst]))[:PAGES]


def _focus(asked: int | None, first: Frame) -> tuple[int, ...]:
    """The object asked for, else the one nearest to the ego, nothing where there is none."""
    objects = first.scene.objects
    if asked is not None and asked not in objects.id:
        raise ValueError(f"focus must be an object of the first scene, {objects.id.tolist()}, got {asked}")
    if asked is not None:
        return (asked,)
    if len(objects.id) == 0:
        return ()
    distance = np.hypot(*(objects.pose[:, :2] - first.scene.ego.pose[:2]).T)
    return (int(objects.id[distance.argmin()]),)
