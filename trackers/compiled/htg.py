"""The update of the learned density of one object; docs/methods/hierarchical-truncated-gaussians.md.

xi (7,) = px, py, phi, v, omega, log l, log w. Bins (B, 22) are rows of numbers in the columns below, `at` (M,) is the
bin of each of M detections z (M, 2), and a row of c (M, 11) has what is constant of its density: cosine and sine of the
turn, then along both axes 1 / (rho + r), gain and scaled bounds a, b as in `trackers.htg.density`, and a sum.
"""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.jit import compiled
from trackers.compiled.linear import bell, inverse, symmetrize, wrap
from trackers.compiled.modes import LENGTH, PHI
from trackers.compiled.tables import ACROSS, ALONG, POSE, RANGE, UNUSABLE, UX, UY

RHO, BOUNDS, THETA, NOISE, LOG_MASS, ANCHOR, SCALE, SHIFT, TYPICAL, MEAN, COV = 0, 1, 5, 6, 8, 9, 11, 13, 15, 17, 19
ALPHA, FLAT, LARGEST_STEP, STARTS, ROUNDS, CONTEST, ASPECTS, CENTRED, ABOVE, SWITCH = range(10)  # of the settings
SMALLEST, LARGEST = math.log(0.01), math.log(1e3)  # as in `trackers.htg.map`
SQRT2, SQRTPI, LOG_2PI = math.sqrt(2.0), math.sqrt(math.pi), math.log(2 * math.pi)
FAR = 25.0  # from which on few terms of a series are a complementary error function


@compiled
def bin_of(m: NDArray, x: float, y: float, settings: NDArray) -> int:
    """(HTG.12), (HTG.13): the bin of a body with mean m (7,) for a sensor at x, y."""
    B, aspect = int(settings[ASPECTS]), wrap(m[PHI] - math.atan2(m[1] - y, m[0] - x))
    turn = math.floor((aspect + math.pi) * (B / (2 * math.pi)) + 0.5 * settings[CENTRED])
    return int(turn) % B + (B if math.exp(m[LENGTH]) > settings[ABOVE] else 0)


@compiled
def frame(half: float, b: NDArray, a: int) -> tuple[float, float, float, float]:
    """(HTG.14), (HTG.15): scale, shift, and how both grow along axis a of a body of this half size in bin b (22,)."""
    anchor, shift, scale = b[ANCHOR + a], b[SHIFT + a], b[SCALE + a]
    share = abs(anchor)
    h = (1 - share) * half + share * b[TYPICAL + a] / 2
    further = (anchor * share + shift * (1 - share)) * (half / h) / scale
    return scale * h, anchor * (half - h) + shift * h, (1 - share) * (half / h), further


@compiled
def prepare(b: NDArray, noise: NDArray, c: NDArray) -> None:
    """(HTG.3): the constants c (11,) of the density of bin b (22,) with more noise (2,) along its turned axes."""
    c[0], c[1], rho, c[10] = math.cos(b[THETA]), math.sin(b[THETA]), b[RHO], -LOG_2PI - b[LOG_MASS]
    for a in range(2):
        r = b[NOISE + a] + noise[a]
        c[2 + a] = 1 / (rho + r)
        scale = 1 / (SQRT2 * math.sqrt(rho * r * c[2 + a]))
        c[4 + a], c[6 + a], c[8 + a] = rho * c[2 + a] * scale, b[BOUNDS + a] * scale, b[BOUNDS + 2 + a] * scale
        c[10] += 0.5 * math.log(c[2 + a])


@compiled
def outside(t: float, shift: float) -> float:
    """(HTG.4): Phi(sqrt(2) t) times e^shift, of which shift <= t^2 is 0 unless t < 0."""
    if t < -FAR:
        r = 1 / (2 * t * t)
        return bell(shift - t * t) * (1 - r * (1 - 3 * r * (1 - 5 * r * (1 - 7 * r)))) / (-2 * t * SQRTPI)
    return 0.5 * math.exp(shift) * math.erfc(-t)


@compiled
def density(x: float, y: float, c: NDArray, g: NDArray) -> float:
    """(HTG.5), (HTG.7): log density at unit coordinates x, y, and its gradient g (2,)."""
    zx, zy = c[0] * x + c[1] * y, c[0] * y - c[1] * x
    ax, bx, ay, by = -c[4] * zx - c[6], c[4] * zx - c[8], -c[5] * zy - c[7], c[5] * zy - c[9]
    shift = min(max(ax, bx, ay, by), 0.0) ** 2  # of the nearest side, for a point in the hole
    qx, qy = outside(ax, shift) + outside(bx, shift), outside(ay, shift) + outside(by, shift)
    scale = math.exp(-shift)
    Q = qx + (1 - qx * scale) * qy
    slope_x = c[4] * (bell(shift - bx * bx) - bell(shift - ax * ax)) / SQRTPI
    slope_y = c[5] * (bell(shift - by * by) - bell(shift - ay * ay)) / SQRTPI
    gx, gy = slope_x * (1 - qy * scale) / Q - c[2] * zx, slope_y * (1 - qx * scale) / Q - c[3] * zy
    g[0], g[1] = c[0] * gx - c[1] * gy, c[0] * gy + c[1] * gx
    return c[10] - 0.5 * (c[2] * zx * zx + c[3] * zy * zy) + math.log(Q) - shift


