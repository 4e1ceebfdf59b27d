"""Statistics of runs on common random numbers: intervals, paired differences, and what the seeds can resolve.

Scenarios are fixed, seeds are drawn: every average is the mean over scenarios of what the seeds gave in each, and the
bootstrap draws seeds within scenarios (Agarwal et al. (2021), "Deep Reinforcement Learning at the Edge of the
Statistical Precipice", section 4). A sample is therefore a list of arrays, one a scenario.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import bootstrap, chi2, norm, t, trim_mean

LEVEL = 0.95
RESAMPLES = 2000
SEED = 20261121  # of the resampling: the same results give the same intervals
FEWEST = 3  # seeds in a scenario; an interval from fewer would be fiction

Sample = Sequence[NDArray]  # (n_c,) for each scenario c
Statistic = Callable[..., NDArray]


class Interval(NamedTuple):
    """An estimate with its 95 % interval, NaN where there is none."""

    value: float
    low: float
    high: float

    def __contains__(self, x: object) -> bool:
        return isinstance(x, int | float) and self.low <= x <= self.high


NO_INTERVAL = Interval(np.nan, np.nan, np.nan)


class Difference(NamedTuple):
    """A tracker minus the reference, on the same seeds, on a scale on which less is better."""

    mean: Interval
    iqm: Interval  # interquartile mean
    improvement: Interval  # probability that the tracker is better in a run, ties counting half
    pairs: int  # runs that both have
    needed: float  # seeds a scenario that would resolve a difference of this size, inf for none at all

    @property
    def verdict(self) -> str:
        """Better, worse, or what the seeds cannot tell."""
        if np.isnan(self.mean.low):
            return "too few seeds"
        if self.mean.low == self.mean.high == 0:
            return "the same"
        return "better" if self.mean.high < 0 else "worse" if self.mean.low > 0 else "unresolved"


def mean_of_means(*groups: NDArray, axis: int = -1) -> NDArray:
    """Mean over scenarios of the means over seeds."""
    return np.mean([np.mean(group, axis=axis) for group in groups], axis=0)


def interquartile_mean(*groups: NDArray, axis: int = -1) -> NDArray:
    """Mean of the middle half of all runs, Agarwal et al. (2021)."""
    joined = np.concatenate([np.moveaxis(group, axis, -1) for group in groups], -1)
    return trim_mean(joined, 0.25, axis=-1)


def interval(sample: Sample, statistic: Statistic = mean_of_means) -> Interval:
    """Estimate and 95 % bootstrap interval; bias-corrected (BCa) for one scenario, percentiles for several.

    The bootstrap takes the spread of few seeds for too small: it is asked for a higher level, see `expanded`.

    >>> interval([np.array([1.0, 1.0, 1.0])])
    Interval(value=1.0, low=1.0, high=1.0)
    """
    sample = _known(sample)
    if not sample:
        return NO_INTERVAL
    value = float(statistic(*sample))
    if min(map(len, sample)) < FEWEST:
        return Interval(value, np.nan, np.nan)
    if all(np.ptp(group) == 0 for group in sample):
        return Interval(value, value, value)
    one = len(sample) == 1
    found = bootstrap(
        tuple(sample),
        statistic,
        n_resamples=RESAMPLES,
        confidence_level=expanded([len(group) for group in sample]),
        method="BCa" if one and statistic is mean_of_means else "percentile",
        vectorized=True,
        rng=np.random.default_rng(SEED),
    ).confidence_interval
    return Interval(value, float(found.low), float(found.high))


def expanded(seeds: Sequence[int]) -> float:
    """Level at which a percentile interval from so many seeds in each scenario covers 95 %.

    Expanded percentile interval of Hesterberg (2015), "What Teachers Should Know About the Bootstrap": the normal
    quantile that belongs to the level is that of Student's t, times the root of n / (n - 1).
    """
    quantile = t.ppf((1 + LEVEL) / 2, sum(seeds) - len(seeds)) * np.sqrt(np.mean([n / (n - 1) for n in seeds]))
    return float(2 * norm.cdf(quantile) - 1)


def compare(tracker: Sample, reference: Sample) -> Difference:
    """Paired comparison of two trackers; arrays hold the same seeds in the same order, NaN where nothing was measured.

    Both on a scale on which less is better, see `measures.badness`.
    """
    if [len(a) for a in tracker] != [len(b) for b in reference]:
        raise ValueError(
            "tracker and reference must hold the same seeds, got "
            f"{[len(a) for a in tracker]} and {[len(b) for b in reference]}; drop the runs that one of them lacks"
        )
    d = _known([a - b for a, b in zip(tracker, reference, strict=True)])
    mean = interval(d)
    better = [(group < 0) + 0.5 * (group == 0) for group in d]
    return Difference(mean, interval(d, interquartile_mean), interval(better), sum(map(len, d)), needed(d, mean))


def needed(d: Sample, mean: Interval) -> float:
    """Seeds a scenario with which the interval of a difference like this one would just leave out zero.

    The distance from the mean to the end of its interval shrinks with the root of the number of seeds.
    """
    if not d or np.isnan(mean.low):
        return np.nan
    if mean.low == mean.high:
        return float(min(map(len, d))) if mean.value else np.inf
    reach = mean.value - mean.low if mean.value > 0 else mean.high - mean.value  # towards zero
    seeds = np.mean([len(group) for group in d])
    return float(np.floor(seeds * (reach / mean.value) ** 2) + 1) if mean.value else np.inf


def chi2_limits(dof: int, count: NDArray) -> tuple[NDArray, NDArray]:
    """Limits (...) that the mean of `count` (...) independent chi-square values keeps with 95 %; NaN for count 0."""
    count = np.asarray(count, float)
    some = np.where(count > 0, count, np.nan)
    low, high = (chi2.ppf(q, dof * some) / some for q in ((1 - LEVEL) / 2, (1 + LEVEL) / 2))
    return low, high


def _known(sample: Sample) -> list[NDArray]:
    """What was measured, whatever the order of the seeds.

    Scenarios in which fewer than `FEWEST` seeds measured it are left out where others have more.
    """
    finite = [np.sort(np.asarray(group, float)[np.isfinite(group)]) for group in sample]
    enough = [group for group in finite if len(group) >= FEWEST]
    return enough or [group for group in finite if len(group)]
