"""Small matrix algebra on stacks of 2 x 2 and n x n matrices."""

import numpy as np
from numpy.typing import NDArray

I2 = np.eye(2)
# The cofactors of a 3 x 3 matrix with entries 0 1 2 / 3 4 5 / 6 7 8 are a[i] a[j] - a[k] a[l] for these i, j, k, l.
COFACTORS = np.array(
    [[4, 2, 1, 5, 0, 2, 3, 1, 0], [8, 7, 5, 6, 8, 3, 7, 6, 4], [5, 1, 2, 3, 2, 0, 4, 0, 1], [7, 8, 4, 8, 6, 5, 6, 7, 3]]
)
ROUNDING = 1e-13  # share of a covariance that rounding may take from the next one


def symmetrize(A: NDArray) -> NDArray:
    """Symmetric part of A (..., n, n); takes off rounding, not modelling errors."""
    return (A + A.mT) / 2


def outer(a: NDArray) -> NDArray:
    """A a^T (..., n, n) of vectors a (..., n)."""
    return a[..., :, None] * a[..., None, :]


def sqrtm(A: NDArray) -> NDArray:
    """Symmetric square root of symmetric positive semidefinite A (..., 2, 2)."""
    a, b, d = A[..., 0, 0], A[..., 0, 1], A[..., 1, 1]
    s = np.sqrt(np.maximum(a * d - b * b, 0.0))
    t = np.sqrt(a + d + 2 * s)
    return (A + s[..., None, None] * I2) / np.where(t > 0, t, 1.0)[..., None, None]


def largest_eigenvalue(A: NDArray) -> NDArray:
    """Larger eigenvalue (...) of symmetric A (..., 2, 2)."""
    a, b, d = A[..., 0, 0], A[..., 0, 1], A[..., 1, 1]
    return (a + d) / 2 + np.hypot((a - d) / 2, b)


def inverse(A: NDArray) -> NDArray:
    """Inverse of symmetric positive definite A (..., 2, 2)."""
    a, b, d = A[..., 0, 0], A[..., 0, 1], A[..., 1, 1]
    return ((a + d)[..., None, None] * I2 - A) / (a * d - b * b)[..., None, None]


def inverse_sqrtm(A: NDArray) -> NDArray:
    """Inverse of the symmetric square root of symmetric positive definite A (..., 2, 2)."""
    a, b, d = A[..., 0, 0], A[..., 0, 1], A[..., 1, 1]
    s = np.sqrt(a * d - b * b)
    t = a + d + s
    return (t[..., None, None] * I2 - A) / (s * np.sqrt(t + s))[..., None, None]


def quadratic(d: NDArray, A: NDArray) -> NDArray:
    """d^T A^-1 d (...) of vectors d (..., n) and positive definite A (..., n, n)."""
    return (d * np.linalg.solve(A, d[..., None])[..., 0]).sum(-1)


def root(P: NDArray) -> NDArray:
    """Lower triangular L (..., n, n) with L L^T = P, positive definite; where rounding took that away, `floored`."""
    try:
        return np.linalg.cholesky(P)
    except np.linalg.LinAlgError:
        return np.linalg.cholesky(floored(P, P))


def floored(P: NDArray, before: NDArray) -> NDArray:
    """Covariance P (..., n, n), definite again where rounding has made eigenvalues 0 or less; else as it came.

    The floor of the eigenvalues is `ROUNDING`, in units of the standard deviations of `before` (..., n, n), the
    covariance that P was computed from. A matrix that is not finite stays as it is.
    """
    try:
        np.linalg.cholesky(P)
        return P
    except np.linalg.LinAlgError:
        out = P.copy()
    square = (-1, *P.shape[-2:])
    for A, B in zip(out.reshape(square), before.reshape(square), strict=True):  # each alone: the others keep every bit
        try:
            np.linalg.cholesky(A)
        except np.linalg.LinAlgError:
            if np.isfinite(A).all():
                std = np.sqrt(np.maximum(B.diagonal(), max(ROUNDING * B.diagonal().max(), np.finfo(float).tiny)))
                value, vector = np.linalg.eigh(A / std[:, None] / std)
                A[:] = (vector * np.maximum(value, ROUNDING)) @ vector.T * std[:, None] * std
    return out


def inverse_and_log_det(A: NDArray) -> tuple[NDArray, NDArray]:
    """Inverse (..., 3, 3) and log determinant (...) of positive definite A (..., 3, 3); LAPACK costs several times."""
    a = A.reshape(*A.shape[:-2], 9)
    i, j, k, l = COFACTORS
    cofactors = a[..., i] * a[..., j] - a[..., k] * a[..., l]
    det = a[..., 0] * cofactors[..., 0] + a[..., 1] * cofactors[..., 3] + a[..., 2] * cofactors[..., 6]
    return (cofactors / det[..., None]).reshape(A.shape), np.log(det)


def inverse_and_det(A: NDArray) -> tuple[NDArray, NDArray]:
    """The same for entries first, A (9, ...): inverse (9, ...) and determinant (...)."""
    a = A.take(COFACTORS, axis=0)
    cofactors = a[0] * a[1]
    cofactors -= a[2] * a[3]
    det = np.add.reduce(A[:3] * cofactors[::3])
    cofactors /= det
    return cofactors, det
