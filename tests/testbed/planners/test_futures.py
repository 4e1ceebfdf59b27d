"""Two futures of who drives beside the path: how likely a change is, and where it leads."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbed.planners.futures import LOG_ODDS, change_probability, futures
from testbed.planners.prediction import others_on, path_ahead, relate, relate_at
from tests.testbed.planners.roads import world

RESULTS = Path(__file__).resolve().parents[3] / "docs" / "results" / "lane_changes.json"
NUMBERS = st.floats(-3, 3)


@given(NUMBERS, NUMBERS, st.floats(0, 2), st.floats(0, 2), st.floats(-1, 1), st.floats(1, 9), st.sampled_from((-1, 1)))
def test_more_uncertainty_never_makes_a_change_less_likely(offset, speed, place, drift, rho, more, side):
    lean, cov = np.array([offset, speed]), np.diag([place**2, drift**2])
    cov[0, 1] = cov[1, 0] = rho * place * drift
    sure, unsure = (change_probability(lean, c, np.array(side)) for c in (cov, more * cov))
    assert 0 <= sure <= unsure + 1e-12 <= 1 + 1e-12
    assert change_probability(-lean, cov, np.array(-side)) == pytest.approx(float(sure))


def test_a_change_is_as_likely_as_in_real_traffic():
    found = json.loads(RESULTS.read_text())
    np.testing.assert_allclose(LOG_ODDS, found["log_odds"], atol=0.05)
    lean = np.array([[0.0, 0.0], [0.2, 1.0], [1.0, 0.5]])
    p = change_probability(lean, np.zeros((2, 2)), np.ones(3))
    np.testing.assert_allclose(p, [0.0025, 0.613, 0.550], atol=0.001)  # by hand, from the log odds


def found(*others, width=2.0):
    env = world(*others)
    core = env.unwrapped
    path = path_ahead(core.road.network, core.vehicle.lane_index, None, core.vehicle.position, 150.0)
    all_others = others_on(core.road, core.vehicle, 150.0)
    return path, futures(path, all_others, relate(path, all_others), 5.0, width)


LEANS = {"x": 220.0, "y": 7.6, "vx": 18.0, "vy": -1.0}


def test_who_leans_towards_the_path_has_a_second_future_that_ends_in_its_middle():
    path, f = found(LEANS)
    np.testing.assert_array_equal(f.of, [0, 0])
    np.testing.assert_allclose(f.chance, [1.0, change_probability(np.array([0.4, 1.0]), np.zeros((2, 2)), 1)])
    across = relate_at(path, f.others, np.array([0.0, 3.0, 60.0])).across
    np.testing.assert_allclose(across[0], 3.6)
    assert abs(across[1, 1]) < 0.6
    np.testing.assert_allclose(across[1, [0, 2]], [3.6, 0.0], atol=1e-6)


def test_changes_up_to_a_doubt_count_nothing_and_what_is_certain_counts_in_full():
    _, f = found(LEANS)
    assert f.beyond(0.0).tolist() == f.chance.tolist()
    np.testing.assert_allclose(f.beyond(0.2), [1.0, (f.chance[1] - 0.2) / 0.8])
    np.testing.assert_allclose(f.beyond(0.99), [1.0, 0.0])


@pytest.mark.parametrize(
    "other",
    [
        {**LEANS, "x": 201.0},  # alongside the ego
        {**LEANS, "y": 5.5},  # on the path
        {**LEANS, "vy": 1.0, "y": 8.4},  # leans away
        {**LEANS, "vx": -18.0},  # comes towards the ego
    ],
)
def test_who_is_not_beside_ahead_and_driving_the_same_way_has_one_future(other):
    _, f = found(other)
    np.testing.assert_array_equal(f.chance, [1.0])


def test_the_future_of_who_stays_has_no_motion_across():
    _, f = found({**LEANS, "vy": 1.0})
    assert f.others.velocity[0, 1] == 0.0
    _, f = found({**LEANS, "x": 201.0})
    assert f.others.velocity[0, 1] == -1.0
