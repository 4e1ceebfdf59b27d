"""The page docs/learned-policies.md, and the committed table of drives that it is made from."""

from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from studies.effects import Factor, effects_table, names, read_runs, write_runs
from studies.learned.drives import ENVIRONMENT, FIRST, drives, policies
from studies.learned.figure import draw
from studies.learned.trainings import section
from studies.page import DOCS, Docs, Page, fill
from testbed.command_line.options import Dask, Jobs
from testbed.command_line.terminal import user_input
from testbed.experiments.engine import Engine
from testbed.frame import TRUTH

RESULTS = "learned.csv"
DRIVEN = Factor("driven", TRUTH, lambda tracker: f"on {tracker}")
TITLES = {
    "length": ("Length of an episode [decisions, 30 at most]", 1),
    "reward": ("Return, by the environment's own reward", 1),
    "crashed": ("Share of episodes that end in a crash", 2),
}


def render(table: pd.DataFrame) -> str:
    """The page from the drives."""
    seeds = sorted(table["seed"].unique())
    parts = [f"## {title}\n\n{effects_table(table, DRIVEN, name, digits)}" for name, (title, digits) in TITLES.items()]
    return fill(
        "learned/page.md.j2",
        environment=ENVIRONMENT,
        trackers=" and ".join(f"`{name}`" for name in names(table, "tracker") if name != TRUTH),
        seeds=table["scenario"].nunique(),
        episodes=len(seeds),
        first=FIRST,
        last=seeds[-1],
        tables="\n\n".join(parts),
        trainings=section(table),
    )


def main(
    folder: Annotated[
        Path | None, typer.Argument(help="Policies TRACKER-SEED.npz, which are driven anew; without: as committed.")
    ] = None,
    docs: Docs = DOCS,
    out: Annotated[
        str, typer.Option(help="Directory of the drives; those that are there are kept.")
    ] = "runs/learned-drives",
    jobs: Jobs = 1,
    dask: Dask = None,
) -> None:
    """Write the page "What tracks cost a learned policy" and the table that it shows."""
    with user_input((OSError, ValueError)):
        path = docs / "results" / RESULTS
        if folder is not None:
            write_runs(drives(policies(folder), out, Engine(jobs, dask)), path)
        page, table = Page("learned-policies", docs), read_runs(path, "give the folder of the policies")
        draw(table, page.picture("learned-policies"))
        page.write(render(table))
