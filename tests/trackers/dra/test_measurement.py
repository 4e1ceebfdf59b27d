"""Motion, regions, prior and measurement of data-region association: numbers, derivatives, printed errors."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackers import Scan
from trackers.dra import Parameters, ProcessNoise, motion
from trackers.dra.filter import root
from trackers.dra.measurement import flatten, linearise_regions, observe
from trackers.dra.regions import ALPHA, BETA, gates, ray_prior, region_moments, side_distance
from trackers.dra.state import OBSERVED, ORDER, P1, P2, PLACE, VELOCITY, W, along_velocity, rectangle, vertices
from trackers.linalg import inverse_and_det, inverse_and_log_det

X = np.array([20, 30, 0, 3, 1, 0, 0.1, 2.4, 0.9, 2.4, -0.9])
P = np.diag([0.25, 0.25, 0.01, 0.25, 0.25, 0.01, 0.01, 0.04, 0.04, 0.04, 0.04])
Z = np.array([[17.9, 0.03, 2.2], [18.6, -0.01, 2.3]])  # range, azimuth, range rate
NOISE = (0.1, 0.005, 0.027)
SCAN = Scan(Z, np.ones(2, bool), np.array([[0, 0, 0.1]]), np.array([[28, 0.5]]), np.array([NOISE]))
RECOMMENDED = Parameters()
PRINTED = Parameters(ct=ProcessNoise(0.5**2, 1e-6, 1e-4), turn_jacobian=False, rotating_ca=False)


def random_state(seed, lead=()):
    rng = np.random.default_rng(seed)
    m = rng.normal(0, 1, (*lead, 11)) * [10, 5, 1, 10, 5, 1, 0.3, 1, 1, 1, 1]
    m[..., 7:] = vertices(rng.uniform(-3, 3, lead), rng.uniform([2, 1], [12, 2.6], (*lead, 2)))
    return m


@pytest.mark.parametrize("model", ["cv", "ca", "ct"])
@pytest.mark.parametrize("rotating", [False, True])
@given(seed=st.integers(0, 2**32 - 1), w=st.sampled_from([0.0, 1e-5, 9.9e-4, 1.1e-3, 0.3, -2.0]))
def test_transitions_have_the_jacobian_of_finite_differences(model, rotating, seed, w):
    m, p = random_state(seed), replace(RECOMMENDED, rotating_ca=rotating)
    m[W] = w
    _, J = motion.transition(model, m, 0.1, p)
    step = 1e-5 * np.eye(11)
    numeric = [
        (motion.transition(model, m + d, 0.1, p)[0] - motion.transition(model, m - d, 0.1, p)[0]) / 2e-5 for d in step
    ]
    np.testing.assert_allclose(J, np.stack(numeric, -1), atol=1e-7)


def test_the_printed_covariance_of_a_turn_has_no_correlation_with_the_yaw_rate():
    """(22) with F alone, as printed: the yaw rate could be learned through range rates only."""
    _, printed = motion.predict("ct", X, P, 0.1, PRINTED)
    assert printed[4, W] == printed[7, W] == 0
    _, cov = motion.predict("ct", X, P, 0.1, replace(PRINTED, turn_jacobian=True))
    np.testing.assert_allclose(cov[4, 4], 0.342431, atol=1e-6)
    got = cov[[0, 4, 7], W]
    np.testing.assert_allclose(got, [-6.0e-5, 0.0299885, -0.00092395], atol=1e-7)


def test_a_turn_gives_the_state_of_an_independent_implementation():
    m, _ = motion.predict("ct", X, P, 0.1, PRINTED)
    want = [22.99945, 29.9885, 0, 3.114998, 1.299945, 0, 0.1, 2.39088, 0.923955, 2.40888, -0.875955]
    np.testing.assert_allclose(m, want, atol=5e-6)


@given(seed=st.integers(0, 2**32 - 1), T=st.floats(0.01, 1.0))
def test_a_turn_without_yaw_rate_is_constant_velocity_and_the_series_is_smooth(seed, T):
    m = random_state(seed)
    m[W] = 0
    p = replace(RECOMMENDED, rotating_ca=False)
    np.testing.assert_allclose(motion.transition("ct", m, T, p)[0], motion.transition("cv", m, T, p)[0], atol=1e-12)
    edge = motion.SMALL / T
    for low, high in zip(motion.turn(edge * (1 - 1e-9), T), motion.turn(edge * (1 + 1e-9), T), strict=True):
        np.testing.assert_allclose(low, high, rtol=1e-6, atol=1e-10)


def test_process_noise_of_one_step_is_the_printed_one():
    q = ProcessNoise(0.04, 1e-6, 1e-4)
    Gc = np.array([0.1**2 / 2, 0.1, 1])
    Q = motion.noise(q, 0.1, 0.1)
    np.testing.assert_allclose(Q[:3, :3], 0.04 * np.outer(Gc, Gc), rtol=1e-12)
    np.testing.assert_allclose(Q[3:6, 3:6], 0.04 * np.outer(Gc, Gc), rtol=1e-12)
    np.testing.assert_allclose(np.diag(Q)[6:], [1e-6] + 4 * [1e-4], rtol=1e-12)


def test_gates_grow_with_their_own_side():
    np.testing.assert_allclose(SCAN.xy, [[17.748958, 2.320451], [18.524721, 1.671741]], atol=1e-6)
    got = gates(X, SCAN.xy, SCAN.position_noise(), 0.15, 1.0, 0.0)
    np.testing.assert_array_equal(got, [[0, 1, 1, 0, 1], [0, 1, 0, 0, 0]])
    front = X[PLACE] + [[2.4 + 0.7, 0.0]]  # within 0.3 half lengths of the front, beyond 0.3 half widths
    assert gates(X, front, np.zeros((1, 2, 2)), 0.15, 1.0, 0.0)[0, 0]


def test_a_detection_far_from_all_gates_belongs_to_the_nearest_side():
    far = X[PLACE] + [[0.0, 40.0], [-30.0, 0.2], [-30.0, 20.0]]
    got = gates(X, far, np.zeros((3, 2, 2)), 0.15, 1.0, 0.0)
    np.testing.assert_array_equal(got, [[0, 0, 0, 1, 0], [0, 0, 1, 0, 0], [0, 0, 1, 0, 0]])


def test_distances_from_the_sides_are_in_oblique_coordinates():
    """Of a body of 4 by 2 m: beside its left, off the rear left corner, and in the middle; front, right, rear, left."""
    e, half = np.array([[0.5, -5.0, 0.0], [3.0, 5.0, 0.0]]), np.array([[2.0], [1.0]])
    want = [[np.hypot(1.5, 2), 4, np.hypot(2.5, 2), 2], [np.hypot(7, 4), np.hypot(6, 3), 5, 5], [2, 1, 2, 1]]
    np.testing.assert_allclose(side_distance(e, half), want, rtol=1e-12)


def test_region_moments_are_those_of_points_drawn():
    rng = np.random.default_rng(0)
    s = np.concatenate([np.ones((100_000, 1)), rng.random((100_000, 2))], -1)
    q = (s @ ALPHA.T)[..., None] * X[P1] + (s @ BETA.T)[..., None] * X[P2]
    mean, cov = region_moments(X)
    np.testing.assert_allclose(q.mean(0), mean, atol=0.02)
    np.testing.assert_allclose([np.cov(q[:, i].T) for i in range(5)], cov, atol=0.02)


@pytest.mark.parametrize(
    ("place", "want"),
    [
        ((20, 0), (0.078598, 0.010701, 0.6, 0.010701, 0.3)),
        ((20, 3), (0.063329, 0.121743, 0.478257, 0.036671, 0.3)),
        ((2, 10), (0.013495, 0.6, 0.001466, 0.085038, 0.3)),
    ],
)
def test_the_prior_of_rays_is_that_of_an_independent_implementation(place, want):
    m = X.copy()
    m[PLACE] = place
    np.testing.assert_allclose(ray_prior(m, np.zeros(2), 0.6, 0.1), want, atol=1e-6)


@given(seed=st.integers(0, 2**32 - 1))
def test_the_prior_of_rays_sums_to_one_and_is_even_inside_and_the_same_in_a_mirror(seed):
    m, sensor = random_state(seed), np.random.default_rng(seed).normal(0, 20, 2)
    got = ray_prior(m, sensor, 0.6, 0.1)
    np.testing.assert_allclose(got.sum(), 1, rtol=1e-12)
    np.testing.assert_allclose(ray_prior(m, m[PLACE], 0.6, 0.1), 0.2)
    flip = np.tile([1.0, -1.0], 2)
    mirrored = m.copy()
    mirrored[[3, 8, 10]] *= -1
    mirrored[7:] = mirrored[[9, 10, 7, 8]]
    other = ray_prior(mirrored, sensor * flip[:2], 0.6, 0.1)
    np.testing.assert_allclose(other, got[[0, 3, 2, 1, 4]], rtol=1e-9)


def test_points_of_the_regions_are_measured_as_by_an_independent_implementation():
    weight = np.array([1, 0.25, 0.6])
    q = (ALPHA @ weight)[:, None] * X[P1] + (BETA @ weight)[:, None] * X[P2]
    _, flat = flatten(SCAN, NOISE)
    body = X[None, None, None, None]
    q = q.reshape(1, 1, 1, 5, 1, 2)
    h = observe(q, body[..., None, PLACE], body[..., None, VELOCITY], body[..., None, W], flat)[0, 0, 0, :, :, 0]
    want = [
        (22.544678, 2.115577, 0.013351),
        (18.916924, 2.119266, 0.011241),
        (17.934952, 1.968503, 0.093568),
        (21.555742, 1.990653, 0.081928),
        (19.822535, 2.003830, 0.074935),
    ]
    np.testing.assert_allclose(h, want, atol=1e-6)


def test_the_range_rate_is_the_derivative_of_the_range_of_a_turning_point():
    """The Doppler term w J q of (7), the sensor's own motion included."""
    ps, vs, step = np.array([1.0, -2.0]), np.array([28.0, 0.5]), 1e-5
    q = np.array([2.4, -0.9])

    def distance(t):
        turn = X[W] * t
        R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        return np.hypot(*(X[PLACE] + t * X[VELOCITY] + R @ q - ps - t * vs))

    scan = SCAN._replace(pose=np.array([[*ps, 0.1]]))
    _, flat = flatten(scan, NOISE)
    body = X[None, None, None, None, None]
    h = observe(q.reshape(1, 1, 1, 1, 1, 2), body[..., PLACE], body[..., VELOCITY], body[..., W], flat)
    np.testing.assert_allclose(h[0, 0, 0, 0, 1, 0], (distance(step) - distance(-step)) / (2 * step), rtol=1e-6)


