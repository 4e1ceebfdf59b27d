"""Intervals of means over independent units: the bootstrap, Student's t, and limits of chi-square means.

Units are what is drawn independently: seeds, Monte Carlo runs, or blocks of scans. A sample of the bootstrap is a list
of arrays, one a stratum (a scenario): strata are fixed, units are drawn within them, and the estimate is the mean over
strata of the means over units (Agarwal et al. (2021), "Deep Reinforcement Learning at the Edge of the Statistical
Precipice", section 4). Where the strata have their units in common, as scenarios have seeds, a unit is drawn for all of
them at once: one seed gives the vehicles of different scenarios the same sizes, and what these do to a tracker does not
average out over scenarios.
"""

import warnings
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import bootstrap, chi2, norm, t

LEVEL = 0.95
TAIL = (1 - LEVEL) / 2  # probability on either side of an interval
RESAMPLES = 2000
SEED = 20261121  # of the resampling: the same results give the same intervals
FEWEST = 3  # units in a stratum; a bootstrap interval from fewer means nothing

Strata = Sequence[NDArray]  # (n_c,) for each stratum c
Statistic = Callable[..., NDArray]


class Interval(NamedTuple):
    """An estimate with its 95 % interval, NaN where there is none."""

    value: float
    low: float
    high: float

    def __contains__(self, x: object) -> bool:
        return isinstance(x, int | float) and self.low <= x <= self.high


NO_INTERVAL = Interval(np.nan, np.nan, np.nan)


def mean_of_means(*strata: NDArray, axis: int = -1) -> NDArray:
    """Mean over strata of the means over units; NaN is not measured."""
    with warnings.catch_warnings(action="ignore", category=RuntimeWarning):  # a resample without a value of a stratum
        return np.nanmean([np.nanmean(stratum, axis=axis) for stratum in strata], axis=0)


def interquartile_mean(*strata: NDArray, axis: int = -1) -> NDArray:
    """Mean of the middle half of all units, Agarwal et al. (2021); NaN is not measured."""
    joined = np.sort(np.concatenate([np.moveaxis(stratum, axis, -1) for stratum in strata], -1))
    count = np.isfinite(joined).sum(-1, keepdims=True)
    cut, place = count // 4, np.arange(joined.shape[-1])
    return np.mean(joined, axis=-1, where=(cut <= place) & (place < count - cut))


def bootstrap_interval(sample: Strata, statistic: Statistic = mean_of_means) -> Interval:
    """Estimate and 95 % bootstrap interval; bias-corrected (BCa) for the mean of one stratum, else percentiles.

    The bootstrap takes the spread of few units for too small: it is asked for a higher level, see `expanded`. Values
    that are not finite are left out, and strata with fewer than `FEWEST` values where others have more. A statistic of
    several arrays on the same units takes their indices as the sample: `[np.arange(n)]`.

    >>> bootstrap_interval([np.array([1.0, 1.0, 1.0])])
    Interval(value=1.0, low=1.0, high=1.0)
    """
    sample = measured(sample)
    if not sample:
        return NO_INTERVAL
    value = float(statistic(*sample))
    if min(map(len, sample)) < FEWEST:
        return Interval(value, np.nan, np.nan)
    if all(np.ptp(stratum) == 0 for stratum in sample):
        return Interval(value, value, value)
    one = len(sample) == 1
    found = bootstrap(
        tuple(sample),
        statistic,
        n_resamples=RESAMPLES,
        confidence_level=expanded([len(stratum) for stratum in sample]),
        method="BCa" if one and statistic is mean_of_means else "percentile",
        vectorized=True,
        rng=np.random.default_rng(SEED),
    ).confidence_interval
    return Interval(value, float(found.low), float(found.high))


