"""Review logs of the best, the median and the worst run of every tracker, and what a page says of a log."""

import os
import shlex
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple
from urllib.parse import quote

import numpy as np

from testbed.experiments.engine import Engine, perform
from testbed.experiments.run import DONE, FAILED, FOUND, Outcome, Run
from testbed.experiments.single import RunConfig
from testbed.experiments.single import run as run_live
from testbed.experiments.store import Results, Store
from testbed.experiments.study import Study
from testbed.files import make_directory
from testbed.log.record import run_id
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
    """Best, median and worst run of every tracker, in its order.

    What counts is the GOSPA of a run divided by the mean over all trackers and seeds of its scenario. Without that the
    worst run of every tracker would come from the one scenario that is hard for all. Of an even number of runs the
    median is the better one of the two in the middle; ties go to the scenario and seed that come first. A tracker with
    one or two runs has as many logs.
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
    """Write the logs of all `picks` into the folder of the results; those that are there already are kept.

    progress(done, total) after each. Raises OSError, in one sentence, where the folder cannot be written or a cluster
    cannot be used.
    """
    study, out = results.study, Path(results.study.out)
    make_directory(out / FOLDER)
    runs = list({pick.run: pick for pick in picks(results)}.values())
    outcomes = [Outcome(pick.name, FOUND) for pick in runs if log_path(pick, out).exists()]
    work = [(pick, study, out) for pick in runs if not log_path(pick, out).exists()]
    with closing(perform(write_one, work, engine, _reads)) as finished:
        if progress:
            progress(len(outcomes), len(runs))
        for outcome in finished:
            outcomes.append(outcome)
            if progress:
                progress(len(outcomes), len(runs))
    return outcomes


def _reads(pick: Pick, study: Study, out: Path) -> list[Path]:
    """What a log is made from: in open loop a recording, in closed loop nothing."""
    return [Store(study, out).recording_path(pick.run)] if pick.run.loop == "open" else []


def write_one(pick: Pick, study: Study, out: Path) -> Outcome:
    """Write one log into the folder of the results, where it appears when it is complete."""
    path, run = log_path(pick, out), pick.run
    try:
        with TemporaryDirectory(dir=path.parent, prefix=".part-") as part:
            if run.loop == "open":
                made = write_log(Store(study, out).recording(run), pick.trackers, Path(part), run.faults)
            else:
                config = RunConfig(
                    run.scenario,
                    pick.trackers,
                    str(run.radar),
                    run.planner,
                    run.seed,
                    run.duration,
                    part,
                    faults=run.faults,
                    after=run.settings.get("after"),
                )
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
