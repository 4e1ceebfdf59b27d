"""The page docs/persistence.md, and the committed table of runs that it is made from."""

from typing import Annotated

import pandas as pd
import typer

from studies.effects import effects_table, facts, read_runs, write_runs
from studies.page import DOCS, Docs, Page, fill
from studies.persistence.runs import DURATION, LIFETIME, RIG, runs
from testbed.command_line.terminal import user_input
from testbed.experiments.run import parse_seeds

RESULTS = "persistence.csv"
TITLES = {  # of what is on the page; all measures are in its data file
    "nees_position": "NEES of position (2 where the covariance is honest)",
    "nees_length": "NEES of length (1 where it is)",
    "gospa": "GOSPA [m]",
}


def render(table: pd.DataFrame) -> str:
    """The page from the runs."""
    parts = [f"### {title}\n\n{effects_table(table, LIFETIME, name, 2)}" for name, title in TITLES.items()]
    return fill(
        "persistence/page.md.j2", facts=f"Rig `{RIG}`, {facts(table)}, {DURATION:g} s each.", tables="\n\n".join(parts)
    )


def main(
    seeds: Annotated[str | None, typer.Option(help="Run these anew, as in 320:330; without: as committed.")] = None,
    docs: Docs = DOCS,
) -> None:
    """Write the page "Scattering centres that stay" and the table that it shows."""
    with user_input((OSError, ValueError)):
        path = docs / "results" / RESULTS
        if seeds is not None:
            write_runs(runs(seeds=parse_seeds(seeds)), path)
        Page("persistence", docs).write(render(read_runs(path, "give the seeds to run, --seeds 320:330")))
