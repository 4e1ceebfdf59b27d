"""The page docs/persistence.md, and the committed table of runs that it is made from.

Trackers on the scenes of one drive, as a rig sees them whose scattering centres last for different times.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Annotated

import pandas as pd
import typer

from sensors import RADARS, Persistence, Radar
from studies.effects import Factor, effects_table, facts, read_runs, write_runs
from studies.page import DOCS, Docs, Page, fill
from studies.runs import every_sensor, seen_by, summaries
from testbed.command_line.options import Dask, Jobs
from testbed.command_line.terminal import user_input
from testbed.evaluation.metric import METRICS, Metric
from testbed.experiments.engine import Engine
from testbed.experiments.run import parse_seeds

RESULTS = "persistence.csv"
RIG = "surround"
LIFETIMES = (0.0, 0.2, 1.0, 5.0)  # [s]; 0: drawn anew in each scan
LIFETIME = Factor("lifetime", 0.0, lambda lifetime: f"{lifetime:g} s" if lifetime else "off")
TRACKERS = ("imm-spline", "rm-feldmann")
SCENARIOS, SEEDS, DURATION = ("cut-in", "dense-traffic"), tuple(range(320, 330)), 6.0  # [s]
SHOWN = ("nees_position", "nees_length", "gospa")  # on the page; all measures are in its data file
MEASURES = ("gospa", "nees_position", "nees_length", "abs_length", "rmse_position")
COLUMNS = ("scenario", "lifetime", "tracker", "seed", *MEASURES)


def lasting(radar: Radar, lifetime: float) -> Radar:
    """The rig with scattering centres that last for so long [s], 0 for those drawn anew in each scan."""
    option = Persistence(lifetime) if lifetime else None
    return every_sensor(radar, lambda sensor: replace(sensor, persistence=option))


def runs(out: str, engine: Engine, seeds: Sequence[int] = SEEDS, duration: float = DURATION) -> pd.DataFrame:
    """One row a scenario, lifetime, tracker and seed, with `COLUMNS`; all lifetimes see the same drive."""
    asked = {
        (scenario, lifetime, tracker, seed): seen_by(lasting(RADARS[RIG], lifetime), scenario, seed, tracker, duration)
        for scenario, seed, lifetime, tracker in product(SCENARIOS, seeds, LIFETIMES, TRACKERS)
    }
    summary = summaries(list(asked.values()), out, engine)
    rows = [(*key, *(summary(run)[measure] for measure in MEASURES)) for key, run in asked.items()]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def render(table: pd.DataFrame) -> str:
    """The page from the runs."""
    parts = [f"### {_title(METRICS[name])}\n\n{effects_table(table, LIFETIME, name, 2)}" for name in SHOWN]
    return fill(
        "persistence/page.md.j2", facts=f"Rig `{RIG}`, {facts(table)}, {DURATION:g} s each.", tables="\n\n".join(parts)
    )


def _title(metric: Metric) -> str:
    return metric.title if metric.ideal is None else f"{metric.title}, {metric.sense}"


def main(
    seeds: Annotated[str | None, typer.Option(help="Run these anew, as in 320:330; without: as committed.")] = None,
    docs: Docs = DOCS,
    out: Annotated[
        str, typer.Option(help="Directory of the runs; those that are there are kept.")
    ] = "runs/persistence",
    jobs: Jobs = 1,
    dask: Dask = None,
) -> None:
    """Write the page "Scattering centres that stay" and the table that it shows."""
    with user_input((OSError, ValueError)):
        path = docs / "results" / RESULTS
        if seeds is not None:
            write_runs(runs(out, Engine(jobs, dask), parse_seeds(seeds)), path)
        Page("persistence", docs).write(render(read_runs(path, "give the seeds to run, --seeds 320:330")))
