"""Symmetric 2 x 2 matrices as columns xx, xy, yy (..., 3, K), and points (..., 2, K): thousands at the cost of few."""

import numpy as np
from numpy.typing import NDArray


def upright(xx: NDArray, xy: NDArray, yy: NDArray) -> NDArray:
    """Columns (..., 3, K) of their entries (..., K); `np.stack` costs several times as much."""
    S = np.empty((*xx.shape[:-1], 3, xx.shape[-1]))
    S[..., 0, :], S[..., 1, :], S[..., 2, :] = xx, xy, yy
    return S


def columns(A: NDArray) -> NDArray:
    """Columns (..., 3, K) of matrices A (..., K, 2, 2)."""
    return upright(A[..., 0, 0], A[..., 0, 1], A[..., 1, 1])


def matrices(S: NDArray) -> NDArray:
    """Matrices (..., K, 2, 2) of columns S (..., 3, K); the inverse of `columns`."""
    xx, xy, yy = S[..., 0, :], S[..., 1, :], S[..., 2, :]
    return np.stack([xx, xy, xy, yy], -1).reshape(*xx.shape, 2, 2)


def determinant(S: NDArray) -> NDArray:
    """Determinants (..., K)."""
    return S[..., 0, :] * S[..., 2, :] - S[..., 1, :] * S[..., 1, :]


def congruence(A: NDArray) -> NDArray:
    """The map (..., 3, 3) that takes the columns of Sigma to those of A Sigma A^T, A (..., 2, 2)."""
    a, b, c, d = A[..., 0, 0], A[..., 0, 1], A[..., 1, 0], A[..., 1, 1]
    K = np.empty((*A.shape[:-2], 3, 3))
    K[..., 0, 0], K[..., 0, 1], K[..., 0, 2] = a * a, 2 * a * b, b * b
    K[..., 1, 0], K[..., 1, 1], K[..., 1, 2] = a * c, a * d + b * c, b * d
    K[..., 2, 0], K[..., 2, 1], K[..., 2, 2] = c * c, 2 * c * d, d * d
    return K


def polar_noise(along: NDArray, across: NDArray, sight: NDArray) -> NDArray:
    """Covariances (..., 3, M) [m^2] of variances along and across (..., M) the lines of sight (..., M, 2)."""
    c, s = sight[..., 0], sight[..., 1]
    difference = along - across
    return upright(across + difference * c * c, difference * c * s, across + difference * s * s)


def squares(s: NDArray) -> NDArray:
    """What scales columns (..., 3, 1) from the unit frame to sizes s (..., 2)."""
    return np.stack([s[..., 0] ** 2, s[..., 0] * s[..., 1], s[..., 1] ** 2], -1)[..., None]
