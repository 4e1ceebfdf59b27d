"""The two rules, on numbers by hand and on suites of chance."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t as student

from testbed.experiments.statistics import pooled_spread, spread_of_others
from testbed.experiments.tolerated import BETTER, GONE, OVERALL, TOLERANCES, WORSE, Tolerance, tolerated
from tests.testbed.experiments import made_suites

BASE = made_suites.make(0)
KEY = "a", "scenario-3"


def found(new, verdict, base=BASE):
    return [c for c in tolerated(new, base) if c.verdict == verdict]


def test_the_pooled_spread_is_that_of_the_textbook():
    groups = [np.array([1.0, 3.0]), np.array([10.0, 10.0, 13.0])]
    assert pooled_spread(groups) == (pytest.approx(np.sqrt((2 + 6) / 3)), 3)
    spread, dof = spread_of_others(groups)
    np.testing.assert_allclose(spread, [np.sqrt(3), np.sqrt(2)])
    assert dof.tolist() == [2, 1]


def test_without_degrees_of_freedom_there_is_no_spread():
    spread, dof = pooled_spread([np.array([1.0]), np.array([])])
    assert np.isnan(spread)
    assert dof == 0


@pytest.mark.parametrize("size", [0.5, 5.0])
def test_jitter_of_any_size_alarms_in_less_than_five_per_cent_of_suites(size):
    """Whether smaller or far larger than the tolerances, where every run moves by chance nothing is told."""
    suites = [made_suites.make(k, trackers=("a",)) for k in range(200)]
    alarms = [bool(found(made_suites.shaken(base, k + 1000, size), WORSE, base)) for k, base in enumerate(suites)]
    assert np.mean(alarms) < 0.05


def test_the_same_results_are_the_same():
    assert not found(BASE, WORSE) + found(BASE, BETTER) + found(BASE, GONE)


@given(st.sampled_from(sorted(TOLERANCES)), st.sampled_from([made_suites.SCENARIOS[k] for k in (0, 7, 23)]))
def test_a_fault_in_one_scenario_is_found_where_nothing_else_moves(measure, scenario):
    before = BASE["b", scenario][measure]
    (change,) = found(made_suites.changed(BASE, ("b", scenario), measure, before + 2), WORSE)
    assert change[:3] == ("b", scenario, measure)
    assert change.change == pytest.approx(2)


def test_a_fault_that_only_one_seed_shows_is_found():
    new = made_suites.changed(BASE, KEY, "gospa", BASE[KEY]["gospa"] + [0.0, 1.0])
    assert [c[:3] for c in found(new, WORSE)] == [(*KEY, "gospa")]


def test_a_fault_that_three_scenarios_share_does_not_hide_itself():
    """Each is held against the spread between seeds, not against the changes of the others."""
    new = BASE
    for k in (1, 4, 9):
        key = "a", f"scenario-{k}"
        new = made_suites.changed(new, key, "gospa", BASE[key]["gospa"] + [1.0, 1.1])
    assert {c.scenario for c in found(new, WORSE)} == {"scenario-1", "scenario-4", "scenario-9"}


def test_a_fault_stands_out_of_jitter_but_jitter_of_its_size_hides_it():
    fault = 10 * np.ones(2) * TOLERANCES["gospa"].scenario
    for size, told in ((0.3, True), (10.0, False)):
        new = made_suites.shaken(BASE, 5, size)
        new = made_suites.changed(new, KEY, "gospa", new[KEY]["gospa"] + fault)
        assert bool([c for c in found(new, WORSE) if c.measure == "gospa"]) == told


def test_the_limit_in_a_scenario_follows_from_the_seeds_of_the_others_by_hand():
    """One other scenario of eight moves by +-1: pooled over 7 of them the variance is 2 / 7."""
    keys = [("a", f"scenario-{k}") for k in range(8)]
    base = {key: {m: np.full(2, 2.0 if m == "nees_position" else 0.0) for m in TOLERANCES} for key in keys}
    new = made_suites.changed(base, keys[1], "gospa", [1.0, -1.0])
    change = next(c for c in tolerated(new, base) if c[:3] == ("a", "scenario-0", "gospa"))
    share = 0.01 / (8 * len(TOLERANCES))
    assert change.limit == pytest.approx(student.isf(share, 7) * np.sqrt(2 / 7) / np.sqrt(2))


def test_a_small_loss_everywhere_is_found_over_all_scenarios_only():
    """In each scenario it is within the tolerance of that, over all it is not."""
    new = BASE
    for c in made_suites.SCENARIOS:
        new = made_suites.changed(new, ("a", c), "lost", BASE["a", c]["lost"] + 0.4)
    assert [c[:3] for c in found(new, WORSE)] == [("a", OVERALL, "lost")]


def test_a_gain_is_no_loss():
    new = BASE
    for c in made_suites.SCENARIOS:
        new = made_suites.changed(new, ("a", c), "gospa", BASE["a", c]["gospa"] * 0.8)
    assert not found(new, WORSE)
    assert ("a", OVERALL, "gospa") in [c[:3] for c in found(new, BETTER)]


def test_for_a_consistency_measure_too_small_is_as_bad_as_too_large():
    even = {key: {**cell, "nees_position": np.full(2, 2.0)} for key, cell in BASE.items()}
    for value in (0.5, 3.5):
        (change,) = found(made_suites.changed(even, KEY, "nees_position", [value] * 2), WORSE, even)
        assert change.change == pytest.approx(1.5)


def test_a_measure_that_is_gone_is_told_and_one_that_is_new_is_not():
    nothing = [1.0, np.nan]
    (change,) = found(made_suites.changed(BASE, KEY, "rmse_length", nothing), GONE)
    assert change[:3] == (*KEY, "rmse_length")
    assert change.before == BASE[KEY]["rmse_length"][1]
    base = made_suites.changed(BASE, KEY, "rmse_length", nothing)
    new = made_suites.changed(BASE, KEY, "rmse_length", [1.0, 50.0])
    assert not found(new, WORSE, base) + found(new, GONE, base)


def test_of_two_scenarios_the_tolerance_alone_decides():
    small = {key: BASE[key] for key in (KEY, ("a", "scenario-4"))}
    new = made_suites.changed(small, KEY, "gospa", small[KEY]["gospa"] + [0.0, 0.3])
    assert [c[:3] for c in found(new, WORSE, small)] == [(*KEY, "gospa")]


def test_runs_without_a_baseline_are_passed_over():
    assert {c.tracker for c in tolerated(made_suites.make(0, ("a", "new")), BASE)} == {"a"}
    assert tolerated(made_suites.make(0, ("new",)), BASE) == []


@given(st.permutations(list(BASE)))
def test_the_order_of_runs_does_not_matter(order):
    new = made_suites.shaken(BASE, 3, 3.0)
    expected = {c[:3]: c for c in tolerated(new, BASE)}
    for change in tolerated({key: new[key] for key in order}, BASE):
        np.testing.assert_allclose(change[3:7], expected[change[:3]][3:7], rtol=1e-9, atol=1e-12)


def test_the_documented_tolerances_are_those_in_use():
    text = (Path(__file__).parents[3] / "docs" / "regression.md").read_text()
    documented = {}
    for names, *numbers in re.findall(r"^\| (`\w+`.*?) \| ([\d.]+) \| ([\d.]+) \| (\d+) % \|$", text, re.M):
        overall, scenario, percent = map(float, numbers)
        documented |= {name: Tolerance(overall, scenario, percent / 100) for name in re.findall(r"`(\w+)`", names)}
    assert documented == TOLERANCES
