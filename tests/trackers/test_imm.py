"""The interacting multiple model by its identities, over filters of two kinds, and against a loop."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trackers import Scan, find, prior
from trackers.htg.map import HTGMap
from trackers.imm import IMM, chain, mix, moments, reweight

SLOW, FAST = HTGMap(yaw_accel_std=0.02), HTGMap(yaw_accel_std=0.5)


def random_mixture(seed, lead=(), K=3, n=5):
    rng = np.random.default_rng(seed)
    A = rng.normal(0, 1, (*lead, K, n, n))
    mu = rng.dirichlet(np.ones(K), lead)
    return rng.normal(0, 3, (*lead, K, n)), A @ A.mT + 0.1 * np.eye(n), mu


def random_chain(seed, K=3):
    return np.random.default_rng(seed).dirichlet(np.ones(K), K)


def start_and_scan():
    xy = np.array([10.0, 5.0]) + np.random.default_rng(0).uniform([-2, -0.9], [2, 0.9], (6, 2))
    return prior((10.0, 5.0, 0.1), velocity=(22.0, 2.2)), Scan.from_xy(xy, noise=(0.1, 0.01, 0.1))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_mixing_keeps_mean_and_covariance_of_the_whole(seed):
    m, P, mu = random_mixture(seed, (2,))
    mixed = mix(m, P, mu, random_chain(seed))
    for before, after in zip(moments(m, P, mu), moments(*mixed), strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(mixed[2].sum(-1), 1, rtol=1e-12)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_mixing_equals_a_loop_with_the_weights_inside_the_sum(seed):
    m, P, mu = random_mixture(seed)
    Pi = random_chain(seed)
    m0, P0, c = mix(m, P, mu, Pi)
    for j in range(3):
        w = [Pi[i, j] * mu[i] / sum(Pi[k, j] * mu[k] for k in range(3)) for i in range(3)]
        mean = sum(w[i] * m[i] for i in range(3))
        cov = sum(w[i] * (P[i] + np.outer(m[i] - mean, m[i] - mean)) for i in range(3))
        np.testing.assert_allclose(m0[j], mean, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(P0[j], cov, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(c[j], sum(Pi[i, j] * mu[i] for i in range(3)), rtol=1e-12)


def test_the_printed_mixing_with_the_weights_outside_the_sum_loses_the_whole():
    """(30) as printed: one weight before the sum over i; even the trace of the mixture is not kept."""
    m, P, mu = random_mixture(3)
    Pi = random_chain(3)
    m0, _, c = mix(m, P, mu, Pi)
    w = Pi * mu[:, None] / c
    printed = np.stack([w[j, j] * sum(P[i] + np.outer(m[i] - m0[j], m[i] - m0[j]) for i in range(3)) for j in range(3)])
    assert abs(np.trace(moments(m0, printed, c)[1]) / np.trace(moments(m, P, mu)[1]) - 1) > 0.05


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_names_of_the_modes_do_not_matter(seed):
    m, P, mu = random_mixture(seed)
    Pi, order = random_chain(seed), np.random.default_rng(seed).permutation(3)
    plain = mix(m, P, mu, Pi)
    other = mix(m[order], P[order], mu[order], Pi[np.ix_(order, order)])
    for a, b in zip(plain, other, strict=True):
        np.testing.assert_allclose(a[order], b, rtol=1e-9, atol=1e-12)


def test_what_a_model_lacks_the_other_keeps():
    m, P, mu = random_mixture(5, n=4)
    own = np.ones((3, 4), bool)
    own[0, 2:] = False
    m[0, 2:] = 0.0
    m0, P0, _ = mix(m, P, mu, np.array([[0.0, 1, 0], [0, 1, 0], [0, 0, 1]]), own)
    w = mu[:2] / mu[:2].sum()
    np.testing.assert_allclose(m0[1], [*(w @ m[:2, :2]), *m[1, 2:]], rtol=1e-9)
    np.testing.assert_allclose(P0[1, 2:, 2:], P[1, 2:, 2:], rtol=1e-9)
    np.linalg.cholesky(P0[1:])  # nothing goes into the first


def test_angles_are_mixed_around_the_circle():
    m, P, mu = np.array([[np.pi - 0.1], [0.3 - np.pi]]), np.full((2, 1, 1), 0.01), np.array([0.5, 0.5])
    mean, cov = moments(m, P, mu, angles=(0,))
    np.testing.assert_allclose(np.cos(mean - (np.pi + 0.1)), 1, atol=1e-12)
    np.testing.assert_allclose(cov, 0.01 + 0.2**2)


def test_the_chain_is_a_power_of_one_step_and_the_identity_without_time():
    one = chain(3, 0.9, 1.0)
    np.testing.assert_allclose(one, 0.85 * np.eye(3) + 0.05)
    np.testing.assert_allclose(chain(3, 0.9, 4.0), np.linalg.matrix_power(one, 4), rtol=1e-12)
    np.testing.assert_array_equal(chain(3, 0.9, 0.0), np.eye(3))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), scale=st.sampled_from([1.0, 1e3, 1e6]))
def test_probabilities_sum_to_one_and_none_is_lost(seed, scale):
    rng = np.random.default_rng(seed)
    mu = reweight(rng.dirichlet(np.ones(3), 4), -scale * rng.random((4, 3)))
    np.testing.assert_allclose(mu.sum(-1), 1, rtol=1e-12)
    assert mu.min() > 0.99e-8


def test_one_model_is_the_filter():
    start, scan = start_and_scan()
    imm = IMM((SLOW,), angles=(2,))
    state, info = imm.update(imm.predict(imm.init(start), 0.1), scan)
    alone, alone_info = SLOW.update(SLOW.predict(SLOW.init(start), 0.1), scan)
    np.testing.assert_allclose(state.models.m[0], alone.m, rtol=1e-9)
    np.testing.assert_allclose(state.models.P[0], alone.P, rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(info.nis, alone_info.nis, rtol=1e-9)


def test_an_identity_transition_is_a_bank_of_filters():
    start, scan = start_and_scan()
    imm = IMM((SLOW, FAST), stay=1.0, angles=(2,))
    state = imm.init(start)
    alone = [f.init(start) for f in imm.filters]
    for _ in range(3):
        state, _ = imm.update(imm.predict(state, 0.1), scan)
        alone = [f.update(f.predict(s, 0.1), scan)[0] for f, s in zip(imm.filters, alone, strict=True)]
    for k, s in enumerate(alone):
        np.testing.assert_allclose(state.models.m[k], s.m, rtol=1e-9)
        np.testing.assert_allclose(state.models.P[k], s.P, rtol=1e-6, atol=1e-10)


def test_a_batch_equals_the_loop_and_no_detection_leaves_the_prediction():
    imm = IMM((SLOW, FAST), angles=(2,))
    start, scan = start_and_scan()
    both = prior(np.stack([start.pose, start.pose + 0.3]), velocity=np.stack([start.velocity] * 2))
    state = imm.predict(imm.init(both), 0.1)
    got, info = imm.update(state, scan._replace(mask=np.array([[True] * 6, [False] * 6])))
    one = imm.update(imm.predict(imm.init(start), 0.1), scan)[0]
    np.testing.assert_allclose(got.models.m[0], one.models.m, rtol=1e-9)
    np.testing.assert_allclose(got.mu[0], one.mu, rtol=1e-9)
    np.testing.assert_array_equal(got.models.m[1], state.models.m[1])
    np.testing.assert_array_equal(got.mu[1], state.mu[1])
    assert np.isnan(info.nis[1])
    assert imm.estimate(got).pose.shape == (2, 3)


def test_interacting_data_regions_are_data_regions_with_interacting_models():
    """The likelihood of all detections that those filters tell is what weighs the modes."""
    f = find("edra-imm", parameters="literal")  # mixes all components
    imm = IMM(tuple(find("edra-imm", parameters="literal", models=(k,)) for k in f.models), stay=f.numbers.stay)
    start, scan = start_and_scan()
    state, _ = f.update(f.init(start), scan)
    banks = [g.update(g.init(start), scan) for g in imm.filters]
    want = reweight(np.full(3, 1 / 3), np.array([info.log_likelihood for _, info in banks]))
    np.testing.assert_allclose(state.mu, want, rtol=1e-9)


def test_bad_arguments_are_named():
    with pytest.raises(ValueError, match="stay must lie between"):
        IMM((SLOW, FAST), stay=0.3)
    with pytest.raises(ValueError, match="filters must name"):
        IMM(())
    with pytest.raises(ValueError, match="step must be positive"):
        IMM((SLOW, FAST), step=0.0)
    with pytest.raises(ValueError, match="dt must be >= 0"):
        IMM((SLOW, FAST)).predict(IMM((SLOW, FAST)).init(prior((0.0, 0.0, 0.0))), -1.0)
