"""Review logs of picked runs and of the worst pairs of drives, and what a page says of a log."""

import os
import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from testbed.evaluation.driving import LONGEST
from testbed.experiments.drives import DriveWatch
from testbed.experiments.engine import Engine, nothing, perform
from testbed.experiments.episode import episode
from testbed.experiments.pairs import Drive, WorstPair, events
from testbed.experiments.report.texts import say
from testbed.experiments.run import DONE, FAILED, FOUND, Outcome, Run, outcome_of
from testbed.experiments.single import RunConfig
from testbed.experiments.single import run as run_live
from testbed.experiments.store import Results, Store
from testbed.experiments.study import Study
from testbed.files import make_directory
from testbed.frame import TRUTH, Frame
from testbed.log.pair import TRACKS, LoggedDrive, write_pair
from testbed.log.record import RoadGeometry, run_id
from testbed.replay.replaying import RECORDED
from testbed.replay.rescan import REPLAY, write_log

FOLDER = "logs"
PAGE = ".html"  # of a log, in place of its .rrd
PLACES = ("best", "median", "worst")


class LogFiles(NamedTuple):
    """What a report page says of one log."""

    href: str = ""  # of the log, empty where there is none
    page: str = ""  # of its page for a browser, empty where that was not written
    command: str = ""  # that opens the log in the viewer
    note: str = ""  # why there is no log


def href(path: Path, folder: Path) -> str:
    """Address of a file as seen from a page in the folder.

    >>> href(Path("runs/logs/a b.rrd"), Path("runs"))
    'logs/a%20b.rrd'
    """
    return quote(Path(os.path.relpath(path, folder)).as_posix(), safe="/")


def found(path: Path, folder: Path, note: str) -> LogFiles:
    """The log, and beside it the page that `testbed review LOG --html PAGE` has written; the note where none is."""
    if not path.exists():
        return LogFiles(note=note)
    page = path.with_suffix(PAGE)
    command = f"testbed review {shlex.quote(str(path))}"
    return LogFiles(href(path, folder), href(page, folder) if page.exists() else "", command)


class Pick(NamedTuple):
    """A run that gets a log."""

    place: str  # best, median or worst
    run: Run
    gospa: float  # [m]
    relative: float  # GOSPA over the mean of its scenario
    trackers: tuple[str, ...]  # in the log: the one it is about, then the reference, unless that failed on this seed

    @property
    def name(self) -> str:
        """That of the run."""
        return self.run.name


