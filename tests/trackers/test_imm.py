"""Interacting models by their identities and against a loop."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackers import Scan, find, prior
from trackers.imm import chain, mix, moments, reweight


def random_mixture(seed, lead=(), K=3, n=5):
    rng = np.random.default_rng(seed)
    A = rng.normal(0, 1, (*lead, K, n, n))
    mu = rng.dirichlet(np.ones(K), lead)
    return rng.normal(0, 3, (*lead, K, n)), A @ A.mT + 0.1 * np.eye(n), mu


def random_chain(seed, K=3):
    return np.random.default_rng(seed).dirichlet(np.ones(K), K)


@given(seed=st.integers(0, 2**32 - 1))
def test_mixing_keeps_mean_and_covariance_of_the_whole(seed):
    m, P, mu = random_mixture(seed, (2,))
    mixed = mix(m, P, mu, random_chain(seed))
    for before, after in zip(moments(m, P, mu), moments(*mixed), strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(mixed[2].sum(-1), 1, rtol=1e-12)


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


@given(seed=st.integers(0, 2**32 - 1), scale=st.sampled_from([1.0, 1e3, 1e6]))
def test_probabilities_sum_to_one_and_none_is_lost(seed, scale):
    rng = np.random.default_rng(seed)
    mu = reweight(rng.dirichlet(np.ones(3), 4), -scale * rng.random((4, 3)))
    np.testing.assert_allclose(mu.sum(-1), 1, rtol=1e-12)
    assert mu.min() > 0.99e-8


def test_an_identity_chain_mixes_nothing_and_one_model_stays_alone():
    m, P, mu = random_mixture(1, (2,))
    for got, want in zip(mix(m, P, mu, chain(3, 1.0, 5.0)), (m, P, mu), strict=True):
        np.testing.assert_allclose(got, want, rtol=1e-12, atol=1e-12)
    m, P, mu = random_mixture(1, K=1)
    for got, want in zip(mix(m, P, mu, chain(1, 0.3, 1.0)), (m, P, mu), strict=True):
        np.testing.assert_allclose(got, want, rtol=1e-12, atol=1e-12)


def test_models_are_weighed_by_the_likelihood_of_all_detections():
    """One update of three models side by side gives each the weight that it would have by itself."""
    f = find("edra-imm")
    xy = np.array([10.0, 5.0]) + np.random.default_rng(0).uniform([-2, -0.9], [2, 0.9], (6, 2))
    start, scan = prior((10.0, 5.0, 0.1), velocity=(22.0, 2.2)), Scan.from_xy(xy, noise=(0.1, 0.01, 0.1))
    state, _ = f.update(f.init(start), scan)
    alone = [find("edra-imm", models=(k,)) for k in f.models]
    log_c1 = [g.update(g.init(start), scan)[1].log_likelihood for g in alone]
    np.testing.assert_allclose(state.mu, reweight(np.full(3, 1 / 3), np.array(log_c1)), rtol=1e-9)


def test_a_probability_to_stay_that_makes_no_chain_is_refused():
    with pytest.raises(ValueError, match="stay must lie between"):
        chain(3, 0.3, 1.0)
