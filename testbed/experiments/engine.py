"""Many tasks on many processes, here or on a cluster; tasks of a worker that was killed are done again.

A task is a tuple. Its last element is the folder where its files lie; the first has a name.
"""

import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky.process_executor import TerminatedWorkerError

from testbed.experiments import cluster
from testbed.experiments.run import FAILED, Outcome
from testbed.limits import check_jobs

PARENT_CHECK = 1.0  # [s] from one check of a worker that its parent lives to the next
MOST_CRASHES = 3  # of workers in a row without a finished task, before the tasks that had begun are tried alone


class Engine(NamedTuple):
    """Where the tasks are done."""

    jobs: int = 1  # processes on this machine; 1: this process alone
    dask: str | None = None  # address of the scheduler of a cluster, which is used instead


def check(engine: Engine) -> None:
    """Raise ValueError or OSError, in one sentence, for processes or a cluster that cannot do any task."""
    check_jobs(engine.jobs)
    if engine.dask is not None:
        with cluster.connected(engine.dask):
            pass


def nothing(*task: Any) -> Sequence[Path]:
    """The files that a task reads, where it reads none."""
    return ()


def perform(
    function: Callable[..., Outcome],
    tasks: Sequence[tuple[Any, ...]],
    engine: Engine,
    reads: Callable[..., Sequence[Path]] = nothing,
) -> Generator[Outcome]:
    """Outcomes of `function(*task)` in the order in which they are finished. Close the iterator to stop early.

    A task whose worker is killed again and again is reported as failed, and stops no other.

    Args:
        function: writes nowhere but in the folder of the task.
        tasks: tuples, of which the last element is that folder.
        engine: where they are done.
        reads: the paths in its folder that `function(*task)` reads where they are there.

    Raises:
        ValueError, OSError: in one sentence, for a cluster that cannot be used, or was lost.
    """
    if engine.dask is None:
        return _perform_here(function, tasks, engine)
    return cluster.perform(function, tasks, engine.dask, reads)


def _perform_here(
    function: Callable[..., Outcome], tasks: Sequence[tuple[Any, ...]], engine: Engine
) -> Generator[Outcome]:
    """As `perform`; tasks that had begun beside one that kills its processes are tried alone."""
    remaining = dict(enumerate(tasks))
    crashes = 0
    while remaining:
        begun: list[tuple[int, tuple[Any, ...]]] = []
        try:
            for key, outcome in _finished(function, _noting(list(remaining.items()), begun), engine):
                del remaining[key]
                crashes = 0
                yield outcome
        except TerminatedWorkerError:
            crashes += 1
        if crashes == MOST_CRASHES:
            for key, task in [entry for entry in begun if entry[0] in remaining]:
                del remaining[key]
                yield _alone(function, key, task)
            crashes = 0


def _alone(function: Callable[..., Outcome], key: int, task: tuple[Any, ...]) -> Outcome:
    """Outcome of a task in a process of its own on this machine, in the second of two attempts at the latest."""
    for _ in range(2):
        try:
            return next(outcome for _, outcome in _finished(function, [(key, task)], Engine(jobs=2)))
        except TerminatedWorkerError as error:
            crash = error
    return Outcome(task[0].name, FAILED, f"its process was killed again and again: {crash}")


def _noting(tasks: Iterable[tuple[int, tuple[Any, ...]]], begun: list[tuple[int, tuple[Any, ...]]]) -> Iterator[Any]:
    """The tasks; each is put onto the list `begun` when it is taken."""
    for task in tasks:
        begun.append(task)
        yield task


def _finished(
    function: Callable[..., Outcome], tasks: Iterable[tuple[int, tuple[Any, ...]]], engine: Engine
) -> Iterator[tuple[int, Outcome]]:
    with _backend(engine), warnings.catch_warnings():
        parallel = Parallel(n_jobs=engine.jobs, return_as="generator_unordered", batch_size=1)
        warnings.filterwarnings("ignore", ".*tasks which were still being processed", UserWarning)
        results = parallel(delayed(_keyed)(key, function, *task) for key, task in tasks)
        try:
            yield from results
        finally:
            results.close()


def _backend(engine: Engine) -> Any:
    if engine.jobs == 1:
        return parallel_config(backend="sequential")
    return parallel_config(backend="loky", initializer=_start_worker, initargs=(os.getpid(),))


def _start_worker(parent: int) -> None:
    """Ctrl-C reaches all processes of a terminal, and only the parent handles it; a worker ends with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    """Exit as soon as another process is the parent, as after SIGKILL, which leaves the parent no time to say so."""
    while os.getppid() == parent:
        time.sleep(PARENT_CHECK)
    os._exit(1)


def _keyed(key: int, function: Callable[..., Outcome], *task: Any) -> tuple[int, Outcome]:
    return key, function(*task)
