"""From polar to Cartesian velocity, where the linear form alone would be singular."""

import numpy as np

from trackers.motion.turn import cartesian_covariance


def test_at_standstill_the_velocity_varies_across_the_heading_as_sampled():
    m, P = np.array([0.0, 0.0, 0.7, 0.0, 0.0]), np.diag([0.1, 0.2, 0.3**2, 0.5**2, 0.01])
    draw = np.random.default_rng(0).multivariate_normal(m, P, 400_000)
    d = draw[:, 2] - 0.7  # to second order, as the covariance: v (e + d n), e and n along and across the heading
    along, across = draw[:, 3], draw[:, 3] * d
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    want = turn @ np.cov(along, across) @ turn.T
    np.testing.assert_allclose(cartesian_covariance(m, P)[2:, 2:], want, rtol=0.02, atol=1e-3)


def test_at_speed_the_course_is_what_varies_across():
    m, P = np.array([0.0, 0.0, 0.0, 20.0, 0.0]), np.diag([0.1, 0.2, 0.02**2, 0.5**2, 0.01])
    cov = cartesian_covariance(m, P)
    np.testing.assert_allclose(np.diag(cov), [0.1, 0.2, 0.25, 20**2 * 0.02**2 + 0.25 * 0.02**2], rtol=1e-6)
    np.testing.assert_allclose(cov - np.diag(np.diag(cov)), 0, atol=1e-12)
