"""Small dense matrices in compiled code: loops over 7 x 7 entries cost less there than one call of a library."""

import numpy as np
from numba import njit

compiled = njit(cache=True, error_model="numpy")  # of all kernels; kept on disk, and a division by 0 is inf as in numpy


@compiled
def times(A, B):
    """A B."""
    C = np.zeros((A.shape[0], B.shape[1]))
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            for j in range(B.shape[1]):
                C[i, j] += A[i, k] * B[k, j]
    return C


@compiled
def congruent(A, B):
    """A B A^T of a symmetric B, symmetric to the last digit."""
    C = times(times(A, B), A.T)
    return (C + C.T) / 2


@compiled
def root(P):
    """Lower triangular L with L L^T = P, and whether P is definite."""
    n = len(P)
    L = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            rest = P[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            if i > j:
                L[i, j] = rest / L[j, j]
            elif rest > 0:
                L[i, i] = np.sqrt(rest)
            else:
                return L, False
    return L, True


@compiled
def solved(A, B):
    """A^-1 B by elimination with pivots, and log |det A|, -inf for a singular A; A and B stay as they are."""
    A, X, n, log_det = A.copy(), B.copy(), len(A), 0.0
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        if A[best, k] == 0.0 or np.isnan(A[best, k]):
            return X, -np.inf
        if best != k:
            for j in range(n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
            for j in range(X.shape[1]):
                X[k, j], X[best, j] = X[best, j], X[k, j]
        log_det += np.log(abs(A[k, k]))
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            for j in range(k + 1, n):
                A[i, j] -= factor * A[k, j]
            for j in range(X.shape[1]):
                X[i, j] -= factor * X[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(X.shape[1]):
            for i in range(k + 1, n):
                X[k, j] -= A[k, i] * X[i, j]
            X[k, j] /= A[k, k]
    return X, log_det


@compiled
def wrapped(angle):
    """Angle in [-pi, pi) [rad]."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
