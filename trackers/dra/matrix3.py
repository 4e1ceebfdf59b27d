"""Inverse and determinant of stacks of symmetric 3 x 3 matrices; LAPACK costs several times as much."""

import numpy as np
from numpy.typing import NDArray

# The cofactors of a matrix with entries 0 1 2 / 3 4 5 / 6 7 8 are A[I] A[J] - A[K] A[L].
I, J = [4, 2, 1, 5, 0, 2, 3, 1, 0], [8, 7, 5, 6, 8, 3, 7, 6, 4]
K, L = [5, 1, 2, 3, 2, 0, 4, 0, 1], [7, 8, 4, 8, 6, 5, 6, 7, 3]
FACTORS = np.array([I, J, K, L])


def inverse_and_log_det(A: NDArray) -> tuple[NDArray, NDArray]:
    """Inverse (..., 3, 3) and log determinant (...) of symmetric positive definite A (..., 3, 3), by cofactors."""
    a = A.reshape(*A.shape[:-2], 9)
    cofactors = a[..., I] * a[..., J] - a[..., K] * a[..., L]
    det = a[..., 0] * cofactors[..., 0] + a[..., 1] * cofactors[..., 3] + a[..., 2] * cofactors[..., 6]
    return (cofactors / det[..., None]).reshape(A.shape), np.log(det)


def inverse_and_det(A: NDArray) -> tuple[NDArray, NDArray]:
    """Inverse (9, ...) and determinant (...) of symmetric positive definite A (9, ...), entries first, by cofactors."""
    a = A.take(FACTORS, axis=0)
    cofactors = a[0] * a[1]
    cofactors -= a[2] * a[3]
    det = np.add.reduce(A[:3] * cofactors[::3])
    cofactors /= det
    return cofactors, det
