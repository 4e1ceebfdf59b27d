"""The page docs/probes.md: what each probe asks, how safe it is on the truth, a picture of each."""

from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from scenarios.lanes import lane_shapes
from scenarios.probes import PROBES
from scenarios.record import Scenario
from sensors.scene import Scene
from studies.page import DOCS, Docs, Page, fill
from studies.probes.drives import SEEDS, Acceptance, Probes, acceptance, drive_of
from studies.probes.figure import draw
from studies.runs import made
from testbed.command_line.options import Dask, Jobs
from testbed.command_line.terminal import user_input
from testbed.environment.registration import env_id
from testbed.evaluation.drive_evaluator import DriveEvaluator
from testbed.evaluation.driving import LONGEST
from testbed.experiments.engine import Engine
from testbed.experiments.episode import episode
from testbed.experiments.identity import shared_digest
from testbed.experiments.probe import BLIND, FREE, LOSS, TTC
from testbed.files import make_directory, write_json
from testbed.frame import TRUTH, Frame
from testbed.log.text import markdown_table

SHOWN = 1  # seed of the pictures


def main(
    docs: Docs = DOCS,
    out: Annotated[str, typer.Option(help="Directory of the drives; those of the same code are kept.")] = "runs/probes",
    seeds: Annotated[int, typer.Option(help="Number of drives of each probe.")] = SEEDS,
    jobs: Jobs = 1,
    dask: Dask = None,
) -> None:
    """Drive all probes on the truth, and on nothing; write probes.md, its pictures and results/probes.json.

    After Ctrl-C the same command does the rest.
    """
    with user_input():
        page = Page("probes", docs)
        make_directory(docs / "results")
    metas = made(Probes(seeds=seeds, out=out), Engine(jobs, dask)).metas
    found: dict[str, dict[str, list[dict[str, Any]]]] = {p: {TRUTH: [], BLIND: []} for p in PROBES}
    for run, meta in metas.items():
        row = {key: value for key, value in meta["spans"][0].items() if key != "phase"}
        found[run.scenario][run.source].append(row)
    probes = [acceptance(probe, rows[TRUTH], rows[BLIND]) for probe, rows in found.items()]
    for probe in PROBES:
        picture(probe, page.picture(probe))
    today = f"{datetime.now(UTC):%Y-%m-%d}"
    accepted = list(map(asdict, probes))
    write_json(
        docs / "results" / "probes.json",
        {
            "date": today,
            "code": shared_digest(),
            "seeds": seeds,
            "verdicts": accepted,
            "drives": {probe: rows[TRUTH] for probe, rows in found.items()},
            "blind": {probe: rows[BLIND] for probe, rows in found.items()},
        },
    )
    page.write(render(probes), date=today)


def picture(probe: str, path: Path) -> None:
    """Draw one drive of a probe on the truth."""
    scenes: list[Scene] = []
    evaluator = DriveEvaluator()

    def keep(frame: Frame) -> None:
        scenes.append(frame.scene)
        evaluator.step(frame.scene)

    episode(drive_of(probe, SHOWN), [keep])
    network = PROBES[probe].build(np.random.default_rng(SHOWN)).road.network
    draw(scenes, evaluator.curves, lane_shapes(network), path)


def render(probes: list[Acceptance]) -> str:
    """What the page says about the drives on the truth."""
    return fill(
        "probes/page.md.j2",
        example=env_id("probe-brake"),
        drives=probes[0].drives,
        low=TTC[0],
        high=TTC[1],
        free=FREE,
        loss=LOSS,
        blind=max(v.blind[0] for v in probes),
        seed=SHOWN,
        table=table(probes),
        parameters=parameters([PROBES[v.probe] for v in probes]),
        sections="\n".join(section(PROBES[v.probe]) for v in probes),
    )


def table(probes: list[Acceptance]) -> str:
    """One row a probe."""
    head = (
        "probe", "planner", "drives", "collisions", "least TTC [s]: median (range)", "largest DRAC [m/s²]: median",
        "hardest braking [m/s²]: median (largest)", "score", "score blind", "blind drives that fail", "accepted",
    )  # fmt: skip
    rows = []
    for v in probes:
        low, median, high = v.ttc
        ttc = f"{median:.2f} ({low:.2f} to {high:.2f})" if low < LONGEST else "–"
        braking = f"{v.braking[0]:.1f} ({v.braking[1]:.1f})"
        counts = str(v.drives), str(v.collisions)
        scores = f"{v.score[0]:.2f}", f"{v.score[1]:.2f}", f"{v.blind[1]} of {v.blind[0]}"
        verdict = "yes" if v.accepted else "no"
        rows.append((f"`{v.probe}`", f"`{v.planner}`", *counts, ttc, f"{v.drac:.1f}", braking, *scores, verdict))
    return markdown_table(head, rows)


def parameters(probes: list[Scenario]) -> str:
    """One row a parameter."""
    return markdown_table(
        ("probe", "parameter", "default", "easy to hard", "what"),
        [
            (f"`{v.name}`", f"`{p.name}`", f"{p.default:g} {p.unit}", f"{p.easy:g} to {p.hard:g} {p.unit}", p.note)
            for v in probes
            for p in v.parameters
        ],
    )


def section(probe: Scenario) -> str:
    """What one probe asks, its picture."""
    return fill("probes/probe.md.j2", name=probe.name, purpose=probe.purpose)
