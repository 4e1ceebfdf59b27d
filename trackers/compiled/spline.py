"""The update of the contour filter of one object; docs/methods/spline-pmht.md.

m (7,) and P (7, 7), M detections, L ellipses; positions are relative to the centre of m. Covariances are rows xx, xy,
yy, and points rows x, y: (3, L) and (2, L).
"""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.jit import compiled
from trackers.compiled.linear import cholesky, congruence, inverse, ndtr, symmetrize, wrap
from trackers.compiled.tables import ACROSS, ALONG, POSE, RANGE, SENSOR, UX, UY

PHI, LENGTH, WIDTH = 2, 5, 6
REACH, MEAN, FIRST = 3.0, 0.5 / 9.0, 2.0 + 4 * 0.5 / 9.0  # as in `trackers.pmht.joint`
LEAST_WEIGHT, LEAST_SIZE, LEAST_DENSITY = 1e-9, 0.3, 1e-300
EDGE, LEAST_COVER = 0.3, 1e-3  # as in `trackers.pmht.visibility`


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
def place(
    m: NDArray, x: float, y: float, mu: NDArray, Sigma: NDArray, wider: float, c: NDArray, E: NDArray, box: NDArray
) -> None:
    """(PMHT.3), (PMHT.8): centres c (2, L), covariances E (3, L) of ellipses, box (3,) of points even over the body.

    x, y are the centre of m relative to that of the prediction; mu (2, L), Sigma (3, L) in the unit frame.
    """
    cos, sin = math.cos(m[PHI]), math.sin(m[PHI])
    a, b, g, d = cos * m[LENGTH], -sin * m[WIDTH], sin * m[LENGTH], cos * m[WIDTH]
    for l in range(mu.shape[1]):
        c[0, l] = a * mu[0, l] + b * mu[1, l] + x
        c[1, l] = g * mu[0, l] + d * mu[1, l] + y
        xx, xy, yy = Sigma[0, l], Sigma[1, l], Sigma[2, l]
        E[0, l] = wider * (a * a * xx + 2 * a * b * xy + b * b * yy)
        E[1, l] = wider * (a * g * xx + (a * d + b * g) * xy + b * d * yy)
        E[2, l] = wider * (g * g * xx + 2 * g * d * xy + d * d * yy)
    box[0], box[1], box[2] = (a * a + b * b) / 12, (a * g + b * d) / 12, (g * g + d * d) / 12


@compiled
def see(table: NDArray, c: NDArray, phi: float, sensor: NDArray, unseen: float, pi: NDArray) -> None:
    """(PMHT.22), (PMHT.40): weights pi (L,) of the ellipses for a sensor; table (A, L) of their visibility.

    sensor (5,): x, y, heading, half the opening angle and range, inf where it sees everywhere.
    """
    A, L = table.shape
    total = 0.0
    for l in range(L):
        dx, dy = c[0, l] - sensor[0], c[1, l] - sensor[1]
        at = ((math.atan2(-dy, -dx) - phi) % (2 * math.pi)) * (A / (2 * math.pi))
        low = int(at)
        pi[l] = (1 - at + low) * table[low % A, l] + (at - low) * table[(low + 1) % A, l]
        if sensor[3] < np.inf:
            r, azimuth = math.hypot(dx, dy), abs(wrap(math.atan2(dy, dx) - sensor[2]))
            inside = min(sensor[4] - r, (sensor[3] - azimuth) * r)
            pi[l] *= max(ndtr(inside / EDGE), LEAST_COVER)  # (PMHT.40)
        total += pi[l]
    for l in range(L):
        pi[l] = (1 - unseen) * pi[l] / max(total, 1e-12) + unseen / L


@compiled
def same(a: NDArray, b: NDArray) -> bool:
    """Whether all numbers of a and b (n,) are the same."""
    for i in range(len(a)):  # noqa: SIM110 - numba has no generators here
        if a[i] != b[i]:
            return False
    return True


@compiled
def exponent(dx: float, dy: float, xx: float, xy: float, yy: float) -> float:
    """(PMHT.10): the exponent of a Gaussian density."""
    return -0.5 * (dx * dx * yy - 2 * dx * dy * xy + dy * dy * xx) / (xx * yy - xy * xy)


