"""What every command of many runs does: make what is missing, judge, show, write tables and a report."""

import os
import platform
import signal
from collections.abc import Callable, Generator, Hashable, Sequence
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any, NamedTuple, NoReturn

import numpy as np
import typer
from joblib import cpu_count
from rich.console import Console
from rich.progress import Progress as Bar

from testbed.command_line.interruption import InterruptRequest, interruptible
from testbed.command_line.terminal import console, progress_bar, stages, user_input
from testbed.experiments.engine import Engine, nothing, perform
from testbed.experiments.engine import check as check_engine
from testbed.experiments.run import FAILED, Outcome, Run, outcome_of
from testbed.experiments.store import Results, Store, make, reads, record
from testbed.experiments.study import Findings, Progress, Study, Tally, check_file

GOES_ON = "the same command makes the rest"


def check(study: Study, engine: Engine, junit: Path | None = None) -> None:
    """Raise LookupError, TypeError, ValueError or OSError, in one sentence, for what cannot be made or written."""
    study.check()
    check_engine(engine)
    if junit is not None:
        check_file("junit", junit)
    Store(study).check()


def execute(study: Study, engine: Engine, progress: Progress | None = None) -> Tally:
    """Make all runs that the folder lacks, group by group; progress(done, total, what) after each.

    Ctrl-C or SIGTERM ends it when the runs that have begun are finished; the next call makes the rest.

    Raises what `Study.check`, `Store.open` and `engine.perform` raise for what cannot be run.
    """
    study.check()
    store, tally, start = Store(study), Tally(), perf_counter()
    with interruptible() as request:
        store.open()
        asked = shuffled(study.work(), study.together)
        works = [work for work in asked if request.signal is not None or not store.is_made(work)]
        tally.found = len(asked) - len(works)
        drives = {store.recording_path(w): w for w in works if isinstance(w, Run) and w.loop == "open"}
        needed = [(run, study, store.out) for path, run in drives.items() if not path.exists()]
        for _ in stage(record, nothing, needed, engine, request, "recording", progress):
            pass  # its runs try again what failed here, and report it
        tasks = [(work, study, store.out) for work in works]
        for outcome in stage(make, reads, tasks, engine, request, study.what, progress):
            tally.add(outcome)
    tally.wall = perf_counter() - start
    tally.exit_status = request.exit_status
    return tally


def shuffled(works: Sequence[Any], together: Callable[[Any], Hashable]) -> list[Any]:
    """All work, group by group, in an order of the groups that differs from process to process.

    So two machines on one folder rarely make the same, and what an interruption leaves is spread over the groups.
    """
    groups: dict[Hashable, list[Any]] = {}
    for work in works:
        groups.setdefault(together(work), []).append(work)
    found, own = list(groups.values()), np.random.default_rng([os.getpid(), *platform.node().encode()])
    return [work for k in own.permutation(len(found)) for work in found[k]]


def stage(
    function: Callable[..., Outcome],
    reads: Callable[..., Sequence[Path]],
    tasks: Sequence[tuple[Any, ...]],
    engine: Engine,
    request: InterruptRequest,
    what: str,
    progress: Progress | None,
) -> Generator[Outcome]:
    """Outcomes of one kind of tasks, until an interruption is requested; progress(done, total, what) after each."""
    if request.signal is not None or not tasks:
        return
    with closing(perform(function, tasks, engine, reads)) as outcomes:
        if progress:
            progress(0, len(tasks), what)
        for k, outcome in enumerate(outcomes, 1):
            yield outcome
            if progress:
                progress(k, len(tasks), what)
            if request.signal is not None:
                return


def calculated(function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]], engine: Engine) -> Generator[Any]:
    """function(*each) for all arguments, in their order, for calculations that keep no files.

    Raises RuntimeError with the traceback where one fails, and what `engine.perform` raises. Close it to stop early.
    """
    with TemporaryDirectory(prefix="testbed-") as folder:
        tasks = [(_Calculation(str(k), function, given), Path(folder)) for k, given in enumerate(arguments)]
        waiting: dict[str, Any] = {}
        with closing(perform(_calculate, tasks, engine)) as outcomes:
            for k in range(len(tasks)):
                while str(k) not in waiting:
                    outcome = next(outcomes)
                    if outcome.status == FAILED:
                        raise RuntimeError(outcome.note)
                    waiting[outcome.name] = outcome.value
                yield waiting.pop(str(k))


