"""One drive: a scenario in closed loop under one condition, its curves and measures in a Parquet file."""

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from time import process_time
from typing import Any

import gymnasium as gym
import numpy as np

from testbed.environment.registration import make
from testbed.environment.sources import conditions
from testbed.evaluation.drive_evaluator import DriveEvaluator
from testbed.evaluation.tracking import Evaluator, jsonable
from testbed.experiments.rows import check_part, write
from testbed.experiments.run import FOUND, Outcome, outcome_of
from testbed.frame import Frame
from testbed.planners import find as find_planner
from testbed.regret.curves import SCHEMA, Curves
from testbed.regret.discrepancy import Discrepancy, largest
from testbed.regret.study import Settings, Task

FOLDER = "drives"
DRIVEN = (  # metrics of the drive
    "elapsed", "collisions", "ttc_min", "ttc_plane_min", "ttc_5", "drac_max", "tit", "headway_min",
    "deceleration_max", "jerk", "progress", "drive_score",
)  # fmt: skip
TRACKING = (  # measures of the tracker in its own drive
    "gospa", "missed_percent", "false_per_scan", "switches", "lost", "birth_delay",
    "rmse_position", "rmse_velocity", "rmse_heading_deg", "rmse_length", "rmse_width", "nees_position",
)  # fmt: skip


def drive_path(task: Task, out: Path) -> Path:
    """Where a drive lies."""
    return out / FOLDER / f"{task.name}.parquet"


def drive(task: Task, settings: Settings, out: Path) -> Outcome:
    """Make a drive, unless it has a valid file."""

    def work() -> str:
        path, note = drive_path(task, out), ""
        if path.exists():
            try:
                check_part(path, task, SCHEMA)
                return FOUND
            except ValueError as error:
                note = str(error)
        curves, meta = driven(task, settings)
        write(curves.table(), {"task": task._asdict(), **meta}, path)
        return note

    return outcome_of(task.name, work)


def reads(task: Task, settings: Settings, out: Path) -> Sequence[Path]:
    """What a drive reads: its own file, which it replaces where it is damaged."""
    return [drive_path(task, out)]


class DriveObserver:
    """Collects what is kept of a drive, scan by scan."""

    def __init__(self, tracker: str | None) -> None:
        self.drive = DriveEvaluator()
        self.tracking = None if tracker is None else Evaluator(tracker)
        self._pose: list[Any] = []
        self._action: list[str] = []
        self._found: list[Discrepancy] = []

    def __call__(self, frame: Frame) -> None:
        """Take one frame."""
        tracks, info = next(iter(frame.outputs.values()))
        self.drive.step(frame.scene)
        if self.tracking is not None:
            self.tracking.keep(frame.time, frame.scene, frame.origin, tracks, info.owner)
        self._pose.append(frame.scene.ego.pose)
        self._action.append(frame.action)
        self._found.append(largest(frame.scene, frame.origin.visible, tracks))

    @property
    def curves(self) -> Curves:
        """The drive so far."""
        sizes = np.array([d.size for d in self._found])
        return Curves(self.drive.curves, np.array(self._pose), sizes, self._action, [d.text for d in self._found])


def driven(task: Task, settings: Settings) -> tuple[Curves, dict[str, Any]]:
    """Curves of a drive, and its measures, decisions, tracking errors and CPU time [s] as JSON types."""
    condition = conditions.parse(task.condition)
    observer = DriveObserver(task.condition if condition.groups is None and condition.tracker else None)
    start = process_time()
    with closing(make_env(task, settings)) as env:
        env.get_wrapper_attr("attach")(observer)
        times, decisions = drive_through(env, task)
        cpu = process_time() - start
    drive = observer.drive.summary()
    tracking = {} if observer.tracking is None else observer.tracking.summary()
    return observer.curves, {
        "measures": {key: drive[key] for key in DRIVEN},
        "tracking": jsonable({key: tracking[key] for key in TRACKING if key in tracking}),
        "decisions": decisions,
        "times": times,
        "seconds": {"cpu": cpu},
    }


def drive_through(env: gym.Env, task: Task) -> tuple[list[float], list[list[float]]]:
    """One episode with the planner and the seed of a task: time [s] and action of every decision."""
    planner: Any = find_planner(task.planner)
    times: list[float] = []
    decisions: list[list[float]] = []
    env.reset(seed=task.seed)
    getattr(planner, "begin", lambda env: None)(env)
    done = False
    while not done:
        choice = planner.choose(env)
        env.set_wrapper_attr("plan", choice.plan)
        times.append(env.get_wrapper_attr("truth").time)
        decisions.append(np.ravel(choice.action).astype(float).tolist())
        _, _, terminated, truncated, _ = env.step(choice.action)
        done = terminated or truncated
    return times, decisions


def make_env(task: Task, settings: Settings, **options: Any) -> gym.Env:
    """The environment of a drive; options go to `TrackedEnv`."""
    planner = find_planner(task.planner)
    config: dict[str, Any] = {}
    if settings.duration is not None:
        config["duration"] = settings.duration
    if action := getattr(planner, "action", None):
        config["action"] = dict(action)
    condition = conditions.parse(task.condition)
    found = conditions.source(condition, settings.radar, task.seed)
    return make(
        task.scenario,
        config,
        tracker=found,
        radar=settings.radar,
        planner=task.planner,
        warm_up=settings.warm_up,
        faults=condition.faults,
        **options,
    )
