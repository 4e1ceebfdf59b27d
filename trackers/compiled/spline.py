"""The spatial update of pmht-spline, one object after the other: what `trackers.pmht` does for a batch.

Equations: docs/methods/spline-pmht.md. The numpy form is the reference; functions here are named after theirs.
"""

from typing import NamedTuple

import numpy as np

from trackers.compiled.algebra import compiled, congruent, root, solved, times
from trackers.pmht.association import LEAST_WEIGHT, LOG_2PI
from trackers.pmht.joint import REACH, WEIGHTS, WEIGHTS_MEAN
from trackers.pmht.state import LEAST_SIZE

LEAST_DENSITY = 1e-300
WEIGHT_FIRST, WEIGHT_OTHER, WEIGHT_MEAN = float(WEIGHTS[0, 0]), float(WEIGHTS[1, 0]), float(WEIGHTS_MEAN[1])


class Rules(NamedTuple):
    """Parameters of `SplinePmht`."""

    iterations: int
    sigma: float
    widened: float
    eps: float
    unseen: float
    lost_below: float
    interior: float
    rays: bool  # weights by what the sensors see


class Body(NamedTuple):
    """One object before the update."""

    m: np.ndarray  # (7,)
    P: np.ndarray  # (7, 7)
    mu: np.ndarray  # (2, L) centres of the ellipses in the unit frame
    Sigma: np.ndarray  # (3, L + 1) their covariances as columns
    visible: np.ndarray  # (A, L)


class Detections(NamedTuple):
    """Its n detections, relative to its centre."""

    z: np.ndarray  # (n, 2) [m]
    R: np.ndarray  # (n, 3) [m^2]
    sensor: np.ndarray  # (n, 2) [m]


class Expected(NamedTuple):
    """Its ellipses under the Gaussian of the state."""

    T: np.ndarray  # (7, 7)
    c: np.ndarray  # (L, 2) [m]
    h: np.ndarray  # (L, 2, 7) [m]
    C: np.ndarray  # (L, 3) [m^2]


@compiled
def relative(m, polar, pose, noise, mask, sigma):
    """The detections (M,) under the mask relative to the centre of m."""
    n, k = mask.sum(), 0
    z, R, sensor = np.empty((n, 2)), np.empty((n, 3)), np.empty((n, 2))
    for i in range(len(mask)):
        if not mask[i]:
            continue
        c, s = np.cos(polar[i, 1] + pose[i, 2]), np.sin(polar[i, 1] + pose[i, 2])
        z[k, 0] = pose[i, 0] + polar[i, 0] * c - m[0]
        z[k, 1] = pose[i, 1] + polar[i, 0] * s - m[1]
        along = (sigma if np.isnan(noise[i, 0]) else noise[i, 0]) ** 2
        across = (sigma if np.isnan(noise[i, 1]) else polar[i, 0] * noise[i, 1]) ** 2
        more = along - across
        R[k, 0], R[k, 1], R[k, 2] = across + more * c * c, more * c * s, across + more * s * s
        sensor[k, 0], sensor[k, 1] = pose[i, 0] - m[0], pose[i, 1] - m[1]
        k += 1
    return Detections(z, R, sensor)


@compiled
def predict_ellipses(m, P, mu):
    """Moments of the ellipses' centres under N(m, P), and whether P is definite."""
    L = mu.shape[1]
    c, h, C = np.empty((L, 2)), np.empty((L, 2, 7)), np.empty((L, 3))
    backwards, definite = root(P[::-1, ::-1])
    T = np.ascontiguousarray(backwards[::-1])  # (PMHT.7)
    A, d = np.empty((15, 2, 2)), np.zeros((15, 7))
    for k in range(7):
        for j in range(7):
            d[1 + k, j] = REACH * T[j, k]
            d[8 + k, j] = -d[1 + k, j]
    for k in range(15):
        cos, sin = np.cos(m[2] + d[k, 2]), np.sin(m[2] + d[k, 2])
        l, w = m[5] + d[k, 5], m[6] + d[k, 6]
        A[k, 0, 0], A[k, 0, 1], A[k, 1, 0], A[k, 1, 1] = cos * l, -sin * w, sin * l, cos * w
    y = np.empty((15, 2))
    for l in range(L):
        for i in range(2):
            total = 0.0
            for k in range(15):
                y[k, i] = A[k, i, 0] * mu[0, l] + A[k, i, 1] * mu[1, l] + d[k, i]
                total += y[k, i]
            c[l, i] = y[0, i] + WEIGHT_MEAN * (total - 15 * y[0, i])  # (PMHT.12)
            for k in range(7):
                h[l, i, k] = (y[1 + k, i] - y[8 + k, i]) / (2 * REACH)  # (PMHT.13)
        C[l] = 0.0
        for k in range(15):
            weight = WEIGHT_FIRST if k == 0 else WEIGHT_OTHER
            ex, ey = y[k, 0] - c[l, 0], y[k, 1] - c[l, 1]
            C[l, 0] += weight * ex * ex  # (PMHT.12)
            C[l, 1] += weight * ex * ey
            C[l, 2] += weight * ey * ey
    return Expected(T, c, h, C), definite


