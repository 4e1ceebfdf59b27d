"""The page of speed: verdicts and tables from made figures, ratios from real but short work."""

from pathlib import Path

import numpy as np
import pytest

from testbed.bench import Pairs
from testbed.frame import TRUTH
from testbed.speed.goals import Goal, ratio, tracked_steps
from testbed.speed.page import render, table
from testbed.speed.shares import Costs, shares


def test_a_goal_is_met_at_its_figure_and_not_above():
    assert [Goal("a", "b", 1.0, found).met for found in (0.5, 1.0, 1.01)] == [True, True, False]


def test_the_ratio_is_the_median_of_the_pairs():
    assert ratio(Pairs(np.array([1.0, 2.0, 4.0]), np.array([2.0, 3.0, 40.0]))) == pytest.approx(2.0)


def test_the_page_says_what_was_found_and_whether_it_is_enough():
    goals = [Goal("step", "native", 1.0, 2.5), Goal("start", "numpy", 2.0, 1.25)]
    page = render(Path("docs"), goals, {"cut-in": {"radar": 0.25, "tracker": 0.75}}, [Costs(5, 1, 2, 3.25, 4)], "today")
    for line in (
        "| step | native | 2.50 | 1 | not met |",
        "| start | numpy | 1.25 | 2 | met |",
        "| cut-in | 25% | 75% |",
        "| 5 | 4 | 1.0 | 2.0 | 3.2 |",
        "EnvPool",
    ):
        assert line in page
    assert page.startswith("# Speed\n")


def test_a_table_has_a_rule_below_its_heads():
    assert table(["a", "b"], [["1", "2"]]) == "| a | b |\n| --- | --- |\n| 1 | 2 |"


def test_steps_are_timed_in_pairs():
    pairs = tracked_steps(2, TRUTH, 2)
    assert pairs.plain.shape == pairs.extra.shape == (2,)
    assert (pairs.plain > 0).all()


def test_the_shares_of_a_run_add_up_to_its_time(tmp_path):
    found = shares("xia2020-lane", 1, str(tmp_path))
    assert sum(found.values()) == pytest.approx(1.0)
    assert all(0 < share < 1 for share in found.values())
