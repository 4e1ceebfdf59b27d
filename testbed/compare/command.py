"""What `testbed compare` does: the runs, the tables, the report."""

import signal
from pathlib import Path

from rich.console import Console
from rich.progress import Progress as Bar

from testbed.command_line.interruption import InterruptRequest, interruptible
from testbed.command_line.terminal import stages, user_input
from testbed.compare.report import tables
from testbed.compare.report.renderers import terminal
from testbed.compare.report.report import write_report
from testbed.compare.runs.config import Comparison
from testbed.compare.runs.results import Results, collect, write_runs
from testbed.compare.runs.work import Progress, Tally, execute
from testbed.compare.statistics import analysis
from testbed.compare.statistics.analysis import DRIVE, MAIN
from testbed.experiments.engine import Engine

WARNINGS = 8  # that are spelt out on the terminal
FEW = 3  # trackers that stand side by side in 80 columns with their intervals
SHOWN = ("measure", "mean difference", "interquartile mean", "probability of improvement", "verdict")


def compare(comparison: Comparison, engine: Engine, console: Console, bar: Bar) -> int:
    """Run what is missing, show the tables, write the report; returns the exit status."""
    with user_input((OSError, ValueError)), bar:
        tally = execute(comparison, engine, stages(bar))
    show_tally(tally, console)
    results = collect(comparison)
    if results.runs.empty:
        return tally.exit_status or 1
    overview(results, console)
    with user_input((OSError,)):
        table = write_runs(results)
    if tally.interrupted:
        console.print("[yellow]interrupted: tables of the runs made so far; the same command makes the rest[/yellow]")
        return tally.exit_status
    console.print(f"runs     {table}", soft_wrap=True)
    for task in bar.task_ids:
        bar.remove_task(task)
    with interruptible() as request, user_input((OSError,)), bar:
        page = _page(results, tally, engine, stages(bar, "report: "), request)
    if page is None:
        console.print("[yellow]interrupted: no report; the same command writes it[/yellow]")
        return request.exit_status
    console.print(f"report   {page}", soft_wrap=True)
    console.print(f"open it  {page.resolve().as_uri()}", soft_wrap=True)
    return 1 if tally.failed else 0


def _page(results: Results, tally: Tally, engine: Engine, show: Progress, request: InterruptRequest) -> Path | None:
    """The report page, or None where a signal ended it early."""

    def step(done: int, total: int, what: str) -> None:
        show(done, total, what)
        if request.signal is not None:
            raise KeyboardInterrupt

    try:
        return write_report(results, tally, engine=engine, progress=step)
    except KeyboardInterrupt:
        request.signal = request.signal or signal.SIGINT
        return None


def show_tally(tally: Tally, console: Console) -> None:
    """Print how many runs were made and found, and which failed and why."""
    for outcome in tally.redone:
        console.print(f"[yellow]made again[/yellow] {outcome.name}: {outcome.note}", soft_wrap=True, highlight=False)
    for outcome in tally.failed:
        console.print(f"[red]failed[/red] {outcome.name}", highlight=False)
        console.print(outcome.note, markup=False, highlight=False, soft_wrap=True)
    console.print(
        f"{tally.done} runs made, {tally.found} found, {len(tally.failed)} failed, {tally.wall:.0f} s",
        highlight=False,
    )


def overview(results: Results, console: Console) -> None:
    """Means, and differences to the reference, of the main measures over all scenarios."""
    comparison = results.comparison
    cells, drives = list(analysis.cells(results, MAIN)), list(analysis.cells(results, DRIVE))
    where = f"{len(comparison.scenarios)} scenarios, {len(comparison.seeds)} seeds, {comparison.settings.loop} loop"
    for what, group in (("means", cells), ("the drives", drives)):
        if not group:
            continue
        means, title = tables.overview(group, comparison.baseline), f"{where}: {what} with 95 % intervals"
        if len(means.lines) <= FEW:
            console.print(terminal(means.transposed("measure"), title, no_wrap=True))
        else:
            console.print(terminal(means, title, narrow=True))
    if len(comparison.trackers) > 1:
        found = tables.differences(cells, comparison.baseline).only(*SHOWN)
        console.print(terminal(found, f"difference to {comparison.baseline} on the same seeds; negative is better"))
    sentences = analysis.unresolved(cells)
    for sentence in sentences[:WARNINGS]:
        console.print(f"[yellow]![/yellow] {sentence}", highlight=False, soft_wrap=True)
    if len(sentences) > WARNINGS:
        console.print(
            f"[yellow]![/yellow] and {len(sentences) - WARNINGS} more that the seeds cannot resolve: see above"
        )
