"""The random matrix against reference vectors, and statistics with a negative twin."""

import numpy as np
import pytest
from scipy.stats import chi2

from trackers import RandomMatrix, Scan, find, prior
from trackers.geometry import extent_matrix
from trackers.motion.turn import coordinated_turn
from trackers.random_matrix.feldmann import RMState, moments

DETECTIONS = [(1.8, 1.0), (-1.5, -0.9), (2.2, 0.2), (-0.3, 1.1), (0.6, -0.6)]


def reference_state():
    """The prior of the reference vectors, which come from an independent implementation."""
    P = np.diag([0.25, 0.25, 0.01, 1.0, 0.01])
    P[0, 3] = P[3, 0] = 0.1
    P[1, 2] = P[2, 1] = 0.02
    V = 20 * extent_matrix(0.3, np.array([4.6, 1.9]))
    return RMState(np.array([0.0, 0.0, 0.3, 10.0, 0.1]), P, np.array(26.0), V)


def test_prediction_gives_the_reference_vector():
    state = RandomMatrix(tau=10).predict(reference_state(), 0.5)
    np.testing.assert_allclose(state.m, [4.737760079, 1.596377628, 0.35, 10, 0.1], rtol=1e-9)
    np.testing.assert_allclose(state.nu, 25.02458849, rtol=1e-9)
    np.testing.assert_allclose(state.V, [[90.82571688, 26.88654822], [26.88654822, 26.98404735]], rtol=1e-8)
    np.testing.assert_allclose(np.diag(state.P), [0.62846163, 0.70647890, 0.01265625, 1.5625, 0.0125], rtol=1e-7)


def test_update_gives_the_reference_vector():
    # Two digits of the reference differ from its own equations (m[1] .0723745065 for ...4505, P[3, 3] .9796515114 for
    # ...6115), hence 2e-7; the loop below is held to 1e-9.
    state, info = RandomMatrix().update(reference_state(), Scan.from_xy(DETECTIONS))
    np.testing.assert_allclose(state.m, [0.2692357866, 0.0723745065, 0.3057899560, 10.1076943147, 0.1], atol=2e-7)
    np.testing.assert_allclose(
        np.diag(state.P), [0.122822572, 0.0513746361, 0.0087287977, 0.9796515114, 0.01], atol=2e-7
    )
    np.testing.assert_allclose(state.V, [[137.0056574, 35.4884164], [35.4884164, 37.6493443]], rtol=1e-8)
    assert state.nu == 31
    assert info.n == 5


