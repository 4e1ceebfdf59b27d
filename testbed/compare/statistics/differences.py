"""Paired differences of trackers on common random numbers, and what the seeds can resolve.

A sample is a list of arrays, one a scenario, of one value a seed; see `testbed.evaluation.intervals`.
"""

from typing import NamedTuple

import numpy as np

from testbed.evaluation.intervals import Interval, Strata, crossed_interval, interquartile_mean, measured


class PairedDifference(NamedTuple):
    """A tracker minus the reference, on the same seeds, on a scale on which less is better."""

    mean: Interval
    iqm: Interval  # interquartile mean
    improvement: Interval  # probability that the tracker is better in a run, ties counting half
    pairs: int  # runs that both have
    needed: float  # seeds a scenario that would resolve a difference of this size, inf for none at all

    @property
    def verdict(self) -> str:
        """Better, worse, or what the seeds cannot resolve."""
        if np.isnan(self.mean.low):
            return "too few seeds"
        if self.mean.low == self.mean.high == 0:
            return "the same"
        return "better" if self.mean.high < 0 else "worse" if self.mean.low > 0 else "unresolved"


def compare(tracker: Strata, reference: Strata) -> PairedDifference:
    """Paired comparison of two trackers; arrays hold the same seeds in the same order, NaN where nothing was measured.

    Both on a scale on which less is better, see `Metric.badness`.
    """
    if [len(a) for a in tracker] != [len(b) for b in reference]:
        raise ValueError(
            "tracker and reference must hold the same seeds, got "
            f"{[len(a) for a in tracker]} and {[len(b) for b in reference]}; drop the runs that one of them lacks"
        )
    aligned = [a - b for a, b in zip(tracker, reference, strict=True)]
    mean = crossed_interval(aligned)
    better = [np.where(np.isfinite(d), (d < 0) + 0.5 * (d == 0), np.nan) for d in aligned]
    iqm, improvement = crossed_interval(aligned, interquartile_mean), crossed_interval(better)
    both = measured(aligned)
    return PairedDifference(mean, iqm, improvement, sum(map(len, both)), needed(both, mean))


def needed(d: Strata, mean: Interval) -> float:
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
