"""The page docs/probes.md: what each probe asks, how safe it is on the truth, a picture of each."""

from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from scenarios.lanes import lane_shapes
from scenarios.probes import PROBES
from scenarios.record import Scenario
from sensors.scene import Scene
from studies.page import DOCS, Docs, Page, steps
from studies.probes.drives import SEEDS, TTC, Verdict, all_drives, planner_of, verdict
from studies.probes.figure import draw
from testbed.command_line.interruption import interruptible
from testbed.command_line.terminal import user_input
from testbed.environment.registration import env_id
from testbed.evaluation.drive_evaluator import DriveEvaluator
from testbed.evaluation.driving import LONGEST
from testbed.experiments.identity import shared_digest
from testbed.files import make_directory, write_json
from testbed.frame import Frame
from testbed.log.text import markdown_table
from testbed.probing.drives import FREE, Setting, drive

SHOWN = 1  # seed of the pictures
PAGE = """# Probes

Short scenes in which a planner on the truth is just safe, so that what tracking costs shows in the drive. In the scenes
of the catalogue there is so much room that errors of tracking are absorbed.

```python
env = gym.make("{example}", config={{"gap": 26}})  # harder than its default
```

Every other vehicle follows a prescribed course: the same seed gives the same traffic whatever the ego does, so drives
on the truth and on tracks are paired exactly. What a probe asks is a matter of one or two numbers, its parameters,
which the config of the environment sets; they vary by 5 % from seed to seed. The ego keeps its lane, so that a lane
change cannot dodge the question, but for `probe-passing`, where a change for nothing is an answer too, and
`probe-merge`, where the change is what the ego wants. That needs a planner which takes small gaps: `idm-keen`.

The builders are in [scenarios/encounters.py](../scenarios/encounters.py), the table in
[scenarios/probes.py](../scenarios/probes.py). A comparison of `all` scenarios and the baselines leave the probes out;
by name they go wherever a scenario goes.

## On the truth

A probe is accepted if, on the truth, {drives} seeds end without a collision and the median of the least time to
collision lies between {low:g} and {high:g} s; `probe-passing` if the ego never brakes with {free:g} m/s² or more. The
time is that to whatever is nearest in time, in the corridor ahead or, from the side and from behind, in the plane.
Measures: [metrics.md](methods/metrics.md#the-drive).

{table}

All drives: [results/probes.json](results/probes.json).
`PYTHONPATH=docs python -m studies probes --docs docs` drives what is missing in `runs/probes`.

## The limit of a planner

`testbed probe NAME --planner P --tracker T --search PARAMETER` finds the hardest setting that 95 % of the seeds
survive, on the truth and on tracks, by bisection seed by seed. The difference is what tracking costs, in metres where
the parameter is a distance. A drive is survived if nothing is hit, and in `probe-passing` if the ego does not brake.

## The reward of highway-env is no measure of what tracking costs

The default reward is the speed: who brakes late is faster until then, so a planner whose tracks come late can earn more
than on the truth. `config["reward"] = "drive"` rewards what `J` measures instead: speed, less the prices of a short
time to collision and of braking ([MET.28](methods/metrics.md#the-drive)).

{sections}
"""
SECTION = """## {name}

{purpose}

{parameters}

![{name}](pictures/{name}.png)

Seed {seed} on the truth: the road 1.5 s before the least time to collision, then, and 1.5 s later; the drive over time.
"""


def main(
    docs: Docs = DOCS,
    out: Annotated[Path, typer.Option(help="Directory of the drives; those of the same code are kept.")] = Path(
        "runs/probes"
    ),
    seeds: Annotated[int, typer.Option(help="Number of drives of each probe.")] = SEEDS,
) -> None:
    """Drive all probes on the truth; write probes.md, its pictures and results/probes.json.

    After Ctrl-C the same command does the rest.
    """
    with user_input():
        make_directory(out)
        page = Page("probes", docs)
        make_directory(docs / "results")
    with interruptible() as request, steps(len(PROBES) * seeds) as next_step:
        found = all_drives(range(seeds), shared_digest(), out, next_step, request)
    if request.signal is not None:
        raise typer.Exit(request.exit_status)
    verdicts = [verdict(probe, rows) for probe, rows in found.items()]
    for probe in PROBES:
        picture(probe, page.picture(probe))
    today = f"{datetime.now(UTC):%Y-%m-%d}"
    accepted = [asdict(v) | {"accepted": v.accepted} for v in verdicts]
    write_json(
        docs / "results" / "probes.json",
        {"date": today, "code": shared_digest(), "seeds": seeds, "verdicts": accepted, "drives": found},
    )
    page.write(render(verdicts), date=today)


def picture(probe: str, path: Path) -> None:
    """Draw one drive of a probe on the truth."""
    scenes: list[Scene] = []
    evaluator = DriveEvaluator()

    def keep(frame: Frame) -> None:
        scenes.append(frame.scene)
        evaluator.step(frame.scene)

    drive(Setting(probe, planner_of(probe)), SHOWN, observer=keep)
    network = PROBES[probe].build(np.random.default_rng(SHOWN)).road.network
    draw(scenes, evaluator.curves, lane_shapes(network), path)


def render(verdicts: list[Verdict]) -> str:
    """What the page says about the drives on the truth."""
    return PAGE.format(
        example=env_id("probe-brake"),
        drives=verdicts[0].drives,
        low=TTC[0],
        high=TTC[1],
        free=FREE,
        table=table(verdicts),
        sections="\n".join(section(PROBES[v.probe]) for v in verdicts),
    )


def table(verdicts: list[Verdict]) -> str:
    """One row a probe."""
    head = (
        "probe", "planner", "drives", "collisions", "least TTC [s]: median (range)", "largest DRAC [m/s²]: median",
        "hardest braking [m/s²]: median (largest)", "accepted",
    )  # fmt: skip
    rows = []
    for v in verdicts:
        low, median, high = v.ttc
        ttc = f"{median:.2f} ({low:.2f} to {high:.2f})" if low < LONGEST else "–"
        braking = f"{v.braking[0]:.1f} ({v.braking[1]:.1f})"
        counts = str(v.drives), str(v.collisions)
        rows.append(
            (f"`{v.probe}`", f"`{v.planner}`", *counts, ttc, f"{v.drac:.1f}", braking, "yes" if v.accepted else "no")
        )
    return markdown_table(head, rows)


def section(probe: Scenario) -> str:
    """What one probe asks, its parameters, its picture."""
    parameters = markdown_table(
        ("parameter", "default", "easy to hard", "what"),
        [
            (f"`{p.name}`", f"{p.default:g} {p.unit}", f"{p.easy:g} to {p.hard:g} {p.unit}", p.note)
            for p in probe.parameters
        ],
    )
    return SECTION.format(name=probe.name, purpose=probe.purpose, parameters=parameters, seed=SHOWN)
