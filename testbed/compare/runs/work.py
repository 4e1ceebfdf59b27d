"""A comparison from its first run to its last: record, replay, go on after an interruption, tell what failed."""

import os
import platform
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from testbed.compare.runs import tasks as runs
from testbed.compare.runs.config import Comparison, Task, check, claim_folder
from testbed.compare.runs.engine import Engine, cluster, perform
from testbed.compare.runs.rows import check_part
from testbed.compare.runs.tasks import DONE, FAILED, RECORDINGS, ROWS, Drive, Outcome, rows_path
from testbed.command_line.interruption import Wish, interruptible
from testbed.files import make_directory

Progress = Callable[[int, int, str], None]


@dataclass
class Report:
    """What became of a comparison's runs."""

    done: int = 0  # made now
    found: int = 0  # made before
    failed: list[Outcome] = field(default_factory=list)
    redone: list[Outcome] = field(default_factory=list)  # replaced damaged files, which the notes name
    wall: float = 0.0  # [s]
    exit_status: int = 0  # 128 + signal where one ended it early

    @property
    def interrupted(self) -> bool:
        """Whether runs are missing because somebody stopped it."""
        return self.exit_status != 0

    def add(self, outcome: Outcome) -> None:
        """Count one outcome."""
        if outcome.status == FAILED:
            self.failed.append(outcome)
        elif outcome.status == DONE:
            self.done += 1
            if outcome.note:
                self.redone.append(outcome)
        else:
            self.found += 1


def execute(comparison: Comparison, engine: Engine, progress: Progress | None = None) -> Report:
    """Make all runs that the folder lacks; progress(done, total, what) after each.

    Ctrl-C or SIGTERM ends it after the runs at hand: every finished run has its file, and the next call goes on.

    Raises:
        LookupError, ValueError, OSError: in one sentence, for what cannot be run, see `config.check`.
    """
    check(comparison)
    out = Path(comparison.out)
    report, start = Report(), perf_counter()
    with interruptible() as wish, cluster(engine):
        claim_folder(comparison)
        for folder in (ROWS, RECORDINGS):
            make_directory(out / folder)
        drives = shuffled_drives(comparison)
        tasks = [t for d in drives for t in tasks_on(d, comparison)]
        tasks = [t for t in tasks if not _is_found(t, out, wish, report)]
        if comparison.settings.loop == "open":
            missing = {Drive(t.scenario, t.seed) for t in tasks}
            needed = [d for d in drives if d in missing]
            recordings = [(d, comparison.settings, out) for d in needed]
            for _ in _stage(runs.record, recordings, engine, wish, "recording", progress):
                pass  # one that failed will be tried again by its runs, and told by them
        work = [(task, comparison.settings, out) for task in tasks]
        for outcome in _stage(runs.run, work, engine, wish, "runs", progress):
            report.add(outcome)
    report.wall = perf_counter() - start
    report.exit_status = wish.exit_status
    return report


def _is_found(task: Task, out: Path, wish: Wish, report: Report) -> bool:
    """Whether a run has a sound file, which is counted; a damaged one is left to the run that replaces and names it."""
    if wish.signal is not None or not rows_path(task, out).exists():
        return False
    try:
        check_part(rows_path(task, out), task)
    except ValueError:
        return False
    report.found += 1
    return True


def _stage(
    function: Callable[..., Outcome],
    work: Sequence[tuple[Any, ...]],
    engine: Engine,
    wish: Wish,
    what: str,
    progress: Progress | None,
) -> Generator[Outcome]:
    """Outcomes of one kind of tasks, until somebody wishes to stop."""
    if wish.signal is not None or not work:
        return
    with closing(perform(function, work, engine)) as outcomes:
        if progress:
            progress(0, len(work), what)
        for k, outcome in enumerate(outcomes, 1):
            yield outcome
            if progress:
                progress(k, len(work), what)
            if wish.signal is not None:
                return


def shuffled_drives(comparison: Comparison) -> list[Drive]:
    """All pairs of scenario and seed, in an order that differs from process to process.

    So two machines on one folder rarely make the same, and what an interruption leaves is spread over the scenarios.
    """
    drives = [Drive(c, s) for c in comparison.scenarios for s in comparison.seeds]
    own = np.random.default_rng([os.getpid(), *platform.node().encode()])
    return [drives[i] for i in own.permutation(len(drives))]


def tasks_on(drive: Drive, comparison: Comparison) -> list[Task]:
    """The runs on one recording."""
    return [Task(drive.scenario, tracker, drive.seed) for tracker in comparison.trackers]