def crossed_interval(sample: Strata | NDArray, statistic: Statistic = mean_of_means) -> Interval:
    """Estimate and 95 % bootstrap interval of strata with common units: entry k of each is that of unit k.

    Units are drawn for all strata together; what they share widens the interval, what they do not share averages out.
    Values that are not finite count as not measured, and shorter strata as not measured at the end. One stratum alone
    has its `bootstrap_interval`.

    >>> crossed_interval([np.array([1.0, 3.0, 5.0]), np.array([5.0, 3.0, 1.0])])
    Interval(value=3.0, low=3.0, high=3.0)
    """
    most = max(map(len, sample), default=0)
    table = np.full((len(sample), most), np.nan)
    for row, stratum in zip(table, sample, strict=True):
        row[: len(stratum)] = np.where(np.isfinite(stratum), stratum, np.nan)
    enough = np.isfinite(table).sum(1) >= FEWEST
    if enough.sum() <= 1:
        return bootstrap_interval(list(table), statistic)
    table = table[enough]
    table = table[:, np.isfinite(table).any(0)]
    table = table[:, np.lexsort(table)]  # the order of the units has no influence on the draws
    centre = np.zeros((len(table), 1))
    if statistic is mean_of_means:  # a resample without a value of a stratum must not count its mean as drawn
        centre = np.nanmean(table, axis=1, keepdims=True)
    apart, shift = table - centre, float(centre.mean())

    def of_units(unit: NDArray, axis: int = -1) -> NDArray:
        return statistic(*apart[:, unit.astype(int)], axis=axis)

    found = bootstrap_interval([np.arange(table.shape[1])], of_units)
    return Interval(float(statistic(*table)), found.low + shift, found.high + shift)


def expanded(units: Sequence[int]) -> float:
    """Level at which a percentile interval from so many units in each stratum covers 95 %.

    Expanded percentile interval of Hesterberg (2015), "What Teachers Should Know About the Bootstrap": the normal
    quantile that belongs to the level is that of Student's t, times the root of n / (n - 1).
    """
    quantile = t.ppf((1 + LEVEL) / 2, sum(units) - len(units)) * np.sqrt(np.mean([n / (n - 1) for n in units]))
    return float(2 * norm.cdf(quantile) - 1)


def measured(sample: Strata) -> list[NDArray]:
    """The finite values in ascending order, so that the order of the units has no influence on the draws.

    Strata in which fewer than `FEWEST` units were measured are left out where others have more.
    """
    finite = [np.sort(np.asarray(stratum, float)[np.isfinite(stratum)]) for stratum in sample]
    enough = [stratum for stratum in finite if len(stratum) >= FEWEST]
    return enough or [stratum for stratum in finite if len(stratum)]


def student_limit(spread: ArrayLike, dof: ArrayLike, count: ArrayLike = 1, tail: ArrayLike = TAIL) -> NDArray:
    """What the mean of `count` values exceeds by chance with probability `tail`; all arguments broadcast to (...).

    spread: standard deviation of a value, estimated with `dof` degrees of freedom. NaN for dof 0. With the default tail
    it is half the width of a 95 % interval.
    """
    return t.isf(tail, dof) * np.asarray(spread) / np.sqrt(count)


def student_interval(values: ArrayLike) -> tuple[NDArray, NDArray]:
    """Mean (...) over units and half the width (...) of its 95 % interval by Student's t.

    values (..., n), NaN where a unit was not measured. The mean of none is NaN, and so is the width of fewer than two.
    """
    values = np.asarray(values, float)
    known = np.isfinite(values)
    count = known.sum(-1)
    mean = np.where(count > 0, np.where(known, values, 0.0).sum(-1) / np.maximum(count, 1), np.nan)
    squares = np.where(known, (values - mean[..., None]) ** 2, 0.0).sum(-1)
    dof = np.maximum(count - 1, 1)
    half = student_limit(np.sqrt(squares / dof), dof, np.maximum(count, 1))
    return mean, np.where(count > 1, half, np.nan)


def chi2_limits(dof: int, count: ArrayLike) -> tuple[NDArray, NDArray]:
    """Limits (...) that the mean of `count` (...) independent chi-square values keeps with 95 %; NaN for count 0."""
    count = np.asarray(count, float)
    some = np.where(count > 0, count, np.nan)
    low, high = (chi2.ppf(q, dof * some) / some for q in (TAIL, (1 + LEVEL) / 2))
    return low, high
