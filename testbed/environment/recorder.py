"""Recorder of one episode: compares every frame with the truth, writes the review log and a JSON of the results."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from math import inf, nan
from pathlib import Path
from time import perf_counter
from types import MappingProxyType
from typing import Any
from weakref import finalize

from sensors.faults import Fault, is_active
from sensors.scene import Scene
from testbed.environment.smoothing import StateHistory
from testbed.evaluation.drive_evaluator import DriveEvaluator
from testbed.evaluation.driving import HARDEST, LONGEST, DriveFrame
from testbed.evaluation.histories import LOST_AFTER, TIME_ROUNDING
from testbed.evaluation.moments import WORST, all_moments, moment_row, severity_of
from testbed.evaluation.snapshots import Snapshots
from testbed.evaluation.tracking import UNKNOWN, Evaluator, jsonable
from testbed.files import check_target, make_directory, noting_losses, provenance, reserve, write_json
from testbed.frame import Frame, FrameScore
from testbed.limits import check_choice
from testbed.log.record import LEVELS, RoadGeometry, RunMeta
from testbed.log.writer import RunLog
from trackers.multi.tracker import MultiObjectTracker
from trackers.scan import SensorModel

DANGER = 8.0  # [m/s^2] the hardest braking of the ego


def check_level(level: str, metrics: bool) -> None:
    """Raise ValueError for an unknown level of the log, or for a log without the metrics that belong in it."""
    check_choice("log", level, LEVELS)
    if not metrics and level != "off":
        raise ValueError(f"log must be 'off' where metrics are off, got {level!r}; a log holds the metrics too")


class Recorder:
    """Observer of a `TrackedEnv`: attach it before `reset`, close it after the last step.

    A disk that becomes full on the way ends the log with a `LostFileWarning`, whose sentence goes into `lost`. The run
    goes on, and there is room for its results.

    Args:
        meta: what identifies the run.
        directory: where `<run id>.rrd` and `<run id>.json` go.
        level: full, metrics or off; off writes the JSON only.
        phases: (name, start [s], end [s]) of the maneuver.
        road: what to draw.
        sensors: whose fields of view to draw.
        focus: id of the object whose errors get a page of their own until the run ends, and then the one of the worst
            moment has it; None: the one nearest at the start.
        trackers: by name; those whose tracks can be smoothed get a layer of smoothed tracks at level full.
        metrics: False: nothing is compared with the truth, and the JSON holds no measures; for level off only.
        faults: of the radar; their begin and end are events.
        known: first and last time [s] at which the truth is known; frames before and after are not scored. None: there
            is no truth, and so no measure, neither in the log nor in the JSON.
        happened: what the road says of itself, (time [s], text), a list that grows meanwhile; None: it says nothing.
    """

    def __init__(
        self,
        meta: RunMeta,
        directory: str | Path,
        level: str = "full",
        phases: Sequence[tuple[str, float, float]] = (),
        road: RoadGeometry | None = None,
        sensors: tuple[SensorModel, ...] = (),
        focus: int | None = None,
        trackers: Mapping[str, Any] = MappingProxyType({}),
        metrics: bool = True,
        faults: Sequence[Fault] = (),
        known: tuple[float, float] | None = (-inf, inf),
        happened: Sequence[tuple[float, str]] | None = None,
    ) -> None:
        check_level(level, metrics)
        self.metrics, self._known = metrics, known
        self.meta, self.phases = meta, tuple(phases)
        self.directory = Path(directory)
        make_directory(self.directory)
        check_target(self.json_path)
        self._room = reserve(self.directory)  # for the results
        finalize(self, self._room.close)
        self.written: Path | None = None  # the JSON, once it is
        self.lost: list[str] = []  # what could not be written of the log, in sentences
        self.evaluators = {name: Evaluator(name, self.phases) for name in meta.trackers}
        self.drive = DriveEvaluator()
        self.snapshots = Snapshots()
        self.log: RunLog | None = None
        if level != "off":
            path = self.directory / f"{meta.run_id}.rrd"
            self.log = RunLog(path, meta, level="full" if level == "full" else "metrics", focus=focus)
            self.log.static(road or RoadGeometry(), sensors)
        kept = trackers.items() if level == "full" else ()
        self._past = {name: StateHistory(tracker) for name, tracker in kept if isinstance(tracker, MultiObjectTracker)}
        self.seconds: dict[str, float] = defaultdict(float)  # wall time spent on metrics and on the log
        self._faults = {str(fault): fault for fault in faults}
        self._faulty: set[str] = set()  # the faults that are active
        self._happened, self._said = happened, 0  # of these so many are in the log
        self._crashed: set[int] = set()
        self._danger = False  # since DRAC has exceeded `DANGER`, until it falls below half of that
        self._missing: dict[str, dict[int, float]] = {name: {} for name in meta.trackers}  # object id -> since when
        self._held: dict[str, dict[int, int]] = {name: {} for name in meta.trackers}  # object id -> last track
        self._result: dict[str, Any] | None = None
        self._frames = 0

    def __deepcopy__(self, memo: dict) -> None:
        return None

    @property
    def json_path(self) -> Path:
        """Where the results go."""
        return self.directory / f"{self.meta.run_id}.json"

    def __call__(self, frame: Frame) -> None:
        """Score one frame and log it; without a log the errors of pairs are computed later, for many scans at once."""
        start = perf_counter()
        if self.metrics:
            drive = self.drive.step(frame.scene)
            judged = [
                (name, (frame.time, frame.scene, frame.origin, tracks, info.owner))
                for name, (tracks, info) in frame.outputs.items()
            ]
            known = self._known is not None and self._known[0] <= frame.time <= self._known[1]
            if known:
                self.snapshots(frame)
            if self.log is not None:
                unknown = UNKNOWN if self._known else UNKNOWN._replace(mean={})
                scores = {name: self.evaluators[name].step(*seen) if known else unknown for name, seen in judged}
                self._write_log(self.log, frame, scores, drive, start)
            elif known:
                for name, seen in judged:
                    self.evaluators[name].keep(*seen)
                self.seconds["metrics"] += perf_counter() - start
        self._frames += 1

    def _write_log(
        self, log: RunLog, frame: Frame, scores: dict[str, FrameScore], drive: DriveFrame, start: float
    ) -> None:
        """Add one frame to the log, and its states to what is smoothed at the end; its scores were begun at `start`."""
        events = self._phase_events(frame.scene) + self._fault_events(frame.time)
        events += self._crash_events(frame.scene) + self._risk_events(drive) + self._road_events()
        for name, score in scores.items():
            events += self._lost_events(name, frame.time, score)
        scored = perf_counter()
        with self._writing_log():
            ttc = drive.ttc if drive.ttc < LONGEST else nan
            log.step(frame, scores, events, (ttc, drive.drac, max(0.0, -drive.acceleration)))
            for name, past in self._past.items():
                past.keep(frame.step, frame.time, frame.outputs[name][0])
                if past.full:
                    self._smooth(log, name)
        self.seconds["metrics"] += scored - start
        self.seconds["log"] += perf_counter() - scored

    def result(self) -> dict[str, Any]:
        """All measures so far as JSON types: the run, the drive, and for each tracker totals, phases and objects.

        Without metrics, or without truth, the run alone.
        """
        run = {
            "id": self.meta.run_id,
            "scenario": self.meta.scenario,
            "seed": self.meta.seed,
            "radar": self.meta.radar,
            "trackers": list(self.meta.trackers),
            "planner": self.meta.planner,
            "config": self.meta.config,
            "versions": self.meta.versions,
        }
        if self._happened is not None:
            run["events"] = [{"time": time, "text": text} for time, text in self._happened]
        if not self.metrics or self._known is None:
            return {"run": run}
        moments = all_moments(self.evaluators, self.snapshots)
        objects = [(name, row) for name, e in self.evaluators.items() for row in e.object_rows()]
        return {
            "run": run,
            "drive": jsonable(self.drive.summary()),
            "trackers": {name: jsonable(e.summary()) for name, e in self.evaluators.items()},
            "phases": [jsonable(row) for e in self.evaluators.values() for row in e.phase_rows()],
            "objects": [
                {**jsonable(row), "severity": severity_of(moments, n, int(row["object"]))} for n, row in objects
            ],
            "orphans": [jsonable(row) for e in self.evaluators.values() for row in e.orphan_rows()],
            "moments": [moment_row(moment) for moment in moments[:WORST]],
        }

    def close(self, interrupted: bool = False, timing: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Write the JSON, then finish the log, once; nothing is written of an episode without a frame.

        Args:
            interrupted: whether the run ended before the scenario did.
            timing: wall time [s] by part, and cost of each tracker; None: the wall time of metrics and log alone.

        Returns:
            What `result` gives, with `interrupted`, `timing` and what `provenance` says of this process.

        Raises:
            OSError: the results cannot be written; those of an older run stay, and the log keeps its unfinished name.
        """
        if self._result is None:
            ended = {"interrupted": interrupted, "timing": dict(timing or self.seconds), "made": provenance()}
            self._result = self.result() | ended
            self._room.close()
            if self._frames:
                try:
                    write_json(self.json_path, self._result)
                    self.written = self.json_path
                finally:
                    self._close_log(interrupted, replace=self.written is not None)
        return self._result

    def _close_log(self, interrupted: bool, replace: bool) -> None:
        if self.log is None:
            return
        if interrupted:
            self.log.event("WARN", "the run was interrupted")
        found, summary = self._result or self.result(), self._summary()
        try:
            with self._writing_log():
                for name in self._past:
                    self._smooth(self.log, name)
        finally:  # the log is closed even where smoothing fails
            with self._writing_log():
                if self._known:
                    self.log.tables(found["moments"], found["objects"])
                self.log.close(summary, replace)

    def _summary(self) -> dict[str, Any]:
        """Measures of the drive and of each tracker; nothing without truth."""
        if self._known is None:
            return {}
        drive = {f"drive_{key}": value for key, value in self.drive.summary().items()}
        return drive | {name: evaluator.summary() for name, evaluator in self.evaluators.items()}

    def _smooth(self, log: RunLog, name: str) -> None:
        """Add the smoothed tracks of one tracker to the log."""
        smoothed = self._past[name].smoothed()
        log.smoothed(name, smoothed)
        for track in smoothed.failed:
            log.event("WARN", f"{name}: track {track} could not be smoothed, a covariance was not definite")

    @contextmanager
    def _writing_log(self) -> Iterator[None]:
        """Go on where the log cannot be written, but not before it has a first frame."""
        with noting_losses(self.lost) if self._frames else nullcontext():
            yield

    def _phase_events(self, scene: Scene) -> list[tuple[str, str]]:
        return [
            ("INFO", f"phase {name} begins")
            for name, start, _ in self.phases
            if start <= scene.time < start + scene.dt - 1e-9
        ]

    def _fault_events(self, time: float) -> list[tuple[str, str]]:
        """Faults that begin or end."""
        now = {text for text, fault in self._faults.items() if is_active(fault, time)}
        begun, over = sorted(now - self._faulty), sorted(self._faulty - now)
        self._faulty = now
        return [*(("WARN", f"fault {f} begins") for f in begun), *(("INFO", f"fault {f} ends") for f in over)]

    def _road_events(self) -> list[tuple[str, str]]:
        """What the road has said since the last frame."""
        new = (self._happened or ())[self._said :]
        self._said += len(new)
        return [("INFO", text) for _, text in new]

    def _crash_events(self, scene: Scene) -> list[tuple[str, str]]:
        crashed = {int(i) for i in scene.objects.id[scene.objects.crashed]} | ({0} if scene.ego.crashed else set())
        new, self._crashed = crashed - self._crashed, crashed
        if not new:
            return []
        who = " and ".join("ego" if i == 0 else f"veh_{i:02d}" for i in sorted(new))
        return [("ERROR", f"collision: {who}")]

    def _risk_events(self, drive: DriveFrame) -> list[tuple[str, str]]:
        """The onset of a need for harder braking than `DANGER`."""
        before, self._danger = self._danger, drive.drac > (DANGER / 2 if self._danger else DANGER)
        if before or not self._danger:
            return []
        needed = f"{drive.drac:.0f} m/s^2" if drive.drac < HARDEST else f"{HARDEST:.0f} m/s^2 or more"
        return [("WARN", f"braking with {needed} is needed, {drive.gap:.1f} m ahead")]

    def _lost_events(self, name: str, time: float, score: FrameScore) -> list[tuple[str, str]]:
        """Events of counted objects that have been without a track for `LOST_AFTER`."""
        held, missing = self._held[name], self._missing[name]
        for key, track in score.pairs.items():
            held[key] = track
            missing.pop(key, None)
        events = []
        for key in score.counted:
            if key in held and key not in score.pairs:
                since = missing.setdefault(key, time)
                if time - since >= LOST_AFTER - TIME_ROUNDING:
                    events.append(("WARN", f"{name}: veh_{key:02d} lost, was track {held.pop(key)}"))
        return events
