"""Algebra of angles and of small symmetric matrices; work space and results are arrays that the caller has."""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.jit import compiled

SURE = 8.3  # beyond this the standard normal distribution is 1 to the last digit


@compiled
def wrap(angle: float) -> float:
    """Angle within [-pi, pi)."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


@compiled
def ndtr(x: float) -> float:
    """The standard normal distribution."""
    return 1.0 if x > SURE else 0.5 * math.erfc(-x * 0.7071067811865476)


@compiled
def bell(x: float) -> float:
    """The exponential of x, or 0 below e^-200: arithmetic of the smallest numbers takes a hundred times as long."""
    return math.exp(x) if x > -200.0 else 0.0


@compiled
def step(x: float) -> float:
    """The same to 1e-16, at less cost far from 0."""
    return 0.0 if x < -SURE else ndtr(x)


@compiled
def cholesky(A: NDArray, L: NDArray) -> bool:
    """L (n, n), lower triangular, of A = L L^T; false where A (n, n) is not positive definite."""
    n = len(A)
    for i in range(n):
        for j in range(n):
            s = A[i, j]
            for k in range(min(i, j)):
                s -= L[i, k] * L[j, k]
            if j > i:
                L[i, j] = 0.0
            elif j < i:
                L[i, j] = s / L[j, j]
            elif s > 0:
                L[i, i] = math.sqrt(s)
            else:
                return False
    return True


@compiled
def lower_inverse(L: NDArray, X: NDArray) -> None:
    """X = L^-1 of lower triangular matrices (n, n)."""
    for j in range(len(L)):
        for i in range(len(L)):
            s = 1.0 if i == j else 0.0
            for k in range(j, i):
                s -= L[i, k] * X[k, j]
            X[i, j] = s / L[i, i] if i >= j else 0.0


@compiled
def inverse(A: NDArray, out: NDArray) -> bool:
    """The inverse into out of a positive definite A (n, n); false where it is not."""
    n = len(A)
    L, X = np.empty((n, n)), np.empty((n, n))
    if not cholesky(A, L):
        return False
    lower_inverse(L, X)
    for i in range(n):
        for j in range(i + 1):
            s = 0.0
            for k in range(i, n):
                s += X[k, i] * X[k, j]
            out[i, j] = out[j, i] = s
    return True


@compiled
def solve(A: NDArray, B: NDArray) -> float:
    """B (n, m) becomes A^-1 B, A (n, n) is used up; the logarithm of |det A|."""
    n, m = B.shape
    log_det = 0.0
    for c in range(n):
        p = c
        for r in range(c + 1, n):
            if abs(A[r, c]) > abs(A[p, c]):
                p = r
        if p != c:
            for k in range(n):
                A[c, k], A[p, k] = A[p, k], A[c, k]
            for k in range(m):
                B[c, k], B[p, k] = B[p, k], B[c, k]
        log_det += math.log(abs(A[c, c]))
        for r in range(c + 1, n):
            f = A[r, c] / A[c, c]
            for k in range(c + 1, n):
                A[r, k] -= f * A[c, k]
            for k in range(m):
                B[r, k] -= f * B[c, k]
    for c in range(n - 1, -1, -1):
        for k in range(m):
            B[c, k] /= A[c, c]
        for r in range(c):
            for k in range(m):
                B[r, k] -= A[r, c] * B[c, k]
    return log_det


@compiled
def symmetrize(A: NDArray) -> None:
    """A (n, n) becomes its symmetric part."""
    for i in range(len(A)):
        for j in range(i):
            A[i, j] = A[j, i] = (A[i, j] + A[j, i]) / 2


@compiled
def transpose(A: NDArray, out: NDArray) -> None:
    """The transpose of A (n, n) into out."""
    for i in range(len(A)):
        for j in range(len(A)):
            out[i, j] = A[j, i]


@compiled
def product(A: NDArray, B: NDArray, out: NDArray) -> None:
    """The product A B into out, of square matrices (n, n)."""
    n = len(A)
    for i in range(n):
        for j in range(n):
            out[i, j] = 0.0
        for k in range(n):
            for j in range(n):
                out[i, j] += A[i, k] * B[k, j]


@compiled
def congruence(T: NDArray, A: NDArray, out: NDArray) -> None:
    """The product T A T^T into out, made symmetric, of square matrices (n, n)."""
    n = len(T)
    half = np.empty((n, n))
    product(T, A, half)
    for i in range(n):
        for j in range(n):
            s = 0.0
            for k in range(n):
                s += half[i, k] * T[j, k]
            out[i, j] = s
    symmetrize(out)
