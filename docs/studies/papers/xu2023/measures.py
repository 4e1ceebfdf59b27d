"""Measures of xu2023: RMSE over runs, averaged over a stage, with 95 % intervals over the runs.

The paper averages the roots, not the squares. So the influence of a run on the figure of a stage is the mean over its
steps of (s - v) / (2 sqrt(v)), s its squared error and v their mean over the runs (delta method); the interval is that
of the mean influence, by Student's t. A reduction of one method's error by another compares both on the same runs.
"""

import numpy as np
from numpy.typing import NDArray

from studies.papers.xu2023.simulation import IOU_EVERY, STAGES, STEP, STEPS, RunErrors, maneuver
from studies.plus_minus import PlusMinus
from testbed.evaluation.intervals import student_interval

UNITS = ("m", "m/s")
COLUMNS = tuple(f"{stage} {unit}" for stage in STAGES for unit in UNITS)
TABLE_2 = {  # 1000 runs, in the order of COLUMNS
    "DRA(CV)": (0.33, 0.10, 0.65, 0.88, 1.78, 3.29),
    "DRA-IMM": (0.34, 0.11, 0.50, 0.48, 1.52, 2.79),
    "EDRA-IMM": (0.31, 0.08, 0.45, 0.40, 1.35, 2.34),
}
READINGS = (("near", "S"), ("near", "V"), ("far", "V"))  # course of the radar, reading of eq. (42): not printed
LEAST = 1e-12  # [m] error of a stage that is divided by


def stage_mask(stage: str) -> NDArray:
    """Steps (500,) of a stage."""
    t = np.arange(STEPS) * STEP + 1e-9
    return np.any([(t >= a) & (t < b) for a, b in STAGES[stage]], axis=0)


def true_modes() -> NDArray:
    """Motion model (500,) that is true: 0 CV, 1 CA, 2 CT."""
    return np.array([maneuver(k)[2] for k in range(STEPS)])


def influences(squared: NDArray, stage: str) -> tuple[float, NDArray]:
    """RMSE of a stage, and the influence of each run (R,) on it; squared (steps, R)."""
    s = squared[stage_mask(stage)]
    root = np.sqrt(s.mean(1, keepdims=True))
    return float(root.mean()), ((s - root**2) / (2 * np.maximum(root, LEAST))).mean(0)


def interval(value: float, influence: NDArray) -> PlusMinus:
    """A figure on which runs have an influence (R,) of mean 0, with the interval of their mean."""
    _, half = student_interval(influence)
    return PlusMinus(value, float(half))


def rmse(squared: NDArray, stage: str) -> PlusMinus:
    """RMSE over runs, averaged over the steps of a stage; squared (steps, R)."""
    return interval(*influences(squared, stage))


def reduction(before: NDArray, after: NDArray, stage: str) -> PlusMinus:
    """By how many percent the error `after` of a stage is smaller than that `before`; squared errors (steps, R)."""
    (b, on_b), (a, on_a) = influences(before, stage), influences(after, stage)
    return interval(100 * (1 - a / b), 100 * (a * on_b / b - on_a) / b)


def reductions(before: RunErrors, after: RunErrors) -> dict[str, PlusMinus]:
    """Reductions [%] of position and velocity errors in all stages."""
    return {
        f"{stage} {unit}": reduction(b, a, stage)
        for stage in STAGES
        for unit, b, a in zip(UNITS, before[:2], after[:2], strict=True)
    }


def measure(found: RunErrors) -> dict[str, float]:
    """Figures of one method in one case, and the half widths of their intervals."""
    out = {}
    right = found.mode.argmax(-1) == true_modes()[:, None]
    known = found.mode.shape[-1] == len(STAGES)
    for stage in STAGES:
        for unit, squared in zip(UNITS, found[:2], strict=True):
            out[f"{stage} {unit}"], out[f"{stage} {unit} 95 %"] = rmse(squared, stage)
        out[f"{stage} IoU"] = float(found.iou[stage_mask(stage)[::IOU_EVERY]].mean())
        out[f"{stage} mode"] = float(right[stage_mask(stage)].mean()) if known else float("nan")
    out |= {"IoU": float(found.iou.mean()), "mode": float(right.mean()) if known else float("nan")}
    return out | {"farthest [m]": float(np.sqrt(found.position.max())), "runs": found.position.shape[1]}