@compiled
def posterior(
    xi: NDArray, m: NDArray, precision: NDArray, z: NDArray, c: NDArray, at: NDArray, bins: NDArray, g: NDArray
) -> float:
    """(HTG.8), (HTG.30), (HTG.32): log posterior at xi (7,) up to a constant, and its gradient g (7,).

    m (7,) and precision (7, 7) are those of the prediction.
    """
    cos, sin, u, value = math.cos(xi[PHI]), math.sin(xi[PHI]), np.empty(2), 0.0
    l, w = 0.5 * math.exp(xi[LENGTH]), 0.5 * math.exp(xi[LENGTH + 1])
    g[:] = 0.0
    for i in range(len(z)):
        dx, dy = z[i, 0] - xi[0], z[i, 1] - xi[1]
        ex, ey = cos * dx + sin * dy, cos * dy - sin * dx
        hx, tx, wider_l, further_l = frame(l, bins[at[i]], 0)
        hy, ty, wider_w, further_w = frame(w, bins[at[i]], 1)
        x, y = (ex - tx) / hx, (ey - ty) / hy
        value += density(x, y, c[i], u) - math.log(hx * hy)
        gx, gy = u[0] / hx, u[1] / hy
        g[0] -= cos * gx - sin * gy
        g[1] -= cos * gy + sin * gx
        g[PHI] += gx * ey - gy * ex
        g[LENGTH] -= wider_l * (1 + u[0] * x) + further_l * u[0]
        g[LENGTH + 1] -= wider_w * (1 + u[1] * y) + further_w * u[1]
    for i in range(7):
        pull = 0.0
        for j in range(7):
            pull += precision[i, j] * (xi[j] - m[j])
        g[i] -= pull
        value -= 0.5 * (xi[i] - m[i]) * pull
    return value


@compiled
def inform(m: NDArray, b: NDArray, F: NDArray, J: NDArray) -> None:
    """(HTG.34), (HTG.35): adds to J (7, 7) the information of positions with F (6, 6) in bin b (22,)."""
    cos, sin = math.cos(m[PHI]), math.sin(m[PHI])
    hx, tx, wider_l, further_l = frame(0.5 * math.exp(m[LENGTH]), b, 0)
    hy, ty, wider_w, further_w = frame(0.5 * math.exp(m[LENGTH + 1]), b, 1)
    L, LF = np.zeros((7, 6)), np.zeros((7, 6))
    L[0, 0], L[0, 1], L[1, 0], L[1, 1] = -cos / hx, sin / hy, -sin / hx, -cos / hy
    L[PHI, 0], L[PHI, 1], L[PHI, 2], L[PHI, 3] = ty / hx, -tx / hy, hy / hx, -hx / hy
    L[LENGTH, 4], L[LENGTH, 0], L[LENGTH + 1, 5], L[LENGTH + 1, 1] = -wider_l, -further_l, -wider_w, -further_w
    for i in range(7):
        for k in range(6):
            for j in range(6):
                LF[i, j] += L[i, k] * F[k, j]
    for i in range(7):
        for j in range(7):
            for k in range(6):
                J[i, j] += LF[i, k] * L[j, k]


@compiled
def centroid(
    m: NDArray, P: NDArray, z: NDArray, detections: NDArray, at: NDArray, bins: NDArray, eps: NDArray, S: NDArray,
    moved: NDArray,
) -> None:  # fmt: skip
    """(HTG.37): innovation eps (2,) of the mean detection, its covariance S (2, 2), and m moved (7,) by it."""
    n, xx, xy, yy = len(z), 0.0, 0.0, 0.0
    cos, sin, l, w = math.cos(m[PHI]), math.sin(m[PHI]), 0.5 * math.exp(m[LENGTH]), 0.5 * math.exp(m[LENGTH + 1])
    eps[:] = -m[:2]
    for i in range(n):
        b, d = bins[at[i]], detections[i]
        hx, tx = frame(l, b, 0)[:2]
        hy, ty = frame(w, b, 1)[:2]
        x, y = tx + hx * b[MEAN], ty + hy * b[MEAN + 1]
        eps[0] += (z[i, 0] - cos * x + sin * y) / n
        eps[1] += (z[i, 1] - sin * x - cos * y) / n
        p, q, r = hx * hx * b[COV], hx * hy * b[COV + 1], hy * hy * b[COV + 2]
        along, across = d[ALONG] ** 2, d[ACROSS] ** 2
        xx += cos * cos * p - 2 * cos * sin * q + sin * sin * r + across + (along - across) * d[UX] ** 2
        yy += sin * sin * p + 2 * cos * sin * q + cos * cos * r + across + (along - across) * d[UY] ** 2
        xy += cos * sin * (p - r) + (cos * cos - sin * sin) * q + (along - across) * d[UX] * d[UY]
    S[0, 0], S[1, 1] = P[0, 0] + xx / n**2, P[1, 1] + yy / n**2
    S[0, 1], S[1, 0] = P[0, 1] + xy / n**2, P[1, 0] + xy / n**2
    det = S[0, 0] * S[1, 1] - S[0, 1] * S[1, 0]
    x, y = (S[1, 1] * eps[0] - S[0, 1] * eps[1]) / det, (S[0, 0] * eps[1] - S[1, 0] * eps[0]) / det
    for i in range(7):
        moved[i] = m[i] + P[i, 0] * x + P[i, 1] * y


