"""The car-following model against its formulas and limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbed.planners.car_following import CarFollowing

MODEL = CarFollowing()
IDM = CarFollowing(coolness=0.0)
speeds = st.floats(0.0, 40.0)
gaps = st.floats(0.2, 200.0)


def follow(model, v, target, s, v_l):
    return float(model.follow(v, target, np.array([s]), np.array([v_l]))[0])


def test_without_coolness_it_is_the_formula_of_idm():
    v, target, s, v_l = 20.0, 30.0, 25.0, 17.0
    wanted = 3.0 + 20.0 * 1.4 + 20.0 * 3.0 / (2 * np.sqrt(2.5 * 3.0))
    expected = 2.5 * (1 - (20 / 30) ** 4 - (wanted / 25.0) ** 2)
    assert follow(IDM, v, target, s, v_l) == pytest.approx(expected, rel=1e-12)


def test_a_cut_in_of_an_equally_fast_leader_is_taken_coolly():
    assert follow(IDM, 25.0, 30.0, 12.0, 25.0) < -15.0
    assert -MODEL.brake - 0.3 < follow(MODEL, 25.0, 30.0, 12.0, 25.0) < -2.0


@given(v=speeds, s=gaps, v_l=speeds)
def test_coolness_never_brakes_less_than_a_collision_takes(v, s, v_l):
    """Constant deceleration (v - v_l)^2 / (2 s) just avoids the leader; 1 % of slack is the share of IDM."""
    needed = max(v - v_l, 0.0) ** 2 / (2 * s)
    cool, plain = follow(MODEL, v, 30.0, s, v_l), follow(IDM, v, 30.0, s, v_l)
    assert plain - 1e-9 <= cool
    if plain < -needed:
        assert cool <= -0.99 * needed + 1e-9


@given(v=speeds, s=gaps, v_l=speeds, closer=st.floats(0.1, 0.99))
def test_a_closer_leader_never_lets_it_accelerate_more(v, s, v_l, closer):
    assert follow(MODEL, v, 30.0, closer * s, v_l) <= follow(MODEL, v, 30.0, s, v_l) + 1e-9


def test_where_idm_is_content_nothing_is_changed():
    assert follow(MODEL, 20.0, 30.0, 80.0, 22.0) == pytest.approx(follow(IDM, 20.0, 30.0, 80.0, 22.0))


def test_the_free_road_is_driven_at_the_target_from_both_sides():
    assert MODEL.free(0.0, 30.0) == MODEL.accel
    assert MODEL.free(30.0, 30.0) == pytest.approx(0.0)
    assert 0.0 > MODEL.free(31.0, 30.0) > MODEL.free(40.0, 30.0) > -MODEL.brake
    assert MODEL.free(20.0, np.inf) == MODEL.accel


def test_behind_a_leader_at_the_desired_gap_and_speed_it_stays():
    assert follow(MODEL, 20.0, np.inf, MODEL.desired_gap(20.0, 20.0), 20.0) == pytest.approx(0.0, abs=1e-12)


def test_a_follower_is_forced_to_brake_the_harder_the_faster_it_comes():
    imposed = MODEL.imposed(np.array([20.0, 25.0, 35.0]), 20.0, np.full(3, 30.0), 0.7)
    assert (np.diff(imposed) > 0).all()
    assert imposed[0] == pytest.approx(2.5 * ((3.0 + 14.0) / 30.0) ** 2)
