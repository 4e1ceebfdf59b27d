"""The update of the contour filter of one object; docs/methods/spline-pmht.md.

m (7,) and P (7, 7), M detections, L ellipses; positions are relative to the centre of m. Covariances are rows xx, xy,
yy, and points rows x, y: (3, L) and (2, L).
"""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.association import LEAST_WEIGHT, associate, place, relative, see, synthesise
from trackers.compiled.jit import compiled
from trackers.compiled.linear import cholesky, congruence, inverse, symmetrize
from trackers.compiled.modes import LENGTH, PHI, WIDTH

REACH, MEAN, FIRST = 3.0, 0.5 / 9.0, 2.0 + 4 * 0.5 / 9.0  # as in `trackers.pmht.joint`
LEAST_SIZE = 0.3  # [m] as in `trackers.pmht.state`


@compiled
def rotating_root(P: NDArray, T: NDArray) -> bool:
    """(PMHT.7): T (7, 7) of P = T T^T; false where P is not positive definite."""
    n = len(P)
    A, L = np.empty((n, n)), np.empty((n, n))
    for i in range(n):
        for j in range(n):
            A[i, j] = (P[n - 1 - i, n - 1 - j] + P[n - 1 - j, n - 1 - i]) / 2
    if not cholesky(A, L):
        return False
    for i in range(n):
        T[i] = L[n - 1 - i]
    return True


@compiled
def predict_ellipses(m: NDArray, T: NDArray, mu: NDArray, c: NDArray, h: NDArray, C: NDArray) -> None:
    """(PMHT.12), (PMHT.13): expected centres c (2, L), slopes h (7, 2, L), covariances C (3, L) of ellipses mu."""
    L = mu.shape[1]
    y = np.empty((15, 2, L))
    for k in range(15):
        j, sign = (k - 1) % 7, 0.0 if k == 0 else (REACH if k < 8 else -REACH)
        phi, a, b = m[PHI] + sign * T[PHI, j], m[LENGTH] + sign * T[LENGTH, j], m[WIDTH] + sign * T[WIDTH, j]
        cos, sin = math.cos(phi), math.sin(phi)
        for l in range(L):
            y[k, 0, l] = cos * a * mu[0, l] - sin * b * mu[1, l] + sign * T[0, j]
            y[k, 1, l] = sin * a * mu[0, l] + cos * b * mu[1, l] + sign * T[1, j]
    C[:] = 0.0
    for l in range(L):
        for i in range(2):
            c[i, l] = y[0, i, l]
            for k in range(1, 15):
                c[i, l] += MEAN * (y[k, i, l] - y[0, i, l])
        for k in range(15):
            w, x, z = FIRST if k == 0 else MEAN, y[k, 0, l] - c[0, l], y[k, 1, l] - c[1, l]
            C[0, l] += w * x * x
            C[1, l] += w * x * z
            C[2, l] += w * z * z
        for k in range(7):
            h[k, 0, l] = (y[k + 1, 0, l] - y[k + 8, 0, l]) / (2 * REACH)
            h[k, 1, l] = (y[k + 1, 1, l] - y[k + 8, 1, l]) / (2 * REACH)


@compiled
def missing(c: NDArray, h: NDArray, S: NDArray, w: NDArray, z: NDArray, u: NDArray, out: NDArray) -> None:
    """(PMHT.38): information (7, 7) that is missing, where u (7,) is true, as which ellipse is whose is not known.

    S (3, L) is the covariance of one detection of each ellipse.
    """
    M, L = w.shape
    second, score = np.zeros((3, L)), np.zeros((7, M))
    for l in range(L):
        x, y, det = c[0, l], c[1, l], S[0, l] * S[2, l] - S[1, l] * S[1, l]
        for k in range(7):
            x += h[k, 0, l] * u[k]
            y += h[k, 1, l] * u[k]
        for i in range(M):
            ax = (S[2, l] * (z[i, 0] - x) - S[1, l] * (z[i, 1] - y)) / det
            ay = (S[0, l] * (z[i, 1] - y) - S[1, l] * (z[i, 0] - x)) / det
            second[0, l] += w[i, l] * ax * ax
            second[1, l] += w[i, l] * ax * ay
            second[2, l] += w[i, l] * ay * ay
            for k in range(7):
                score[k, i] += w[i, l] * (h[k, 0, l] * ax + h[k, 1, l] * ay)
    turned, more = np.empty((7, 2, L)), np.empty((7, 7))
    for k in range(7):
        for l in range(L):
            turned[k, 0, l] = h[k, 0, l] * second[0, l] + h[k, 1, l] * second[1, l]
            turned[k, 1, l] = h[k, 0, l] * second[1, l] + h[k, 1, l] * second[2, l]
    np.dot(turned.reshape(7, 2 * L), h.reshape(7, 2 * L).T, out)
    np.dot(score, score.T, more)
    for i in range(7):
        for j in range(7):
            out[i, j] -= more[i, j]
    symmetrize(out)


