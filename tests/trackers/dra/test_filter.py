"""Data-region association as filters: updates against loops, laws of all forms, limits, a body in shape."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import logsumexp

from trackers import Scan, find, prior
from trackers.batch import take
from trackers.dra import DataRegion, DataRegionState, Parameters, ProcessNoise
from trackers.dra.filter import root
from trackers.dra.measurement import flatten, linearise_regions
from trackers.dra.regions import ALPHA, BETA, gates
from trackers.geometry import rotation

X = np.array([20, 30, 0, 3, 1, 0, 0.1, 2.4, 0.9, 2.4, -0.9])
P = np.diag([0.25, 0.25, 0.01, 0.25, 0.25, 0.01, 0.01, 0.04, 0.04, 0.04, 0.04])
Z = np.array([[17.9, 0.03, 2.2], [18.6, -0.01, 2.3]])
NOISE = np.array([[0.1, 0.005, 0.027]])
SCAN = Scan(Z, np.ones(2, bool), np.array([[0, 0, 0.1]]), np.array([[28, 0.5]]), NOISE)
PRINTED = ProcessNoise(0.1**2, 1e-6, 1e-4)  # cv of the paper; no constraints, no gate
OPEN = Parameters(
    cv=PRINTED, gate=100.0, interior_gate=100.0, gate_sigmas=0.0, rectangle_std=np.inf, heading_std=np.inf
)
ALONE = DataRegion(models=("cv",), parameters=OPEN, prior="uniform")
STATE = DataRegionState(np.ones(1), X[None], P[None])


def drawn_scan(rng, m, sensor, speed, lead=(), M=6, regions=(0.06, 0.12, 0.48, 0.04, 0.3), noise=NOISE):
    """Detections of a body m (11,) by a sensor (3,) that moves at speed (2,)."""
    region = rng.choice(5, (*lead, M), p=regions)
    s = np.concatenate([np.ones((*lead, M, 1)), rng.random((*lead, M, 2))], -1)
    q = (ALPHA[region] * s).sum(-1)[..., None] * m[7:9] + (BETA[region] * s).sum(-1)[..., None] * m[9:]
    r = m[[0, 3]] + q - sensor[:2]
    relative = m[[1, 4]] + m[6] * np.stack([-q[..., 1], q[..., 0]], -1) - speed
    d = np.hypot(r[..., 0], r[..., 1])
    polar = np.stack([d, np.arctan2(r[..., 1], r[..., 0]) - sensor[2], (relative * r).sum(-1) / d], -1)
    polar = polar + rng.standard_normal(polar.shape) * noise
    return Scan(polar, np.ones((*lead, M), bool), sensor[None], np.asarray(speed, float)[None], noise)


@pytest.mark.parametrize(
    ("prior_of", "x", "y", "log_c1"),
    [("uniform", 20.052281, 2.513950, 0.663928), ("rays", 20.080857, 2.464093, 1.168414)],
)
def test_updates_are_those_of_an_independent_implementation(prior_of, x, y, log_c1):
    state, info = replace(ALONE, prior=prior_of).update(STATE, SCAN)
    np.testing.assert_allclose(state.m[0, [0, 3]], [x, y], atol=2e-6)
    np.testing.assert_allclose(info.log_likelihood, log_c1, atol=2e-6)


@given(seed=st.integers(0, 2**32 - 1), gate=st.sampled_from([0.05, 0.3, 100.0]))
def test_the_sequential_form_is_a_loop_over_detections_and_regions(seed, gate):
    """(DRA.22) with one matrix for each detection in each region that it may come from."""
    f = replace(ALONE, parameters=replace(OPEN, gate=gate, interior_gate=min(gate, 1.0)))
    scan = drawn_scan(np.random.default_rng(seed), X, np.array([0, 0, 0.1]), (28, 0.5), M=5)
    _, flat = flatten(scan, tuple(NOISE[0]))
    L = root(X, P)
    regions = linearise_regions(X[None, None], L[None, None], flat)
    zbar, D, B = regions.zbar[0, 0, 0], regions.D[0, 0, 0], regions.B[0, 0, 0]
    u, C, log_c1 = np.zeros(9), np.eye(9), 0.0
    for z, may in zip(flat.z[0], gates(X, flat.xy[0], flat.R_xy[0], gate, min(gate, 1.0), 0.0), strict=True):
        log_w, du, loss = [], [], []
        for i in np.nonzero(may)[0]:
            S, e = D[i] @ C @ D[i].T + B[i], z - zbar[i] - D[i] @ u
            K = C @ D[i].T @ np.linalg.inv(S)
            log_w.append(np.log(0.2) - 0.5 * (e @ np.linalg.solve(S, e) + np.linalg.slogdet(2 * np.pi * S)[1]))
            du.append(K @ e)
            loss.append(K @ D[i] @ C)
        w, du = np.exp(log_w - logsumexp(log_w)), np.array(du)
        d = du - w @ du
        u, C = u + w @ du, C - np.einsum("i,ijk->jk", w, loss) + np.einsum("i,ij,ik->jk", w, d, d)
        log_c1 += logsumexp(log_w)
    state, info = f.update(STATE, scan)
    rest = L[:, 9:] @ L[:, 9:].T
    np.testing.assert_allclose(state.m[0], X + L[:, :9] @ u, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(state.P[0], L[:, :9] @ C @ L[:, :9].T + rest, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(info.log_likelihood, log_c1, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("form", ["sequential", "soft"])
@given(seed=st.integers(0, 2**32 - 1))
def test_a_batch_with_different_gates_and_detections_is_a_loop_over_its_objects(form, seed):
    rng = np.random.default_rng(seed)
    f = find("edra-imm", form=form)
    start = prior(rng.normal((20, 3, 0), [0.5, 0.5, 0.05], (4, 3)), velocity=rng.normal((30, 1), 0.5, (4, 2)))
    scan = drawn_scan(rng, X, np.array([0, 0, 0.1]), (28, 0.5), (4,))
    scan = scan._replace(mask=rng.random((4, 6)) < [[1.0], [0.7], [0.3], [0.0]])
    state = f.init(start)
    together, info = f.update(state, scan)
    for b in range(4):
        alone, alone_info = f.update(take(state, b), scan._replace(polar=scan.polar[b], mask=scan.mask[b]))
        for x, y in zip((*take(together, b), info.log_likelihood[b]), (*alone, alone_info.log_likelihood), strict=True):
            np.testing.assert_allclose(x, y, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("form", ["sequential", "soft"])
@given(seed=st.integers(0, 2**32 - 1))
def test_order_and_padding_do_not_matter_to_any_form(form, seed):
    rng = np.random.default_rng(seed)
    f = find("edra-imm", form=form)
    scan = drawn_scan(rng, X, np.array([0, 0, 0.1]), (28, 0.5))
    polar = scan.polar.copy()
    polar[rng.random(6) < 0.3, 2] = np.nan
    state = f.init(prior((20.0, 3.0, 0.0), velocity=(30.0, 1.0)))
    plain, _ = f.update(state, scan._replace(polar=polar))
    order = rng.permutation(6)
    padded = np.concatenate([polar[order], np.full((2, 3), np.nan)])
    other, _ = f.update(state, scan._replace(polar=padded, mask=np.arange(8) < 6))
    for a, b in zip(plain, other, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-8, atol=1e-9)


def test_a_missing_range_rate_is_not_used():
    """The same as range rates with no information."""
    polar = SCAN.polar.copy()
    polar[:, 2] = np.nan
    without, _ = ALONE.update(STATE, SCAN._replace(polar=polar))
    vague, _ = ALONE.update(STATE, SCAN._replace(noise=NOISE * [1, 1, 1e6]))
    np.testing.assert_allclose(without.m, vague.m, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(without.P, vague.P, rtol=1e-6, atol=1e-9)


def test_every_detection_is_seen_by_its_own_sensor():
    """Two sensors in one scan are two scans of one sensor each, where the regions are certain."""
    narrow = replace(ALONE, parameters=replace(OPEN, gate=0.05, interior_gate=1e-3))
    rng = np.random.default_rng(4)
    kw = {"M": 1, "regions": (0, 0, 1, 0, 0), "noise": NOISE / 100}
    a = drawn_scan(rng, X, np.array([0, 0, 0.1]), (28, 0.5), **kw)
    b = drawn_scan(rng, X, np.array([10.0, -4.0, -0.4]), (3, 2.0), **kw)
    both = Scan(*(np.concatenate([x, y]) for x, y in zip(a[:5], b[:5], strict=True)))
    tight = DataRegionState(np.ones(1), X[None], 1e-4 * P[None])
    once, _ = narrow.update(tight, both)
    twice, _ = narrow.update(narrow.update(tight, a)[0], b)
    np.testing.assert_allclose(once.m, twice.m, atol=3e-3)  # linearised once or twice
    swapped, _ = narrow.update(tight, both._replace(pose=both.pose[::-1]))
    assert np.abs(swapped.m - once.m).max() > 1e-2


def test_modes_follow_a_braking_target():
    f, rng = find("edra-imm"), np.random.default_rng(0)
    x = np.array([0, 25, 0, 0, 0, 0, 0, 2.4, 0.9, 2.4, -0.9])
    state = f.init(prior((0.0, 0.0, 0.0), velocity=(25.0, 0.0)))
    modes = []
    for k in range(40):
        brake = -6.0 if k >= 20 else 0.0
        x[0] += 0.1 * x[1] + 0.005 * brake
        x[1] += 0.1 * brake
        scan = drawn_scan(rng, x, np.array([x[0] - 20, -5.0, 0.0]), (x[1], 0.0), M=8)
        state, info = f.update(f.predict(state, 0.1), scan)
        modes.append(info.mode)
    np.testing.assert_allclose(np.sum(modes, -1), 1, rtol=1e-12)
    assert np.mean([m[0] for m in modes[10:20]]) > 0.6
    assert np.max([m[1] for m in modes[20:26]]) > 0.5


def follow(f, seconds, seed, M=8, noise=(0.15, 0.01, 0.1)):
    """Estimates while following straight behind; every detection on the rear or inside, nothing gated."""
    rng, noise = np.random.default_rng(seed), np.array([noise])
    x = np.array([20, 25, 0, 0, 0, 0, 0, 2.4, 0.9, 2.4, -0.9])
    state = f.init(prior((20.3, 0.2, 0.02), velocity=(25.0, 0.0), size_std=(0.6, 0.2)))
    out = []
    for _ in range(round(seconds / 0.1)):
        x[0] += 2.5
        scan = drawn_scan(rng, x, np.array([x[0] - 20, 0, 0]), (25, 0), M=M, regions=(0, 0, 0.7, 0, 0.3), noise=noise)
        state, _ = f.update(f.predict(state, 0.1), scan)
        out.append(f.estimate(state))
    return x, out


@pytest.mark.parametrize("form", ["sequential", "soft"])
def test_a_minute_behind_a_car_neither_collapses_nor_turns_it(form):
    x, estimates = follow(find("edra-imm", form=form), 60, 3)
    size = np.array([e.size for e in estimates])
    assert size[:, 0].min() > 3.6
    assert size[:, 0].max() < 6.0
    assert size[:, 1].min() > 1.4
    assert size[:, 1].max() < 2.4
    assert max(abs(e.pose[2]) for e in estimates) < 0.1
    assert abs(estimates[-1].pose[1]) < 0.2


@pytest.mark.parametrize("form", ["sequential", "soft"])
def test_near_singular_covariances_and_bodies_give_finite_states(form):
    f = find("edra-imm", form=form)
    start = f.init(prior((20.0, 3.0, 0.0), velocity=(30.0, 1.0)))
    flat = start.m.copy()
    flat[..., 7:] = 0.0
    for m, P in ((start.m, 1e-12 * start.P), (flat, start.P)):
        state, _ = f.update(start._replace(m=m, P=P), SCAN)
        assert all(np.isfinite(a).all() for a in state)
        assert np.isfinite(f.estimate(state).size).all()


def test_thousands_of_detections_of_several_sensors_are_taken():
    f, rng = find("edra-imm", form="soft"), np.random.default_rng(0)
    scan = drawn_scan(rng, X, np.array([0, 0, 0.1]), (28, 0.5), M=3000)
    scan = scan._replace(pose=np.repeat(scan.pose, 3000, 0), velocity=np.repeat(scan.velocity, 3000, 0))
    state, info = f.update(f.init(prior((20.0, 3.0, 0.0), velocity=(30.0, 1.0))), scan)
    assert info.n == 3000
    np.testing.assert_allclose(f.estimate(state).pose[:2], X[[0, 3]], atol=0.3)


@given(seed=st.integers(0, 2**32 - 1), grow=st.floats(0.7, 1.5), spread=st.floats(0.5, 2.0))
def test_resizing_changes_the_size_and_nothing_else(seed, grow, spread):
    rng = np.random.default_rng(seed)
    f = find("edra-imm")
    start = prior(rng.normal(0, 10, (2, 3)), velocity=rng.normal(0, 10, (2, 2)))
    state = f.init(start)
    before = f.estimate(state)
    size = before.size * grow
    after = f.estimate(f.resize(state, size, before.size_std * spread))
    np.testing.assert_allclose(after.size, size, rtol=1e-9)
    std = before.size_std * spread
    std[:, 0] = np.maximum(std[:, 0], f.numbers.least_length_std * size[:, 0])  # (DRA.39)
    np.testing.assert_allclose(after.size_std, std, rtol=1e-6)
    for name in ("pose", "velocity", "cov", "heading_std", "yaw_rate_std"):
        np.testing.assert_allclose(getattr(after, name), getattr(before, name), rtol=1e-6, atol=1e-9)


def test_directions_known_far_better_than_others_have_deviations_above_their_rounding():
    for heading in np.random.default_rng(8).uniform(-np.pi, np.pi, 50):
        m, wide = X.copy(), P.copy()
        along = rotation(heading)[:, 0]
        m[7:] = (m[7:].reshape(2, 2) @ rotation(heading).T).ravel()
        v = np.concatenate([along, along])  # the length only
        wide[7:, 7:] = 1e11 * v[:, None] * v
        estimate = ALONE.estimate(STATE._replace(m=m[None], P=wide[None]))
        assert (estimate.size_std > 0).all()
        assert estimate.heading_std > 0


def test_bad_parameters_are_named():
    for kw, match in (
        ({"models": ("cv", "cx")}, "models must be some of"),
        ({"prior": "ray"}, "prior must be one of"),
        ({"form": "parallel"}, "form must be one of"),
        ({"parameters": "papers"}, "parameters must be one of"),
        ({"passes": 0}, "passes must be a whole number > 0"),
        ({"parameters": Parameters(stay=0.2)}, "stay must lie between"),
    ):
        with pytest.raises(ValueError, match=match):
            DataRegion(**kw)


def test_the_body_is_where_the_detections_are_after_a_quarter_turn():
    """At pi/20 rad/s the extent turns with the velocity."""
    f, rng = find("edra-imm"), np.random.default_rng(5)
    x = np.array([0, 15, 0, 0, 0, 0, np.pi / 20, 2.4, 0.9, 2.4, -0.9])
    state = f.init(prior((0.0, 0.0, 0.0), velocity=(15.0, 0.0), yaw_rate=0.0))
    turn = rotation(np.pi / 20 * 0.1)
    for _ in range(100):
        for i, j in ((1, 4), (7, 8), (9, 10)):
            x[[i, j]] = turn @ x[[i, j]]
        x[[0, 3]] += 0.1 * x[[1, 4]]
        sensor = np.array([*(x[[0, 3]] - [18, 12]), 0.0])
        state, _ = f.update(
            f.predict(state, 0.1), drawn_scan(rng, x, sensor, (15, 0), M=10, regions=(0.1, 0.2, 0.2, 0.2, 0.3))
        )
    estimate = f.estimate(state)
    np.testing.assert_allclose(estimate.pose[2], np.pi / 2, atol=0.05)
    np.testing.assert_allclose(estimate.size, [4.8, 1.8], atol=0.3)
    np.testing.assert_allclose(estimate.yaw_rate, np.pi / 20, atol=0.03)
