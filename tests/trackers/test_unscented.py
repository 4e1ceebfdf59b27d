"""The unscented transform by what it must get right: linear functions, angles, covariances at their limit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackers.geometry import wrap_angle
from trackers.unscented import STANDARD, Scaling, moments, root, sigma_points

SCALINGS = (STANDARD, Scaling(alpha=0.5, beta=0.0), Scaling(alpha=1e-3, kappa=-1.0))


def transform(f, m, P, scaling=STANDARD):
    X = sigma_points(m, P, scaling)
    return moments(X, f(X), scaling)


def gaussian(seed, lead=(), n=4):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((*lead, n, n))
    return rng.normal(0, 3, (*lead, n)), A @ A.mT + 0.1 * np.eye(n)


@given(seed=st.integers(0, 2**32 - 1), scaling=st.sampled_from(SCALINGS))
def test_moments_of_a_linear_function_are_exact(seed, scaling):
    m, P = gaussian(seed, (3,))
    F = np.random.default_rng(seed + 1).standard_normal((5, 4))
    got = transform(lambda x: x @ F.T, m, P, scaling)
    tolerance = 1e-11 / scaling.alpha**2  # weights of 1 / alpha^2 that cancel
    np.testing.assert_allclose(got.mean, m @ F.T, atol=tolerance)
    np.testing.assert_allclose(got.cov, F @ P @ F.T, atol=10 * tolerance)
    np.testing.assert_allclose(got.D, P @ F.T, atol=10 * tolerance)


def test_the_mean_of_a_square_is_exact_and_its_variance_with_beta_two():
    got = transform(np.square, np.array([3.0]), np.array([[0.25]]))
    np.testing.assert_allclose(got.mean, 9 + 0.25)
    np.testing.assert_allclose(got.cov, 4 * 9 * 0.25 + 2 * 0.25**2, rtol=1e-12)


@pytest.mark.parametrize("lead", [(), (1,), (3, 2)])
def test_many_at_once_equal_one_at_a_time(lead):
    m, P = gaussian(5, lead)
    got = transform(np.sin, m, P)
    for i in np.ndindex(lead):
        for many, one in zip(got, transform(np.sin, m[i], P[i]), strict=True):
            np.testing.assert_allclose(many[i], one, rtol=1e-12, atol=1e-14)


@given(turn=st.floats(-20, 20))
def test_wrapped_angles_have_the_moments_of_unwrapped_ones(turn):
    m, P = np.array([turn, 1.0]), np.array([[0.3, 0.1], [0.1, 0.2]])
    X = sigma_points(m, P)
    Y = X.copy()
    Y[:, 0] = wrap_angle(Y[:, 0])
    got, plain = moments(X, Y, angles=(0,)), moments(X, X)
    np.testing.assert_allclose(wrap_angle(got.mean - plain.mean), 0, atol=1e-9)
    np.testing.assert_allclose(got.cov, plain.cov, atol=1e-9)
    np.testing.assert_allclose(got.D, plain.D, atol=1e-9)


def test_a_covariance_that_lost_definiteness_has_a_root_and_its_neighbours_keep_theirs():
    _, P = gaussian(1, (3,))
    flat = P.copy()
    flat[1] = np.diag([1.0, 2.0, 0.0, -1e-17])
    L = root(flat)
    np.testing.assert_allclose(L @ L.mT, flat, atol=1e-13)
    np.testing.assert_allclose(L[[0, 2]], np.linalg.cholesky(P[[0, 2]]), atol=1e-13)
    assert (np.triu(L, 1) == 0).all()


def test_a_scaling_without_reach_is_one_sentence():
    with pytest.raises(ValueError, match=r"alpha and kappa must make alpha\^2 \(n \+ kappa\) positive, got -1"):
        sigma_points(*gaussian(0), Scaling(kappa=-5.0))
