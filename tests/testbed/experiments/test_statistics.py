"""Paired differences of trackers, their verdicts, and how many seeds it takes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbed.evaluation.intervals import FEWEST, Interval, bootstrap_interval
from testbed.experiments.statistics import compare, needed

numbers = st.floats(-100, 100).map(lambda x: round(x, 3))
groups = st.lists(st.lists(numbers, min_size=FEWEST, max_size=8).map(np.array), min_size=1, max_size=3)


@given(groups, st.randoms(use_true_random=False))
def test_the_order_of_the_seeds_changes_nothing(sample, random):
    seeds = min(map(len, sample))
    sample = [group[:seeds] for group in sample]
    order = random.sample(range(seeds), seeds)
    other = [group[::-1] ** 2 / 50 for group in sample]
    mixed = [[group[order] for group in values] for values in (sample, other)]
    assert bootstrap_interval(sample) == bootstrap_interval(mixed[0])
    assert compare(sample, other) == compare(*mixed)


@given(groups)
def test_a_tracker_compared_with_itself_is_the_same(sample):
    found = compare(sample, sample)
    assert found.verdict == "the same"
    assert found.mean == found.iqm == Interval(0, 0, 0)
    assert found.improvement == Interval(0.5, 0.5, 0.5)
    assert found.pairs == sum(map(len, sample))
    assert found.needed == np.inf


@given(groups, groups)
def test_an_unresolved_difference_needs_more_seeds_than_there_are_and_a_resolved_one_no_more(a, b):
    a = [x[: min(map(len, (x, y)))] for x, y in zip(a, b, strict=False)]
    b = [y[: len(x)] for x, y in zip(a, b, strict=False)]
    found, seeds = compare(a, b), np.mean([len(group) for group in a])
    if found.verdict == "unresolved":
        assert found.needed > seeds
    elif found.verdict in ("better", "worse"):
        assert found.needed <= seeds + 1


def test_seeds_needed_by_hand():
    d = [np.zeros(10), np.zeros(10)]
    assert needed(d, Interval(1.0, -1.0, 2.5)) == 41  # 10 (2 / 1)^2 leave the end of the interval at zero
    assert needed(d, Interval(-1.0, -5.0, 0.5)) == 23  # 10 1.5^2 = 22.5
    assert needed(d, Interval(2.0, 1.0, 9.0)) == 3  # 10 (1 / 2)^2 = 2.5
    assert needed(d, Interval(0.0, -1.0, 1.0)) == np.inf
    assert np.isnan(needed(d, Interval(1.0, np.nan, np.nan)))
    assert needed(d, Interval(1.0, 1.0, 1.0)) == 10


@pytest.mark.parametrize(("shift", "verdict"), [(-1.0, "better"), (1.0, "worse"), (0.0, "unresolved")])
def test_verdicts_know_which_way_is_better(shift, verdict):
    rng = np.random.default_rng(5)
    reference = [rng.normal(10, 5, 20) for _ in range(2)]  # seeds differ far more than trackers do: pairing sees it
    tracker = [group + shift + rng.normal(0, 0.5, 20) for group in reference]
    assert compare(tracker, reference).verdict == verdict


def test_two_seeds_are_too_few_for_a_verdict():
    found = compare([np.array([1.0, 2.0])], [np.array([0.0, 0.0])])
    assert found.verdict == "too few seeds"
    assert found.mean.value == 1.5
    assert np.isnan([found.mean.low, found.mean.high, found.needed]).all()


def test_probability_of_improvement_by_hand():
    tracker = [np.array([1.0, 1.0, 5.0, 0.0]), np.array([2.0, 2.0, 2.0])]
    reference = [np.array([2.0, 1.0, 4.0, 3.0]), np.array([3.0, 3.0, 1.0])]
    # better, tied, worse, better: 2.5 of 4; better, better, worse: 2 of 3
    assert compare(tracker, reference).improvement.value == pytest.approx((2.5 / 4 + 2 / 3) / 2)


def test_a_pair_counts_only_where_both_were_measured():
    tracker = [np.array([1.0, np.nan, 3.0, 4.0, 5.0])]
    reference = [np.array([0.0, 0.0, np.nan, 0.0, 0.0])]
    found = compare(tracker, reference)
    assert found.pairs == 3
    assert found.mean.value == pytest.approx(10 / 3)
    assert compare([np.full(3, np.nan)], [np.zeros(3)]).verdict == "too few seeds"


def test_samples_of_different_seeds_are_refused():
    with pytest.raises(ValueError, match=r"same seeds, got \[3\] and \[4\]; drop the runs"):
        compare([np.zeros(3)], [np.zeros(4)])
