import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.courses import (
    HEADING,
    RATE,
    VX,
    VY,
    YAW_RATE,
    Push,
    Segment,
    Shift,
    T,
    X,
    Y,
    check,
    follow_lane,
    integrate,
    peak_lateral_acceleration,
    pushed,
)
from scenarios.papers import TABLE_1
from scenarios.paths import along, through

BEND = along((0.0, 0.0, 0.3), ((80.0, 0.0), (200.0, 1 / 150), (200.0, -1 / 120)), ramp=40.0)
STRAIGHT = along((0.0, 0.0, 0.0), ((200.0, 0.0),))
COURSES = {
    "integrated": integrate((3.0, -2.0, 2.9), 20.0, [Segment(2), Segment(3, -4, 0.1), Segment(4, 1, -0.12)]),
    "lane change": follow_lane(STRAIGHT, 0.0, 25.0, shifts=[Shift(0.0, 4.0, -4.0)], duration=4.0),
    "along a bend": follow_lane(BEND, 20.0, 16.0, [Segment(3), Segment(4, -1.5)], [Shift(2, 4, 4)], duration=20.0),
}
courses = pytest.mark.parametrize("table", COURSES.values(), ids=COURSES)


def derivative(values):
    """Central differences, without the ends."""
    return (values[2:] - values[:-2]) * RATE / 2


@courses
def test_velocity_is_the_derivative_of_position(table):
    # at 4 m beside a path whose clothoid begins, curvature interpolated over 1 m errs by 5e-5 / m: 16 * 4 * 5e-5 m/s
    assert np.abs(derivative(table[:, [X, Y]]) - table[1:-1, [VX, VY]]).max() < 4e-3


@courses
def test_yaw_rate_is_the_derivative_of_the_heading(table):
    assert np.abs(derivative(table[:, HEADING]) - table[1:-1, YAW_RATE]).max() < 2e-3


@courses
def test_heading_is_the_course(table):
    sine = np.sin(table[:, HEADING] - np.arctan2(table[:, VY], table[:, VX]))
    assert np.abs(sine).max() < 1e-12


@courses
def test_rows_are_a_hundredth_of_a_second_apart(table):
    np.testing.assert_allclose(np.diff(table[:, T]), 1 / RATE, atol=1e-12)


def test_a_constant_yaw_rate_is_a_circle_of_speed_over_yaw_rate():
    # 10 m/s and 0.5 rad/s: R = 20 m; half a turn after 2 pi seconds lands at (0, 2 R). The sharpest onset is 10 ms.
    table = integrate((0.0, 0.0, 0.0), 10.0, [Segment(8.0, 0.0, 0.5)], ramp=0.0)
    at = np.array([np.interp(2 * np.pi + 0.005, table[:, T], table[:, k]) for k in (X, Y)])
    np.testing.assert_allclose(at, [0.05, 40.0], atol=2e-3)
    centre = np.array([0.05, 20.0])
    np.testing.assert_allclose(np.linalg.norm(table[2:-2, [X, Y]] - centre, axis=1)[:700], 20.0, atol=1e-2)


@given(
    st.lists(st.tuples(st.floats(0.3, 5), st.floats(-2, 2), st.floats(-0.2, 0.2)), min_size=1, max_size=5),
    st.floats(0.1, 2.0),
)
def test_total_turn_is_the_sum_of_duration_times_yaw_rate(parts, ramp):
    parts = [(round(d, 2), a, w) for d, a, w in parts]
    table = integrate((0, 0, 0), 60.0, [Segment(*p) for p in parts], ramp=round(ramp, 2))
    assert table[-1, HEADING] == pytest.approx(sum(d * w for d, _, w in parts), abs=1e-9)


def test_the_yaw_rate_needs_the_ramp_to_build_up():
    table = integrate((0, 0, 0), 20.0, [Segment(3.0, 0.0, 0.1)], ramp=1.0)
    np.testing.assert_allclose(table[[0, 50, 100, 200], YAW_RATE], [0.0, 0.05, 0.1, 0.1], atol=1e-12)