@compiled
def joint_update(
    m: NDArray, T: NDArray, c: NDArray, h: NDArray, C: NDArray, E: NDArray, n: NDArray, zs: NDArray, Rs: NDArray,
    w: NDArray, z: NDArray, doubt: float, m_new: NDArray, P_new: NDArray,
) -> bool:  # fmt: skip
    """(PMHT.14), (PMHT.15), (PMHT.39): moments after the detections of all ellipses; false where none are definite."""
    L = c.shape[1]
    g, A, inner, pull, u = np.zeros((7, 2, L)), np.empty((7, 7)), np.empty((7, 7)), np.zeros(7), np.zeros(7)
    for l in range(L):
        if not n[l] > LEAST_WEIGHT:
            continue
        xx, xy, yy = C[0, l] + (E[0, l] + Rs[0, l]) / n[l], C[1, l] + (E[1, l] + Rs[1, l]) / n[l], 0.0
        yy = C[2, l] + (E[2, l] + Rs[2, l]) / n[l]
        for k in range(7):
            xx -= h[k, 0, l] * h[k, 0, l]
            xy -= h[k, 0, l] * h[k, 1, l]
            yy -= h[k, 1, l] * h[k, 1, l]
        det = xx * yy - xy * xy
        for k in range(7):
            g[k, 0, l] = (yy * h[k, 0, l] - xy * h[k, 1, l]) / det
            g[k, 1, l] = (xx * h[k, 1, l] - xy * h[k, 0, l]) / det
    np.dot(h.reshape(7, 2 * L), g.reshape(7, 2 * L).T, A)
    symmetrize(A)
    for i in range(7):
        for l in range(L):
            pull[i] += g[i, 0, l] * (zs[0, l] - c[0, l]) + g[i, 1, l] * (zs[1, l] - c[1, l])
        A[i, i] += 1.0
    if not inverse(A, inner):
        return False
    for i in range(7):
        for j in range(7):
            u[i] += inner[i, j] * pull[j]
    for i in range(7):
        m_new[i] = m[i]
        for j in range(7):
            m_new[i] += T[i, j] * u[j]  # (PMHT.15b)
    if doubt > 0:
        lost = np.empty((7, 7))
        missing(c, h, E + Rs, w, z, u, lost)
        for i in range(7):
            A[i, i] -= 1.0
        value, U = np.linalg.eigh(A - doubt * lost)
        for i in range(7):
            for j in range(7):
                inner[i, j] = 0.0
                for k in range(7):
                    inner[i, j] += U[i, k] / (1 + max(value[k], 0.0)) * U[j, k]  # (PMHT.39)
    congruence(T, inner, P_new)  # (PMHT.15a)
    return True


