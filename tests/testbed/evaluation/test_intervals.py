"""Intervals that cover what they promise: bootstrap, Student's t, chi-square limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, chi2, t, trim_mean

from testbed.evaluation.intervals import (
    FEWEST,
    LEVEL,
    RESAMPLES,
    bootstrap_interval,
    chi2_limits,
    crossed_interval,
    expanded,
    interquartile_mean,
    mean_of_means,
    student_interval,
    student_limit,
)

RUNS = 200
numbers = st.floats(-100, 100).map(lambda x: round(x, 3))
groups = st.lists(st.lists(numbers, min_size=FEWEST, max_size=8).map(np.array), min_size=1, max_size=3)


def coverage(draw, truth, seed, interval=bootstrap_interval):
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


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_twenty_skewed_seeds_cover_a_little_less(sign):
    assert within(coverage(lambda rng: [sign * rng.exponential(size=20)], sign, seed=7), 0.92)


def test_seeds_counted_four_times_are_caught():
    assert coverage(lambda rng: [np.repeat(rng.normal(size=5), 4)], 0.0, seed=7) < 0.75


def common_seeds(share):
    """Six scenarios of ten seeds, of whose spread a share is that of the seed."""
    return lambda rng: list(np.sqrt(share) * rng.normal(size=10) + np.sqrt(1 - share) * rng.normal(size=(6, 10)))


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_intervals_of_seeds_that_scenarios_have_in_common_cover_what_they_promise(share):
    assert within(coverage(common_seeds(share), 0.0, 7, crossed_interval), LEVEL)


def test_intervals_that_take_common_seeds_for_independent_cover_less():
    assert coverage(common_seeds(0.3), 0.0, seed=7) < 0.85


def test_crossed_intervals_of_one_scenario_are_those_of_its_seeds():
    values = np.array([3.0, np.nan, 1.0, 4.0, 1.5])
    assert crossed_interval([values]) == bootstrap_interval([values])


@given(groups)
def test_a_crossed_interval_has_the_mean_of_the_scenarios_and_holds_it(sample):
    found = crossed_interval(sample)
    assert found.value == pytest.approx(np.mean([group.mean() for group in sample]), abs=1e-9)
    if np.isfinite(found.low):
        assert found.low - 1e-9 <= found.value <= found.high + 1e-9


def test_scenarios_with_fewer_seeds_than_an_interval_needs_have_none():
    for sample in ([[1.0], [5.0], [9.0]], [[1.0, 1.1, np.nan, np.nan], [np.nan, np.nan, 5.0, 5.1]]):
        found = crossed_interval([np.array(values) for values in sample])
        assert np.isnan([found.low, found.high]).all()
        assert np.isfinite(found.value)


def test_a_scenario_that_few_seeds_measured_stays_in_every_draw():
    rng = np.random.default_rng(1)
    few_seeds = np.where(np.arange(10) < 3, 100 + 0.01 * rng.normal(size=10), np.nan)
    found = crossed_interval([0.01 * rng.normal(size=10), few_seeds])
    assert found.high - found.low < 0.1


def test_a_seed_that_was_not_measured_in_a_scenario_counts_in_the_others():
    full = [np.arange(6.0), np.arange(6.0) ** 2]
    gap = [np.where(np.arange(6) == 2, np.nan, full[0]), full[1]]
    assert crossed_interval(gap).value == pytest.approx((13 / 5 + 55 / 6) / 2)
    assert crossed_interval([*full, np.full(6, np.nan)]) == crossed_interval(full)


def test_scenarios_that_differ_do_not_widen_the_interval():
    noise = np.random.default_rng(3).normal(size=(2, 20))
    together = bootstrap_interval([noise[0], noise[1]])
    apart = bootstrap_interval([noise[0], 1000 + noise[1]])
    assert close(np.array(apart) - 500, together)


def test_the_level_asked_of_a_bootstrap_falls_to_the_nominal_one_with_many_seeds():
    assert expanded([5]) > expanded([20]) > expanded([5000])
    assert expanded([10**6]) == pytest.approx(LEVEL, abs=1e-5)
    assert expanded([5] * 20) < expanded([5])  # scenarios share the doubt about the spread
    assert expanded([5]) == pytest.approx(0.99809, abs=1e-4)  # 2 Phi(2.7764 sqrt(5 / 4)) - 1


@given(groups)
def test_an_interval_holds_its_estimate_and_lies_within_the_values(sample):
    found = bootstrap_interval(sample)
    assert found.low <= found.value + 1e-9
    assert found.value <= found.high + 1e-9
    low, high = (np.mean([end(group) for group in sample]) for end in (np.min, np.max))
    assert low - 1e-9 <= found.low
    assert found.high <= high + 1e-9


drawn = (st.integers(0, 10**6), st.integers(1, 3), st.floats(-50, 50), st.booleans())


def twenty_seeds(seed, scenarios):
    """Normal values without ties: a resample with the very mean of the sample would count by its rounding."""
    return list(np.random.default_rng(seed).normal(size=(scenarios, 20)))


@given(*drawn, st.floats(1e-6, 4))
def test_intervals_move_and_stretch_with_the_values(seed, scenarios, shift, middle, scale):
    sample = twenty_seeds(seed, scenarios)
    statistic = interquartile_mean if middle else mean_of_means
    plain = np.array(bootstrap_interval(sample, statistic))
    assert close(bootstrap_interval([scale * group + shift for group in sample], statistic), scale * plain + shift)


@given(*drawn)
def test_intervals_are_mirrored_with_the_values(seed, scenarios, shift, middle):
    """In distribution only: values are sorted before they are drawn, so a mirrored sample has other resamples.

    Its ends are quantiles of RESAMPLES draws. The share of the true distribution, here of ten times as many draws, that
    lies outside of them is therefore what a binomial count gives.
    """
    scenarios = scenarios if middle else max(scenarios, 2)  # the mean of one is bias-corrected: see coverage above
    sample = twenty_seeds(seed, scenarios)
    statistic = interquartile_mean if middle else mean_of_means
    found = bootstrap_interval([shift - group for group in sample], statistic)
    assert found.value == pytest.approx(shift - statistic(*sample), rel=1e-9, abs=1e-9)
    rng = np.random.default_rng(seed + 1)
    means = np.sort(statistic(*(rng.choice(group, (10 * RESAMPLES, 20)) for group in sample)))
    outside = [(means > shift - found.low).mean(), (means < shift - found.high).mean()]
    fewest, most = binom.ppf([1e-7, 1 - 1e-7], RESAMPLES, (1 - expanded([20] * scenarios)) / 2) / RESAMPLES
    assert fewest <= min(outside) <= max(outside) <= most


@given(st.lists(st.lists(numbers, min_size=1, max_size=9), min_size=1, max_size=4))
def test_the_interquartile_mean_is_that_of_the_middle_half_of_all_runs(lists):
    values = sorted(x for group in lists for x in group)
    cut = len(values) // 4
    middle = values[cut : len(values) - cut]
    found = interquartile_mean(*(np.array(group) for group in lists))
    assert float(found) == pytest.approx(sum(middle) / len(middle), rel=1e-9, abs=1e-9)


@given(st.lists(numbers, min_size=4, max_size=12), st.lists(st.booleans(), min_size=12, max_size=12))
def test_the_interquartile_mean_leaves_out_what_was_not_measured(values, missing):
    seen = np.array([np.nan if gone else x for x, gone in zip(values, missing, strict=False)])
    known = seen[np.isfinite(seen)]
    if len(known):
        assert interquartile_mean(seen) == pytest.approx(trim_mean(known, 0.25), abs=1e-9)


def test_one_wild_run_hardly_moves_the_interquartile_mean():
    calm = [np.arange(10.0), np.arange(10.0)]
    wild = [np.where(np.arange(10) == 9, 1e6, np.arange(10.0)), np.arange(10.0)]
    assert bootstrap_interval(wild, interquartile_mean).value == bootstrap_interval(calm, interquartile_mean).value
    assert bootstrap_interval(wild).value > 1e4


def test_what_was_not_measured_is_left_out():
    nan = np.nan
    gaps = [np.array([1.0, nan, 3.0, 2.0]), np.full(4, nan), np.array([nan, 6.0, 4.0, 5.0])]
    assert bootstrap_interval(gaps) == bootstrap_interval([np.array([1.0, 3.0, 2.0]), np.array([6.0, 4.0, 5.0])])
    assert bootstrap_interval(gaps).value == 3.5
    assert np.isnan(bootstrap_interval([np.full(5, nan)])).all()
    assert np.isnan(bootstrap_interval([])).all()


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


def studies_covered(half_width, seed):
    """Share of 20000 studies of 12 normal runs whose interval mean +- half_width(runs (S, 12)) holds the truth."""
    runs = np.random.default_rng(seed).normal(3.0, 2.0, (20000, 12))
    return np.mean(np.abs(runs.mean(-1) - 3.0) <= half_width(runs))


def is_share_of_studies(share, level):
    """Is a share of 20000 studies what a probability gives, in 999 of 1000 cases?"""
    low, high = binom.ppf([0.0005, 0.9995], 20000, level) / 20000
    return low <= share <= high


def test_students_interval_of_twelve_runs_covers_what_it_promises():
    assert is_share_of_studies(studies_covered(lambda runs: student_interval(runs)[1], seed=11), LEVEL)


def test_twelve_runs_with_the_quantile_of_many_are_caught():
    covered = studies_covered(lambda runs: 1.96 * runs.std(-1, ddof=1) / np.sqrt(12), seed=11)
    assert not is_share_of_studies(covered, LEVEL)
    assert is_share_of_studies(covered, 2 * t.cdf(1.96, 11) - 1)  # .924


def test_students_limit_is_that_of_the_table():
    assert student_limit(2.0, 10, 4) == pytest.approx(2.228, abs=1e-3)
    assert student_limit(1.0, np.array([5, 20]), tail=0.005) == pytest.approx([4.032, 2.845], abs=1e-3)


def test_students_interval_by_hand():
    mean, half = student_interval(np.array([[1.0, 3.0, np.nan], [np.nan, 4.0, np.nan], [np.nan, np.nan, np.nan]]))
    np.testing.assert_allclose(mean, [2.0, 4.0, np.nan])
    np.testing.assert_allclose(half, [12.706, np.nan, np.nan], atol=1e-3)  # t = 12.706, spread sqrt(2) / sqrt(2)
    assert [float(x) for x in student_interval([2.0, 2.0])] == [2.0, 0.0]


def test_a_ratio_of_two_columns_is_drawn_by_the_indices_of_its_units():
    rng = np.random.default_rng(3)
    noise = rng.normal(0, 0.3, 20)  # of both columns: only pairs that stay together cancel it
    before, after = 2 * np.exp(noise), np.exp(noise + rng.normal(0, 0.01, 20))

    def ratio(unit, axis=-1):
        return before[unit.astype(int)].mean(axis) / after[unit.astype(int)].mean(axis)

    found = bootstrap_interval([np.arange(20)], ratio)
    assert 1.98 < found.low < 2.0 < found.high < 2.02
