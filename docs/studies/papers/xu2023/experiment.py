"""Reproduction of xu2023: data-region association with one and with interacting motion models, Table II and figures.

The paper prints neither the radar's course nor the transition matrix nor the prior; docs/reproductions.md says what is
used instead, and the rows "not printed" vary it.
"""

from collections.abc import Mapping
from contextlib import closing
from pathlib import Path

import numpy as np

from studies.papers.reference import figures
from studies.papers.report import HERE, MethodRow, PaperReport, Progress, carry_out, silent
from studies.papers.xu2023.cases import FAR, NEAR, STAY, SWEEPS, Sweep
from studies.papers.xu2023.claims import answers
from studies.papers.xu2023.measures import UNITS, measure
from studies.papers.xu2023.simulation import STAGES, RunErrors, collect, join, split, track
from testbed.experiments.command import calculated
from testbed.experiments.engine import Engine

PAPER = "xu2023"
REFERENCE = figures(PAPER)
MEASURES = {f"{stage} {unit}": 2 for stage in STAGES for unit in UNITS} | {"IoU": 2, "mode": 2}
LEGEND = (
    "± half the 95 % interval over the runs. RMSE of position [m] and velocity [m/s] over the stages, mean IoU, share "
    "of scans with the right mode. Reference: Table II, for literal and recommended the figures of an independent "
    "implementation. The file has the numbers of runs"
)
BATCH = 50  # runs at once: larger arrays are no faster, smaller ones are slower


class ManeuverRuns:
    """Rows and errors of what has been run."""

    def __init__(self) -> None:
        self.rows: list[MethodRow] = []
        self.errors: dict[tuple[str, str], RunErrors] = {}

    def add(self, case: str, method: str, found: RunErrors) -> None:
        """Measure the runs of a row and keep their errors."""
        self.errors[case, method] = found
        self.rows.append(MethodRow(case, method, measure(found), REFERENCE.get((case, method), {})))

    @property
    def measured(self) -> dict[tuple[str, str], Mapping[str, float]]:
        """Figures by case and method."""
        return {(row.case, row.method): row.measured for row in self.rows}


def batch(sweep: Sweep, runs: int, seed: int, number: int) -> list[RunErrors]:
    """Batch `number` of a sweep's runs, by variant; equal batches of all sweeps have the same random numbers."""
    size = min(BATCH, sweep.runs(runs) - number * BATCH)
    offset = np.repeat([v.offset for v in sweep.variants], size, 0)
    prior_std = np.repeat([v.prior_std for v in sweep.variants], size, 0)
    together = collect(track(sweep.filter, offset, prior_std, (seed, number), sweep.follows))
    return split(together, len(sweep.variants))


def batches(sweeps: tuple[Sweep, ...], runs: int) -> list[tuple[Sweep, int]]:
    """Sweeps and numbers of their batches."""
    return [(s, number) for s in sweeps for number in range(-(-s.runs(runs) // BATCH))]


def experiment(
    runs: int,
    seed: int,
    found: ManeuverRuns,
    progress: Progress = silent,
    sweeps: tuple[Sweep, ...] = SWEEPS,
    engine: Engine = HERE,
) -> None:
    """Run all sweeps into `found`, which holds what is finished when a Stopped comes through."""
    work = batches(sweeps, runs)
    parts: list[list[RunErrors]] = []
    with closing(calculated(batch, [(sweep, runs, seed, number) for sweep, number in work], engine)) as results:
        for done, (sweep, _) in enumerate(work, 1):
            parts.append(next(results))
            if done == len(work) or work[done][0] is not sweep:
                for variant, errors in zip(sweep.variants, zip(*parts, strict=True), strict=True):
                    found.add(sweep.case, variant.name, join(errors))
                parts = []
            progress(done, len(work), f"{sweep.case}: {sweep.variants[0].name}")


def run(
    runs: int = 100, out: Path | None = None, progress: Progress = silent, seed: int = 0, engine: Engine = HERE
) -> PaperReport:
    """The whole experiment; see `carry_out`."""
    found = ManeuverRuns()

    def draw(folder: Path) -> tuple[Path, ...]:
        from studies.papers.xu2023 import figures  # with matplotlib, which takes long to import

        return figures.draw(found.errors, folder)

    blank = PaperReport(
        paper=PAPER,
        title="Data-region association and interacting motion models for extended targets (Xu et al., 2023)",
        settings={
            "runs": runs,
            "seed": seed,
            "radar near [m]": NEAR,
            "radar far [m]": FAR,
            "stay": STAY,
            "hypotheses": 32,
            "first modes": "equally likely",
        },
        columns=MEASURES,
        legend=LEGEND,
    )
    return carry_out(
        blank,
        lambda: experiment(runs, seed, found, progress, engine=engine),
        rows=lambda: found.rows,
        answers=lambda: answers(found.measured, found.errors),
        draw=draw,
        out=out,
        progress=progress,
    )