@compiled
def maximise(
    xi: NDArray, m: NDArray, precision: NDArray, gain: NDArray, z: NDArray, c: NDArray, at: NDArray, bins: NDArray,
    settings: NDArray,
) -> int:  # fmt: skip
    """(HTG.36): the starts xi (2, 7) climb in place, in steps of gain (7, 7) times gradient; which is the higher."""
    low, high, most = 0, int(settings[STARTS]), settings[LARGEST_STEP]
    value, g, length, step = np.empty(2), np.empty((2, 7)), np.ones(2), np.zeros((2, 7))
    trial, slope = np.empty(7), np.empty(7)
    for s in range(high):
        value[s] = posterior(xi[s], m, precision, z, c, at, bins, g[s])
    for k in range(int(settings[ROUNDS])):
        if k == int(settings[CONTEST]) and high - low > 1:
            low = 1 if value[1] > value[0] else 0
            high = low + 1
        promise = -np.inf
        for s in range(low, high):
            rise = 0.0
            for i in range(7):
                step[s, i] = 0.0
                for j in range(7):
                    step[s, i] += gain[i, j] * g[s, j]
                rise += g[s, i] * step[s, i]
            promise = max(promise, length[s] * rise)
        if not promise >= settings[FLAT]:
            break
        for s in range(low, high):
            for i in range(7):
                d = min(max(step[s, i], -most), most) if i >= LENGTH else step[s, i]
                trial[i] = xi[s, i] + length[s] * d
            found = posterior(trial, m, precision, z, c, at, bins, slope)
            if found >= value[s]:
                xi[s], g[s], value[s], length[s] = trial, slope, found, 1.0
            else:
                length[s] *= 0.5
    return 1 if high > 1 and (low == 1 or value[1] > value[0]) else 0


@compiled
def update(
    m: NDArray, P: NDArray, bins: NDArray, scores: NDArray, detections: NDArray, settings: NDArray,
    m_new: NDArray, P_new: NDArray, eps: NDArray, S: NDArray,
) -> int:  # fmt: skip
    """(HTG.31), (HTG.38): the moments after M detections, and the innovation: 0, 2 where something is not definite.

    scores (B, V, V, 6, 6) is F of (HTG.34) of each bin and level of noise along both axes.
    """
    M, noise, at = len(detections), np.empty(2), np.empty(len(detections), np.int64)
    z, c, xi, J = np.empty((M, 2)), np.empty((M, 11)), np.empty((2, 7)), np.zeros((7, 7))
    for i in range(M):
        d = detections[i]
        z[i, 0], z[i, 1] = d[POSE] + d[RANGE] * d[UX], d[POSE + 1] + d[RANGE] * d[UY]
        at[i] = bin_of(m, d[POSE], d[POSE + 1], settings)
        b = bins[at[i]]
        cos, sin = math.cos(m[PHI]), math.sin(m[PHI])
        hx, hy = frame(0.5 * math.exp(m[LENGTH]), b, 0)[0], frame(0.5 * math.exp(m[LENGTH + 1]), b, 1)[0]
        x, y, level = cos * d[UX] + sin * d[UY], cos * d[UY] - sin * d[UX], np.zeros(2, np.int64)
        cos, sin = math.cos(b[THETA]), math.sin(b[THETA])
        x, y, p, q = x / hx, y / hy, -y / hx, x / hy
        noise[0] = (d[ALONG] * (cos * x + sin * y)) ** 2 + (d[ACROSS] * (cos * p + sin * q)) ** 2
        noise[1] = (d[ALONG] * (cos * y - sin * x)) ** 2 + (d[ACROSS] * (cos * q - sin * p)) ** 2
        prepare(b, noise, c[i])
        for a in range(2):
            for edge in settings[SWITCH:]:
                level[a] += edge < noise[a]
        inform(m, b, scores[at[i], level[0], level[1]], J)
    precision, gain = np.empty((7, 7)), np.empty((7, 7))
    if not inverse(P, precision) or not inverse(precision + J, gain):
        return UNUSABLE
    if not inverse(precision + settings[ALPHA] * J, P_new):
        return UNUSABLE
    symmetrize(P_new)
    xi[0] = m
    centroid(m, P, z, detections, at, bins, eps, S, xi[1])
    m_new[:] = xi[maximise(xi, m, precision, gain, z, c, at, bins, settings)]
    for a in range(LENGTH, LENGTH + 2):
        m_new[a] = min(max(m_new[a], SMALLEST), LARGEST)
    return 0