class _Calculation(NamedTuple):
    """A call with a name."""

    name: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]


def _calculate(task: _Calculation, out: Path) -> Outcome:
    value: Any = None

    def work() -> str:
        nonlocal value
        value = task.function(*task.arguments)
        return ""

    return outcome_of(task.name, work)._replace(value=value)


def carry_out(study: Study, engine: Engine, console: Console, bar: Bar, junit: Path | None = None) -> int:
    """Make what is missing, show what the runs say, write tables, JUnit and report; returns the exit status.

    What cannot be made or written is one sentence and exit status 2; see `check`.
    """
    with user_input((OSError, ValueError)), bar:
        tally = execute(study, engine, stages(bar))
    show_tally(tally, console)
    results = Results.read(study)
    if not (study.whole or results.metas) or (study.whole and tally.interrupted):
        if tally.interrupted:
            console.print(f"[yellow]interrupted: {GOES_ON}[/yellow]")
        return tally.exit_status or 1
    found = study.judge(results, tally)
    for part in found.shown:
        console.print(part, highlight=False, soft_wrap=isinstance(part, str))
    with user_input((OSError,)):
        study.write(results, found, console)
        if tally.interrupted:
            console.print(f"[yellow]interrupted: tables of the {study.what} made so far; {GOES_ON}[/yellow]")
            return tally.exit_status
        if junit is not None:
            study.junit(results, found, tally, junit)
            console.print(f"junit    {junit}", soft_wrap=True, highlight=False)
    status = _report(study, results, found, tally, engine, console, bar)
    return status or (1 if found.failed or tally.failed else 0)


def _report(
    study: Study, results: Results, found: Findings, tally: Tally, engine: Engine, console: Console, bar: Bar
) -> int:
    """Write the report page, if the study has one; the status is that of a signal that ended it early."""
    for task in bar.task_ids:
        bar.remove_task(task)
    show = stages(bar, "report: ")
    with interruptible() as request, user_input((OSError,)):

        def step(done: int, total: int, what: str) -> None:
            bar.start()  # a study without a report shows none
            show(done, total, what)
            if request.signal is not None:
                raise KeyboardInterrupt

        try:
            page = study.page(results, found, tally, engine, step)
        except KeyboardInterrupt:
            console.print("[yellow]interrupted: no report; the same command writes it[/yellow]")
            return 128 + (request.signal or signal.SIGINT)
        finally:
            if bar.live.is_started:
                bar.stop()
    if page is not None:
        console.print(f"report   {page}", soft_wrap=True)
        console.print(f"open it  {page.resolve().as_uri()}", soft_wrap=True)
    return 0


def run_study(make: Callable[[], Study], jobs: int | None, dask: str | None, junit: Path | None = None) -> NoReturn:
    """All of a command: make its study, check it, carry it out; raises typer.Exit with the status.

    jobs: processes, None for one a core, but no more than there are runs.
    """
    with user_input():
        study = make()
        engine = Engine(min(cpu_count(), len(study.work())) if jobs is None else jobs, dask)
        check(study, engine, junit)
    bar = progress_bar("{task.completed:.0f} / {task.total:.0f}", 600.0)
    raise typer.Exit(carry_out(study, engine, console, bar, junit))


def show_tally(tally: Tally, console: Console) -> None:
    """Print how many runs were made and found, and which failed and why."""
    for outcome in tally.redone:
        console.print(f"[yellow]made again[/yellow] {outcome.name}: {outcome.note}", soft_wrap=True, highlight=False)
    for outcome in tally.failed:
        console.print(f"[red]failed[/red] {outcome.name}", highlight=False)
        console.print(outcome.note, markup=False, highlight=False, soft_wrap=True)
    console.print(
        f"{tally.done} runs made, {tally.found} found, {len(tally.failed)} failed, {tally.wall:.0f} s", highlight=False
    )
