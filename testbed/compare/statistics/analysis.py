"""From the results of a folder to the tables of a comparison: plain data frames with intervals."""

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import norm

from testbed.compare.runs.results import WHOLE_RUN, Results
from testbed.compare.statistics.differences import PairedDifference, compare
from testbed.evaluation.intervals import LEVEL, Interval, chi2_limits, crossed_interval
from testbed.evaluation.metric import METRICS

MAIN = ("gospa", "missed_percent", "false_per_scan", "rmse_position", "rmse_velocity", "rmse_length", "nees_position")
DRIVE = (  # of the ego, in closed loop
    "collisions", "drive_score", "progress", "drac_max", "tit", "deceleration_max", "jerk",
)  # fmt: skip
EDGES = (0.0, 0.25, 0.5, 0.75, 0.999)  # of the visible share; a bin holds its upper edge
LABELS = ("hidden", "to 25 %", "to 50 %", "to 75 %", "to 100 %", "whole")
PHASES = ("before", "onset", "during", "after")
RANGES = (0.0, 25.0, 50.0, 75.0, 100.0, np.inf)  # [m]
VISIBLE = (-np.inf, *EDGES, np.inf)  # share of the outline; a band holds its upper edge
BANDS = {
    "range": (RANGES, (*(f"{a:g} to {b:g} m" for a, b in itertools.pairwise(RANGES[:-1])), f"over {RANGES[-2]:g} m")),
    "visible": (VISIBLE, LABELS),
}
BAND_MEASURES = (  # column of `by_band`, title, factor, digits
    ("position", "position RMSE [m]", 1.0, 2),
    ("velocity", "velocity RMSE [m/s]", 1.0, 2),
    ("length", "length RMSE [m]", 1.0, 2),
    ("held", "frames with a track that fits [%]", 100.0, 1),
)
FEWEST_FRAMES = 30  # with a track, for the errors of a band
DOF = 2  # of NEES and NIS, each of a point in the plane
QUANTITIES = ("nees_position", "nees_velocity", "nis")


class Cell(NamedTuple):
    """One tracker by one measure, over some runs."""

    group: str  # scenario or phase, "all" for everything
    tracker: str
    measure: str
    mean: Interval
    difference: PairedDifference | None  # to the reference, None for the reference itself


def samples(
    spans: pd.DataFrame, measure: str, scenarios: Sequence[str], seeds: Sequence[int]
) -> dict[str, list[NDArray]]:
    """Tracker -> values (seeds) for each scenario, NaN where a run lacks the measure."""
    table = spans.pivot_table(index=["tracker", "scenario"], columns="seed", values=measure, dropna=False)
    table = table.reindex(columns=list(seeds))
    trackers = table.index.get_level_values(0).unique()
    none = np.full(len(seeds), np.nan)
    return {
        t: [table.loc[(t, c)].to_numpy(float) if (t, c) in table.index else none for c in scenarios] for t in trackers
    }


def cells(results: Results, measures: Sequence[str], by: str | None = None) -> Iterator[Cell]:
    """Means and paired differences; by: None over all runs, "scenario" or "phase"."""
    comparison = results.comparison
    if by == "phase":
        groups = [(p, results.spans[results.spans["phase"] == p], comparison.scenarios) for p in PHASES]
    elif by == "scenario":
        groups = [(c, results.runs, (c,)) for c in comparison.scenarios]
    else:
        groups = [(WHOLE_RUN, results.runs, comparison.scenarios)]
    for group, spans, scenarios in groups:
        for measure in measures:
            if spans.empty or measure not in spans or not spans[measure].notna().any():
                continue
            found = samples(spans, measure, scenarios, comparison.seeds)
            for tracker in comparison.trackers:
                if tracker in found:
                    yield _cell(group, tracker, measure, found, comparison.baseline)


def _cell(group: str, tracker: str, measure: str, found: dict[str, list[NDArray]], baseline: str) -> Cell:
    difference = None
    if tracker != baseline and baseline in found:
        bad = [[_badness(measure, values) for values in found[name]] for name in (tracker, baseline)]
        difference = compare(*bad)
    return Cell(group, tracker, measure, crossed_interval(found[tracker]), difference)


def _badness(measure: str, values: NDArray) -> NDArray:
    return np.array([METRICS[measure].badness(v) for v in values.tolist()])


def pairwise(results: Results, measure: str) -> pd.DataFrame:
    """Probability that the tracker of the row is better than that of the column in a run; NaN on the diagonal."""
    comparison = results.comparison
    found = samples(results.runs, measure, comparison.scenarios, comparison.seeds)
    names = [t for t in comparison.trackers if t in found]
    bad = {t: np.array([_badness(measure, v) for v in found[t]]) for t in names}
    table = pd.DataFrame(np.nan, index=names, columns=names)
    for row in names:
        for column in names:
            d = (bad[row] - bad[column]).ravel()
            d = d[np.isfinite(d)]
            if row != column and len(d):
                table.loc[row, column] = np.mean((d < 0) + 0.5 * (d == 0))
    return table


def by_band(results: Results, band: str) -> pd.DataFrame:
    """Errors of counted objects by range or by visible share: one row a tracker and band.

    Columns: tracker, band, frames, held (share of frames with a track that fits), and for each of position, velocity
    and length the RMSE with its interval over runs: value, low, high.
    """
    edges, labels = BANDS[band]
    errors = ("position", "velocity", "length")
    rows = results.rows(["scenario", "tracker", "seed", "status", band, *errors], settled=True)
    rows = rows[rows["status"].isin(("pair", "missed"))]
    right = band == "visible"
    rows = rows.assign(band=pd.cut(rows[band], edges, right=right, labels=labels), held=rows["status"] == "pair")
    rows[list(errors)] = rows[list(errors)].astype(float) ** 2
    keys = ["tracker", "band", "scenario", "seed"]
    runs = rows.groupby(keys, observed=True)[["held", *errors]].mean()
    counts = rows.groupby(["tracker", "band"], observed=True)["held"].agg(["size", "sum"])
    table = []
    for tracker in results.comparison.trackers:
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
        settled=True,
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
    for tracker in results.comparison.trackers:
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


def unresolved(cells: Sequence[Cell]) -> list[str]:
    """One sentence for each difference that the seeds cannot resolve, with how many it would take."""
    sentences = []
    for cell in cells:
        d = cell.difference
        if d is None or d.verdict not in ("unresolved", "too few seeds"):
            continue
        label = METRICS[cell.measure].label
        if d.verdict == "too few seeds":
            sentences.append(f"{cell.tracker}, {label}: {d.pairs} runs are too few for an interval")
        else:
            seeds = (
                f"about {d.needed:.0f} seeds a scenario would" if np.isfinite(d.needed) else "no number of seeds will"
            )
            sentences.append(
                f"{cell.tracker}, {label}: the difference {d.mean.value:+.3g} is not resolved; {seeds} resolve it"
            )
    return sentences


def _root(square: Interval) -> Interval:
    """A root mean square from the mean square; the bias of an interval near zero may not make it imaginary."""
    return Interval(*(float(np.sqrt(max(x, 0.0))) for x in square))


def _by_scenario(values: pd.Series) -> list[NDArray]:
    """Values by (scenario, seed) as a sample, NaN where a run has none."""
    return list(values.unstack("seed").to_numpy(float))


def _columns(name: str, found: Interval) -> dict[str, float]:
    return {name: found.value, f"{name}_low": found.low, f"{name}_high": found.high}
