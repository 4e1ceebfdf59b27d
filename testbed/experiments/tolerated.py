"""What moved: new runs compared with the baselines of the same seeds, tracker by tracker and scenario by scenario.

All differences are new minus baseline on a scale on which less is better (`Metric.badness`). Two rules find a change
for the worse; mirrored, they find one for the better:

1. A tracker over all scenarios: the bootstrap interval of the mean change lies above the tolerance. Units are
   the scenarios, each with the mean over its seeds, as two seeds in each are too few to draw from.
2. A tracker in one scenario: the mean change exceeds the tolerance, and Student's limit from the spread between seeds
   within the other scenarios, taken in units of their tolerances as errors differ by scenario. So a fault in one
   scenario is found where nothing else moves, and where every run moves by chance nothing is.

A suite has some thousand differences. For all of them together to raise a false alarm in at most 2 % of suites,
each gets an equal share of these (Bonferroni), half of them for each rule; rule 1 has to pass such a limit of Student's
too, since its own interval, at 95 %, would be left by chance in some tracker and measure of almost every suite.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from testbed.evaluation.intervals import FEWEST, bootstrap_interval, student_limit
from testbed.experiments.statistics import badness, spread_of_others

Values = Mapping[tuple[str, str], Mapping[str, NDArray]]  # tracker, scenario -> measure -> (seeds), NaN: not measured

ALARMS = 0.02  # share of suites with a false alarm where nothing but chance moves the runs
FEWEST_DOF = 6  # of the spread in rule 2; with less, in a small part of the suite, the tolerance alone decides
OVERALL = "all scenarios"
WORSE, BETTER, SAME, GONE = "worse", "better", "the same", "not measured any more"


class Tolerance(NamedTuple):
    """How far a measure may move the wrong way, on a scale on which less is better, before it counts.

    `relative` times the baseline is added to each of the first two.
    """

    overall: float  # mean over all scenarios
    scenario: float  # mean over the seeds of one scenario
    relative: float


# What rounding may do: machines and versions of libraries differ in the last digits, and now and then such a digit
# decides which track gets a detection. With all ranges multiplied by 1 + 1e-9 N(0, 1), 157 of 160 runs (8 scenarios by
# 10 trackers by 2 seeds) moved by no more than 1e-6 in any measure. The other three, all in the roundabout, moved by up
# to .010 m GOSPA, .016 m position, .045 m/s velocity, .07 degrees heading and .039 m length RMSE, .25 % missed, 1.6 of
# a NEES of 69, and by no false track, lost track or switch. A mean over two seeds moves by half of that.
TOLERANCES = {
    "gospa": Tolerance(0.02, 0.02, 0.01),
    "missed_percent": Tolerance(0.2, 0.2, 0.01),
    "false_per_scan": Tolerance(0.02, 0.02, 0.01),
    "rmse_position": Tolerance(0.01, 0.02, 0.01),
    "rmse_velocity": Tolerance(0.02, 0.03, 0.01),
    "rmse_heading_deg": Tolerance(0.1, 0.1, 0.01),
    "rmse_length": Tolerance(0.02, 0.03, 0.01),
    "nees_position": Tolerance(0.2, 0.2, 0.02),
    "lost": Tolerance(0.1, 0.5, 0.05),  # in a scenario: one more in one of two runs is within chance
    "switches": Tolerance(0.1, 0.5, 0.05),
}


class Moved(NamedTuple):
    """One measure of one tracker in one scenario, or over all of them."""

    tracker: str
    scenario: str  # OVERALL for rule 1
    measure: str
    before: float  # mean of the baseline
    after: float
    change: float  # on a scale on which less is better
    limit: float  # what a change had to exceed
    verdict: str

    @property
    def size(self) -> float:
        """How many times its limit a change is; infinite where a measure is gone."""
        return np.inf if self.verdict == GONE else abs(self.change) / self.limit


class _Pairs(NamedTuple):
    """Runs that both have, of one tracker and measure."""

    scenarios: list[str]
    before: list[NDArray]  # (n_c,) for each scenario
    after: list[NDArray]

    def differences(self, measure: str) -> list[NDArray]:
        return [badness(measure, new) - badness(measure, old) for new, old in zip(self.after, self.before, strict=True)]


def tolerated(new: Values, baselines: Values) -> list[Moved]:
    """Every difference that can be taken, with its verdict; runs without a baseline are passed over."""
    keys = [key for key in new if key in baselines]
    trackers = list(dict.fromkeys(tracker for tracker, _ in keys))
    shares = [ALARMS / 2 / (count * len(TOLERANCES)) for count in (len(trackers), len(keys))] if keys else []
    changes: list[Moved] = []
    for tracker in trackers:
        for measure, tolerance in TOLERANCES.items():
            rows = [(c, baselines[t, c][measure], new[t, c][measure]) for t, c in keys if t == tracker]
            pairs = _pairs(rows)
            changes += _gone(tracker, measure, rows)
            changes += _overall(tracker, measure, pairs, tolerance, shares[0])
            changes += _by_scenario(tracker, measure, pairs, tolerance, shares[1])
    return changes


def _pairs(rows: Sequence[tuple[str, NDArray, NDArray]]) -> _Pairs:
    both = [(c, a, b, np.isfinite(a) & np.isfinite(b)) for c, a, b in rows]
    found = [(c, a[known], b[known]) for c, a, b, known in both if known.any()]
    return _Pairs([c for c, _, _ in found], [a for _, a, _ in found], [b for _, _, b in found])


def _gone(tracker: str, measure: str, rows: Sequence[tuple[str, NDArray, NDArray]]) -> Iterator[Moved]:
    """Runs in which something was measured before, and nothing is now."""
    for scenario, before, after in rows:
        gone = np.isfinite(before) & ~np.isfinite(after)
        if gone.any():
            was = float(before[gone].mean())
            yield Moved(tracker, scenario, measure, was, np.nan, np.nan, np.nan, GONE)


def _overall(tracker: str, measure: str, pairs: _Pairs, tolerance: Tolerance, share: float) -> Iterator[Moved]:
    """Rule 1; it needs three scenarios for an interval."""
    means = np.array([group.mean() for group in pairs.differences(measure)])
    if len(means) < FEWEST:
        return
    change = float(means.mean())
    allowed = tolerance.overall + tolerance.relative * _mean([badness(measure, group) for group in pairs.before])
    limit = max(allowed, float(student_limit(means.std(ddof=1), len(means) - 1, len(means), share)))
    if abs(change) > limit:  # else the interval, which is slow to compute, changes nothing
        found = bootstrap_interval([means])
        limit = max(limit, allowed + (change - found.low if change > 0 else found.high - change))
    before, after = _mean(pairs.before), _mean(pairs.after)
    yield Moved(tracker, OVERALL, measure, before, after, change, limit, _verdict(change, limit))


def _by_scenario(tracker: str, measure: str, pairs: _Pairs, tolerance: Tolerance, share: float) -> Iterator[Moved]:
    """Rule 2."""
    d = pairs.differences(measure)
    allowed = np.array([tolerance.scenario + tolerance.relative * badness(measure, g).mean() for g in pairs.before])
    spread, dof = spread_of_others([group / unit for group, unit in zip(d, allowed, strict=True)])
    chance = student_limit(spread, dof, np.array([len(group) for group in d]), share)
    limits = allowed * np.where(dof >= FEWEST_DOF, np.maximum(chance, 1.0), 1.0)
    for scenario, before, after, group, limit in zip(*pairs, d, limits.tolist(), strict=True):
        numbers = float(before.mean()), float(after.mean()), float(group.mean()), limit
        yield Moved(tracker, scenario, measure, *numbers, _verdict(numbers[2], limit))


def _verdict(change: float, limit: float) -> str:
    return SAME if abs(change) <= limit else WORSE if change > 0 else BETTER


def _mean(groups: Sequence[NDArray]) -> float:
    """Mean over scenarios of the means over seeds."""
    return float(np.mean([group.mean() for group in groups]))