@compiled
def associate(
    z: NDArray, R: NDArray, sensor: NDArray, c: NDArray, E: NDArray, box: NDArray, x: float, y: float, phi: float,
    spare: NDArray, table: NDArray, widened: float, unseen: float, interior: float, eps: float, w: NDArray,
) -> float:  # fmt: skip
    """(PMHT.9), (PMHT.10), (PMHT.17): weights w (M, L) of the ellipses, and the explained share of the scan.

    z (M, 2), R (M, 3), sensor (M, 5); spare (3, L or 0) is what the uncertainty of the state adds.
    """
    M, L = w.shape
    q, pi, own = np.empty(L), np.empty(L), 0.0
    for i in range(M):
        if i == 0 or not same(sensor[i], sensor[i - 1]):
            see(table, c, phi, sensor[i], unseen, pi)
        xx, xy, yy = box[0] + R[i, 0], box[1] + R[i, 1], box[2] + R[i, 2]
        within = interior / (1 - interior) * math.exp(exponent(z[i, 0] - x, z[i, 1] - y, xx, xy, yy))
        within /= 2 * math.pi * math.sqrt(xx * yy - xy * xy)  # (PMHT.9)
        rest, top = eps + within, -np.inf
        for l in range(L):
            xx, xy, yy = widened * E[0, l] + R[i, 0], widened * E[1, l] + R[i, 1], widened * E[2, l] + R[i, 2]
            if spare.shape[1]:
                xx, xy, yy = xx + spare[0, l], xy + spare[1, l], yy + spare[2, l]
            q[l] = exponent(z[i, 0] - c[0, l], z[i, 1] - c[1, l], xx, xy, yy)
            w[i, l] = pi[l] / (2 * math.pi * math.sqrt(xx * yy - xy * xy))
            top = max(top, q[l])
        top = max(top, -600.0) if rest > 0 else top  # any shift will do that keeps the sum within range
        total, share = rest * math.exp(-top), 0.0
        for l in range(L):
            w[i, l] *= math.exp(q[l] - top)
            total += w[i, l]
        for l in range(L):
            w[i, l] /= total  # (PMHT.10)
            share += w[i, l]
        own += share + (1 - share) * within / (within + max(eps, LEAST_DENSITY))
    return own / M  # (PMHT.17)


@compiled
def synthesise(w: NDArray, z: NDArray, R: NDArray, n: NDArray, zs: NDArray, Rs: NDArray) -> None:
    """(PMHT.11): numbers n (L,), places zs (2, L) and noises Rs (3, L) of one detection for each ellipse."""
    n[:], zs[:], Rs[:] = 0.0, 0.0, 0.0
    for i in range(w.shape[0]):
        for l in range(w.shape[1]):
            n[l] += w[i, l]
            for k in range(2):
                zs[k, l] += w[i, l] * z[i, k]
            for k in range(3):
                Rs[k, l] += w[i, l] * R[i, k]
    for l in range(w.shape[1]):
        for k in range(2):
            zs[k, l] /= max(n[l], LEAST_WEIGHT)
        for k in range(3):
            Rs[k, l] /= max(n[l], LEAST_WEIGHT)


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
    for i in range(7):
        for j in range(7):
            s = 0.0
            for l in range(L):
                s += (h[i, 0, l] * second[0, l] + h[i, 1, l] * second[1, l]) * h[j, 0, l]
                s += (h[i, 0, l] * second[1, l] + h[i, 1, l] * second[2, l]) * h[j, 1, l]
            for k in range(M):
                s -= score[i, k] * score[j, k]
            out[i, j] = s
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
    for i in range(7):
        for l in range(L):
            pull[i] += g[i, 0, l] * (zs[0, l] - c[0, l]) + g[i, 1, l] * (zs[1, l] - c[1, l])
        for j in range(i + 1):
            s = 0.0
            for l in range(L):
                s += h[i, 0, l] * g[j, 0, l] + h[i, 1, l] * g[j, 1, l]
                s += h[j, 0, l] * g[i, 0, l] + h[j, 1, l] * g[i, 1, l]
            A[i, j] = A[j, i] = s / 2 + (1.0 if i == j else 0.0)
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
def relative(m: NDArray, detections: NDArray, view: NDArray, z: NDArray, R: NDArray, sensor: NDArray) -> None:
    """Places z (M, 2), noises R (M, 3) and sensors (M, 5) of detections, from the centre of m (7,).

    view (S, 2): half the opening angle and the range of each sensor; without rows they see everywhere.
    """
    sensor[:, 3:] = np.inf
    for i in range(len(z)):
        d = detections[i]
        along, across, c, s = d[ALONG] ** 2, d[ACROSS] ** 2, d[UX], d[UY]
        R[i, 0], R[i, 1] = across + (along - across) * c * c, (along - across) * c * s
        R[i, 2] = across + (along - across) * s * s
        sensor[i, 0], sensor[i, 1] = d[POSE] - m[0], d[POSE + 1] - m[1]
        sensor[i, 2] = d[POSE + 2]
        if len(view):
            sensor[i, 3], sensor[i, 4] = view[int(d[SENSOR]), 0], view[int(d[SENSOR]), 1]
        z[i, 0], z[i, 1] = sensor[i, 0] + d[RANGE] * c, sensor[i, 1] + d[RANGE] * s


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
