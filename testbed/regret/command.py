"""What `testbed regret` does: the drives, the tables, the report."""

from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.progress import Progress as Bar

from testbed.command_line.terminal import stages, user_input
from testbed.compare.command import show_tally
from testbed.compare.report.renderers import terminal
from testbed.experiments.engine import Engine
from testbed.files import check_target, make_directory
from testbed.regret import analysis, junit
from testbed.regret.pairs import table
from testbed.regret.report import tables
from testbed.regret.report.page import Findings, find, write_page
from testbed.regret.results import DRIVES, PAIRS, Results, write_table
from testbed.regret.study import Study
from testbed.regret.work import execute

SHOWN = ("drive_score", "tit", "progress")  # beside the scenario, in 80 columns
WARNINGS = 8  # that are spelt out on the terminal


@dataclass(frozen=True)
class Options:
    """How a study is made."""

    engine: Engine = field(default_factory=Engine)
    junit: Path | None = None

    def check(self) -> None:
        """Raise OSError, in one sentence, where the JUnit file cannot be written."""
        if self.junit is not None:
            check_target(self.junit)
            make_directory(self.junit.parent)


def regret(study: Study, options: Options, console: Console, bar: Bar) -> int:
    """Make the drives that are missing, show the tables, write the report; returns the exit status."""
    with user_input((OSError, ValueError)), bar:
        tally = execute(study, options.engine, stages(bar))
    show_tally(tally, console)
    results = Results(study)
    if not results.drives:
        return tally.exit_status or 1
    pairs = table(results)
    with user_input((OSError,)):
        for name, rows in ((DRIVES, results.table), (PAIRS, pairs)):
            console.print(f"{name:16} {write_table(rows, Path(study.out) / name)}", soft_wrap=True)
    if pairs.empty:
        return tally.exit_status or 1
    found = find(results.table, pairs)
    overview(found, console)
    if tally.interrupted:
        console.print("[yellow]interrupted: tables of the drives made so far; the same command makes the rest[/yellow]")
        return tally.exit_status
    same = analysis.self_test(results)
    for task in (task for task, equal in same.items() if not equal):
        console.print(f"[red]self-test[/red] {task.name} differs from the drive of the tracker itself")
    with user_input((OSError,)):
        if options.junit is not None:
            junit.write(pairs, found.total, tally.failed, same, options.junit)
            console.print(f"junit    {options.junit}", soft_wrap=True, highlight=False)
        page = write_page(results, found, tally)
    console.print(f"report   {page}", soft_wrap=True)
    console.print(f"open it  {page.resolve().as_uri()}", soft_wrap=True)
    return 1 if tally.failed or not all(same.values()) else 0


def overview(found: Findings, console: Console) -> None:
    """The regret by tracker and planner, the changes by scenario, and what the seeds cannot resolve."""
    if found.together:
        console.print(terminal(tables.overview(found.together, ""), "regret [s] against the truth, all scenarios"))
    for cells, title in ((found.total, "change against the truth"), (found.doses, "change against what is in view")):
        if cells:
            shown = [c for c in cells if c.measure in SHOWN]
            console.print(terminal(tables.changes(shown, ""), title, narrow=True))
    sentences = [*found.verdict, *analysis.one_sided(found.total)]
    sentences += analysis.unresolved([c for c in found.together if c.measure == "drive_score"])
    for sentence in sentences[:WARNINGS]:
        console.print(f"[yellow]![/yellow] {sentence}", highlight=False, soft_wrap=True)