def test_unscented_moments_are_those_of_an_independent_implementation():
    _, flat = flatten(SCAN, NOISE)
    got = linearise_regions(X[None, None], root(X, P)[None, None], flat)
    want = [(17.868753, 2.013832, 0.068693), (20.237512, 2.049547, 0.049492)]
    np.testing.assert_allclose(got.zbar[0, 0, 0, [2, 4]], want, atol=1e-6)
    S = (got.D @ got.D.mT + got.B)[0, 0, 0, 2]
    rear = [[0.287873, -0.004682, 0.002485], [-0.004682, 0.255435, -0.001710], [0.002485, -0.001710, 0.001693]]
    np.testing.assert_allclose(S, rear, atol=1e-6)


def test_unscented_moments_become_jacobians_of_each_detection_s_own_sensor():
    """With a small covariance D L^-1 is the derivative of h; by finite differences, two sensors in one scan."""
    pose, velocity = np.array([[0, 0, 0.1], [30.0, 12.0, -2.0]]), np.array([[28, 0.5], [-3.0, 1.0]])
    _, flat = flatten(SCAN._replace(pose=pose, velocity=velocity), NOISE)
    L = 1e-5 * np.eye(11)[:, ORDER]
    D = linearise_regions(X[None, None], L[None, None], flat).D[0, 0] / 1e-5
    q = lambda x: (ALPHA @ [1, 0.5, 0.5])[:, None] * x[P1] + (BETA @ [1, 0.5, 0.5])[:, None] * x[P2]  # noqa: E731

    def h(x):
        b = x[None, None, None, None, None]
        return observe(q(x).reshape(1, 1, 1, 5, 1, 2), b[..., PLACE], b[..., VELOCITY], b[..., W], flat)[0, 0, ..., 0]

    numeric = np.stack([(h(X + d) - h(X - d)) / 2e-6 for d in 1e-6 * np.eye(11)[ORDER[:OBSERVED]]], -1)
    assert D.shape == (2, 5, 3, 9)
    np.testing.assert_allclose(D, numeric, atol=2e-6)


