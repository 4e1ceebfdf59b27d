"""The page docs/faults.md, and the committed table of runs that it is made from."""

from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from studies.effects import effect, effects_table, facts, names, read_runs, write_runs
from studies.faults.figure import draw
from studies.faults.tables import FAULT, NONE, by_fault
from studies.page import DOCS, Docs, Page, fill
from studies.stored import stored_comparison
from testbed.command_line.terminal import user_input
from testbed.experiments.store import Results

RESULTS = "faults.csv"


def render(table: pd.DataFrame) -> str:
    """The page from the runs."""
    return fill("faults/page.md.j2", facts=f"{facts(table)}.", gospa=effects_table(table, FAULT, "gospa", 2))


def main(
    folder: Annotated[
        Path | None, typer.Argument(help="What `testbed compare --fault ... --out` left; without: as committed.")
    ] = None,
    docs: Docs = DOCS,
) -> None:
    """Write the page "Faults of the radar" and the table that it shows."""
    with user_input((OSError, ValueError)):
        path = docs / "results" / RESULTS
        if folder is not None:
            table = by_fault(Results.read(stored_comparison(folder)).runs)
            if NONE not in set(table["fault"]):
                raise ValueError(f"{folder} has no runs without a fault; compare the scenarios themselves too")
            write_runs(table, path)
        table = read_runs(path, "give the folder of `testbed compare --out FOLDER`")
        page = Page("faults", docs)
        trackers, faults = names(table, "tracker"), [f for f in names(table, "fault") if f != NONE]
        changes = {f: {t: effect(table, FAULT, f, t, "gospa").change for t in trackers} for f in faults}
        draw(changes, page.picture("faults"))
        page.write(render(table))
