"""Logs of the worst pairs: the drive on the truth and the drive on tracks, side by side on one timeline."""

from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.lanes import lane_shapes
from testbed.environment.road_geometry import road_geometry
from testbed.evaluation.driving import LONGEST
from testbed.experiments.run import DONE, FOUND, Outcome, outcome_of
from testbed.files import make_directory
from testbed.frame import TRUTH, Frame
from testbed.log.pair import TRACKS, LoggedDrive, write_pair
from testbed.log.record import RoadGeometry
from testbed.regret.analysis import WorstPair
from testbed.regret.drives import DriveObserver, drive_through, make_env
from testbed.regret.pairs import events
from testbed.regret.study import Settings, Study, Task

FOLDER = "logs"


class Replayed(NamedTuple):
    """A drive made again, with its frames."""

    observer: DriveObserver
    frames: list[Frame]
    road: RoadGeometry


def log_path(task: Task, out: Path) -> Path:
    """Where the log of a pair lies."""
    return out / FOLDER / f"{task.name}_beside_{TRUTH}.rrd"


def write(worst: list[WorstPair], study: Study) -> list[Outcome]:
    """Write the logs that are missing; a log that cannot be written is a failed outcome."""
    out = Path(study.out)
    make_directory(out / FOLDER)
    return [write_one(pair, study.settings, out) for pair in worst]


def write_one(pair: WorstPair, settings: Settings, out: Path) -> Outcome:
    """Make both drives of a pair again, and their log, unless it is there."""

    def work() -> str:
        path = log_path(pair.task, out)
        if path.exists():
            return FOUND
        reference = replayed(pair.task._replace(condition=TRUTH), settings)
        tracked = replayed(pair.task, settings)
        beside = events(tracked.observer.curves, reference.observer.curves)
        if np.isfinite(pair.parted):
            beside = sorted([(pair.parted, f"parts from the truth: {pair.parting}"), *beside])
        drives = [
            LoggedDrive(TRUTH, "on the truth", reference.frames, _curves(reference), []),
            LoggedDrive(TRACKS, f"on {pair.task.condition}", tracked.frames, _curves(tracked), beside),
        ]
        write_pair(path, path.stem, drives, reference.road, _summary(pair))
        return ""

    return outcome_of(pair.task.name, work)


def replayed(task: Task, settings: Settings) -> Replayed:
    """The drive of a task, made again; its frames are those of the study, bit for bit."""
    frames: list[Frame] = []
    observer = DriveObserver(None)
    with closing(make_env(task, settings)) as env:
        for called in (frames.append, observer):
            env.get_wrapper_attr("attach")(called)
        drive_through(env, task)
        road = road_geometry(lane_shapes(env.get_wrapper_attr("unwrapped").road.network))
    return Replayed(observer, frames, road)


def made(outcomes: list[Outcome]) -> int:
    """How many logs are there."""
    return sum(outcome.status in (DONE, FOUND) for outcome in outcomes)


def _curves(drive: Replayed) -> dict[str, NDArray]:
    curves = drive.observer.curves.drive
    return {
        "speed [m/s]": curves.speed,
        "braking [m/s^2]": curves.braking,
        "TTC [s]": curves.ttc.clip(max=LONGEST),
        "DRAC [m/s^2]": curves.drac,
    }


def _summary(pair: WorstPair) -> str:
    task = pair.task
    return (
        f"# {task.scenario}, seed {task.seed}\n\nPlanner `{task.planner}`: truth above, `{task.condition}` "
        f"below. Regret {pair.regret:.2f} s.\n\nWhere the drives part: {pair.parting}.\n"
    )