def test_the_root_is_one_and_turns_with_the_world():
    rng = np.random.default_rng(1)
    A = rng.normal(0, 1, (11, 11))
    C, m = A @ A.T, random_state(1)
    L = root(m, C)
    np.testing.assert_allclose(L @ L.T, C, rtol=1e-9, atol=1e-9)
    T = np.eye(11)
    for i, j in ((0, 3), (1, 4), (2, 5), (7, 8), (9, 10)):
        T[np.ix_([i, j], [i, j])] = [[0, -1], [1, 0]]
    np.testing.assert_allclose(root(T @ m, T @ C @ T.T), T @ L, rtol=1e-7, atol=1e-9)


def test_a_rectangle_stays_and_a_sheared_body_becomes_one():
    m, cov = rectangle(X, P, 1e-3)
    np.testing.assert_allclose(m, X, atol=1e-12)
    sheared = X + np.array([0] * 7 + [0.3, 0, -0.3, 0])
    for _ in range(5):
        sheared, cov = rectangle(sheared, P, 1e-3)
    np.testing.assert_allclose(sheared[P1] @ sheared[P1], sheared[P2] @ sheared[P2], atol=1e-3)
    np.linalg.cholesky(cov)


def test_the_heading_follows_the_velocity_when_it_moves_and_not_at_standstill():
    m = X.copy()
    m[VELOCITY] = 30 * np.array([np.cos(0.1), np.sin(0.1)])
    fast, _ = along_velocity(m, P, 0.03, 0.0)
    turned = np.arctan2(*(fast[P1] + fast[P2])[::-1])
    assert 0.02 < turned < 0.1
    m[VELOCITY] = [0.0, 0.01]  # across the body, by noise
    slow, cov = along_velocity(
        m, np.diag([0.25, 1e-2, 0.01, 0.25, 1e-2, 0.01, 0.01, 1e-3, 1e-3, 1e-3, 1e-3]), 0.03, 0.0
    )
    assert abs(np.arctan2(*(slow[P1] + slow[P2])[::-1])) < 0.01
    np.linalg.cholesky(cov)


