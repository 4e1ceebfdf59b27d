"""The smoother against the batch solution, by the laws of every registered filter, and by statistics with a twin."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from testbed.check.draws import arrays
from trackers import TRACKERS, RandomMatrix, Scan, find, prior
from trackers.batch import stack, take
from trackers.composed import Composed
from trackers.filter import SMOOTHED, Abilities, Extent, Gaussian
from trackers.geometry import extent_matrix, rotation, to_world, unit, wrap_angle
from trackers.motion.turn import PHI, coordinated_turn, turn_noise
from trackers.smoother import smooth, smooth_extents, smooth_moments, smooth_stacked

DT, SIZE = 0.1, np.array([4.7, 1.85])
FILTERS = tuple(name for name in TRACKERS if not isinstance(find(name), Composed))


# -- a linear chain ---------------------------------------------------------------------------------------------------


class LinearState(NamedTuple):
    m: np.ndarray
    P: np.ndarray


class Linear:
    """Position and velocity on a line, a filter that the package does not know."""

    angles = ()

    def __init__(self, Q=0.3):
        self.Q = Q

    def gaussian(self, state):
        return Gaussian(state.m, state.P)

    def with_gaussian(self, state, gaussian):
        return state._replace(m=gaussian.m, P=gaussian.P)

    def predict(self, state, dt):
        F = np.array([[1, dt], [0, 1]])
        Q = self.Q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        return LinearState(state.m @ F.T, F @ state.P @ F.T + Q)

    def update(self, state, z, R=0.4):
        K = state.P[..., :, 0] / (state.P[..., 0, 0] + R)[..., None]
        m = state.m + K * (z - state.m[..., 0])[..., None]
        return LinearState(m, state.P - K[..., :, None] * state.P[..., None, 0, :])


def linear_run(seed, dt, lead=(), R=0.4):
    rng = np.random.default_rng(seed)
    f = Linear()
    state = LinearState(np.zeros((*lead, 2)), np.zeros((*lead, 2, 2)) + np.diag([4.0, 1.0]))
    z = rng.normal(0, 2, (len(dt) + 1, *lead))
    states = [f.update(state, z[0])]
    for k, step in enumerate(dt):
        states.append(f.update(f.predict(states[-1], step), z[k + 1]))
    return f, states, z


def batch_solution(z, dt, R=0.4):
    """Mean and covariance of all states (K, 2) at once: the information of prior, motion and measurements."""
    K, f = len(z), Linear()
    J, h = np.zeros((K, 2, K, 2)), np.zeros((K, 2))
    J[0, :, 0, :] = np.diag([1 / 4, 1.0])
    for k in range(K):
        J[k, 0, k, 0] += 1 / R
        h[k, 0] += z[k] / R
    for k, step in enumerate(dt):
        F = np.array([[1, step], [0, 1]])
        W = np.linalg.inv(f.predict(LinearState(np.zeros(2), np.zeros((2, 2))), step).P)
        J[k, :, k, :] += F.T @ W @ F
        J[k, :, k + 1, :] -= F.T @ W
        J[k + 1, :, k, :] -= W @ F
        J[k + 1, :, k + 1, :] += W
    cov = np.linalg.inv(J.reshape(2 * K, 2 * K))
    return (cov @ h.ravel()).reshape(K, 2), np.stack([cov[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in range(K)])


@given(seed=st.integers(0, 2**32 - 1))
def test_smoothing_a_linear_chain_is_the_batch_solution(seed):
    dt = np.random.default_rng(seed).choice([0.5, 1.0, 2.0], 12)
    f, states, z = linear_run(seed, dt)
    m, P = batch_solution(z, dt)
    got = stack(smooth(f, states, dt))
    np.testing.assert_allclose(got.m, m, atol=5e-12)  # the batch solution has lost more digits than the smoother
    np.testing.assert_allclose(got.P, P, atol=5e-13)


def test_smoothing_without_process_noise_is_not_the_batch_solution():
    """Eq. (10) of the paper as printed has no process noise."""
    dt = np.ones(12)
    f, states, z = linear_run(3, dt)
    m, P = (np.stack(c) for c in zip(*states, strict=True))
    F = np.array([[1.0, 1], [0, 1]])
    before = np.concatenate([m[:1], m[:-1]]), np.concatenate([P[:1], P[:-1]])
    bare = smooth_moments(m, P, before[0] @ F.T, F @ before[1] @ F.T, before[1] @ F.T)
    assert np.abs(bare[0] - batch_solution(z, dt)[0]).max() > 0.1


@pytest.mark.parametrize("lead", [(1,), (3, 2)])
def test_linear_chains_side_by_side_are_smoothed_as_one_at_a_time(lead):
    dt = np.array([0.5, 1.0, 0.5, 2.0])
    f, states, _ = linear_run(1, dt, lead)
    many = smooth(f, states, dt)
    for i in np.ndindex(lead):
        one = smooth(f, [LinearState(s.m[i], s.P[i]) for s in states], dt)
        for a, b in zip(many, one, strict=True):
            np.testing.assert_allclose(a.m[i], b.m, rtol=1e-12, atol=1e-13)
            np.testing.assert_allclose(a.P[i], b.P, rtol=1e-12, atol=1e-13)


def test_an_angle_that_was_wrapped_on_the_way_changes_nothing():
    """A track that starts again from its own estimate has a wrapped heading."""
    f, states, truth, _ = follow(RandomMatrix(), seed=2, heading=np.pi - 0.02)
    assert np.ptp(np.sign(wrap_angle(truth[:, PHI]))) == 2
    wrapped = [s._replace(m=np.where(np.arange(5) == PHI, wrap_angle(s.m), s.m)) for s in states]
    plain, other = (stack(smooth(f, s, DT)) for s in (states, wrapped))
    np.testing.assert_allclose(wrap_angle(plain.m[:, PHI] - other.m[:, PHI]), 0, atol=1e-9)
    np.testing.assert_allclose(plain.P, other.P, atol=1e-9)


# -- every registered filter ------------------------------------------------------------------------------------------


def motion(K, runs, rng, heading=0.3, accel_std=1.5, yaw_accel_std=0.1):
    """Truth (K, runs, 5) that moves as the random matrix thinks."""
    x = np.tile([20.0, -5.0, heading, 15.0, 0.05], (runs, 1))
    found = [x]
    for _ in range(K - 1):
        noise = turn_noise(x[:, PHI], DT, accel_std, yaw_accel_std) + 1e-14 * np.eye(5)
        x = coordinated_turn(x, DT)[0] + (np.linalg.cholesky(noise) @ rng.standard_normal((runs, 5, 1)))[..., 0]
        found.append(x)
    return np.stack(found)


def follow(filter, seed, K=40, runs=None, heading=0.3, missing=(15, 20)):
    """The filter, its states after each scan of bodies with even detections, and the truth."""
    rng = np.random.default_rng(seed)
    count = 1 if runs is None else runs
    x = motion(K, count, rng, heading)
    pose = x[0, :, :3] + rng.normal(0, [0.5, 0.5, 0.1], (count, 3))
    velocity = x[0, :, 3:4] * unit(x[0, :, 2]) + rng.normal(0, 1.0, (count, 2))
    shape = prior(pose, velocity, size=SIZE * rng.normal(1, 0.05, (count, 2)), size_std=0.05 * SIZE)
    root = np.linalg.cholesky(extent_matrix(x[..., PHI], SIZE) / 4 + 0.2**2 * np.eye(2))
    z = x[..., None, :2] + rng.standard_normal((K, count, 8, 2)) @ root.mT
    if runs is None:
        x, z, shape = x[:, 0], z[:, 0], take(shape, np.asarray(0))
    states, state = [], filter.init(shape)
    for k in range(K):
        state = filter.predict(state, DT) if k else state
        mask = np.full(z.shape[1:-1], not missing[0] <= k < missing[1])
        state, _ = filter.update(state, Scan.from_xy(z[k], mask))
        states.append(state)
    return filter, states, x, z


@pytest.mark.parametrize("name", FILTERS)
def test_every_filter_gets_states_of_its_own_kind_that_know_no_less(name):
    f, states, _, _ = follow(find(name), seed=3, runs=2)
    got = smooth(f, states, DT)
    assert len(got) == len(states)
    for a, b in zip(got, states, strict=True):
        assert [np.shape(x) for x in arrays(a)] == [np.shape(x) for x in arrays(b)]
    after = stack(got)
    value = np.linalg.eigvalsh(f.gaussian(after).P)
    assert (value > -1e-9 * value.max(-1, keepdims=True)).all()
    for a in arrays(f.estimate(after))[:8]:
        assert np.isfinite(a).all()
    last = zip(f.gaussian(got[-1]), f.gaussian(states[-1]), strict=True)
    for a, b in last:
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("name", FILTERS)
def test_every_filter_is_smoothed_side_by_side_as_alone(name):
    f, states, _, _ = follow(find(name), seed=4, runs=2, K=12, missing=(4, 6))
    many = stack(smooth(f, states, DT))
    for i in range(2):
        one = smooth(f, [take(s, np.asarray(i)) for s in states], DT)
        for a, b in zip(arrays(take_second(many, i)), arrays(stack(one)), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-8)  # roots of near-singular covariances


def take_second(state, i):
    """Row i of the second axis of every field."""
    return type(state)(*(take_second(x, i) if isinstance(x, tuple) else x if x is None else x[:, i] for x in state))


@pytest.mark.parametrize("name", FILTERS)
def test_scans_without_detections_at_the_end_change_nothing_before_them(name):
    f, states, _, _ = follow(find(name), seed=5, K=20, missing=(8, 11))
    more = [*states, f.predict(states[-1], DT)]
    more.append(f.predict(more[-1], DT))
    short, long = (f.gaussian(stack(smooth(f, s, DT)[: len(states) - 1])) for s in (states, more))
    # Mixing changes what a model lacks, and so the moments of the last state.
    mixes = Abilities.of(f).has("mixed") and f.mixed(states[0], DT) is not None
    tolerance = 0.02 if mixes else 1e-6
    np.testing.assert_allclose(long.m, short.m, atol=tolerance)
    np.testing.assert_allclose(long.P, short.P, atol=tolerance * np.abs(short.P).max())


@pytest.mark.parametrize("name", FILTERS)
def test_one_state_is_smoothed_already(name):
    f, states, _, _ = follow(find(name), seed=6, K=1)
    (got,) = smooth(f, states, DT)
    for a, b in zip(arrays(got), arrays(states[0]), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("name", ["rm-feldmann", "rm-koch", "htg-rm", "dra-imm"])
def test_smoothing_lowers_the_errors_of_place_and_velocity(name):
    f, states, x, _ = follow(find(name), seed=7, runs=None if name == "dra-imm" else 30)
    before, after = (f.estimate(stack(s)) for s in (states, smooth(f, states, DT)))
    for read in (lambda e: e.pose[..., :2] - x[..., :2], lambda e: e.velocity - x[..., 3:4] * unit(x[..., 2])):
        assert np.square(read(after)).mean() < 0.7 * np.square(read(before)).mean()


class PackedState(NamedTuple):
    numbers: np.ndarray  # (..., 6) position, velocity, and their covariances row by row


class Packed(Linear):
    """The same filter with a state of its own making."""

    def gaussian(self, state):
        return Gaussian(state.numbers[..., :2], state.numbers[..., 2:].reshape(*state.numbers.shape[:-1], 2, 2))

    def with_gaussian(self, state, gaussian):
        return PackedState(np.concatenate([gaussian.m, gaussian.P.reshape(*gaussian.m.shape[:-1], 4)], -1))

    def predict(self, state, dt):
        return self.with_gaussian(state, super().predict(LinearState(*self.gaussian(state)), dt))


def test_a_filter_is_smoothed_whatever_its_state_looks_like_if_it_is_smoothable():
    f, states, _ = linear_run(1, [0.1, 0.2, 0.1], lead=(2,))
    packed = Packed()
    want = stack(smooth(f, states, [0.1, 0.2, 0.1]))
    got = stack(smooth(packed, [packed.with_gaussian(None, s) for s in states], [0.1, 0.2, 0.1]))
    np.testing.assert_allclose(packed.gaussian(got).m, want.m, rtol=1e-12)
    np.testing.assert_allclose(packed.gaussian(got).P, want.P, rtol=1e-12)


@pytest.mark.parametrize("name", FILTERS)
def test_every_filter_of_the_catalogue_is_smoothable(name):
    assert Abilities.of(find(name)).has(*SMOOTHED)


def test_a_filter_that_is_not_smoothable_is_named():
    class Wild:
        pass

    with pytest.raises(TypeError, match="Wild must have angles, gaussian and with_gaussian to be smoothed"):
        smooth(Wild(), [LinearState(np.zeros(2), np.eye(2))], DT)


def test_no_state_and_times_that_do_not_fit_are_one_sentence():
    f, states, _ = linear_run(0, np.ones(3))
    with pytest.raises(ValueError, match="states must be at least one state, got none"):
        smooth(f, [], 1.0)
    with pytest.raises(ValueError, match=r"dt must be one number or 3 for 4 states, got shape \(4,\)"):
        smooth(f, states, np.ones(4))


# -- statistics -------------------------------------------------------------------------------------------------------


def nees(m, P, x):
    """Position NEES in the middle of the chains, one number a run."""
    d = (m - x)[..., :2]
    return (d * np.linalg.solve(P[..., :2, :2], d[..., None])[..., 0]).sum(-1)


def mean_nees_within(values, d, level=0.999):
    tail = (1 - level) / 2
    low, high = chi2.ppf([tail, 1 - tail], df=d * values.size) / values.size
    return low < values.mean() < high


@pytest.fixture(scope="module")
def bodies():
    return follow(RandomMatrix(), seed=8, runs=400, missing=(18, 22))


@pytest.mark.parametrize("k", [10, 20, 30])
def test_smoothed_errors_match_their_covariance(bodies, k):
    f, states, x, _ = bodies
    got = smooth(f, states, DT)[k]
    assert mean_nees_within(nees(got.m, got.P, x[k]), d=2)


def test_a_smoother_that_believes_in_less_process_noise_is_caught(bodies):
    _, states, x, _ = bodies
    got = smooth(RandomMatrix(accel_std=0.1, yaw_accel_std=0.01), states, DT)[20]
    assert not mean_nees_within(nees(got.m, got.P, x[20]), d=2)


def test_smoothed_sizes_are_nearer_to_the_truth(bodies):
    f, states, _, _ = bodies
    before, after = (f.estimate(stack(s)).size[:20] - SIZE for s in (states, smooth(f, states, DT)))
    assert (np.square(after).mean((0, 1)) < 0.75 * np.square(before).mean((0, 1))).all()


# -- extents and mixtures ---------------------------------------------------------------------------------------------


def test_a_smoothed_extent_has_seen_all_detections_past_and_future_with_the_weight_of_their_distance():
    rng = np.random.default_rng(0)
    share, n = 0.8, rng.integers(1, 9, 6).astype(float)
    X, turn = rng.normal(size=(6, 2, 2)), rng.normal(size=5)
    n[3] = 0.0
    X[3] = 0.0
    seen = X @ X.mT
    nu, V, expected = [n[0]], [seen[0]], []
    for k in range(5):
        R = rotation(turn[k])
        expected.append((share * nu[-1], share * R @ V[-1] @ R.T))
        nu.append(expected[-1][0] + n[k + 1])
        V.append(expected[-1][1] + seen[k + 1])
    angle = np.append(0.0, np.cumsum(turn))
    nu_expected, V_expected = (np.stack(c) for c in zip(*expected, strict=True))
    predicted = Extent(6 + nu_expected, V_expected, angle[1:], 6.0)
    got = smooth_extents(Extent(6 + np.stack(nu), np.stack(V), angle, 6.0), predicted)
    for k in range(6):
        weight = share ** np.abs(np.arange(6) - k)
        R = rotation(angle[k] - angle)
        np.testing.assert_allclose(got.nu[k], 6 + weight @ n, rtol=1e-12)
        np.testing.assert_allclose(got.V[k], (weight[:, None, None] * (R @ seen @ R.mT)).sum(0), atol=1e-12)


def test_models_that_are_all_alike_are_smoothed_as_one():
    f = find("dra")
    three = find("dra", models=("cv", "cv", "cv"))
    _, states, _, _ = follow(f, seed=9, K=12, missing=(4, 6))
    _, many, _, _ = follow(three, seed=9, K=12, missing=(4, 6))
    one, mixed = stack(smooth(f, states, DT)), stack(smooth(three, many, DT))
    want, got = f.gaussian(one), three.gaussian(mixed)
    np.testing.assert_allclose(got.m, want.m, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(got.P, want.P, rtol=1e-7, atol=1e-9)


def test_a_box_seen_at_last_is_turned_back_with_the_vehicle():
    """A turning vehicle whose extent becomes known at the end: the smoothed box keeps to the heading of its time."""
    f = RandomMatrix(accel_std=0.1, yaw_accel_std=0.01)
    pose = np.array([0.0, 0.0, 0.4])
    state = f.init(prior(pose, velocity=10 * unit(0.4), yaw_rate=0.5, size=(4.6, 1.9), size_std=(1.5, 0.6)))
    states = [state]
    for _ in range(10):
        states.append(f.predict(states[-1], DT))
    q = np.random.default_rng(0).uniform(-1, 1, (2000, 2))
    x = states[-1].m
    z = to_world(x[:3], q[(q**2).sum(-1) < 1] * SIZE / 2)
    states[-1], _ = f.update(states[-1], Scan.from_xy(z, noise=(0.01, 1e-4, 0.1)))
    first = f.estimate(smooth_stacked(f, stack(states), DT))
    np.testing.assert_allclose(first.size, np.broadcast_to(SIZE, (11, 2)), rtol=0.05)
