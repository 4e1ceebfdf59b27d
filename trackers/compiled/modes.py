"""Motion modes of one body: mixing, motion, moments, and weights after an update.

Equations: docs/methods/interacting-models.md and motion-modes.md. m (K, 7) and P (K, 7, 7) of K modes with
probabilities mu (K,), as in `trackers.motion`.
"""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.jit import compiled
from trackers.compiled.linear import bell, symmetrize, wrap

PX, PY, PHI, SPEED, OMEGA, LENGTH, WIDTH = range(7)
LEAST = 1e-8  # probability of a mode
SLOW, LEAST_BOUND, FULL_TURN = 3.0, 1e-6, 0.3  # as in `trackers.motion.modes`


@compiled
def metres(s: float, log: bool) -> float:
    """Length or width [m] of a component of the state, which holds that or its logarithm."""
    return math.exp(s) if log else s


@compiled
def moments(m: NDArray, P: NDArray, mu: NDArray, mean: NDArray, cov: NDArray) -> None:
    """(IMM.13): mean (7,) and cov (7, 7) of the mixture, the heading about that of the most likely mode."""
    K, n = m.shape
    best = 0
    for k in range(K):
        if mu[k] > mu[best]:
            best = k
    about = m[best, PHI]
    d = np.empty((K, n))
    mean[:], cov[:] = 0.0, 0.0
    for k in range(K):
        for i in range(n):
            d[k, i] = wrap(m[k, i] - about) if i == PHI else m[k, i]
            mean[i] += mu[k] * d[k, i]
    for k in range(K):
        for i in range(n):
            d[k, i] -= mean[i]
        for i in range(n):
            for j in range(n):
                cov[i, j] += mu[k] * P[k, i, j] + mu[k] * d[k, i] * d[k, j]
    mean[PHI] += about
    symmetrize(cov)


@compiled
def begun(
    m: NDArray, P: NDArray, mu: NDArray, onset: NDArray, told: float, dt: float, stays: float, share: NDArray
) -> float:
    """(MODE.29): probabilities share (K,) that the modes begin from the first one within dt, and their sum.

    told is `Modes.told_std`, stays the probability to be in the first one still, by the chain.
    """
    nx, ny = -math.sin(m[0, PHI]), math.cos(m[0, PHI])
    across = nx * (P[0, PX, PX] * nx + P[0, PX, PY] * ny) + ny * (P[0, PY, PX] * nx + P[0, PY, PY] * ny)
    speed = total = 0.0
    for k in range(len(mu)):
        speed += mu[k] * m[k, SPEED]
        total += onset[k]
    slow = told**2 / (told**2 + across) * min(1.0, abs(speed) / SLOW)  # (MODE.33)
    some = min(1 - math.exp(-total * slow * dt), stays / 2)
    for k in range(len(mu)):
        share[k] = some * onset[k] * slow / max(total * slow, 1e-9)
    return share.sum()


@compiled
def mix(
    m: NDArray, P: NDArray, mu: NDArray, kept: float, onset: NDArray, told: float, dt: float, m_new: NDArray,
    P_new: NDArray, c: NDArray,
) -> None:  # fmt: skip
    """(IMM.9), (IMM.10), (MODE.29): the start of each mode and its predicted probability c (K,)."""
    K = len(mu)
    w, share = np.empty(K), np.empty(K)
    total = begun(m, P, mu, onset, told, dt, kept + (1 - kept) / K, share)
    for j in range(K):
        c[j] = 0.0
        for i in range(K):
            w[i] = (1 - kept) / K + (kept if i == j else 0.0) + (share[j] if i == 0 else 0.0)
            w[i] = (w[i] - (total if i == j == 0 else 0.0)) * mu[i]
            c[j] += w[i]
        for i in range(K):
            w[i] /= max(c[j], 2.2250738585072014e-308)
        moments(m, P, w, m_new[j], P_new[j])