def test_braking_ends_at_standstill_and_a_later_start_is_from_rest():
    table = integrate((0, 0, 0), 10.0, [Segment(4.0, -5.0), Segment(2.0), Segment(2.0, 3.0)], onset=0.1)
    speed = np.hypot(table[:, VX], table[:, VY])
    assert speed[450] == 0.0
    assert speed[-1] == pytest.approx(6.0, abs=1e-9)
    assert (speed >= 0).all()


def test_a_lane_change_arrives_in_the_next_lane_with_the_textbook_peak():
    # quintic: the largest second derivative of 10 u^3 - 15 u^4 + 6 u^5 is 10 / sqrt(3) = 5.774
    table = follow_lane(STRAIGHT, 0.0, 25.0, shifts=[Shift(0.0, 4.0, 4.0)], duration=4.0)
    assert table[-1, [Y, HEADING]] == pytest.approx([4.0, 0.0], abs=1e-9)
    assert peak_lateral_acceleration(table) == pytest.approx(4.0 / 16.0 * 5.774, rel=0.01)


def test_a_course_along_a_bend_keeps_its_lateral_offset():
    table = follow_lane(BEND, 30.0, 15.0, lateral=3.0, duration=15.0)
    lateral = [BEND.project(row[[X, Y]])[1] for row in table[::50]]
    np.testing.assert_allclose(lateral, 3.0, atol=1e-6)
    np.testing.assert_allclose(np.hypot(table[:, VX], table[:, VY]), 15.0, atol=1e-9)


def test_a_course_beyond_the_lateral_limit_is_refused():
    hard = follow_lane(STRAIGHT, 0.0, 25.0, shifts=[Shift(0.0, 2.0, 4.0)], duration=2.0)
    check(hard, 6.0)
    with pytest.raises(ValueError, match=r"peaks at 5\.7"):
        check(hard, 4.0)


def test_a_segment_without_duration_is_refused():
    with pytest.raises(ValueError, match="longer than 0 s"):
        integrate((0, 0, 0), 10.0, [Segment(0.0)])


def test_a_segment_may_not_turn_a_course_that_follows_a_lane():
    with pytest.raises(ValueError, match="leave yaw_rate at 0"):
        follow_lane(through([(0, 0), (100, 0)]), 0.0, 10.0, [Segment(1.0, 0.0, 0.1)])


def test_a_pushed_body_has_the_velocities_of_table_1_and_points_along_them():
    course = pushed((0.0, 0.0), (30.0, 0.0), TABLE_1)
    for time, velocity in ((10.0, (30, 0)), (15.5, (15 - 0.75, -10 - 1)), (20.5, (0.5, -30 + 0.75)), (31, (20, 0))):
        row = course[round(time * RATE)]  # half a second of onset later than in the table
        np.testing.assert_allclose(row[[VX, VY]], velocity, atol=0.3)
    np.testing.assert_allclose(course[-1, [VX, VY]], (0, 20), atol=1e-6)  # turned by 90 degrees, to the right
    np.testing.assert_allclose(course[:, HEADING], np.unwrap(np.arctan2(course[:, VY], course[:, VX])))


def test_a_pushed_course_is_consistent_with_its_own_derivatives():
    course = pushed((5.0, -3.0), (20.0, 4.0), (Push(1.0), Push(2.0, (-3.0, 2.0)), Push(3.0, yaw_rate=-0.2)))
    rate = np.gradient(course[:, [X, Y, HEADING]], 1 / RATE, axis=0)[2:-2]
    np.testing.assert_allclose(rate, course[2:-2, [VX, VY, YAW_RATE]], atol=2e-3)


@pytest.mark.parametrize("push", [Push(0.0), Push(1.0, (1.0, 0.0), 0.1)])
def test_a_push_takes_time_and_either_accelerates_or_turns(push):
    with pytest.raises(ValueError, match="pushes must last longer"):
        pushed((0.0, 0.0), (10.0, 0.0), (push,))
