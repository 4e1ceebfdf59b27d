"""The page docs/faults.md, and the committed table of runs that it is made from."""

from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from studies.comparison.publish import stored_comparison
from studies.effects import effect, effects_table, facts, names, read_runs, write_runs
from studies.faults.figure import draw
from studies.faults.tables import FAULT, NONE, by_fault
from studies.page import DOCS, Docs, Page
from testbed.command_line.terminal import user_input
from testbed.compare.runs.results import collect

RESULTS = "faults.csv"
TEXT = """# Faults of the radar

A fault is an option of every run, and of every environment:

```
testbed run cut-in --fault front:outage:3:5 --fault drop:0.2
testbed compare cut-in --tracker imm-spline --fault drop:0.2 --fault corners:yaw:0.5
testbed regret probe-brake --tracker imm-spline --fault front:outage:2:3
testbed regress --scenario cut-in --fault drop:0.2
```

```python
env = gym.make("testbed/cut-in-v0", faults=["front:outage:3:5", sensors.Dropout(0.2)])
```

It reads `[SENSORS:]KIND:VALUES`, times in seconds since the reset. SENSORS is `surround` (all of the rig, also where
nothing stands there), `front`, `rear`, `corners`, `left`, `right`, or the number of a sensor. Several at once are
joined by `+`, or, in `testbed run`, given one by one; the others take every `--fault` by itself, beside runs without
one. In `compare` and `regress` a fault belongs to the scenario, `cut-in+drop:0.2`; in `regret` to the tracker,
`imm-spline+drop:0.2`. Definitions: [radar-faults.md](methods/radar-faults.md).

| fault | what | Python |
| --- | --- | --- |
| `outage:START:END` | no scans are delivered; trackers know that | `Outage` |
| `drop:SHARE[:START:END]` | scans of single sensors are lost, each with this probability | `Dropout` |
| `yaw:DEGREES[:START:END]` | a sensor is turned in its mount | `Misalignment` |
| `clock:SECONDS[:START:END]` | scans are older than the time on them | `ClockOffset` |
| `burst:START:COUNT[:SECONDS]` | interference: COUNT more false alarms a scan, for half a second | `Interference` |
| `blind:rain:SHARE[:START:END]` | this share of the range is left, and fewer detections within it | `Blindness` |
| `blind:dirt:SHARE[:START:END]` | this share of the detections is left, at any range | `Blindness` |

Begin and end of a fault are events in the log. Without a fault, and outside its time, every detection is the same bit
for bit. Objects that a fault hides still count, so what it costs is seen as missed.

## What they cost

{facts} In brackets 95 % intervals over the seeds, where they are three or
more; a change is against no fault on the same seeds, bold where its
interval leaves out zero. Less is better.

![change of GOSPA by fault and tracker](pictures/faults.png)

### GOSPA [m]

{gospa}

### Switches in a run

{switches}
"""


def render(table: pd.DataFrame) -> str:
    """The page from the runs."""
    tables = {m: effects_table(table, FAULT, m, digits) for m, digits in (("gospa", 2), ("switches", 1))}
    return TEXT.format(facts=f"{facts(table)}.", **tables)


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
            table = by_fault(collect(stored_comparison(folder)).runs)
            if NONE not in set(table["fault"]):
                raise ValueError(f"{folder} has no runs without a fault; compare the scenarios themselves too")
            write_runs(table, path)
        table = read_runs(path, "give the folder of `testbed compare --out FOLDER`")
        page = Page("faults", docs)
        trackers, faults = names(table, "tracker"), [f for f in names(table, "fault") if f != NONE]
        changes = {f: {t: effect(table, FAULT, f, t, "gospa").change for t in trackers} for f in faults}
        draw(changes, page.picture("faults"))
        page.write(render(table))
