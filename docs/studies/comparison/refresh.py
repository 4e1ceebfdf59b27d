"""New digests for committed results whose code has changed and whose numbers have not.

`PYTHONPATH=docs python -m studies refresh --sample 20` repeats a sample of the runs in docs/results with the code at
hand. Where every measure has the bits that are committed, the digests in `comparison.json` become those of the code
at hand. Where one has not, a table says which, the exit status is 1, and nothing is written.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, NamedTuple

import numpy as np
import pandas as pd
import typer
from rich.markup import escape

from studies.comparison.publish import ABOUT, read
from studies.page import steps
from testbed.command_line.tables import light_table
from testbed.command_line.terminal import console, user_input
from testbed.compare.report.report import NAME
from testbed.compare.runs.config import Settings, Task
from testbed.compare.runs.tasks import RECORDINGS, ROWS, rows_path, run
from testbed.evaluation.metric import COSTS
from testbed.experiments.engine import Engine, check, perform
from testbed.experiments.identity import shared_digest, tracker_digest
from testbed.experiments.rows import read_meta
from testbed.experiments.run import FAILED, Outcome
from testbed.files import make_directory, write_atomic, write_json

KEYS = [*Task._fields, "phase"]
SHOWN = 40  # rows of the table
DIGITS = 9  # significant; that tell a float32 from its neighbours


class Mismatch(NamedTuple):
    """One number of a run that is not the committed one."""

    run: str
    phase: str
    measure: str
    committed: float
    now: float


def digests(trackers: Sequence[str]) -> dict[str, str]:
    """Those of the code at hand, by their names in `comparison.json`."""
    return {"code": shared_digest(), **{f"code of {tracker}": tracker_digest(tracker) for tracker in trackers}}


def draw(tasks: Sequence[Task], sample: int, seed: int) -> list[Task]:
    """A sample of runs; no tracker has two before every one has one, and so on."""
    count: dict[str, int] = {}
    ranked = []
    for k in np.random.default_rng(seed).permutation(len(tasks)):
        count[tasks[k].tracker] = count.get(tasks[k].tracker, 0) + 1
        ranked.append((count[tasks[k].tracker], tasks[k]))
    return [task for _, task in sorted(ranked, key=lambda item: item[0])[:sample]]


def mismatches(task: Task, committed: pd.DataFrame, spans: Sequence[dict[str, Any]]) -> Iterator[Mismatch]:
    """Numbers of a run that are not those in the table of all runs, after the same cast to float32.

    spans: the measures of the run by phase, as the file of its rows has them. Wall times are not compared.
    """
    own = np.logical_and.reduce([committed[name] == value for name, value in task._asdict().items()])
    before = committed[own].set_index("phase")
    now = pd.DataFrame(spans).set_index("phase")
    for phase in [*before.index, *now.index.difference(before.index)]:
        for measure in before.columns.difference([*KEYS, *COSTS], sort=False):
            a, b = (_float32(table, phase, measure) for table in (before, now))
            if phase not in before.index or phase not in now.index or a.tobytes() != b.tobytes():
                yield Mismatch(task.name, phase, measure, float(a), float(b))


def _float32(table: pd.DataFrame, phase: str, measure: str) -> np.float32:
    """The committed form of a number; one NaN for everything that was not measured."""
    found = table.loc[phase, measure] if phase in table.index and measure in table else None
    return np.float32(np.nan) if pd.isna(found) else np.float32(found)


def repeat(tasks: Sequence[Task], settings: Settings, jobs: int, folder: Path) -> list[Outcome]:
    """Make the runs again, in a folder without others."""
    for name in (ROWS, RECORDINGS):
        make_directory(folder / name)
    with steps(len(tasks)) as step:
        outcomes = []
        for outcome in perform(run, [(task, settings, folder) for task in tasks], Engine(jobs)):
            step(outcome.name)
            outcomes.append(outcome)
    return outcomes


def main(
    results: Annotated[Path, typer.Option(help="Directory of the committed results.")] = Path("docs/results"),
    report: Annotated[Path, typer.Option(help="Directory of the report page, which names the digest.")] = Path(
        "docs/comparison"
    ),
    sample: Annotated[int, typer.Option(min=1, help="Number of runs to repeat.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Of the sample.")] = 0,
    jobs: Annotated[int, typer.Option(help="Number of processes; -1 for one a core.")] = 1,
) -> None:
    """Repeat a sample of the committed runs; where all are equal, write the digests of the code at hand."""
    with user_input(), TemporaryDirectory() as folder:
        check(Engine(jobs))
        committed, known, _ = read(results)
        comparison = committed.comparison
        old, new = known["identity"], digests(comparison.trackers)
        tasks = draw(comparison.tasks, sample, seed)
        repeated = {task.tracker for task in tasks}
        left = [t for t in comparison.trackers if old.get(f"code of {t}") != new[f"code of {t}"] and t not in repeated]
        if left:
            raise ValueError(f"sample: {sample} runs leave out {', '.join(left)}, whose code has changed; take more")
        outcomes = repeat(tasks, comparison.settings, jobs, Path(folder))
        failed = [outcome for outcome in outcomes if outcome.status == FAILED]
        metas = [] if failed else [(task, read_meta(rows_path(task, Path(folder)))) for task in tasks]
        found = [m for task, meta in metas for m in mismatches(task, committed.spans, meta["spans"])]
    for outcome in failed:
        console.print(f"failed   {outcome.name}\n{outcome.note}", markup=False, highlight=False, soft_wrap=True)
    if found:
        console.print(_table(found))
    if failed or found:
        console.print("the digests are left as they were", highlight=False)
        raise typer.Exit(1)
    with user_input((OSError,)):
        _write(results, report, known, new)
    names = ", ".join(task.name for task in tasks)
    console.print(
        f"proved equal, {len(tasks)} of {len(comparison.tasks)} runs: {names}", soft_wrap=True, highlight=False
    )
    console.print(f"digests  {results / ABOUT}; now `make comparison-page`", soft_wrap=True, highlight=False)


def _write(results: Path, report: Path, known: dict[str, Any], new: dict[str, str]) -> None:
    """The new digests into the settings of the results, and into the report page where there is one."""
    old = known["identity"]
    page = report / NAME
    if page.exists():
        write_atomic(page, page.read_text().replace(old["code"], new["code"]))
    write_json(results / ABOUT, known | {"identity": old | new})


def _table(found: Sequence[Mismatch]) -> Any:
    table = light_table(f"{len(found)} numbers that are not the committed ones")
    for head in ("run", "phase", "measure"):
        table.add_column(head)
    for head in ("committed", "now"):
        table.add_column(head, justify="right")
    for m in found[:SHOWN]:
        table.add_row(*map(escape, m[:3]), f"{m.committed:.{DIGITS}g}", f"{m.now:.{DIGITS}g}")
    if len(found) > SHOWN:
        table.add_row(f"and {len(found) - SHOWN} more", *[""] * 4)
    return table
