"""What the runs of a study say: paired differences on the same seeds, intervals, and what the seeds can resolve.

A sample is a list of arrays, one a scenario, of one value a seed; see `testbed.evaluation.intervals`.
"""

from collections.abc import Iterator, Mapping, Sequence
from math import factorial
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from testbed.environment.sources.substitution import GROUPS
from testbed.evaluation.intervals import Interval, Strata, crossed_interval, interquartile_mean, measured
from testbed.evaluation.metric import METRICS
from testbed.experiments.store import Results
from testbed.experiments.study import WHOLE_RUN

MAIN = ("gospa", "missed_percent", "false_per_scan", "rmse_position", "rmse_velocity", "rmse_length", "nees_position")
DRIVE = (  # of the ego, in closed loop
    "collisions", "drive_value", "progress", "drac_max", "tit", "deceleration_max", "jerk",
)  # fmt: skip
PHASES = ("before", "onset", "during", "after")


class Change(NamedTuple):
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


def compare(tracker: Strata, reference: Strata) -> Change:
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
    return Change(mean, iqm, improvement, sum(map(len, both)), needed(both, mean))


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


class Cell(NamedTuple):
    """One tracker by one measure, over some runs."""

    group: str  # scenario or phase, "all" for everything
    tracker: str
    measure: str
    mean: Interval
    difference: Change | None  # to the reference, None for the reference itself


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
    comparison = results.study
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
        bad = [[badness(measure, values) for values in found[name]] for name in (tracker, baseline)]
        difference = compare(*bad)
        if not difference.pairs and np.isnan(np.concatenate(found[tracker])).all():
            difference = None  # it was never measured, as NEES of tracks without covariances
    return Cell(group, tracker, measure, crossed_interval(found[tracker]), difference)


def badness(measure: str, values: NDArray) -> NDArray:
    """Values (N,) of a measure on a scale on which less is better."""
    return np.array([METRICS[measure].badness(v) for v in values.tolist()])


def pairwise(results: Results, measure: str) -> pd.DataFrame:
    """Probability that the tracker of the row is better than that of the column in a run; NaN on the diagonal."""
    comparison = results.study
    found = samples(results.runs, measure, comparison.scenarios, comparison.seeds)
    names = [t for t in comparison.trackers if t in found]
    bad = {t: np.array([badness(measure, v) for v in found[t]]) for t in names}
    table = pd.DataFrame(np.nan, index=names, columns=names)
    for row in names:
        for column in names:
            d = (bad[row] - bad[column]).ravel()
            d = d[np.isfinite(d)]
            if row != column and len(d):
                table.loc[row, column] = np.mean((d < 0) + 0.5 * (d == 0))
    return table


def pooled_spread(groups: Sequence[NDArray]) -> tuple[float, int]:
    """Standard deviation within groups (n_c,), pooled over them, and its degrees of freedom; NaN for none of these.

    >>> pooled_spread([np.array([1.0, 3.0]), np.array([0.0, 0.0])])
    (1.0, 2)
    """
    squares, dof = _sums(groups)
    return float(_spread(squares.sum(), dof.sum())), int(dof.sum())


def spread_of_others(groups: Sequence[NDArray]) -> tuple[NDArray, NDArray]:
    """The same for each group (C,) over all groups but itself, with the degrees of freedom (C,)."""
    squares, dof = _sums(groups)
    others = np.array([squares[np.arange(len(squares)) != k].sum() for k in range(len(squares))])
    return _spread(others, dof.sum() - dof), dof.sum() - dof


def _sums(groups: Sequence[NDArray]) -> tuple[NDArray, NDArray]:
    """Sums of squares (C,) about the means of the groups, and their degrees of freedom (C,)."""
    known = [group for group in groups if len(group)]
    squares = [float(((group - group.mean()) ** 2).sum()) for group in known]
    return np.array(squares), np.array([len(group) - 1 for group in known], int)


def _spread(squares: NDArray, dof: NDArray) -> NDArray:
    return np.sqrt(squares / np.where(dof > 0, dof, np.nan))


def shapley(values: Mapping[str, NDArray]) -> dict[str, NDArray]:
    """Exact Shapley values: share (...) of each group in values["EGV"] - values[""], docs/methods/regret.md, 5.

    values: an array (...) for each of the eight subsets of the groups, as named by `substitution.subsets`.

    >>> shapley({s: np.array(float(len(s))) for s in ("", "E", "G", "V", "EG", "EV", "GV", "EGV")})["E"].item()
    1.0
    """
    n = len(GROUPS)
    shares = {}
    for group in GROUPS:
        share = np.zeros_like(np.asarray(values[""], float))
        for subset, value in values.items():
            if group not in subset:
                weight = factorial(len(subset)) * factorial(n - len(subset) - 1) / factorial(n)
                with_it = "".join(g for g in GROUPS if g in subset + group)
                share = share + weight * (np.asarray(values[with_it]) - np.asarray(value))  # (RGT.8)
        shares[group] = share
    return shares
