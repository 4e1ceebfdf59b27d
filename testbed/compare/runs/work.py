"""All runs of a comparison: record, replay, continue after an interruption, count what failed."""

import os
import platform
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from sensors.fault_text import split_faults
from testbed.command_line.interruption import InterruptRequest, interruptible
from testbed.compare.runs import tasks as works
from testbed.compare.runs.config import Comparison, Settings, Task, check, write_settings
from testbed.compare.runs.tasks import RECORDINGS, ROWS, RecordingTask, recording_of, recording_path, rows_path
from testbed.experiments.engine import Engine, nothing, perform
from testbed.experiments.rows import is_made
from testbed.experiments.run import DONE, FAILED, Outcome
from testbed.files import make_directory

Progress = Callable[[int, int, str], None]


@dataclass
class Tally:
    """How the runs of a comparison ended."""

    done: int = 0  # made now
    found: int = 0  # made before
    failed: list[Outcome] = field(default_factory=list)
    redone: list[Outcome] = field(default_factory=list)  # replaced damaged files, which the notes name
    wall: float = 0.0  # [s]
    exit_status: int = 0  # 128 + signal where one ended it early

    @property
    def interrupted(self) -> bool:
        """Whether runs are missing because a signal ended the work early."""
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


def execute(comparison: Comparison, engine: Engine, progress: Progress | None = None) -> Tally:
    """Make all runs that the folder lacks; progress(done, total, what) after each.

    Ctrl-C or SIGTERM ends it when the runs that have begun are finished; the next call makes the rest.

    Raises:
        LookupError, ValueError, OSError: in one sentence, for what cannot be run, see `config.check` and
            `engine.perform`.
    """
    check(comparison)
    out = Path(comparison.out)
    tally, start = Tally(), perf_counter()
    with interruptible() as request:
        write_settings(comparison)
        for folder in (ROWS, RECORDINGS):
            make_directory(out / folder)
        recordings = shuffled_recordings(comparison)
        asked = [t for r in recordings for t in tasks_on(r, comparison)]
        tasks = [t for t in asked if request.signal is not None or not is_made(rows_path(t, out), t)]
        tally.found = len(asked) - len(tasks)
        if comparison.settings.loop == "open":
            missing = {recording_of(t) for t in tasks}
            missing = {r for r in missing if not recording_path(r, out).exists()}
            needed = [(r, comparison.settings, out) for r in recordings if r in missing]
            for _ in stage(works.record, nothing, needed, engine, request, "recording", progress):
                pass  # its runs try again what failed here, and report it
        work = [(task, comparison.settings, out) for task in tasks]
        for outcome in stage(works.run, _reads, work, engine, request, "runs", progress):
            tally.add(outcome)
    tally.wall = perf_counter() - start
    tally.exit_status = request.exit_status
    return tally


def _reads(task: Task, settings: Settings, out: Path) -> list[Path]:
    """What a run reads: its recording, and its own rows, which it replaces where they are damaged."""
    recording = [recording_path(recording_of(task), out)] if settings.loop == "open" else []
    return [*recording, rows_path(task, out)]


def stage(
    function: Callable[..., Outcome],
    reads: Callable[..., Sequence[Path]],
    work: Sequence[tuple[Any, ...]],
    engine: Engine,
    request: InterruptRequest,
    what: str,
    progress: Progress | None,
) -> Generator[Outcome]:
    """Outcomes of one kind of tasks, until an interruption is requested; progress(done, total, what) after each."""
    if request.signal is not None or not work:
        return
    with closing(perform(function, work, engine, reads)) as outcomes:
        if progress:
            progress(0, len(work), what)
        for k, outcome in enumerate(outcomes, 1):
            yield outcome
            if progress:
                progress(k, len(work), what)
            if request.signal is not None:
                return


def shuffled_recordings(comparison: Comparison) -> list[RecordingTask]:
    """All pairs of scenario and seed, in an order that differs from process to process.

    So two machines on one folder rarely make the same, and what an interruption leaves is spread over the scenarios.
    """
    every = (recording_of(Task(c, "", s)) for c in comparison.scenarios for s in comparison.seeds)
    found = list(dict.fromkeys(every))
    own = np.random.default_rng([os.getpid(), *platform.node().encode()])
    return [found[i] for i in own.permutation(len(found))]


def tasks_on(recording: RecordingTask, comparison: Comparison) -> list[Task]:
    """The runs on one recording."""
    cases = [case for case in comparison.scenarios if split_faults(case)[0] == recording.scenario]
    return [Task(case, tracker, recording.seed) for case in cases for tracker in comparison.trackers]
