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


@pytest.mark.parametrize("curvature", [0.03, -0.02, 0.0])
def test_straight_on_a_bend_means_to_turn_as_the_lane_does(curvature):
    """(MODE.34): 10 m/s along a lane of a curvature is a yaw rate of ten times that, and the speed stays."""
    modes = Modes((Mode("straight", 0.1, 0.003, 0.25, 0.3),))
    m, P = np.array([[0.0, 0.0, 0.0, 10.0, 0.0, 0.0, 0.0]]), np.diag([0.1, 0.1, 1e-4, 0.01, 0.01, 0.01, 0.01])[None]
    fit = []
    for _ in range(40):
        m, P, likely = modes.moved(m, P, np.array([4.6]), 0.1, np.array(curvature))
        fit.append(likely[0])
    np.testing.assert_allclose(m[0, [SPEED, OMEGA]], [10.0, 10.0 * curvature], atol=0.03)
    assert fit[-1] > -0.01
    assert bool(fit[0] < -0.1) is (curvature != 0)


def test_the_yaw_rate_of_a_lane_is_measured_as_any_other_quantity():
    """The textbook update of a measurement 0 of omega - c v, with the variance that it has."""
    rng, c, dt = np.random.default_rng(0), 0.05, 0.1
    modes, still_modes = Modes((Mode("one", 0.0, 0.0, 0.25, 3.0),)), still(0.25)
    A = 0.1 * rng.normal(size=(7, 7))
    m, P = np.array([3.0, -2.0, 0.7, 8.0, 0.1, 4.0, 1.8]), A @ A.T + 1e-3 * np.eye(7)
    m0, P0 = moved(still_modes, m, dt, P=P)  # (MODE.2) to (MODE.4) alone
    h = np.array([0.0, 0.0, 0.0, -c, 1.0, 0.0, 0.0])
    R = (3.0**2 * min(1.0, 100 / (u := m0[SPEED] ** 2 + P0[SPEED, SPEED])) / u) * 1.0 / dt
    gain = P0 @ h / (h @ P0 @ h + R)
    got = modes.moved(m[None], P[None], np.array([4.6]), dt, np.array(c))
    np.testing.assert_allclose(got[0][0], m0 - gain * (h @ m0), rtol=1e-9)
    np.testing.assert_allclose(got[1][0], P0 - np.outer(gain, h @ P0), rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(got[2][0], -0.5 * (h @ m0) ** 2 / (h @ P0 @ h + R), rtol=1e-9)  # (MODE.32)
