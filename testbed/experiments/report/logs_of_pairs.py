"""Logs of the worst pairs: the drive on the truth and the drive on tracks, side by side on one timeline."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from testbed.evaluation.driving import LONGEST
from testbed.experiments.drives import DriveWatch
from testbed.experiments.episode import episode
from testbed.experiments.pairs import Drive, WorstPair, events
from testbed.experiments.report.logs import FOLDER
from testbed.experiments.report.texts import say
from testbed.experiments.run import FOUND, Outcome, Run, outcome_of
from testbed.files import make_directory
from testbed.frame import TRUTH, Frame
from testbed.log.pair import TRACKS, LoggedDrive, write_pair
from testbed.log.record import RoadGeometry


class Replayed(NamedTuple):
    """A drive made again, with its frames."""

    watch: DriveWatch
    frames: list[Frame]
    road: RoadGeometry


def log_path(drive: Drive, out: Path) -> Path:
    """Where the log of a pair lies."""
    return out / FOLDER / f"{drive.name}_beside_{TRUTH}.rrd"


def write(worst: list[WorstPair], study: Any, progress: Callable[[int, int], None] | None = None) -> list[Outcome]:
    """Write the logs that are missing; a log that cannot be written is a failed outcome."""
    out = Path(study.out)
    make_directory(out / FOLDER)
    outcomes = []
    for pair in worst:
        outcomes.append(write_one(pair, study.run, out))
        if progress:
            progress(len(outcomes), len(worst))
    return outcomes


def write_one(pair: WorstPair, run: Callable[[Drive], Run], out: Path) -> Outcome:
    """Make both drives of a pair again, and their log, unless it is there."""

    def work() -> str:
        path = log_path(pair.drive, out)
        if path.exists():
            return FOUND
        reference = replayed(run(pair.drive._replace(condition=TRUTH)))
        tracked = replayed(run(pair.drive))
        beside = events(tracked.watch.curves, reference.watch.curves)
        if np.isfinite(pair.parted):
            beside = sorted([(pair.parted, f"parts from the truth: {pair.parting}"), *beside])
        drives = [
            LoggedDrive(TRUTH, "on the truth", reference.frames, _curves(reference), []),
            LoggedDrive(TRACKS, f"on {pair.drive.condition}", tracked.frames, _curves(tracked), beside),
        ]
        write_pair(path, path.stem, drives, reference.road, _summary(pair))
        return ""

    return outcome_of(pair.drive.name, work)


def replayed(run: Run) -> Replayed:
    """A drive, made again; its frames are those of the study, bit for bit."""
    frames: list[Frame] = []
    watch = DriveWatch(run)
    return Replayed(watch, frames, episode(run, [frames.append, watch]).drawn)


def _curves(drive: Replayed) -> dict[str, NDArray]:
    curves = drive.watch.curves.drive
    return {
        "speed [m/s]": curves.speed,
        "braking [m/s^2]": curves.braking,
        "TTC [s]": curves.ttc.clip(max=LONGEST),
        "DRAC [m/s^2]": curves.drac,
    }


def _summary(pair: WorstPair) -> str:
    drive = pair.drive._asdict()
    return say("pair log", regret=f"{pair.regret:.2f}", parting=pair.parting, **drive) + "\n"
