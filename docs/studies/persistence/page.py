"""The page docs/persistence.md, and the committed table of runs that it is made from."""

from typing import Annotated

import pandas as pd
import typer

from studies.effects import effects_table, facts, read_runs, write_runs
from studies.page import DOCS, Docs, Page
from studies.persistence.runs import DURATION, LIFETIME, RIG, runs
from testbed.command_line.terminal import user_input
from testbed.compare.runs.config import parse_seeds

RESULTS = "persistence.csv"
TITLES = {
    "nees_position": "NEES of position (2 where the covariance is honest)",
    "nees_length": "NEES of length (1 where it is)",
    "abs_length": "Mean error of length, without sign [m]",
    "rmse_position": "RMSE of position [m]",
    "gospa": "GOSPA [m]",
}
TEXT = """# Scattering centres that stay

Real scatterers, an edge, a wheel house, a mirror, stay on a body for a while. By default those of our radars are drawn
anew in each scan, so that a tracker averages errors that are independent; with real ones it would average less. The
option `persistence` of a sensor gives scattering centres a lifetime:

```python
from dataclasses import replace
from sensors import RADARS, Persistence

rig = RADARS["surround"]
lasting = replace(rig, sensors=tuple(replace(s, persistence=Persistence(lifetime=1.0)) for s in rig.sensors))
```

Each scan alone is distributed as without it: how many detections a vehicle gives, where on it they lie, what is hidden,
noise and false alarms. What changes is that the next scan finds the same centres on the same places of the body. How:
[radar.md](methods/radar.md), section 11.

It is off in every rig. How long a centre lasts can be told from boxes of one vehicle over time, with the detections in
them; the real detections that the radars are compared with are of single frames or without boxes. Without a measured
lifetime a default would be a guess, and it would move every result.

## What it changes

{facts} Lifetime "off" is as usual. In brackets 95 % intervals over the seeds; a change is
against off on the same drives, bold where its interval leaves out zero.

{tables}
"""


def render(table: pd.DataFrame) -> str:
    """The page from the runs."""
    parts = [f"### {title}\n\n{effects_table(table, LIFETIME, name, 2)}" for name, title in TITLES.items()]
    return TEXT.format(facts=f"Rig `{RIG}`, {facts(table)}, {DURATION:g} s each.", tables="\n\n".join(parts))


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
