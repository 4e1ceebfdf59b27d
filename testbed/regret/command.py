"""What `testbed regret` does: the drives, the tables, the report."""

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import Progress as Bar

from testbed.command_line.terminal import stages, user_input
from testbed.compare.command import show_tally
from testbed.compare.report.renderers import terminal
from testbed.compare.runs.engine import Engine
from testbed.regret import analysis
from testbed.regret.analysis import Pairs
from testbed.regret.measures import TABLE
from testbed.regret.report import tables
from testbed.regret.results import Results
from testbed.regret.study import Study
from testbed.regret.work import execute

SHOWN = ("J", "tit", "progress")  # beside the scenario, in 80 columns
WARNINGS = 8  # that are spelt out on the terminal


@dataclass(frozen=True)
class Options:
    """How a study is made and shown."""

    engine: Engine = Engine()  # noqa: RUF009 - frozen
    junit: Path | None = None


def regret(study: Study, options: Options, console: Console, bar: Bar) -> int:
    """Make the drives that are missing, show the tables, write the report; returns the exit status."""
    with user_input((OSError, ValueError)), bar:
        tally = execute(study, options.engine, stages(bar))
    show_tally(tally, console)
    results = Results(study)
    if not results.drives:
        return tally.exit_status or 1
    found = analysis.references(results)
    overview(study, found, console)
    with user_input((OSError,)):
        console.print(f"drives   {results.write()}", soft_wrap=True)
    if tally.interrupted:
        console.print("[yellow]interrupted: tables of the drives made so far; the same command makes the rest[/yellow]")
        return tally.exit_status
    broken = [task for task, equal in analysis.self_test(results).items() if not equal]
    for task in broken:
        console.print(f"[red]self-test[/red] {task.name} differs from the drive of the tracker itself")
    return 1 if tally.failed or broken else 0


def overview(study: Study, found: dict[str, Pairs], console: Console) -> None:
    """The regret by tracker and planner, the changes by scenario, and what the seeds cannot resolve."""
    where = f"{len(study.scenarios)} scenarios, {len(study.seeds)} seeds"
    together = list(analysis.cells(found["total"], study.scenarios, TABLE, together=True))
    console.print(terminal(tables.overview(together, ""), f"regret J [s] against the truth, {where}"))
    single = list(analysis.cells(found["total"], study.scenarios, SHOWN))
    console.print(terminal(tables.changes(single, ""), "change against the truth", narrow=True))
    for sentence in analysis.one_sided(single):
        console.print(f"[yellow]![/yellow] {sentence}", highlight=False, soft_wrap=True)
    sentences = analysis.unresolved([c for c in together if c.measure == "J"])
    for sentence in sentences[:WARNINGS]:
        console.print(f"[yellow]![/yellow] {sentence}", highlight=False, soft_wrap=True)
