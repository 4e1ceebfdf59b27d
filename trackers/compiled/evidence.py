"""What a spatial update and the range rates say of the motion modes; docs/methods/motion-modes.md, sections 3 and 4."""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.jit import compiled
from trackers.compiled.linear import (
    cholesky,
    congruence,
    inverse,
    lower_inverse,
    product,
    solve,
    symmetrize,
    transpose,
    wrap,
)
from trackers.compiled.modes import LENGTH, OMEGA, PHI, SPEED, WIDTH, forward, metres, reweight
from trackers.compiled.tables import POSE, RANGE, RATE, RATE_ACROSS, RATE_STD, UX, UY

LOST, LEAST_SIZE = -0.1, 0.8  # as in `trackers.motion.places` and `.mixture`


@compiled
def likelihood(m: NDArray, P: NDArray, m_new: NDArray, P_new: NDArray, s: NDArray, Lam: NDArray) -> float:
    """(MODE.10), (MODE.11): score s (7,) and information Lam (7, 7) of an update; its least share, inf without one."""
    n = len(m)
    L, T, A, B = np.zeros((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    if not cholesky(P, L) or not inverse(P_new, A):
        return np.inf
    transpose(L, T)
    congruence(T, A, B)
    for i in range(n):
        B[i, i] -= 1.0
    value, U = np.linalg.eigh(B)  # (MODE.11)
    lower_inverse(L, T)
    X = np.empty((n, n))
    transpose(T, X)
    product(X, U, A)  # V
    for i in range(n):
        s[i] = 0.0
        for j in range(n):
            Lam[i, j] = B[i, j] = 0.0
            for k in range(n):
                Lam[i, j] += A[i, k] * max(value[k], 0.0) * A[j, k]
                B[i, j] += X[i, k] * X[j, k]
    symmetrize(Lam)
    for i in range(n):
        for j in range(n):
            s[i] += (Lam[i, j] + B[i, j]) * (m_new[j] - m[j])  # (MODE.10)
    return value[0]


@compiled
def inform(m: NDArray, P: NDArray, J: NDArray, y: NDArray) -> float:
    """M (7,), P (7, 7) in place by information J (7, 7) and score y (7,) at m; the log likelihood of this."""
    n, log_l = len(m), 0.0
    A, B = np.empty((n, n)), P.copy()
    product(P, J, A)
    for i in range(n):
        A[i, i] += 1.0
    log_det = solve(A, B)
    symmetrize(B)
    P[:] = B
    for i in range(n):
        step = 0.0
        for j in range(n):
            step += B[i, j] * y[j]
        m[i] += step
        log_l += 0.5 * y[i] * step
    return log_l - 0.5 * log_det


@compiled
def correct(m: NDArray, P: NDArray, about: NDArray, s: NDArray, Lam: NDArray) -> float:
    """(MODE.12), (MODE.13): m (7,), P (7, 7) of one mode in place by a likelihood about a mean (7,); its log."""
    n, log_l = len(m), 0.0
    delta, rest = m - about, s.copy()
    delta[PHI] = wrap(delta[PHI])
    for i in range(n):
        pull = 0.0
        for j in range(n):
            pull += Lam[i, j] * delta[j]
        rest[i] -= pull
        log_l += s[i] * delta[i] - 0.5 * delta[i] * pull
    return log_l + inform(m, P, Lam, rest)


@compiled
def rates(
    mu: NDArray, m: NDArray, P: NDArray, log: bool, axle: NDArray, z: NDArray, settings: NDArray, log_l: NDArray
) -> None:
    """(MODE.14) to (MODE.21): all modes in place by the range rates of detections z; adds to log_l (K,).

    settings: std, common_std, clip.
    """
    K, M, own_std, common_std, clip = len(mu), len(z), settings[0], settings[1], settings[2]
    r, h, w, yaw, t = np.zeros((K, M)), np.zeros((K, M, 5)), np.zeros(M), 0.0, 1 / common_std**2
    unknown = np.zeros(M)
    for k in range(K):
        ex, ey, v, omega = math.cos(m[k, PHI]), math.sin(m[k, PHI]), m[k, SPEED], m[k, OMEGA]
        l, b = metres(m[k, LENGTH], log), metres(m[k, WIDTH], log)
        d = axle[k] * l
        yaw += mu[k] * (omega**2 + P[k, OMEGA, OMEGA])
        for i in range(M):
            if not math.isfinite(z[i, RATE]):
                continue
            ux, uy = z[i, UX], z[i, UY]
            lx, ly = z[i, POSE] + z[i, RANGE] * ux - m[k, 0], z[i, POSE + 1] + z[i, RANGE] * uy - m[k, 1]
            along, aside = ux * ex + uy * ey, uy * ex - ux * ey
            half = 0.5 * (abs(aside) * l + abs(along) * b)
            spread = half**2 / 3  # (MODE.16)
            gain = spread / max(spread + z[i, RATE_ACROSS] ** 2, 1e-9)  # (MODE.16)
            h[k, i, 0], h[k, i, 1], h[k, i, SPEED] = -gain * omega * uy, gain * omega * ux, along  # (MODE.15)
            h[k, i, PHI] = v * aside - omega * d * along
            h[k, i, OMEGA] = gain * (lx * uy - ly * ux) + d * aside
            r[k, i] = z[i, RATE] - v * along - omega * h[k, i, OMEGA]  # (MODE.14)
            unknown[i] += mu[k] * (1 - gain) * spread
    for i in range(M):
        if not math.isfinite(z[i, RATE]):
            continue
        variance, least = z[i, RATE_STD] ** 2 + own_std**2 + yaw * unknown[i], np.inf  # (MODE.17)
        for k in range(K):
            S = variance + common_std**2
            for a in range(5):
                for b in range(5):
                    S += h[k, i, a] * P[k, a, b] * h[k, i, b]
            least = min(least, r[k, i] ** 2 / S)
        w[i] = min(1.0, clip / max(math.sqrt(least), 1e-9)) / variance  # (MODE.18)
        t += w[i]
    J, y, wh = np.zeros((7, 7)), np.zeros(7), np.zeros(5)
    for k in range(K):
        J[:], y[:], wh[:] = 0.0, 0.0, 0.0
        rr = q = 0.0
        for i in range(M):
            rr += w[i] * r[k, i]
            q += w[i] * r[k, i] ** 2
            for c in range(5):
                wh[c] += w[i] * h[k, i, c]
                y[c] += w[i] * h[k, i, c] * r[k, i]
                for b in range(5):
                    J[c, b] += w[i] * h[k, i, c] * h[k, i, b]
        for c in range(5):
            y[c] -= wh[c] * rr / t  # (MODE.19)
            for b in range(5):
                J[c, b] -= wh[c] * wh[b] / t
        log_l[k] += inform(m[k], P[k], J, y) - 0.5 * (q - rr**2 / t)  # (MODE.20), (MODE.21)


@compiled
def positive(m: NDArray, log: bool) -> None:
    """Modes m (K, 7) in place with sizes of `LEAST_SIZE` at least."""
    if not log:
        for k in range(len(m)):
            m[k, LENGTH], m[k, WIDTH] = max(m[k, LENGTH], LEAST_SIZE), max(m[k, WIDTH], LEAST_SIZE)


@compiled
def move(
    mu: NDArray, m: NDArray, P: NDArray, log: bool, mean: NDArray, cov: NDArray, m_new: NDArray, P_new: NDArray,
    axle: NDArray, z: NDArray, settings: NDArray, ahead: NDArray,
) -> bool:  # fmt: skip
    """(MODE.10) to (MODE.23): modes in place, after the place's filter took their moments to m_new (7,), P_new (7, 7).

    mean (7,) and cov (7, 7) are the moments, before and after; ahead (1,) [m] driven. settings (5,): std,
    common_std, clip, backwards, backed. False where something is not definite.
    """
    s, Lam, log_l, measured = np.empty(7), np.empty((7, 7)), np.zeros(len(mu)), False
    least = likelihood(mean, cov, m_new, P_new, s, Lam)
    if least == np.inf:
        return False
    for k in range(len(mu)):
        if least < LOST:
            m[k], P[k] = m_new, P_new
        else:
            log_l[k] = correct(m[k], P[k], mean, s, Lam)
    positive(m, log)
    for i in range(len(z)):
        measured |= math.isfinite(z[i, RATE])
    if measured:
        rates(mu, m, P, log, axle, z, settings, log_l)
        positive(m, log)
    reweight(mu, log_l)
    ahead[0] = forward(m, P, mu, ahead[0], settings[3], settings[4], mean, cov)
    return True