def test_update_equals_a_loop_over_detections():
    """(RM.12) and (RM.13), written out for one object."""
    f, s = RandomMatrix(rho=0.4, sigma=0.3), reference_state()
    state, _ = f.update(s, Scan.from_xy(DETECTIONS))
    n, z_bar = 5, sum(np.array(z) for z in DETECTIONS) / 5
    Sig = sum(np.outer(z - z_bar, z - z_bar) for z in np.array(DETECTIONS))
    root = lambda A: (lambda w, U: U @ np.diag(np.sqrt(w)) @ U.T)(*np.linalg.eigh(A))  # noqa: E731
    Xh = s.V / (s.nu - 6)
    Y = f.rho * Xh + f.sigma**2 * np.eye(2)
    H = np.eye(2, 5)
    S = H @ s.P @ H.T + Y / n
    K = s.P @ H.T @ np.linalg.inv(S)
    e = z_bar - H @ s.m
    A, B = root(Xh) @ np.linalg.inv(root(S)), root(Xh) @ np.linalg.inv(root(Y))
    np.testing.assert_allclose(state.m, s.m + K @ e, rtol=1e-9)
    np.testing.assert_allclose(state.P, s.P - K @ H @ s.P, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(state.V, s.V + A @ np.outer(e, e) @ A.T + B @ Sig @ B.T, rtol=1e-9)


def static_check(filter, runs=200, steps=150, seed=4):
    """Mean length and width over the last half: a fixed car, detections from its ellipse."""
    rng = np.random.default_rng(seed)
    X = extent_matrix(0.5, np.array([4.7, 1.8]))
    root = np.linalg.cholesky(X / 4 + 0.2**2 * np.eye(2))
    P = np.diag([0.2**2, 0.2**2, 1e-12, 1e-12, 1e-12])
    s = RMState(
        np.tile([0, 0, 0.5, 0, 0.0], (runs, 1)),
        np.tile(P, (runs, 1, 1)),
        np.full(runs, 26.0),
        np.tile(20 * X, (runs, 1, 1)),
    )
    sizes = []
    for _ in range(steps):
        s = s._replace(P=s.P + np.diag([0.05**2, 0.05**2, 0, 0, 0]), nu=6 + 0.97 * (s.nu - 6), V=0.97 * s.V)
        n = rng.poisson(8, runs)
        z = rng.standard_normal((runs, 30, 2)) @ root.T
        s, _ = filter.update(s, Scan.from_xy(z, np.arange(30) < n[:, None]))
        sizes.append(filter.estimate(s).size.mean(0))
    return np.mean(sizes[steps // 2 :], 0)


def test_extent_is_unbiased_on_ellipse_data():
    np.testing.assert_allclose(static_check(RandomMatrix()), [4.7, 1.8], rtol=0.02)


def test_a_scale_without_rho_is_caught():
    """With Y = X + R an independent implementation gives 2.35 x 0.90."""
    np.testing.assert_allclose(static_check(RandomMatrix(rho=1.0)), [2.35, 0.90], rtol=0.02)


def simulate(filter, runs, seed, sigma_v=1.5, steps=40, dt=0.1):
    """Position NEES (runs,) at the end of coordinated turns that follow the filter's own model."""
    rng = np.random.default_rng(seed)
    x = np.tile([0.0, 0, 0.2, 12, 0.1], (runs, 1))
    start = prior(
        x[:, :3] + rng.standard_normal((runs, 3)) * [0.5, 0.5, 0.1],
        velocity=np.zeros((runs, 2)),
        size=(4.7, 1.8),
        size_std=(0.2, 0.08),
    )
    state = filter.init(start)
    m = state.m.copy()
    m[:, 3:] = x[:, 3:] + rng.standard_normal((runs, 2)) * [1.0, 0.1]
    state = state._replace(m=m)
    for _ in range(steps):
        a, b = rng.standard_normal(runs) * sigma_v, rng.standard_normal(runs) * 0.1
        phi = x[:, 2]
        gain = np.stack([dt**2 / 2 * np.cos(phi) * a, dt**2 / 2 * np.sin(phi) * a, dt**2 / 2 * b, dt * a, dt * b], -1)
        x = coordinated_turn(x, dt)[0] + gain
        state = filter.predict(state, dt)
        root = np.linalg.cholesky(extent_matrix(x[:, 2], np.array([4.7, 1.8])) / 4 + 0.2**2 * np.eye(2))
        z = x[:, None, :2] + rng.standard_normal((runs, 20, 2)) @ root.mT
        state, _ = filter.update(state, Scan.from_xy(z, np.arange(20) < rng.poisson(6, runs)[:, None]))
    d = state.m[:, :2] - x[:, :2]
    return (d * np.linalg.solve(state.P[:, :2, :2], d[..., None])[..., 0]).sum(-1)


def mean_nees_within(nees, d, level=0.999):
    tail = (1 - level) / 2
    low, high = chi2.ppf([tail, 1 - tail], df=d * nees.size) / nees.size
    return low < nees.mean() < high


def test_centre_error_matches_its_covariance():
    assert mean_nees_within(simulate(RandomMatrix(), runs=500, seed=7), d=2)


def test_overconfident_filter_is_caught():
    assert not mean_nees_within(simulate(RandomMatrix(accel_std=0.1, sigma=0.01, rho=0.1), runs=500, seed=7), d=2)


def test_range_rates_give_speed_and_heading_of_a_passing_car():
    """Heading off by 0.1 rad and speed by 2 m/s are corrected by one scan of range rates, and stay without them."""
    velocity, pose = np.array([20.0, 0.0]), np.zeros(3)
    xy = np.array([10.0, 5.0]) + np.random.default_rng(0).uniform([-2, -0.9], [2, 0.9], (30, 2))
    scan = Scan.from_xy(xy)
    polar = scan.polar.copy()
    polar[:, 2] = (scan.sight * velocity).sum(-1)
    f = RandomMatrix()
    start = f.init(prior((10.0, 5.0, 0.1), velocity=(22.0, 2.2), heading_std=0.1, velocity_std=2.0))
    with_rate = f.estimate(f.update(start, scan._replace(polar=polar, pose=pose[None]))[0])
    without = f.estimate(f.update(start, scan)[0])
    assert np.hypot(*(with_rate.velocity - velocity)) < 0.6 * np.hypot(*(without.velocity - velocity))


def test_bad_input_is_named():
    f = RandomMatrix()
    state = f.init(prior((0.0, 0.0, 0.0)))
    with pytest.raises(ValueError, match="dt must be finite, >= 0"):
        f.predict(state, -0.1)
    with pytest.raises(ValueError, match="dt must be finite, >= 0"):
        f.predict(state, np.nan)
    with pytest.raises(ValueError, match=r"estimate\.cov must be positive definite"):
        f.init(prior((0.0, 0.0, 0.0))._replace(cov=np.zeros((4, 4))))
    with pytest.raises(ValueError, match=r"estimate\.pose must be finite"):
        f.init(prior((np.nan, 0.0, 0.0)))
    with pytest.raises(ValueError, match=r"estimate\.size must be positive"):
        f.init(prior((0.0, 0.0, 0.0), size=(0.0, 2.0)))


def test_unknown_names_and_parameters_are_answered_with_the_nearest():
    with pytest.raises(LookupError, match="did you mean 'rm-feldmann'"):
        find("rm-feldman")
    with pytest.raises(TypeError, match="has no parameter sigmma"):
        find("rm-feldmann", sigmma=1.0)
    assert find("rm-feldmann", sigma=0.5).sigma == 0.5


def test_moments_of_three_points_by_hand():
    n, mean, spread = moments(np.array([[0.0, 0], [2, 0], [1, 3], [9, 9]]), np.array([True, True, True, False]))
    assert n == 3
    np.testing.assert_allclose(mean, [1, 1])
    np.testing.assert_allclose(spread, [[2, 0], [0, 6]])
