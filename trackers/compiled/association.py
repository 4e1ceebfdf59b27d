"""The ellipses of one object in the plane, and which of them made which detection; docs/methods/spline-pmht.md.

M detections, L ellipses; positions are relative to the centre of the prediction. Covariances are rows xx, xy, yy, and
points rows x, y: (3, L) and (2, L).
"""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.jit import compiled
from trackers.compiled.linear import bell, ndtr, wrap
from trackers.compiled.modes import LENGTH, PHI, WIDTH
from trackers.compiled.tables import ACROSS, ALONG, POSE, RANGE, SENSOR, UX, UY

LEAST_WEIGHT, LEAST_DENSITY = 1e-9, 1e-300
EDGE, LEAST_COVER = 0.3, 1e-3  # as in `trackers.pmht.visibility`


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
            w[i, l] *= bell(q[l] - top)
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