@compiled
def innovation(
    z: NDArray, R: NDArray, w: NDArray, c: NDArray, h: NDArray, E: NDArray, eps: NDArray, S: NDArray
) -> None:
    """(PMHT.19): innovation eps (2,) of the mean detection, and its covariance S (2, 2)."""
    M, L = w.shape
    part, total, r = np.zeros(L), 0.0, np.zeros(3)
    eps[:] = 0.0
    for i in range(M):
        for l in range(L):
            part[l] += w[i, l]
            total += w[i, l]
        for k in range(2):
            eps[k] += z[i, k] / M
        for k in range(3):
            r[k] += R[i, k] / M
    for l in range(L):
        part[l] /= max(total, 1e-12)
        for k in range(2):
            eps[k] -= c[k, l] * part[l]
        for k in range(3):
            r[k] += E[k, l] * part[l]
    S[0, 0], S[0, 1], S[1, 1] = r[0] / M, r[1] / M, r[2] / M
    for k in range(7):
        hx = hy = 0.0
        for l in range(L):
            hx += h[k, 0, l] * part[l]
            hy += h[k, 1, l] * part[l]
        S[0, 0] += hx * hx
        S[0, 1] += hx * hy
        S[1, 1] += hy * hy
    S[1, 0] = S[0, 1]


@compiled
def update(
    m: NDArray, P: NDArray, mu: NDArray, Sigma: NDArray, table: NDArray, detections: NDArray, view: NDArray,
    settings: NDArray, iterations: int, m_new: NDArray, P_new: NDArray, eps: NDArray, S: NDArray,
) -> int:  # fmt: skip
    """The moments after M detections, and the innovation: 0, 1 where the object was lost, 2 where nothing is definite.

    settings (7,): widened, unseen, interior, eps, lost_below, inflation, doubt.
    """
    M, L = len(detections), mu.shape[1]
    z, R, sensor = np.empty((M, 2)), np.empty((M, 3)), np.empty((M, 5))
    relative(m, detections, view, z, R, sensor)
    widened, unseen, interior, alarms = settings[0], settings[1], settings[2], settings[3]
    T, c, h, C = np.empty((7, 7)), np.empty((2, L)), np.empty((7, 2, L)), np.empty((3, L))
    at, E, box, w, none = np.empty((2, L)), np.empty((3, L)), np.empty(3), np.empty((M, L)), np.empty((3, 0))
    if not rotating_root(P, T):
        return 2
    predict_ellipses(m, T, mu, c, h, C)
    place(m, 0.0, 0.0, mu, Sigma, 1.0, at, E, box)
    share = associate(z, R, sensor, at, E, box, 0.0, 0.0, m[PHI], C, table, widened, unseen, interior, alarms, w)
    innovation(z, R, w, c, h, E, eps, S)
    lost, wider = share < settings[4], 1.0
    if lost:  # (PMHT.18)
        wider, x, y, pi = settings[5], 0.0, 0.0, np.empty(L)
        for i in range(M):
            see(table, at, m[PHI], sensor[i], unseen, pi)
            x += z[i, 0] / M
            y += z[i, 1] / M
            for l in range(L):
                x -= at[0, l] * pi[l] / M
                y -= at[1, l] * pi[l] / M
        wide = P.copy()
        wide[0, 0] += x * x
        wide[0, 1] += x * y
        wide[1, 0] += x * y
        wide[1, 1] += y * y
        place(m, x, y, mu, Sigma, wider, at, E, box)
        associate(z, R, sensor, at, E, box, x, y, m[PHI], C, table, widened, unseen, interior, alarms, w)
        if not rotating_root(wide, T):
            return 2
        predict_ellipses(m, T, mu, c, h, C)
    n, zs, Rs = np.empty(L), np.empty((2, L)), np.empty((3, L))
    for k in range(iterations):
        if k > 0:
            x, y = m_new[0] - m[0], m_new[1] - m[1]
            place(m_new, x, y, mu, Sigma, wider, at, E, box)
            associate(z, R, sensor, at, E, box, x, y, m_new[PHI], none, table, widened, unseen, interior, alarms, w)
        synthesise(w, z, R, n, zs, Rs)
        doubt = settings[6] if k == iterations - 1 else 0.0
        if not joint_update(m, T, c, h, C, E, n, zs, Rs, w, z, doubt, m_new, P_new):
            return 2
        m_new[LENGTH], m_new[WIDTH] = max(m_new[LENGTH], LEAST_SIZE), max(m_new[WIDTH], LEAST_SIZE)
    return 1 if lost else 0