def picks(results: Results) -> list[Pick]:
    """Best, median and worst run of every tracker; of an even number the median is the better one in the middle.

    What counts is the GOSPA of a run divided by the mean over all trackers and seeds of its scenario. Without that the
    worst run of every tracker would come from the one scenario that is hard for all.
    """
    runs = results.runs
    if "gospa" not in runs:
        return []
    runs = runs[np.isfinite(runs["gospa"].astype(float))]
    runs = runs.assign(mean=runs.groupby("scenario")["gospa"].transform("mean"))
    runs = runs.assign(relative=(runs["gospa"] / runs["mean"].where(runs["mean"] > 0)).fillna(1.0))
    reference = runs[runs["tracker"] == results.study.baseline]
    has_reference = set(zip(reference["scenario"], reference["seed"], strict=True))
    found: list[Pick] = []
    for tracker in results.study.trackers:
        order = runs[runs["tracker"] == tracker].sort_values("relative", kind="stable")
        if len(order):
            at = dict(zip(PLACES, (0, (len(order) - 1) // 2, len(order) - 1), strict=True))
            distinct = {k: place for place, k in reversed(at.items())}  # where two agree the first place stands
            for k, place in sorted(distinct.items()):
                row = order.iloc[k]
                run = results.study.run(row["scenario"], tracker, int(row["seed"]))
                beside = [results.study.baseline] * ((row["scenario"], row["seed"]) in has_reference)
                trackers = tuple(dict.fromkeys((tracker, *beside)))
                found.append(Pick(place, run, float(row["gospa"]), float(row["relative"]), trackers))
    return found


def log_path(pick: Pick, out: Path) -> Path:
    """Where the log of a run lies in the folder of the report."""
    run = pick.run
    planner = REPLAY if run.loop == "open" else run.planner
    name = run_id(run.scenario, pick.trackers, str(run.radar), planner, run.seed, None, run.faults)
    return out / FOLDER / f"{name}.rrd"


def write(
    results: Results,
    engine: Engine = Engine(),  # noqa: B008 - frozen
    progress: Callable[[int, int], None] | None = None,
) -> list[Outcome]:
    """Write the logs of all `picks`; see `write_missing`."""
    runs = {pick.run: pick for pick in picks(results)}.values()
    paths = {pick: log_path(pick, Path(results.study.out)) for pick in runs}
    return write_missing(paths, write_one, results.study, engine, progress, _reads)


def write_missing(
    paths: Mapping[Any, Path],
    write_one: Callable[[Any, Any, Path], Outcome],
    study: Any,
    engine: Engine,
    progress: Callable[[int, int], None] | None = None,
    reads: Callable[..., Sequence[Path]] = nothing,
) -> list[Outcome]:
    """Write logs into the folder of a study; those that are there already are kept.

    paths: by what write_one(what, study, out) makes a log of. progress(done, total) after each. Raises OSError, in one
    sentence, where the folder cannot be written or a cluster cannot be used.
    """
    out = Path(study.out)
    make_directory(out / FOLDER)
    outcomes = [Outcome(what.name, FOUND) for what, path in paths.items() if path.exists()]
    work = [(what, study, out) for what, path in paths.items() if not path.exists()]
    with closing(perform(write_one, work, engine, reads)) as finished:
        if progress:
            progress(len(outcomes), len(paths))
        for outcome in finished:
            outcomes.append(outcome)
            if progress:
                progress(len(outcomes), len(paths))
    return outcomes


def _reads(pick: Pick, study: Study, out: Path) -> list[Path]:
    """What a log is made from: in open loop a recording, in closed loop nothing."""
    return [Store(study, out).recording_path(pick.run)] if pick.run.loop == "open" else []


def write_one(pick: Pick, study: Any, out: Path) -> Outcome:
    """Write one log into the folder of the results, where it appears when it is complete."""
    path, run = log_path(pick, out), pick.run
    try:
        with TemporaryDirectory(dir=path.parent, prefix=".part-") as part:
            if run.loop == "open":
                made = write_log(Store(study, out).recording(run), pick.trackers, Path(part), run.faults)
            elif run.loop == RECORDED:
                made = study.log(run, pick.trackers, Path(part))
            else:
                driven = run.scenario, pick.trackers, str(run.radar), run.planner, run.seed, run.duration
                config = RunConfig(*driven, part, faults=run.faults, after=run.settings.get("after"))
                done = run_live(config)
                if done.interrupted:
                    raise KeyboardInterrupt  # a signal that ended this run ends all of them
                for sentence in done.lost:
                    raise OSError(sentence)
                assert done.rrd is not None  # its level is full
                made = done.rrd
            made.with_suffix(".json").replace(path.with_suffix(".json"))
            made.replace(path)
    except (OSError, ValueError) as error:
        return Outcome(run.name, FAILED, str(error))
    return Outcome(run.name, DONE)


# Pairs of drives, on one timeline


def pair_path(drive: Drive, out: Path) -> Path:
    """Where the log of a drive beside that on the truth lies."""
    return out / FOLDER / f"{drive.name}_beside_{TRUTH}.rrd"


def write_pair_log(pair: WorstPair, study: Any, out: Path) -> Outcome:
    """Make both drives of a pair again, and their log."""

    def work() -> str:
        path = pair_path(pair.drive, out)
        reference = Replayed.of(study.run(pair.drive._replace(condition=TRUTH)))
        tracked = Replayed.of(study.run(pair.drive))
        beside = events(tracked.watch.curves, reference.watch.curves)
        if np.isfinite(pair.parted):
            beside = sorted([(pair.parted, f"parts from the truth: {pair.parting}"), *beside])
        drives = [
            LoggedDrive(TRUTH, "on the truth", reference.frames, reference.curves, []),
            LoggedDrive(TRACKS, f"on {pair.drive.condition}", tracked.frames, tracked.curves, beside),
        ]
        summary = say("pair log", regret=f"{pair.regret:.3f}", parting=pair.parting, **pair.drive._asdict())
        write_pair(path, path.stem, drives, reference.road, summary + "\n")
        return ""

    return outcome_of(pair.name, work)


class Replayed(NamedTuple):
    """A drive made again, with its frames, which are those of the study bit for bit."""

    watch: DriveWatch
    frames: list[Frame]
    road: RoadGeometry

    @classmethod
    def of(cls, run: Run) -> "Replayed":
        """Make it."""
        frames: list[Frame] = []
        watch = DriveWatch(run)
        return cls(watch, frames, episode(run, [frames.append, watch]).drawn)

    @property
    def curves(self) -> dict[str, NDArray]:
        """Those that the log shows."""
        drive = self.watch.curves.drive
        motion = {"speed [m/s]": drive.speed, "braking [m/s^2]": drive.braking}
        return motion | {"TTC [s]": drive.ttc.clip(max=LONGEST), "DRAC [m/s^2]": drive.drac}