@given(seed=st.integers(0, 2**32 - 1))
def test_small_inverses_are_those_of_lapack(seed):
    A = np.random.default_rng(seed).normal(0, 1, (4, 3, 3))
    A = A @ A.mT + 0.01 * np.eye(3)
    inverse, log_det = inverse_and_log_det(A)
    np.testing.assert_allclose(inverse, np.linalg.inv(A), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(log_det, np.linalg.slogdet(A)[1], rtol=1e-8, atol=1e-8)
    first, det = inverse_and_det(A.reshape(4, 9).T)
    np.testing.assert_allclose(first.T.reshape(4, 3, 3), inverse, rtol=1e-12)
    np.testing.assert_allclose(np.log(det), log_det, rtol=1e-12, atol=1e-12)


def test_detections_of_one_sensor_are_a_group_and_those_without_a_rate_another():
    polar = np.array([[9.0, 0.1, 2.0], [5.0, 0.2, 1.0], [7.0, 0.0, np.nan], [np.nan] * 3, [6.0, 0.1, 3.0]])
    pose = np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [1, 1, 1]])
    scan = Scan(polar, np.array([1, 1, 1, 0, 1], bool), pose, np.zeros((1, 2)))
    hit, flat = flatten(scan, NOISE)
    np.testing.assert_array_equal(hit, [0])
    np.testing.assert_array_equal(flat.z[0, :, 0], [5, 6, 7, 9])
    assert flat.group[0, 0] == flat.group[0, 3]
    assert len(set(flat.group[0])) == flat.measured.shape[1] == 3
    assert not flat.measured[0, flat.group[0, 2]]
    np.testing.assert_array_equal(flat.pose[0, flat.group[0, 1]], [1, 1, 1])