@compiled
def place(body, m):
    """Centres (L + 1, 2) [m] relative to the centre of the body and covariances (L + 1, 3), the box last, at m."""
    L = body.mu.shape[1]
    c, E = np.empty((L + 1, 2)), np.empty((L + 1, 3))
    cos, sin = np.cos(m[2]), np.sin(m[2])
    a, b, e, f = cos * m[5], -sin * m[6], sin * m[5], cos * m[6]  # (PMHT.3)
    for l in range(L + 1):
        x, y = (body.mu[0, l], body.mu[1, l]) if l < L else (0.0, 0.0)
        c[l, 0], c[l, 1] = a * x + b * y + m[0] - body.m[0], e * x + f * y + m[1] - body.m[1]
        xx, xy, yy = body.Sigma[0, l], body.Sigma[1, l], body.Sigma[2, l]
        E[l, 0] = a * a * xx + 2 * a * b * xy + b * b * yy  # (PMHT.8)
        E[l, 1] = a * e * xx + (a * f + b * e) * xy + b * f * yy
        E[l, 2] = e * e * xx + 2 * e * f * xy + f * f * yy
    return c, E


@compiled
def log_normal(weight, dx, dy, xx, xy, yy):
    """Log of weight N((dx, dy); 0, S)."""
    det = xx * yy - xy * xy
    return -0.5 * ((dx * (yy * dx - 2 * xy * dy) + xx * dy * dy) / det + np.log(det / weight**2)) - LOG_2PI


@compiled
def seen_weights(visible, c, phi, sensor, unseen, pi):
    """Prior pi (L,), written, of the ellipses at c (L + 1, 2) [m] for a sensor at (2,) [m]."""
    A, L = visible.shape
    total = 0.0
    for l in range(L):
        direction = np.arctan2(sensor[1] - c[l, 1], sensor[0] - c[l, 0]) - phi
        at = direction * (A / (2 * np.pi))
        low = int(np.floor(at))
        part = at - low
        pi[l] = (1 - part) * visible[low % A, l] + part * visible[(low + 1) % A, l]
        total += pi[l]
    for l in range(L):
        pi[l] = (1 - unseen) * pi[l] / max(total, 1e-12) + unseen / L  # (PMHT.22)


@compiled
def associate(body, m, at, spare, rules):
    """Weights (n, L) at the iterate m, covariances (L, 3), explained share; `spare` (L, 3) [m^2] is added to them."""
    n, L = len(at.z), body.mu.shape[1]
    c, E = place(body, m)
    w, pi, own = np.empty((n, L)), np.full(L, 1.0 / L), 0.0
    inside = rules.interior / (1 - rules.interior)
    for i in range(n):
        if rules.rays:
            seen_weights(body.visible, c, m[2], at.sensor[i], rules.unseen, pi)
        dx, dy, R, box = at.z[i, 0] - c[L, 0], at.z[i, 1] - c[L, 1], at.R[i], E[L]
        within = 0.0
        if inside:
            within = inside * np.exp(log_normal(1.0, dx, dy, box[0] + R[0], box[1] + R[1], box[2] + R[2]))  # (PMHT.9)
        log_rest = np.log(rules.eps + within)
        top = log_rest
        for l in range(L):
            xx = rules.widened * E[l, 0] + spare[l, 0] + R[0]  # (PMHT.8)
            xy = rules.widened * E[l, 1] + spare[l, 1] + R[1]
            yy = rules.widened * E[l, 2] + spare[l, 2] + R[2]
            w[i, l] = log_normal(pi[l], at.z[i, 0] - c[l, 0], at.z[i, 1] - c[l, 1], xx, xy, yy)
            top = max(top, w[i, l])
        total = 0.0
        for l in range(L):
            w[i, l] = np.exp(w[i, l] - top)
            total += w[i, l]
        w[i] /= total + np.exp(log_rest - top)  # (PMHT.10)
        mine = w[i].sum()
        own += mine
        if inside:
            own += (1 - mine) * within / (within + max(rules.eps, LEAST_DENSITY))
    return w, E[:L], own / n  # (PMHT.17)


