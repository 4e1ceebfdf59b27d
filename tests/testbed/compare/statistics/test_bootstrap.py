"""Intervals that cover, paired differences, and how many seeds it takes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom, chi2

from testbed.compare.statistics.bootstrap import (
    FEWEST,
    LEVEL,
    Interval,
    chi2_limits,
    compare,
    expanded,
    interquartile_mean,
    interval,
    mean_of_means,
    needed,
)

RUNS = 200
numbers = st.floats(-100, 100).map(lambda x: round(x, 3))
groups = st.lists(st.lists(numbers, min_size=FEWEST, max_size=8).map(np.array), min_size=1, max_size=3)
few = settings(max_examples=25, deadline=None)


def coverage(draw, truth, seed):
    """Share of the intervals of draw(rng) that hold the truth."""
    rng = np.random.default_rng(seed)
    return np.mean([truth in interval(draw(rng)) for _ in range(RUNS)])


def within(share, level):
    """Is a share of RUNS what a probability gives, in 999 of 1000 cases?"""
    low, high = binom.ppf([0.0005, 0.9995], RUNS, level) / RUNS
    return low <= share <= high


def close(a, b):
    return np.allclose(a, b, rtol=1e-9, atol=1e-9, equal_nan=True)


@pytest.mark.parametrize(
    ("draw", "truth"),
    [
        (lambda rng: [rng.normal(size=20)], 0.0),
        (lambda rng: [rng.normal(size=5)], 0.0),
        (lambda rng: [k + rng.normal(size=20) for k in range(4)], 1.5),
        (lambda rng: [rng.normal(3, 0.1, 5), rng.normal(1, 2, 5), rng.normal(0, 1, 5)], 4 / 3),
    ],
)
def test_intervals_of_independent_seeds_cover_what_they_promise(draw, truth):
    assert within(coverage(draw, truth, seed=7), LEVEL)


def test_twenty_skewed_seeds_cover_a_little_less():
    assert within(coverage(lambda rng: [rng.exponential(size=20)], 1.0, seed=7), 0.92)


def test_seeds_counted_four_times_are_caught():
    assert coverage(lambda rng: [np.repeat(rng.normal(size=5), 4)], 0.0, seed=7) < 0.75


def test_scenarios_that_differ_do_not_widen_the_interval():
    noise = np.random.default_rng(3).normal(size=(2, 20))
    together = interval([noise[0], noise[1]])
    apart = interval([noise[0], 1000 + noise[1]])
    assert close(np.array(apart) - 500, together)


def test_the_level_asked_of_a_bootstrap_falls_to_the_nominal_one_with_many_seeds():
    assert expanded([5]) > expanded([20]) > expanded([5000])
    assert expanded([10**6]) == pytest.approx(LEVEL, abs=1e-5)
    assert expanded([5] * 20) < expanded([5])  # scenarios share the doubt about the spread
    assert expanded([5]) == pytest.approx(0.99809, abs=1e-4)  # 2 Phi(2.7764 sqrt(5 / 4)) - 1


@few
@given(groups)
def test_an_interval_holds_its_estimate_and_lies_within_the_values(sample):
    found = interval(sample)
    assert found.low <= found.value + 1e-9
    assert found.value <= found.high + 1e-9
    low, high = (np.mean([end(group) for group in sample]) for end in (np.min, np.max))
    assert low - 1e-9 <= found.low
    assert found.high <= high + 1e-9


@few
@given(st.integers(0, 10**6), st.integers(1, 3), st.floats(-4, 4), st.floats(-50, 50), st.booleans())
def test_intervals_move_and_stretch_with_the_values(seed, scenarios, scale, shift, middle):
    # twenty seeds without ties: a resample with the very mean of the sample would count by its rounding
    sample = list(np.random.default_rng(seed).normal(size=(scenarios, 20)))
    statistic = interquartile_mean if middle else mean_of_means
    plain = np.array(interval(sample, statistic))
    moved = np.array(interval([scale * group + shift for group in sample], statistic))
    if scale < -1e-6:  # sorted values are mirrored, their resamples only in distribution
        assert moved[0] == pytest.approx(scale * plain[0] + shift, rel=1e-9, abs=1e-9)
        assert moved[[2, 1]] == pytest.approx(scale * plain[1:] + shift, abs=0.05 * abs(scale))
    elif scale > 1e-6:
        assert close(moved, scale * plain + shift)


@few
@given(groups, st.randoms(use_true_random=False))
def test_the_order_of_the_seeds_changes_nothing(sample, random):
    order = [random.sample(range(len(group)), len(group)) for group in sample]
    other = [group[::-1] ** 2 / 50 for group in sample]
    mixed = [[group[k] for group, k in zip(values, order, strict=True)] for values in (sample, other)]
    assert interval(sample) == interval(mixed[0])
    assert compare(sample, other) == compare(*mixed)


@few
@given(groups)
def test_a_tracker_compared_with_itself_is_the_same(sample):
    found = compare(sample, sample)
    assert found.verdict == "the same"
    assert found.mean == found.iqm == Interval(0, 0, 0)
    assert found.improvement == Interval(0.5, 0.5, 0.5)
    assert found.pairs == sum(map(len, sample))
    assert found.needed == np.inf


@few
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


@few
@given(st.lists(st.lists(numbers, min_size=1, max_size=9), min_size=1, max_size=4))
def test_the_interquartile_mean_is_that_of_the_middle_half_of_all_runs(lists):
    values = sorted(x for group in lists for x in group)
    cut = len(values) // 4
    middle = values[cut : len(values) - cut]
    found = interquartile_mean(*(np.array(group) for group in lists))
    assert float(found) == pytest.approx(sum(middle) / len(middle), rel=1e-9, abs=1e-9)


def test_one_wild_run_hardly_moves_the_interquartile_mean():
    calm = [np.arange(10.0), np.arange(10.0)]
    wild = [np.where(np.arange(10) == 9, 1e6, np.arange(10.0)), np.arange(10.0)]
    assert interval(wild, interquartile_mean).value == interval(calm, interquartile_mean).value
    assert interval(wild).value > 1e4


def test_what_was_not_measured_is_left_out():
    nan = np.nan
    gaps = [np.array([1.0, nan, 3.0, 2.0]), np.full(4, nan), np.array([nan, 6.0, 4.0, 5.0])]
    assert interval(gaps) == interval([np.array([1.0, 3.0, 2.0]), np.array([6.0, 4.0, 5.0])])
    assert interval(gaps).value == 3.5
    assert np.isnan(interval([np.full(5, nan)])).all()
    assert np.isnan(interval([])).all()


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


def test_chi_square_limits_hold_the_mean_of_that_many_values():
    count = np.array([0, 1, 7, 400])
    low, high = chi2_limits(2, count)
    for k in (1, 2, 3):
        assert low[k] * count[k] == pytest.approx(chi2.ppf(0.025, 2 * count[k]))
        assert high[k] * count[k] == pytest.approx(chi2.ppf(0.975, 2 * count[k]))
    assert np.isnan([low[0], high[0]]).all()
    assert low[1] == pytest.approx(-2 * np.log(0.975))  # two degrees of freedom are an exponential of mean 2
    mean = np.random.default_rng(1).chisquare(2, (RUNS, 7)).mean(1)
    assert within(np.mean((low[2] < mean) & (mean < high[2])), LEVEL)
