"""Closed forms of 2 x 2 matrices against the general ones."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from trackers.linalg import inverse, inverse_sqrtm, largest_eigenvalue, sqrtm


@given(seed=st.integers(0, 2**32 - 1))
def test_inverse_and_roots_are_those_of_eigenvalues(seed):
    rng = np.random.default_rng(seed)
    G = rng.standard_normal((3, 2, 2)) * 10 ** rng.uniform(-3, 3)
    A = G @ G.mT + 1e-3 * np.trace(G @ G.mT, axis1=-2, axis2=-1)[:, None, None] * np.eye(2)
    w, E = np.linalg.eigh(A)
    for function, power in ((inverse, -1), (inverse_sqrtm, -0.5), (sqrtm, 0.5)):
        expected = (E * w[:, None] ** power) @ E.mT
        np.testing.assert_allclose(function(A), expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@given(seed=st.integers(0, 2**32 - 1))
def test_the_larger_eigenvalue_is_that_of_the_general_solver(seed):
    rng = np.random.default_rng(seed)
    G = rng.standard_normal((3, 2, 2)) * 10 ** rng.uniform(-3, 3)
    A = G + G.mT
    expected = np.linalg.eigvalsh(A)
    # Near zero it is a difference of larger numbers: the other eigenvalue gives the scale.
    np.testing.assert_allclose(largest_eigenvalue(A), expected[:, 1], atol=1e-12 * np.abs(expected).max())
