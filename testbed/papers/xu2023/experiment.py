"""Reproduction of xu2023: data-region association with one and with interacting motion models, Table II and figures.

The paper prints neither the radar's course nor the transition matrix nor the prior; card dra_imm, section 14, says what
is used instead, and the rows "not printed" vary it.
"""

import signal
import warnings
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from joblib import Parallel, cpu_count, delayed, parallel_config

from testbed.papers.verdict import Progress, Report, Row, Stopped
from testbed.papers.xu2023.cases import FAR, NEAR, STAY, TRIALS, Trial
from testbed.papers.xu2023.claims import verdicts
from testbed.papers.xu2023.measures import UNITS, measure
from testbed.papers.xu2023.reference import REFERENCE
from testbed.papers.xu2023.trials import STAGES, Trace, join, split, trace, track

PAPER = "xu2023"
MEASURES = {f"{stage} {unit}": 2 for stage in STAGES for unit in UNITS} | {"IoU": 2, "mode": 2}
LEGEND = (
    "± half the 95 % interval over the runs. RMSE of position [m] and velocity [m/s] over the stages, mean IoU, share "
    "of scans with the right mode. Reference: Table II, for literal and recommended the figures of an independent "
    "implementation. The file has the numbers of runs"
)
BATCH = 50  # runs at once: larger arrays are no faster, smaller ones are slower


class Outcome:
    """Rows and traces of what has been run."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.traces: dict[tuple[str, str], Trace] = {}

    def add(self, case: str, method: str, trace: Trace) -> None:
        """Measure a trace and keep it."""
        self.traces[case, method] = trace
        self.rows.append(Row(case, method, measure(trace), REFERENCE.get((case, method), {})))


def batch(trial: Trial, runs: int, seed: int, number: int) -> list[Trace]:
    """The batch of that number of a trial's runs, by variant; all trials with as many runs have the same worlds."""
    size = min(BATCH, trial.runs(runs) - number * BATCH)
    offset = np.repeat([v.offset for v in trial.variants], size, 0)
    prior_std = np.repeat([v.prior_std for v in trial.variants], size, 0)
    whole = trace(track(trial.filter, offset, prior_std, (seed, number), trial.follows))
    return split(whole, len(trial.variants))


def batches(trials: tuple[Trial, ...], runs: int) -> list[tuple[Trial, int]]:
    """Trials and numbers of their batches."""
    return [(t, number) for t in trials for number in range(-(-t.runs(runs) // BATCH))]


def experiment(
    runs: int,
    seed: int,
    progress: Progress | None,
    outcome: Outcome,
    trials: tuple[Trial, ...] = TRIALS,
    jobs: int | None = None,
) -> None:
    """Run all trials into `outcome`, which holds what is finished when a Stopped comes through.

    By default on as many processes as there are cores; the figures do not depend on it.
    """
    work = batches(trials, runs)
    parts: list[list[Trace]] = []
    for done, part in enumerate(_results(work, runs, seed, jobs)):
        trial = work[done][0]
        parts.append(part)
        if done + 1 == len(work) or work[done + 1][0] is not trial:
            for variant, traces in zip(trial.variants, zip(*parts, strict=True), strict=True):
                outcome.add(trial.case, variant.name, join(traces))
            parts = []
        if progress is not None:
            progress(done + 1, len(work), f"{trial.case}: {trial.variants[0].name}")


def _results(work: list[tuple[Trial, int]], runs: int, seed: int, jobs: int | None) -> Iterator[list[Trace]]:
    """Traces of the batches, in their order."""
    jobs = min(cpu_count() if jobs is None else jobs, len(work))
    if jobs == 1:
        yield from (batch(trial, runs, seed, number) for trial, number in work)
        return
    one_core = parallel_config(backend="loky", inner_max_num_threads=1, initializer=_leave_interrupts_to_the_parent)
    with one_core, warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*tasks which were still being processed", UserWarning)
        parallel = Parallel(n_jobs=jobs, return_as="generator", batch_size=1)
        results = parallel(delayed(batch)(trial, runs, seed, number) for trial, number in work)
        try:
            yield from results
        finally:
            results.close()


def _leave_interrupts_to_the_parent() -> None:
    """Ctrl-C reaches all processes of a terminal; the one that asked for the work decides what becomes of it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def run(
    runs: int = 100,
    out: Path | None = None,
    progress: Progress | None = None,
    seed: int = 0,
    trials: tuple[Trial, ...] = TRIALS,
) -> Report:
    """The whole experiment; with `out`, also its figures and JSON in that folder.

    A Stopped from `progress` ends it early: the report then holds the rows that are finished.
    """
    if runs < 1:
        raise ValueError(f"runs must be at least 1, got {runs}")
    outcome, finished = Outcome(), False
    with suppress(Stopped):
        experiment(runs, seed, progress, outcome, trials)
        finished = True
    return report(outcome, runs, seed, finished, out)


def report(outcome: Outcome, runs: int, seed: int, finished: bool, out: Path | None = None) -> Report:
    """What was run, with verdicts if it is finished; with `out`, written there with its figures."""
    made = Report(
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
        rows=tuple(outcome.rows),
        verdicts=verdicts({(r.case, r.method): r.measured for r in outcome.rows}, outcome.traces) if finished else (),
        interrupted=not finished,
    )
    if out is None:
        return made
    if finished:
        from testbed.papers.xu2023.figures import draw

        out.mkdir(parents=True, exist_ok=True)
        made = replace(made, figures=draw(outcome.traces, out))
    made.write(out)
    return made