@compiled
def innovation(expected, w, E, at):
    """Innovation (2,) [m] of the mean detection and its covariance (2, 2) [m^2]."""
    n, L = w.shape
    eps, S, h, noise = np.zeros(2), np.zeros((2, 2)), np.zeros((2, 7)), np.zeros(3)
    part = w.sum(0)
    part /= max(part.sum(), 1e-12)
    for i in range(n):
        eps += at.z[i] / n
        noise += at.R[i] / n
    for l in range(L):
        eps -= part[l] * expected.c[l]  # (PMHT.19)
        h += part[l] * expected.h[l]
        noise += part[l] * E[l]
    S[0, 0], S[0, 1], S[1, 0], S[1, 1] = noise[0] / n, noise[1] / n, noise[1] / n, noise[2] / n
    return eps, S + times(h, h.T)  # (PMHT.19)


@compiled
def corrected(m, expected, w, E, at):
    """Moments after the synthetic detections of all ellipses, and whether they could be computed."""
    n, L = w.shape
    B, b = np.eye(7), np.zeros((7, 1))
    z, R = np.empty(2), np.empty(3)
    for l in range(L):
        z[:], R[:] = 0.0, 0.0
        M = w[:, l].sum()  # (PMHT.11)
        if M <= LEAST_WEIGHT:
            continue
        for i in range(n):
            z += w[i, l] / M * at.z[i]  # (PMHT.11)
            R += w[i, l] / M * at.R[i]
        h, C = expected.h[l], expected.C[l]
        xx, xy, yy = (E[l, 0] + R[0]) / M + C[0], (E[l, 1] + R[1]) / M + C[1], (E[l, 2] + R[2]) / M + C[2]  # (PMHT.14)
        for k in range(7):
            xx -= h[0, k] * h[0, k]
            xy -= h[0, k] * h[1, k]
            yy -= h[1, k] * h[1, k]
        det = xx * yy - xy * xy
        rx, ry = z[0] - expected.c[l, 0], z[1] - expected.c[l, 1]
        for k in range(7):
            gx, gy = (yy * h[0, k] - xy * h[1, k]) / det, (xx * h[1, k] - xy * h[0, k]) / det  # W^-1 h
            b[k, 0] += gx * rx + gy * ry
            for j in range(7):
                B[j, k] += h[0, j] * gx + h[1, j] * gy
    inverse, log_det = solved((B + B.T) / 2, np.eye(7))
    new = m + times(expected.T, times(inverse, b))[:, 0]  # (PMHT.15b)
    new[5], new[6] = max(new[5], LEAST_SIZE), max(new[6], LEAST_SIZE)
    return new, congruent(expected.T, inverse), np.isfinite(log_det)  # (PMHT.15a)


@compiled
def update_one(body, at, rules):
    """Moments, innovation and its covariance, explained share of one object, and whether they could be computed."""
    expected, good = predict_ellipses(body.m, body.P, body.mu)
    w, E, share = associate(body, body.m, at, expected.C, rules)
    eps, S = innovation(expected, w, E, at)
    m, P, spare = body.m, body.P, np.zeros(expected.C.shape)
    good &= share >= rules.lost_below  # else it is to be searched in the neighbourhood, (PMHT.18)
    for k in range(rules.iterations if good else 0):
        if k > 0:
            w, E, _ = associate(body, m, at, spare, rules)
        m, P, fine = corrected(body.m, expected, w, E, at)
        good &= fine
    return m, P, eps, S, share, good


@compiled
def update_all(m, P, mu, Sigma, visible, polar, pose, noise, mask, rules):
    """`update_one` of the T objects with detections; the others stay. The last value is whether all could be."""
    T = len(m)
    m_new, P_new = m.copy(), P.copy()
    eps, S, share, good = np.zeros((T, 2)), np.zeros((T, 2, 2)), np.full(T, np.nan), True
    for t in range(T):
        S[t, 0, 0] = S[t, 1, 1] = 1.0
        if mask[t].any():
            body = Body(m[t], P[t], mu[t], Sigma[t], visible[t])
            at = relative(m[t], polar[t], pose[t], noise[t], mask[t], rules.sigma)
            m_new[t], P_new[t], eps[t], S[t], share[t], fine = update_one(body, at, rules)
            good &= fine
    return m_new, P_new, eps, S, share, good