@compiled
def possible(u: float, lateral: float, curvature: float, fast: float) -> float:
    """(MODE.6): variance of the yaw rate that a mean square speed u allows."""
    u = max(u, 1e-9)
    return min(curvature**2 * u, lateral**2 * min(1.0, fast**2 / u) / u)


@compiled
def move(
    m: NDArray, P: NDArray, dt: float, mode: NDArray, common: NDArray, size_walk: float, log: bool, bend: float
) -> float:
    """(MODE.2) to (MODE.7) of one mode, m (7,), P (7, 7) in place; returns (MODE.32), its log likelihood.

    mode (4,): speed_walk, yaw_walk, axle, lateral; common (5,) begins with curvature, slow_yaw, fast, bound_time.
    """
    curvature, slow_yaw, fast, bound_time = common[0], common[1], common[2], common[3]
    d, v, omega = mode[2] * metres(m[LENGTH], log), m[SPEED], m[OMEGA]
    x = omega * dt / 2
    if abs(x) < 1e-4:
        g, g1 = dt * (1 - x**2 / 6), dt**2 / 2 * (-x / 3)
    else:
        g, g1 = dt * math.sin(x) / x, dt**2 / 2 * (x * math.cos(x) - math.sin(x)) / x**2
    c, s = math.cos(m[PHI] + x), math.sin(m[PHI] + x)
    ex, ey = math.cos(m[PHI]), math.sin(m[PHI])
    fastest = math.sqrt(curvature**2 * (v**2 + P[SPEED, SPEED]) + slow_yaw**2)
    m[PHI] += omega * dt
    fx, fy = math.cos(m[PHI]), math.sin(m[PHI])
    m[PX] += v * g * c + d * (fx - ex)  # (RM.6), (MODE.2)
    m[PY] += v * g * s + d * (fy - ey)
    F = np.zeros((3, 7))  # rows of px, py, phi, less the identity
    F[PX, PHI], F[PY, PHI] = -v * g * s - d * (fy - ey), v * g * c + d * (fx - ex)  # (RM.7), (MODE.3)
    F[PX, SPEED], F[PY, SPEED], F[PHI, OMEGA] = g * c, g * s, dt
    F[PX, OMEGA] = v * (g1 * c - g * dt / 2 * s) - d * dt * fy
    F[PY, OMEGA] = v * (g1 * s + g * dt / 2 * c) + d * dt * fx
    for i in range(3):
        for j in range(7):
            P[i, j] += F[i, PHI] * P[PHI, j] + F[i, SPEED] * P[SPEED, j] + F[i, OMEGA] * P[OMEGA, j]
    for i in range(3):
        for j in range(7):
            P[j, i] += F[i, PHI] * P[j, PHI] + F[i, SPEED] * P[j, SPEED] + F[i, OMEGA] * P[j, OMEGA]
    walk = mode[1] * min(1.0, fastest / FULL_TURN)  # (MODE.5)
    speed = (dt / 2 * ex, dt / 2 * ey, 0.0, 1.0, 0.0)  # (MODE.4)
    yaw = (-d * dt / 2 * fy, d * dt / 2 * fx, dt / 2, 0.0, 1.0)
    for i in range(5):
        for j in range(5):
            P[i, j] += dt * (mode[0] ** 2 * speed[i] * speed[j] + walk**2 * yaw[i] * yaw[j])
    u = m[SPEED] ** 2 + P[SPEED, SPEED]
    bound = possible(u, mode[3], curvature, fast) + (slow_yaw**2 if u < SLOW**2 else 0.0)
    row, off = P[OMEGA] - bend * P[SPEED], m[OMEGA] - bend * m[SPEED]  # (MODE.34)
    S = row[OMEGA] - bend * row[SPEED] + max(bound, LEAST_BOUND) * bound_time / dt
    for i in range(7):
        m[i] -= row[i] / S * off  # (MODE.7)
        for j in range(7):
            P[i, j] -= row[i] / S * row[j]
    P[LENGTH, LENGTH] += size_walk**2 * dt  # (MODE.4)
    P[WIDTH, WIDTH] += size_walk**2 * dt
    symmetrize(P)
    return -0.5 * off**2 / S  # (MODE.32)


