"""Errors by range, by visible share, by phase and over time, from the rows of all runs."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from testbed.evaluation.intervals import FEWEST, student_interval
from testbed.experiments.store import Results

STEP = 0.5  # [s] frames that are averaged together
MOST_SHOWN = 6  # trackers in a figure over time or by band
COLUMNS = ("tracker", "seed", "time", "phase", "status", "gospa2", "position", "nees_position", "nis")
SHADED = ("onset", "during")
ERRORS = ("gospa", "position")
QUANTITIES = ("nees_position", "nis")


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
    names, baseline = results.study.trackers, results.study.baseline
    runs = results.runs
    gospa = runs.groupby(["tracker", "scenario"])["gospa"].mean().groupby("tracker").mean() if len(runs) else {}
    order = sorted(names, key=lambda name: (name != baseline, _last(gospa.get(name)), names.index(name)))
    return list(order)


def _last(value: float | None) -> float:
    return np.inf if value is None or np.isnan(value) else value


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
    for quantity in QUANTITIES:
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
