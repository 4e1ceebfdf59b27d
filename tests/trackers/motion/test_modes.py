"""How the motion modes move: hand-computed cases, and differences for the Jacobian."""

import numpy as np
import pytest

from trackers.geometry import unit, wrap_angle
from trackers.motion.modes import Mode, Modes
from trackers.motion.turn import OMEGA, PHI, SPEED

FREE = 1e9  # a bound that does not bind


def still(axle=0.5, lateral=FREE):
    """One mode without noise."""
    return Modes((Mode("one", 0.0, 0.0, axle, lateral),), curvature=FREE)


def moved(modes, m, dt, length=4.6, P=None):
    P = 1e-18 * np.eye(7) if P is None else P
    m, P, _ = modes.moved(m[None], P[None], np.array([length]), dt)
    return m[0], P[0]


@pytest.mark.parametrize(("axle", "centre", "velocity"), [(0.5, (9.0403, 7.4518), (2.274, 5.670))])
def test_a_body_that_turns_about_its_rear_axle_swings_its_centre_out(axle, centre, velocity):
    m = np.array([0.0, 0.0, 0.0, 6.0, 0.5, 0.0, 0.0])
    for _ in range(20):
        m, _ = moved(still(axle), m, 0.1)
    along = unit(m[PHI])
    lever = axle * 4.6 * m[OMEGA]
    np.testing.assert_allclose(m[:2], centre, atol=5e-5)
    np.testing.assert_allclose(m[SPEED] * along + lever * np.array([-along[1], along[0]]), velocity, atol=5e-4)


def test_a_body_that_turns_about_its_centre_follows_the_circle():
    m = np.array([0.0, 0.0, 0.0, 6.0, 0.5, 0.0, 0.0])
    for _ in range(20):
        m, _ = moved(still(0.0), m, 0.1)
    np.testing.assert_allclose(m[:2], [12 * np.sin(1.0), 12 * (1 - np.cos(1.0))], atol=1e-9)


def test_the_covariance_moves_with_the_derivative_of_the_motion():
    m, dt, step = np.array([3.0, -2.0, 0.7, 8.0, 0.4, 0.0, 0.0]), 0.1, 1e-6
    J = np.stack(
        [(moved(still(), m + step * d, dt)[0] - moved(still(), m - step * d, dt)[0]) / (2 * step) for d in np.eye(7)],
        -1,
    )
    P = np.diag([0.1, 0.2, 0.01, 0.5, 0.02, 0.01, 0.01])
    np.testing.assert_allclose(moved(still(), m, dt, P=P)[1], J @ P @ J.T, atol=1e-6)


def test_what_stands_keeps_its_heading_and_what_drives_may_turn():
    def heading_std(speed):
        m = np.array([0.0, 0.0, 0.0, speed, 0.0, 0.0, 0.0])
        P = np.diag([0.1, 0.1, 0.01**2, 0.05**2, 0.01**2, 0.01, 0.01])
        for _ in range(50):
            m, P = moved(Modes((Mode("turn", 0.0, 0.3, 0.25, 4.0),)), m, 0.1, P=P)
        return np.sqrt(P[PHI, PHI])

    assert heading_std(0.0) < 0.05
    assert heading_std(8.0) > 0.3


@pytest.mark.parametrize(("lateral", "yaw_rate"), [(0.3, 0.02), (4.0, 0.15)])
def test_the_yaw_rate_is_bounded_by_the_acceleration_across(lateral, yaw_rate):
    modes = Modes((Mode("one", 0.0, 0.3, 0.25, lateral),))
    m = np.array([0.0, 0.0, 0.0, 25.0, 0.0, 0.0, 0.0])
    P = np.diag([0.1, 0.1, 1e-4, 0.1, 0.25, 0.01, 0.01])
    for _ in range(100):
        m, P = moved(modes, m, 0.1, P=P)
    assert np.sqrt(P[OMEGA, OMEGA]) < 1.5 * np.sqrt(yaw_rate)  # the walk and the bound balance


def test_at_birth_the_yaw_rate_is_what_speed_and_mode_allow():
    m, P = np.zeros((2, 7)), np.repeat(np.eye(7)[None], 2, 0)
    m[:, SPEED] = 25.0, 5.0
    P[:, SPEED, SPEED] = P[:, OMEGA, OMEGA] = 0.01
    mu, m_k, P_k = Modes().at_birth(m, P)
    np.testing.assert_allclose(mu.sum(-1), 1.0)
    assert (mu[:, 0] == 0.69).all()
    np.testing.assert_array_equal(m_k, np.repeat(m[:, None], 5, 1))
    std = np.sqrt(P_k[..., OMEGA, OMEGA])
    assert (std[0] < [0.05, 0.14, 0.14, 0.18, 0.18]).all()
    np.testing.assert_allclose(std[1], [0.0632, 0.3, 0.3, 0.3, 0.3], atol=1e-3)
    assert (wrap_angle(m_k[..., PHI]) == 0).all()


@pytest.mark.parametrize("wrong", [{"table": ()}, {"first": 1.1}, {"curvature": 0.0}, {"bound_time": -1.0}])
def test_modes_that_cannot_be_are_refused(wrong):
    with pytest.raises(ValueError, match=f"{next(iter(wrong))} must"):
        Modes(**wrong)


def test_a_mode_whose_bound_a_yaw_rate_does_not_keep_is_unlikely():
    """(MODE.32) by hand: at 7.5 m/s the bounds are 0.04 and 0.4 rad/s, ten times the variance in 0.1 s."""
    modes = Modes((Mode("one", 0.0, 0.0, 0.25, 0.3), Mode("two", 0.0, 0.0, 0.25, 3.0)))
    m, P = np.tile([0.0, 0.0, 0.0, 7.5, 0.2, 0.0, 0.0], (2, 1)), np.tile(np.diag([1e-12] * 7), (2, 1, 1))
    P[:, OMEGA, OMEGA] = 0.04**2
    likely = modes.moved(m, P, np.full(2, 4.6), 0.1)[2]
    np.testing.assert_allclose(likely, -0.5 * 0.2**2 / np.array([0.0016 + 0.016, 0.0016 + 1.6]), rtol=1e-6)
    np.testing.assert_array_equal(modes.moved(m * (np.arange(7) != OMEGA), P, np.full(2, 4.6), 0.1)[2], 0.0)
