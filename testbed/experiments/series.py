"""Errors by range, by visible share, by phase and over time, from the rows of all runs."""

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import norm

from testbed.evaluation.intervals import FEWEST, LEVEL, Interval, chi2_limits, crossed_interval, student_interval
from testbed.evaluation.metric import METRICS
from testbed.experiments.statistics import PHASES
from testbed.experiments.store import Results

STEP = 0.5  # [s] frames that are averaged together
MOST_SHOWN = 6  # trackers in a figure over time or by band
COLUMNS = ("tracker", "seed", "time", "phase", "status", "gospa2", "position", "nees_position", "nis")
SHADED = ("onset", "during")
ERRORS = ("gospa", "position")
DRAWN = ("nees_position", "nis")
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
SIZES = ("length", "length_std", "width", "width_std")


class Series(NamedTuple):
    """One tracker in one scenario; arrays (B,), NaN where nothing was measured."""

    scenario: str
    tracker: str
    quantity: str
    time: NDArray  # [s] middle of the bin
    mean: NDArray  # over seeds; of NEES and NIS over all runs and objects
    low: NDArray  # 95 % interval of the mean over seeds; NaN of NEES and NIS
    high: NDArray
    size: NDArray  # runs; of NEES and NIS runs and objects in a frame


def chosen(results: Results) -> list[str]:
    """The first `MOST_SHOWN` of `ranked`."""
    return ranked(results)[:MOST_SHOWN]


def ranked(results: Results) -> list[str]:
    """All trackers: the reference, then the others by their mean GOSPA, those without any run last."""
    names, baseline, runs = results.study.trackers, results.study.baseline, results.runs
    gospa: dict[str, float] = {}
    if len(runs):
        means = runs.groupby(["tracker", "scenario"])["gospa"].mean().groupby("tracker").mean()
        gospa = means.dropna().to_dict()
    return sorted(names, key=lambda name: (name != baseline, gospa.get(name, np.inf), names.index(name)))


class PhaseTimes(NamedTuple):
    """A phase of a scenario, at the median over its runs."""

    scenario: str
    phase: str
    start: float  # [s]
    end: float  # [s]


def over_time(results: Results, trackers: Sequence[str]) -> tuple[list[Series], list[PhaseTimes]]:
    """All series of the given trackers, and the phases; the rows of only one scenario are in memory at a time."""
    made = {(run.case, run.source) for run in set(results.study.work()) - set(results.missing)}
    series: list[Series] = []
    times: list[PhaseTimes] = []
    for scenario in results.study.scenarios:
        if any((scenario, t) in made for t in trackers):
            rows = results.rows(COLUMNS, scenario)
            times += phases(scenario, rows)
            rows = rows.assign(bin=_bins(rows["time"].to_numpy(float)))
            for tracker in trackers:
                part = rows[rows["tracker"] == tracker]
                if len(part):
                    series += _series(scenario, tracker, part)
    return series, times


def phases(scenario: str, rows: pd.DataFrame) -> Iterator[PhaseTimes]:
    """Onset and maneuver, each from its first to its last frame."""
    for phase in SHADED:
        frames = rows[rows["phase"] == phase].groupby(["tracker", "seed"], observed=True)["time"]
        if len(frames):
            yield PhaseTimes(scenario, phase, float(frames.min().median()), float(frames.max().median()))


def _series(scenario: str, tracker: str, rows: pd.DataFrame) -> Iterator[Series]:
    bins = np.arange(rows["bin"].max() + 1)
    time = (bins + 0.5) * STEP
    for quantity, runs in zip(ERRORS, (_gospa(rows), _position(rows)), strict=True):
        table = runs.unstack("seed").reindex(bins)
        yield Series(scenario, tracker, quantity, time, *mean_over_seeds(table.to_numpy(float)))
    pairs = rows[rows["status"] == "pair"]
    none = np.full(len(bins), np.nan)
    for quantity in DRAWN:
        mean = pairs.groupby("bin")[quantity].mean().reindex(bins).to_numpy(float)
        objects = pairs.groupby(["bin", "time"])[quantity].count().groupby("bin").mean()
        yield Series(scenario, tracker, quantity, time, mean, none, none, objects.reindex(bins).to_numpy(float))


def _bins(time: NDArray) -> NDArray:
    """Bins (rows,), each holding its end, so that the last frame of a run is not alone in one; the first holds zero."""
    return np.maximum(np.ceil(time / STEP - 1e-6).astype(int) - 1, 0)


def _gospa(rows: pd.DataFrame) -> pd.Series:
    """Mean GOSPA [m] of the frames in a bin, by bin and seed."""
    frames = rows.groupby(["bin", "seed", "time"])["gospa2"].sum() ** 0.5
    return frames.groupby(["bin", "seed"]).mean()


def _position(rows: pd.DataFrame) -> pd.Series:
    """Position RMSE [m] of the objects with a track in a bin, by bin and seed."""
    pairs = rows[rows["status"] == "pair"]
    squares = (pairs["position"].astype(float) ** 2).groupby([pairs["bin"], pairs["seed"]]).mean()
    return squares**0.5


def mean_over_seeds(values: NDArray) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Mean, its 95 % interval by Student's t, and the count, each (B,); values (B, seeds), NaN where not measured.

    Fewer than three seeds have no interval.
    """
    count = np.isfinite(values).sum(-1)
    mean, half = student_interval(values)
    half = np.where(count >= FEWEST, half, np.nan)
    return mean, mean - half, mean + half, count


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
            frames = counts.loc[(tracker, label), "size"]
            row: dict[str, float | str] = {"tracker": tracker, "band": label, "frames": frames}
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
    columns = ["scenario", "tracker", "seed", "time", "phase", "status", *QUANTITIES, *SIZES]
    rows = results.rows(columns, after=results.study.settings.settle)
    rows = rows[rows["status"] == "pair"].copy()
    z = float(norm.ppf((1 + LEVEL) / 2))
    for side in ("length", "width"):
        rows[f"{side}_covered"] = (rows[side].abs() <= z * rows[f"{side}_std"]).astype(float)
    values = [*QUANTITIES, "length_covered", "width_covered"]
    runs = rows.groupby(["tracker", "phase", "scenario", "seed"], observed=True)[values].mean()
    by_time = rows.groupby(["tracker", "phase", "scenario", "time"], observed=True)
    instants = by_time[list(QUANTITIES)].agg(["mean", "count"])
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