@compiled
def reweight(mu: NDArray, log_l: NDArray) -> None:
    """(IMM.12), (MODE.22): probabilities mu (K,) in place, by log likelihoods (K,), which are used up."""
    top, total = -np.inf, 0.0
    for k in range(len(mu)):
        log_l[k] += math.log(max(mu[k], LEAST))
        top = max(top, log_l[k])
    for k in range(len(mu)):
        mu[k] = bell(log_l[k] - top)
        total += mu[k]
    rest = 0.0
    for k in range(len(mu)):
        mu[k] = max(mu[k] / total, LEAST)
        rest += mu[k]
    for k in range(len(mu)):
        mu[k] /= rest


@compiled
def driven(m: NDArray, P: NDArray, mu: NDArray, dt: float) -> float:
    """(MODE.30): how far the body has driven for certain, forward positive."""
    ahead = 0.0
    for k in range(len(mu)):
        sure = max(abs(m[k, SPEED]) - 2 * math.sqrt(P[k, SPEED, SPEED]), 0.0)
        ahead += mu[k] * math.copysign(sure, m[k, SPEED])
    return ahead * dt


@compiled
def forward(
    m: NDArray, P: NDArray, mu: NDArray, ahead: float, backwards: float, backed: float, mean: NDArray, cov: NDArray
) -> float:
    """(MODE.9), (MODE.23): moments mean (7,), cov (7, 7) of the modes, turned round where the body would reverse.

    ahead is how far it has driven for certain, forward positive; returns that afterwards.
    """
    moments(m, P, mu, mean, cov)
    wrong = mean[SPEED] < -backwards and ahead < -backed
    if wrong and -mean[SPEED] > 3 * math.sqrt(cov[SPEED, SPEED]):
        ahead = 0.0
        for k in range(len(mu)):
            m[k, SPEED] *= -1
            m[k, PHI] += math.pi
            for i in range(7):
                P[k, SPEED, i] *= -1
            for i in range(7):
                P[k, i, SPEED] *= -1
        moments(m, P, mu, mean, cov)
    return ahead


@compiled
def pin(
    m: NDArray, P: NDArray, mu: NDArray, size: NDArray, size_std: NDArray, log: bool, shift: NDArray, course: float,
    mean: NDArray, cov: NDArray,
) -> None:  # fmt: skip
    """(MODE.27), (MODE.28): modes with size (2,) [m] of standard deviation size_std (2,), moved by shift (2,).

    mean (7,) and cov (7, 7) are the moments of the modes, before and after.
    """
    gain, more, s, std = np.empty(2), np.empty(2), size, size_std
    if log:
        s, std = np.log(size), size_std / size
    for a in range(2):
        before = cov[LENGTH + a, LENGTH + a]
        gain[a], more[a] = math.sqrt(min(std[a] ** 2 / before, 1.0)), max(std[a] ** 2 - before, 0.0)
    for k in range(len(m)):
        for a in range(2):
            b = LENGTH + a
            for i in range(7):
                P[k, b, i] *= gain[a]
            for i in range(7):
                P[k, i, b] *= gain[a]
            m[k, b] = s[a] + gain[a] * (m[k, b] - mean[b])
            P[k, b, b] += more[a]
        nx, ny = -math.sin(m[k, PHI]), math.cos(m[k, PHI])
        det = P[k, 0, 0] * P[k, 1, 1] - P[k, 0, 1] * P[k, 1, 0]
        gx, gy = (P[k, 1, 1] * nx - P[k, 0, 1] * ny) / det, (P[k, 0, 0] * ny - P[k, 1, 0] * nx) / det
        aside = nx * shift[0] + ny * shift[1]
        m[k, PX] += shift[0]
        m[k, PY] += shift[1]
        for i in range(PHI, LENGTH):
            m[k, i] += course * aside * (P[k, i, 0] * gx + P[k, i, 1] * gy)
    moments(m, P, mu, mean, cov)
