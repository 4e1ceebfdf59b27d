"""Reproduction of xu2023: data-region association with one and with interacting motion models, Table II and figures.

The paper prints neither the radar's course nor the transition matrix nor the prior; card dra_imm, section 14, says what
is used instead, and a second course of the radar shows how far the result depends on it.
"""

from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from testbed.papers.verdict import Progress, Report, Row, Stopped
from testbed.papers.xu2023_claims import verdicts
from testbed.papers.xu2023_reference import REFERENCE
from testbed.papers.xu2023_trials import STAGES, STEP, STEPS, Course, Trace, maneuver, track
from trackers.dra import DataRegion

PAPER = "xu2023"
MEASURES = {f"{stage} {unit}": 2 for stage in STAGES for unit in ("m", "m/s")} | {"IoU": 2, "mode": 2}
LEGEND = "RMSE of position [m] and velocity [m/s] over the stages, mean IoU, share of scans with the right mode"
NEAR = (-19.3, -23.0)  # [m] 30 m away, bearing 50 deg
FAR = (-43.0, -55.0)  # 70 m
GROUPS = 20  # of runs, for the intervals

_PRINTED = DataRegion(parameters="paper", form="joint", prior="uniform")
_DRA, _IMM = replace(_PRINTED, models=("cv",)), _PRINTED
_EDRA = replace(_PRINTED, prior="rays")
METHODS = {
    **{
        f"{name}, {reading}": replace(f, reading=reading)
        for reading in ("S", "V")
        for name, f in (("DRA(CV)", _DRA), ("DRA-IMM", _IMM), ("EDRA-IMM", _EDRA))
    },
    "literal": DataRegion(parameters="literal"),
    "recommended": DataRegion(),
}
PRINTED = tuple(METHODS)[:6]


@dataclass(frozen=True)
class Case:
    """One course and the methods that are asked there."""

    course: Course
    methods: tuple[str, ...]


CASES = (
    Case(Course("near", NEAR), (*PRINTED, "literal")),
    Case(Course("far", FAR), (*PRINTED[3:], "literal")),
    Case(Course("near, extent follows", NEAR, follows=True), ("EDRA-IMM, V", "recommended")),
)


class Outcome:
    """Rows and traces of what has been run."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.traces: dict[tuple[str, str], Trace] = {}

    def add(self, case: str, method: str, trace: Trace) -> None:
        """Measure a trace and keep it."""
        self.traces[case, method] = trace
        self.rows.append(Row(case, method, measure(trace), REFERENCE.get((case, method), {})))


def stage_mask(stage: str) -> NDArray:
    """Steps (500,) of a stage."""
    t = np.arange(STEPS) * STEP + 1e-9
    return np.any([(t >= a) & (t < b) for a, b in STAGES[stage]], axis=0)


def rmse(squared: NDArray, stage: str) -> float:
    """RMSE over runs, averaged over the steps of a stage; squared (steps, R)."""
    return float(np.sqrt(squared.mean(1))[stage_mask(stage)].mean())


def half_width(squared: NDArray, stage: str) -> float:
    """Half a 95 % interval of `rmse`, from groups of runs; NaN for fewer than two."""
    groups = np.array_split(np.arange(squared.shape[1]), min(GROUPS, squared.shape[1]))
    values = [rmse(squared[:, g], stage) for g in groups]
    return float(1.96 * np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else float("nan")


def measure(trace: Trace) -> dict[str, float]:
    """Figures of one method in one case, and the half widths of their intervals."""
    out = {}
    for stage in STAGES:
        for unit, squared in (("m", trace.position), ("m/s", trace.velocity)):
            out[f"{stage} {unit}"] = rmse(squared, stage)
            out[f"{stage} {unit} 95 %"] = half_width(squared, stage)
    right = trace.mode.argmax(-1) == true_modes()[:, None]
    share = float(right.mean()) if trace.mode.shape[-1] == len(STAGES) else float("nan")
    return out | {"IoU": float(trace.iou.mean()), "mode": share}


def true_modes() -> NDArray:
    """Motion model (500,) that is true: 0 CV, 1 CA, 2 CT."""
    return np.array([maneuver(k)[2] for k in range(STEPS)])


def experiment(runs: int, seed: int, progress: Progress | None, outcome: Outcome) -> None:
    """Run all cases into `outcome`, which holds what is finished when a Stopped comes through."""
    work = [(case.course, name) for case in CASES for name in case.methods]
    for done, (course, name) in enumerate(work):
        steps = []
        for k, step in enumerate(track(METHODS[name], course, runs, seed)):
            steps.append(step)
            if progress is not None and k % 10 == 0:
                progress(done + k / STEPS, len(work), f"{course.name}: {name}")
        outcome.add(course.name, name, Trace(*(np.stack(field) for field in zip(*steps, strict=True))))
    if progress is not None:
        progress(len(work), len(work), "done")


def run(runs: int = 100, out: Path | None = None, progress: Progress | None = None, seed: int = 0) -> Report:
    """The whole experiment; with `out`, also its figures and JSON in that folder.

    A Stopped from `progress` ends it early: the report then holds the rows that are finished.
    """
    if runs < 1:
        raise ValueError(f"runs must be at least 1, got {runs}")
    outcome, finished = Outcome(), False
    with suppress(Stopped):
        experiment(runs, seed, progress, outcome)
        finished = True
    report = Report(
        paper=PAPER,
        title="Data-region association and interacting motion models for extended targets (Xu et al., 2023)",
        settings={"runs": runs, "seed": seed, "radar near [m]": NEAR, "radar far [m]": FAR, "stay": 0.9},
        columns=MEASURES,
        legend=LEGEND,
        rows=tuple(outcome.rows),
        verdicts=verdicts({(r.case, r.method): r.measured for r in outcome.rows}) if finished else (),
        interrupted=not finished,
    )
    if out is None:
        return report
    if finished:
        from testbed.papers.figures_xu2023 import draw

        out.mkdir(parents=True, exist_ok=True)
        report = replace(report, figures=draw(outcome.traces, out))
    report.write(out)
    return report
