"""Errors by range and by visible share, and consistency by phase, from the rows of all runs."""

import itertools

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import norm

from testbed.evaluation.intervals import LEVEL, Interval, chi2_limits, crossed_interval
from testbed.evaluation.metric import METRICS
from testbed.experiments.statistics import PHASES
from testbed.experiments.store import Results

EDGES = (0.0, 0.25, 0.5, 0.75, 0.999)  # of the visible share; a bin holds its upper edge
LABELS = ("hidden", "to 25 %", "to 50 %", "to 75 %", "to 100 %", "whole")
RANGES = (0.0, 25.0, 50.0, 75.0, 100.0, np.inf)  # [m]
VISIBLE = (-np.inf, *EDGES, np.inf)  # share of the outline; a band holds its upper edge
BANDS = {
    "range": (RANGES, (*(f"{a:g} to {b:g} m" for a, b in itertools.pairwise(RANGES[:-1])), f"over {RANGES[-2]:g} m")),
    "visible": (VISIBLE, LABELS),
}
BAND_MEASURES = (  # column of `by_band`, title, factor, digits
    *((key, METRICS[f"rmse_{key}"].title, 1.0, 2) for key in ("position", "velocity", "length")),
    ("held", "frames with a track that fits [%]", 100.0, 1),
)
FEWEST_FRAMES = 30  # with a track, for the errors of a band
DOF = 2  # of NEES and NIS, each of a point in the plane
QUANTITIES = ("nees_position", "nees_velocity", "nis")


def by_band(results: Results, band: str) -> pd.DataFrame:
    """Errors of counted objects by range or by visible share: one row a tracker and band.

    Columns: tracker, band, frames, held (share of frames with a track that fits), and for each of position, velocity
    and length the RMSE with its interval over runs: value, low, high.
    """
    edges, labels = BANDS[band]
    errors = ("position", "velocity", "length")
    rows = results.rows(["scenario", "tracker", "seed", "status", band, *errors], after=results.study.settings.settle)
    rows = rows[rows["status"].isin(("pair", "missed"))]
    right = band == "visible"
    rows = rows.assign(band=pd.cut(rows[band], edges, right=right, labels=labels), held=rows["status"] == "pair")
    rows[list(errors)] = rows[list(errors)].astype(float) ** 2
    keys = ["tracker", "band", "scenario", "seed"]
    runs = rows.groupby(keys, observed=True)[["held", *errors]].mean()
    counts = rows.groupby(["tracker", "band"], observed=True)["held"].agg(["size", "sum"])
    table = []
    for tracker in results.study.trackers:
        for label in labels:
            if (tracker, label) not in counts.index or counts.loc[(tracker, label), "sum"] < FEWEST_FRAMES:
                continue
            part = runs.loc[(tracker, label)]
            row: dict[str, float | str] = {
                "tracker": tracker,
                "band": label,
                "frames": counts.loc[(tracker, label), "size"],
            }
            row |= _columns("held", crossed_interval(_by_scenario(part["held"])))
            for error in errors:
                row |= _columns(error, _root(crossed_interval(_by_scenario(part[error]))))
            table.append(row)
    return pd.DataFrame(table)


def consistency(results: Results) -> pd.DataFrame:
    """NEES, NIS and coverage of length and width by phase: whether the covariances match the errors.

    One row a tracker and phase. For each of nees_position, nees_velocity and nis: the mean over frames with its
    interval over runs, and the share of instants at which the mean over runs and objects keeps its chi-square limits
    (ideal .95; errors of one run are correlated in time, those of different runs are not). For length and width: the
    share of frames in which the truth lies in the 95 % interval of the tracker.
    """
    rows = results.rows(
        [
            "scenario",
            "tracker",
            "seed",
            "time",
            "phase",
            "status",
            *QUANTITIES,
            "length",
            "length_std",
            "width",
            "width_std",
        ],
        after=results.study.settings.settle,
    )
    rows = rows[rows["status"] == "pair"].copy()
    z = float(norm.ppf((1 + LEVEL) / 2))
    for side in ("length", "width"):
        rows[f"{side}_covered"] = (rows[side].abs() <= z * rows[f"{side}_std"]).astype(float)
    values = [*QUANTITIES, "length_covered", "width_covered"]
    runs = rows.groupby(["tracker", "phase", "scenario", "seed"], observed=True)[values].mean()
    instants = rows.groupby(["tracker", "phase", "scenario", "time"], observed=True)[list(QUANTITIES)].agg(
        ["mean", "count"]
    )
    table = []
    for tracker in results.study.trackers:
        for phase in PHASES:
            if (tracker, phase) not in runs.index.droplevel([2, 3]):
                continue
            part = runs.loc[(tracker, phase)]
            row: dict[str, float | str] = {"tracker": tracker, "phase": phase}
            for value in values:
                row |= _columns(value, crossed_interval(_by_scenario(part[value])))
            for quantity in QUANTITIES:
                mean, count = (instants.loc[(tracker, phase)][(quantity, k)].to_numpy() for k in ("mean", "count"))
                row[f"{quantity}_inside"] = inside_share(mean, count)
            table.append(row)
    return pd.DataFrame(table)


def inside_share(mean: NDArray, count: NDArray) -> float:
    """Share of instants at which a mean of `count` chi-square values keeps its 95 % limits; NaN of none."""
    some = count > 0
    low, high = chi2_limits(DOF, count[some])
    return float(np.mean((low <= mean[some]) & (mean[some] <= high))) if some.any() else np.nan


def _root(square: Interval) -> Interval:
    """A root mean square from the mean square; the bias of an interval near zero may not make it imaginary."""
    return Interval(*(float(np.sqrt(max(x, 0.0))) for x in square))


def _by_scenario(values: pd.Series) -> list[NDArray]:
    """Values by (scenario, seed) as a sample, NaN where a run has none."""
    return list(values.unstack("seed").to_numpy(float))


def _columns(name: str, found: Interval) -> dict[str, float]:
    return {name: found.value, f"{name}_low": found.low, f"{name}_high": found.high}
