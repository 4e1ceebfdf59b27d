"""Reproduction of xu2023: data-region association with one and with interacting motion models, Table II and figures.

The paper prints neither the radar's course nor the transition matrix nor the prior; docs/reproductions.md says what is
used instead, and the rows "not printed" vary it.
"""

import signal
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from joblib import Parallel, cpu_count, delayed, parallel_config

from studies.papers.report import MethodRow, PaperReport, Progress, carry_out, silent
from studies.papers.xu2023.cases import FAR, NEAR, STAY, SWEEPS, Sweep
from studies.papers.xu2023.claims import verdicts
from studies.papers.xu2023.measures import UNITS, measure
from studies.papers.xu2023.reference import REFERENCE
from studies.papers.xu2023.simulation import STAGES, RunErrors, collect, join, split, track

PAPER = "xu2023"
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
    jobs: int | None = None,
) -> None:
    """Run all sweeps into `found`, which holds what is finished when a Stopped comes through.

    By default on as many processes as there are cores; the figures do not depend on it.
    """
    work = batches(sweeps, runs)
    parts: list[list[RunErrors]] = []
    for done, part in enumerate(_results(work, runs, seed, jobs)):
        sweep = work[done][0]
        parts.append(part)
        if done + 1 == len(work) or work[done + 1][0] is not sweep:
            for variant, errors in zip(sweep.variants, zip(*parts, strict=True), strict=True):
                found.add(sweep.case, variant.name, join(errors))
            parts = []
        progress(done + 1, len(work), f"{sweep.case}: {sweep.variants[0].name}")


def _results(work: list[tuple[Sweep, int]], runs: int, seed: int, jobs: int | None) -> Iterator[list[RunErrors]]:
    """Errors of the batches, in their order."""
    jobs = min(cpu_count() if jobs is None else jobs, len(work))
    if jobs == 1:
        yield from (batch(sweep, runs, seed, number) for sweep, number in work)
        return
    one_core = parallel_config(backend="loky", inner_max_num_threads=1, initializer=_leave_interrupts_to_the_parent)
    with one_core, warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*tasks which were still being processed", UserWarning)
        parallel = Parallel(n_jobs=jobs, return_as="generator", batch_size=1)
        results = parallel(delayed(batch)(sweep, runs, seed, number) for sweep, number in work)
        try:
            yield from results
        finally:
            results.close()


def _leave_interrupts_to_the_parent() -> None:
    """Ctrl-C reaches all processes of a terminal; the parent process decides what becomes of the work."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def run(runs: int = 100, out: Path | None = None, progress: Progress = silent, seed: int = 0) -> PaperReport:
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
        lambda: experiment(runs, seed, found, progress),
        rows=lambda: found.rows,
        verdicts=lambda: verdicts(found.measured, found.errors),
        draw=draw,
        out=out,
        progress=progress,
    )
