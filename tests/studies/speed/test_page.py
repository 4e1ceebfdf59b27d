"""The page of speed: verdicts and tables from made figures, ratios from real but short work."""

from pathlib import Path

import numpy as np
import pytest

from studies.speed import training
from studies.speed.goals import Goal, growing
from studies.speed.growth import Growth, exponent, growth, motorway
from studies.speed.page import render
from studies.speed.shares import Costs, shares
from studies.speed.training import Step
from testbed.bench import Pairs
from testbed.environment.wrapper import TrackedEnv
from testbed.frame import TRUTH
from testbed.log.text import markdown_table


def test_a_goal_is_met_at_its_figure_and_not_above():
    assert [Goal("a", "b", 1.0, found).met for found in (0.5, 1.0, 1.01)] == [True, True, False]


def test_the_ratio_is_the_median_of_the_pairs():
    assert Pairs(np.array([1.0, 2.0, 4.0]), np.array([2.0, 3.0, 40.0])).ratio == pytest.approx(2.0)


def test_the_page_says_what_was_found_and_whether_it_is_enough():
    goals = [Goal("step", "native", 1.0, 2.5), Goal("start", "numpy", 2.0, 1.25)]
    steps, grown = [Step("perfect tracks", 0.625)], [Growth(10, 6, 9, 0.005, 2e6), Growth(20, 2, 21, 0.008, 4e6)]
    parts = {"cut-in": {"radar": 0.25, "tracker": 0.75}}
    page = render(
        Path("docs"),
        goals,
        steps,
        {"truth": (400, 401.2), "rm-koch": (60, 95)},
        grown,
        parts,
        [Costs(5, 1, 2, 3.25, 4)],
        "today",
    )
    for line in (
        "| step | native | 2.50 | 1 | not met |",
        "| start | numpy | 1.25 | 2 | met |",
        "| cut-in | 25% | 75% |",
        "| 5 | 4 | 1.0 | 2.0 | 3.2 |",
        "| numpy | 400 | 60 |",
        "| 401 | 95 |",
        "| perfect tracks | 0.62 |",
        "| 20 | 2 | 21 | 8.0 | 400 | 4.0 |",
        "400 us in a batch of 20 and 500 us in one of 10",
        "EnvPool",
    ):
        assert line in page
    assert page.startswith("# Speed\n")


def test_a_table_has_a_rule_below_its_heads():
    assert markdown_table(("a", "b"), [("1", "2")]) == "| a | b |\n| --- | --- |\n| 1 | 2 |"


def test_steps_are_timed_in_pairs():
    pairs = training.tracked_steps(2, 2, tracker=TRUTH)
    assert pairs.plain.shape == pairs.extra.shape == (2,)
    assert (pairs.plain > 0).all()


def test_the_shares_of_a_run_add_up_to_its_time(tmp_path):
    found = shares("xia2020-lane", 1, str(tmp_path))
    assert sum(found.values()) == pytest.approx(1.0)
    assert all(0 < share < 1 for share in found.values())


def test_an_exponent_is_that_of_a_power():
    x = np.array([10.0, 20.0, 50.0])
    assert exponent(x, 3 * x**1.25) == pytest.approx(1.25)


def test_growth_is_judged_by_its_exponents():
    found = growing([Growth(n, 6, n, 0.001 * n**1.2, 1e5 * n) for n in (10, 100)])
    assert [goal.found for goal in found] == pytest.approx([1.2, 1.0])
    assert [goal.met for goal in found] == [False, True]


def test_the_motorway_of_growth_has_room_between_its_vehicles():
    places = motorway(200)
    d = np.abs(places[:, None] - places)[~np.eye(200, dtype=bool)]
    assert ((d >= [5.0, 0.0]) | (d >= [0.0, 3.0])).any(-1).all()
    assert np.hypot(*places.T).min() > 3.0


def test_each_vehicle_of_the_motorway_has_one_track():
    found = growth(10, warm_up=8, steps=2)
    assert found.tracks == 10
    assert found.seconds > 0
    assert found.peak > 0


def test_two_hundred_vehicles_that_are_in_sight_at_once_are_tracked():
    assert growth(200, warm_up=8, steps=1).tracks == 200


def test_perfect_tracks_are_scanned_only_where_somebody_watches(monkeypatch):
    made = []

    def kept(*args, **settings):
        made.append(TrackedEnv(*args, **settings))
        return made[-1]

    monkeypatch.setattr(training, "TrackedEnv", kept)
    for watched in (False, True):
        training.tracked_steps(2, 2, watched, tracker=TRUTH)
    bare, scanned = (env.costs[TRUTH].scans for env in made)
    assert (bare, scanned) == (0, 1 + 2 * 15)  # that of the reset, and each frame of two decisions


def test_resets_leave_nothing_open():
    memory, files = training.resets(1, 3)
    assert 1 <= memory < 1.1
    assert files == 1


def test_two_processes_step_two_environments():
    assert training.two_processes(1) > 0


def test_decisions_are_counted_in_both_forms(monkeypatch):
    monkeypatch.setattr(training, "LEARNERS", (TRUTH,))
    ((numpy, compiled),) = training.throughput(1, rounds=1).values()
    assert min(numpy, compiled) > 0


def test_perception_takes_time():
    assert training.perception("xia2020-lane", 1) > 0
