"""htg-rm: the sides of its hole against plain loops, a reference vector, and what must not matter."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.special import log_ndtr, ndtr

from trackers import RandomMatrix, Scan, prior
from trackers.batch import take
from trackers.geometry import extent_matrix, to_world, unit
from trackers.htg.online import AXIS, SIGN, HTGOnline, OnlineState
from trackers.htg.sides import BoundProblem, fit
from trackers.random_matrix.feldmann import RMState

DETECTIONS = [(1.8, 1.0), (-1.5, -0.9), (2.2, 0.2), (-0.3, 1.1), (0.6, -0.6)]


def reference_state():
    """The prior of the reference vectors, which come from an independent implementation."""
    P = np.diag([0.25, 0.25, 0.01, 1.0, 0.01])
    P[0, 3] = P[3, 0] = 0.1
    P[1, 2] = P[2, 1] = 0.02
    return RMState(
        np.array([0.0, 0.0, 0.3, 10.0, 0.1]), P, np.array(26.0), 20 * extent_matrix(0.3, np.array([4.6, 1.9]))
    )


def root(A):
    w, E = np.linalg.eigh(A)
    return E @ np.diag(np.sqrt(w)) @ E.T


def bell(x):
    return np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi)


def hazard(x):
    return np.exp(-(x**2) / 2 - log_ndtr(-x)) / np.sqrt(2 * np.pi)


def best_bound(mu, g, sg, s, cap):
    """(HTG.23) by bisection: the root of the likelihood equation, or the end that it climbs to."""

    def slope(b):
        return g.sum() * hazard(b / s) / s - (g * hazard((b - mu) / sg)).sum() / sg

    if slope(0.0) <= 0:
        return 0.0
    return cap if slope(cap) >= 0 else brentq(slope, 0.0, cap, xtol=1e-14, rtol=1e-14)


def bounds_by_loops(f, z, centre, A, R, sensor, bounds):
    """(HTG.22) and (HTG.23) for one object: detections z (M, 2), bounds (4,)."""
    rho, s, into = f.rm.rho, np.sqrt(f.rm.rho), np.linalg.inv(A)
    r = np.diag(into @ R @ into.T)
    k, bounds = rho / (rho + r), bounds.copy()
    where = into @ (sensor - centre)
    facing = [i for i in range(4) if f.full_view or SIGN[i] * where[AXIS[i]] > 1] or list(range(4))
    share = dict.fromkeys(facing, 0.25)
    mu = {i: np.array([SIGN[i] * k[AXIS[i]] * (into @ (p - centre))[AXIS[i]] for p in z]) for i in facing}
    for _ in range(f.rounds):
        log_g = np.full((len(z), 4), -np.inf)
        for i in facing:
            sg = np.sqrt(k[AXIS[i]] * r[AXIS[i]])
            log_g[:, i] = np.log(share[i]) + log_ndtr((mu[i] - bounds[i]) / sg) - log_ndtr(-bounds[i] / s)
        g = np.exp(log_g - log_g.max(1, keepdims=True))
        g /= g.sum(1, keepdims=True)
        for i in facing:
            share[i] = (g[:, i].sum() + 0.1) / (len(z) + 0.4)
            if g[:, i].sum() >= f.least_weight:
                bounds[i] = best_bound(mu[i], g[:, i], np.sqrt(k[AXIS[i]] * r[AXIS[i]]), s, f.cap * s)
    return bounds, [bounds[i] if i in facing else np.inf for i in range(4)]


def interval(low, high):
    """Mass, mean and variance of the standard normal between two places."""
    mass = ndtr(high) - ndtr(low)
    if high - low < 1e-4:
        return mass, (low + high) / 2, (high - low) ** 2 / 12
    ends = [0.0 if np.isinf(x) else x * bell(x) for x in (low, high)]
    mean = (bell(low) - bell(high)) / mass
    return mass, mean, 1 + (ends[0] - ends[1]) / mass - mean**2


def frame(X, phi):
    w, E = np.linalg.eigh(X)
    i = np.abs(E.T @ unit(phi)).argmax()
    e = E[:, i] * np.sign(E[:, i] @ unit(phi))
    return np.stack([np.sqrt(w[i]) * e, np.sqrt(w[1 - i]) * np.array([-e[1], e[0]])], -1)


def update_by_loops(f, state, z, R, sensor):
    """(HTG.16) to (HTG.25) for one object without range rates."""
    m0, P0, nu0, V0 = state.rm
    bounds, n, s = state.bounds, len(z), np.sqrt(f.rm.rho)
    z_bar, Z = z.mean(0), (z - z.mean(0)).T @ (z - z.mean(0))
    X0 = V0 / (nu0 - 6)
    Y = f.rm.rho * X0 + R
    m, nu, V = m0, nu0, V0
    for _ in range(f.iterations):
        A = frame(V / (nu - 6), m[2])
        bounds, B = bounds_by_loops(f, z, m[:2], A, R, sensor, bounds)
        mass, mean, var = np.transpose([interval(-B[i] / s, B[i + 2] / s) for i in range(2)])
        c = max(1 - mass.prod(), 1e-3)
        z_c, C_c = m[:2] + A @ (s * mean), A @ np.diag(s**2 * var) @ A.T + R
        N, z_v = n / c, c * z_bar + (1 - c) * z_c
        spread = Z + n * np.outer(z_bar - z_v, z_bar - z_v) + (N - n) * (C_c + np.outer(z_c - z_v, z_c - z_v))
        S = P0[:2, :2] + Y / N
        eps = z_v - m0[:2]
        left, right = root(X0) @ np.linalg.inv(root(S)), root(X0) @ np.linalg.inv(root(Y))
        m, nu = m0 + P0[:, :2] @ np.linalg.inv(S) @ eps, nu0 + N
        V = V0 + np.outer(left @ eps, left @ eps) + right @ spread @ right.T
    S = P0[:2, :2] + Y / n
    P = P0 - P0[:, :2] @ np.linalg.inv(S) @ P0[:2]
    return m, P, nu0 + n, V / (nu - 6) * (nu0 + n - 6), bounds


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("full_view", [False, True])
def test_the_update_is_that_of_plain_loops(seed, full_view):
    """Random objects in one batch, some far from what the detections say, some padding; sensors on all sides."""
    rng = np.random.default_rng(seed)
    f = HTGOnline(full_view=full_view)
    T, M, noise = 5, 9, rng.uniform(0.05, 0.4)
    pose = np.stack([rng.uniform(-40, 40, T), rng.uniform(-20, 20, T), rng.uniform(-3, 3, T)], -1)
    states = f.init(prior(pose, velocity=(8.0, 1.0), size=rng.uniform((3.0, 1.5), (9.0, 2.5), (T, 2))))
    states = states._replace(bounds=rng.uniform(0.1, 1.1, (T, 4)))
    truth = pose + rng.normal(0, (0.4, 0.4, 0.1), (T, 3))
    u = rng.uniform(-1, 1, (T, M, 2))
    u[np.arange(T), :, rng.integers(0, 2, T)] = rng.choice([-1, 1], T)[:, None]  # one side of each
    z = to_world(truth, u * (2.3, 0.9) + rng.normal(0, noise, (T, M, 2)))
    mask = np.arange(M) < rng.integers(1, M + 1, T)[:, None]
    new, _ = replace(f, rm=replace(f.rm, sigma=noise)).update(states, Scan.from_xy(z, mask))
    for t in range(T):
        expected = update_by_loops(f, take(states, t), z[t, mask[t]], noise**2 * np.eye(2), np.zeros(2))
        for got, want in zip((*new.rm, new.bounds), expected, strict=True):
            np.testing.assert_allclose(got[t], want, rtol=1e-6, atol=1e-6)


def test_online_update_gives_the_reference_vector():
    f = HTGOnline(RandomMatrix(rho=0.25), iterations=5, n_count=False, full_view=True, cap=2.5)
    state, _ = f.update(OnlineState(reference_state(), np.full(4, 0.7)), Scan.from_xy(DETECTIONS))
    np.testing.assert_allclose(state.rm.m, [0.19271287, 0.18303033, 0.31464243, 10.07708515, 0.1], atol=1e-7)
    np.testing.assert_allclose(state.rm.nu, 48.89772382, atol=1e-6)
    np.testing.assert_allclose(state.bounds, [0.79890850, 0.69398944, 0.75005156, 0.96065047], atol=1e-6)


def front(t, sg, s):
    """Detections with sources at t (n,) outwards of the front of one object, which alone can be seen."""
    n = len(t)
    reach = np.tile(np.append(np.array(t) / sg, 0.0), (4, 1))
    scale = np.tile(np.append(np.full(n, 1 / sg), 1 / s), (4, 1))
    facing = np.array([[False], [False], [True], [False]])
    return BoundProblem(reach, scale, facing, np.zeros(n + 1, int), np.zeros(1, int))


@pytest.mark.parametrize(("t", "b"), [((0.9, 0.95, 0.7, 1.1), 0.7468971395), ((0.3, 0.2, 0.1, 0.15), 0.0)])
@pytest.mark.parametrize("start", [0.0, 0.7, 1.25])
def test_one_sided_bound_has_the_reference_value(t, b, start):
    k = 0.25 / 0.27
    sides = front(k * np.array(t), np.sqrt(k * 0.02), 0.5)
    got = fit(sides, np.full((4, 1), start), 1.25, 1, 0.3)
    np.testing.assert_allclose(got[2], b, atol=1e-9)
    assert (got[[0, 1, 3]] == start).all()  # cannot be seen


@given(
    t=st.lists(st.floats(-3, 6), min_size=1, max_size=6),
    sg=st.floats(0.005, 0.5),
    start=st.floats(0, 1.2),
)
def test_a_bound_is_the_top_of_its_likelihood_wherever_the_detections_are(t, sg, start):
    """Also hundreds of standard deviations away, where the tails leave the range of numbers."""
    s, cap = 0.55, 1.2
    b = fit(front(t, sg, s), np.full((4, 1), start), cap, 1, 0.3)[2, 0]

    def value(b):
        return (log_ndtr((np.array(t) - b) / sg) - log_ndtr(-b / s)).sum()

    near = np.clip(b + np.array([-1e-4, 1e-4]), 0, cap)
    assert 0 <= b <= cap
    assert (value(b) >= [value(x) - 1e-9 * abs(value(x)) for x in near]).all()


def test_a_start_where_the_slope_is_level_is_left():
    """Halley's own step is zero there, although it is not the top."""
    t, sg, s, cap = np.array([0.3, 1.1, 1.1, 1.1, 1.1]), 0.06, 0.55, 1.2

    def slope(b):
        return len(t) * hazard(b / s) / s - hazard((b - t) / sg).sum() / sg

    level = brentq(lambda b: (slope(b + 1e-5) - slope(b - 1e-5)) / 2e-5, 0.01, 0.6)
    b = fit(front(t, sg, s), np.full((4, 1), level), cap, 1, 0.3)[2, 0]
    assert abs(slope(b)) < 1e-6


def test_nothing_seen_leaves_every_row_as_it_came():
    f = HTGOnline()
    states = f.init(prior(np.array([[10.0, 0, 0], [20.0, 3, 0.1], [30.0, 0, 0]])))
    mask = np.array([[False] * 5, [True] * 5, [False] * 5])
    scan = Scan.from_xy(np.tile(np.array(DETECTIONS) + np.array([20.0, 3.0]), (3, 1, 1)), mask)
    new, info = f.update(states, scan)
    for t in (0, 2):
        for a, b in zip((*new.rm, new.bounds), (*states.rm, states.bounds), strict=True):
            np.testing.assert_array_equal(a[t], b[t])
    np.testing.assert_array_equal(np.isnan(info.nis), [True, False, True])
    assert new.rm.nu[1] == states.rm.nu[1] + 5
