"""The work of one task: make a recording or a run, unless it has a valid file."""

from contextlib import closing, suppress
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from sensors.fault_text import split_faults
from testbed.compare.runs.config import Settings, Task
from testbed.environment.registration import make
from testbed.evaluation.drive_evaluator import DriveEvaluator
from testbed.evaluation.tracking import jsonable
from testbed.experiments.rows import Rows, check_part, write
from testbed.experiments.run import FOUND, Outcome, outcome_of
from testbed.frame import TRUTH, Frame
from testbed.planners import begin
from testbed.planners import find as find_planner
from testbed.planners import settings as planner_settings
from testbed.replay import recording as recordings
from testbed.replay.rescan import replay

ROWS, RECORDINGS = "rows", "recordings"  # folders of a comparison


class RecordingTask(NamedTuple):
    """One recording to be made."""

    scenario: str
    seed: int

    @property
    def name(self) -> str:
        """Stem of its file."""
        return f"{self.scenario}_seed{self.seed}".replace("/", "-")


def recording_of(task: Task) -> RecordingTask:
    """The recording of a run: that of its scenario without faults, which are put in when it is replayed."""
    return RecordingTask(split_faults(task.scenario)[0], task.seed)


def recording_path(task: RecordingTask, out: Path) -> Path:
    """Where a recording lies."""
    return out / RECORDINGS / f"{task.name}.npz"


def rows_path(task: Task, out: Path) -> Path:
    """Where the rows of a run lie."""
    return out / ROWS / f"{task.name}.parquet"


def record(task: RecordingTask, settings: Settings, out: Path) -> Outcome:
    """Make a recording."""

    def work() -> str:
        if recording_path(task, out).exists():
            return FOUND
        obtain(task, settings, out)
        return ""

    return outcome_of(f"recording {task.name}", work)


def obtain(task: RecordingTask, settings: Settings, out: Path) -> recordings.Recording:
    """The recording of a scenario and seed; it is made where it is missing or damaged."""
    path = recording_path(task, out)
    if path.exists():
        with suppress(ValueError):
            return recordings.load(path, task.scenario, task.seed, settings.radar)
    made = recordings.record(task.scenario, task.seed, settings.radar, config=settings.config(task.scenario))
    recordings.save(made, path)
    return made


def run(task: Task, settings: Settings, out: Path) -> Outcome:
    """Make the rows of a run; in open loop from its recording."""

    def work() -> str:
        path = rows_path(task, out)
        note = ""
        if path.exists():
            try:
                check_part(path, task)
                return FOUND
            except ValueError as error:
                note = str(error)
        start = perf_counter()
        rows, meta = (_replayed if settings.loop == "open" else _driven)(task, settings, out)
        table = rows.table()
        spans = rows.summaries()
        total = perf_counter() - start
        seconds = meta.pop("seconds")
        seconds["metrics"] = total - sum(seconds.values())
        meta |= {"task": task._asdict(), "spans": spans, "seconds": seconds}
        write(table, meta, path)
        return note

    return outcome_of(task.name, work)


def _replayed(task: Task, settings: Settings, out: Path) -> tuple[Rows, dict[str, Any]]:
    start = perf_counter()
    recording = obtain(recording_of(task), settings, out)
    loaded = perf_counter() - start
    rows = Rows(task, recording.phases, settings.settle)
    perception = replay(recording, (task.tracker,), [rows], split_faults(task.scenario)[1])
    seconds = {"loading": loaded, "tracking": perception.seconds["track"]}
    return rows, {"seconds": seconds, "cost": jsonable(perception.costs[task.tracker].row()), "drive": None}


def _driven(task: Task, settings: Settings, out: Path) -> tuple[Rows, dict[str, Any]]:
    """In closed loop the trackers' worlds differ, but traffic and radar draw the same numbers for the same seed."""
    planner = find_planner(settings.planner)
    first, *also = [TRUTH, task.tracker] if planner.knows_truth else [task.tracker]  # the planner uses the first
    scenario, faults = split_faults(task.scenario)
    config = planner_settings(planner) | settings.config(scenario)
    options = {"tracker": first, "also": also, "radar": settings.radar, "planner": settings.planner, "faults": faults}
    drive = DriveEvaluator()
    start = perf_counter()
    with closing(make(scenario, config, **options)) as env:
        tracked: Any = env
        rows: Rows | None = None
        scoring = 0.0

        def observe(frame: Frame) -> None:
            nonlocal rows, scoring
            before = perf_counter()
            rows = rows or Rows(task, tuple(getattr(tracked.unwrapped, "phases", ())), settings.settle)
            drive.step(frame.scene)
            rows(frame)
            scoring += perf_counter() - before

        tracked.attach(observe)
        env.reset(seed=task.seed)
        begin(planner, env)
        done = False
        while not done:
            _, _, terminated, truncated, _ = env.step(planner.choose(env).action)
            done = terminated or truncated
        spent, cost = tracked.seconds, tracked.costs[task.tracker].row()
    assert rows is not None  # a reset has a frame
    sensing, tracking = spent["sense"], spent["track"]
    seconds = {"simulation": perf_counter() - start - sensing - tracking - scoring}
    seconds |= {"sensing": sensing, "tracking": tracking}
    return rows, {"seconds": seconds, "cost": jsonable(cost), "drive": jsonable(drive.summary())}
