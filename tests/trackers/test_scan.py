"""Scans, estimates, geometry: the floor's own laws."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackers import Scan, SensorModel, prior
from trackers.batch import concatenate, select, take
from trackers.geometry import box_corners, compose, extent_matrix, point_velocity, to_frame, to_world, unit, wrap_angle
from trackers.linalg import sqrtm
from trackers.motion.turn import coordinated_turn
from trackers.random_matrix.feldmann import visible_offset

angles = st.floats(-20, 20)
coordinate = st.floats(-100, 100)


@given(angles)
def test_a_wrapped_angle_points_the_same_way(a):
    assert -np.pi <= wrap_angle(a) < np.pi
    np.testing.assert_allclose(unit(wrap_angle(a)), unit(a), atol=1e-9)


@given(coordinate, coordinate, angles, coordinate, coordinate)
def test_to_frame_inverts_to_world(x, y, h, px, py):
    pose, points = np.array([x, y, h]), np.array([[px, py]])
    np.testing.assert_allclose(to_frame(pose, to_world(pose, points)), points, atol=1e-9)


def test_compose_agrees_with_to_world():
    a, b = np.array([1.0, 2.0, 0.3]), np.array([4.0, -1.0, 0.5])
    point = np.array([[0.7, 0.2]])
    np.testing.assert_allclose(to_world(compose(a, b), point), to_world(a, to_world(b, point)))


def test_corners_start_front_left_and_turn_left():
    corners = box_corners(np.array([10.0, 0, np.pi / 2]), np.array([4.0, 2.0]))
    np.testing.assert_allclose(corners, [[9, 2], [9, -2], [11, -2], [11, 2]], atol=1e-12)


def test_a_lever_arm_ahead_of_a_left_turn_moves_to_the_left():
    np.testing.assert_allclose(point_velocity(np.array([10.0, 0]), np.array(0.5), np.array([2.0, 0])), [10, 1])


def test_square_root_of_a_matrix():
    X = extent_matrix(np.array([0.1, 1.0]), np.array([[4.7, 1.8], [12, 2.5]]))
    np.testing.assert_allclose(sqrtm(X) @ sqrtm(X), X, rtol=1e-12)
    np.testing.assert_array_equal(sqrtm(np.zeros((2, 2))), np.zeros((2, 2)))


@given(st.floats(-1, 1), st.floats(0.01, 2))
def test_the_turn_jacobian_is_the_derivative(omega, dt):
    m, h = np.array([1.0, 2.0, 0.4, 12.0, omega]), 1e-6
    numeric = np.stack(
        [(coordinated_turn(m + h * e, dt)[0] - coordinated_turn(m - h * e, dt)[0]) / (2 * h) for e in np.eye(5)], -1
    )
    np.testing.assert_allclose(coordinated_turn(m, dt)[1], numeric, atol=2e-4)


def test_cartesian_detections_come_back():
    xy = np.random.default_rng(0).normal(0, 30, (4, 6, 2))
    np.testing.assert_allclose(Scan.from_xy(xy, pose=(3.0, 1.0, 2.0)).xy, xy, atol=1e-9)


def test_a_resting_thing_has_no_ground_rate():
    sensor = SensorModel(mount=(3.5, 0.5, 0.2))
    platform = np.array([5.0, 2.0, 0.3, 20.0, 1.0, 0.2])
    pose, velocity = sensor.poses(platform), sensor.velocity(platform)
    d = np.array([40.0, 12.0]) - pose[:2]
    rate = -(d / np.hypot(*d)) @ velocity
    polar = np.array([[np.hypot(*d), np.arctan2(d[1], d[0]) - pose[2], rate]])
    scan = Scan(polar, np.ones(1, bool), pose[None], velocity[None])
    np.testing.assert_allclose(scan.ground_rate, 0, atol=1e-9)


def test_a_turning_platform_moves_its_sensor_by_yaw_rate_times_lever_arm():
    """Heading 90 degrees, so a radar 2 m ahead and 0.5 m left is at (-0.5, 2) from the centre: 0.4 rad/s x that."""
    sensor = SensorModel(mount=(2.0, 0.5, 0.0))
    velocity = sensor.velocity(np.array([[7.0, 3.0, np.pi / 2, 0.0, 10.0, 0.4], [7.0, 3.0, np.pi / 2, 0.0, 10.0, 0.0]]))
    np.testing.assert_allclose(velocity, [[-0.8, 9.8], [0.0, 10.0]], atol=1e-12)


def test_noise_is_along_and_across_the_line_of_sight():
    scan = Scan.from_xy([[0.0, 50.0]], noise=(0.1, 0.02, 0.1))
    np.testing.assert_allclose(scan.position_noise()[0], [[1.0, 0], [0, 0.01]], atol=1e-12)
    np.testing.assert_allclose(Scan.from_xy([[0.0, 50.0]]).position_noise(0.2)[0], 0.04 * np.eye(2), atol=1e-12)


def test_shapes_of_what_comes_in():
    with pytest.raises(ValueError, match="one detection is xy"):
        Scan.from_xy([1.0, 2.0])
    with pytest.raises(ValueError, match=r"mask must be \(\.\.\., M\) with M = 2"):
        Scan.from_xy(np.ones((2, 2)), mask=[True])
    with pytest.raises(ValueError, match=r"pose must be \(\.\.\., 3\)"):
        prior((1.0, 2.0))


def test_rows_are_chosen_and_joined():
    e = prior(np.arange(9.0).reshape(3, 3))
    both = concatenate([take(e, np.array([2])), take(e, np.array([True, False, False]))])
    np.testing.assert_array_equal(both.pose[:, 0], [6, 0])
    assert both.contour is None
    mixed = select(np.array([True, False, False]), e, e._replace(pose=-e.pose))
    np.testing.assert_array_equal(mixed.pose[:, 1], [1, -4, -7])


def test_from_behind_the_mean_lies_on_the_rear_and_from_the_corner_on_both_sides():
    size = np.array([4.0, 2.0])
    np.testing.assert_allclose(visible_offset(np.zeros(3), size, np.array([-30.0, 0])), [-2, 0], atol=1e-9)
    corner = visible_offset(np.zeros(3), size, np.array([-30.0, -30.0]))
    assert -2 < corner[0] < 0
    assert -1 < corner[1] < 0
    np.testing.assert_array_equal(visible_offset(np.zeros(3), size, np.zeros(2)), [0, 0])


@given(angles, angles)
def test_the_visible_mean_turns_with_the_world(turn, bearing):
    size, sensor = np.array([4.7, 1.9]), 20 * unit(bearing)
    plain = visible_offset(np.zeros(3), size, sensor)
    turned = visible_offset(np.array([0, 0, turn]), size, to_world(np.array([0, 0, turn]), sensor[None])[0])
    np.testing.assert_allclose(turned, to_world(np.array([0, 0, turn]), plain[None])[0], atol=1e-6)
