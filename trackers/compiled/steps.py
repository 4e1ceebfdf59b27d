"""The two compiled calls of a step: prediction and update of all T tracks, with their estimates."""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled import evidence, grids, modes, size, spline
from trackers.compiled.jit import compiled
from trackers.compiled.linear import cholesky, wrap
from trackers.compiled.modes import LENGTH, OMEGA, PHI, SPEED
from trackers.compiled.tables import Found, Rows, Seen, Tables

LOST, LEAST_SIZE = -0.1, 0.8  # as in `trackers.motion.places` and `.mixture`
AXLE_STD, ROUNDING = 0.1, 1e-9  # as in `trackers.motion.mixture` and `.turn`
SIDE = math.sin(math.radians(10.0))  # as in `trackers.size.posterior`


@compiled
def around(cov: NDArray, cos: float, sin: float, along: float, across: float) -> None:
    """Variances along and across a heading, added to the first two components of cov."""
    cov[0, 0] += along * cos * cos + across * sin * sin
    cov[1, 1] += along * sin * sin + across * cos * cos
    cov[0, 1] += (along - across) * cos * sin
    cov[1, 0] = cov[0, 1]


@compiled
def outlined(outline: NDArray, pose: NDArray, length: float, width: float, contour: NDArray) -> None:
    """Points (C, 2) in the world of an outline in the unit frame."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for i in range(len(outline)):
        x, y = outline[i, 0] * length, outline[i, 1] * width
        contour[i, 0], contour[i, 1] = pose[0] + cos * x - sin * y, pose[1] + sin * x + cos * y


@compiled
def velocity_cov(m: NDArray, P: NDArray, d: float, more: float, cov: NDArray) -> None:
    """(MODE.25), (MODE.26): cov (4, 4) of place and velocity for an axle d [m] behind the centre; more is across."""
    cos, sin = math.cos(m[PHI]), math.sin(m[PHI])
    J = np.zeros((4, 5))
    J[0, 0] = J[1, 1] = 1.0
    J[2, PHI], J[3, PHI] = -m[SPEED] * sin - m[OMEGA] * d * cos, m[SPEED] * cos - m[OMEGA] * d * sin
    J[2, SPEED], J[3, SPEED], J[2, OMEGA], J[3, OMEGA] = cos, sin, -d * sin, d * cos
    for i in range(4):
        for j in range(4):
            cov[i, j] = ROUNDING if i == j else 0.0
            for k in range(5):
                for l in range(5):
                    cov[i, j] += J[i, k] * P[k, l] * J[j, l]
    around(cov[2:, 2:], cos, sin, 0.0, more)


@compiled
def estimate(t: int, x: Rows, which: int, p: Tables, found: Found) -> None:
    """(MODE.24) to (MODE.26), (ENDS.20), (ENDS.21): box of place and motion, and box with size, of row t."""
    m, P = found.m[t], found.P[t]
    heading, cos, sin = wrap(m[PHI]), math.cos(m[PHI]), math.sin(m[PHI])
    axle = square = 0.0
    for k in range(len(p.modes)):
        axle += x.mu[t, k] * p.modes[k, 2]
        square += x.mu[t, k] * p.modes[k, 2] ** 2
    l, w, d = m[LENGTH], m[LENGTH + 1], m[LENGTH] * axle
    more = P[PHI, PHI] * P[SPEED, SPEED] + (l * m[OMEGA]) ** 2 * (square - axle**2 + AXLE_STD**2)
    box, sized, b = found.cov[0, t], found.cov[1, t], x.belief[t]
    velocity_cov(m, P, d, more, box)
    around(box, cos, sin, (l * p.place_std[0]) ** 2, (w * p.place_std[1]) ** 2)
    sized[:] = box
    around(sized, cos, sin, b[4, 0], b[4, 1])
    found.velocity[t, 0] = m[SPEED] * cos - m[OMEGA] * d * sin
    found.velocity[t, 1] = m[SPEED] * sin + m[OMEGA] * d * cos
    forth = x.anchor[t, 0] * (b[2, 0] + (l - b[0, 0]) / 2)
    aside = x.anchor[t, 1] * (b[2, 1] + (w - b[0, 1]) / 2)
    pose, placed = found.pose[0, t], found.pose[1, t]
    pose[0], pose[1], pose[2], placed[2] = m[0], m[1], heading, heading
    placed[0], placed[1] = m[0] + cos * forth - sin * aside, m[1] + sin * forth + cos * aside
    outlined(p.outline[which], pose, l, w, found.contour[0, t])
    outlined(p.outline[which], placed, b[0, 0], b[0, 1], found.contour[1, t])
    for i, j in enumerate((PHI, OMEGA, LENGTH, LENGTH + 1)):
        found.std[t, i] = math.sqrt(P[j, j])


@compiled
def believe(t: int, x: Rows, length: NDArray, width: NDArray, p: Tables) -> None:
    """The belief of row t from likelihoods of its grids."""
    behind = math.exp(-x.side[t] / p.enough_side) if x.anchor[t, 0] < 0 else 0.0  # (ENDS.34)
    grids.believe(p.lengths, p.length_offsets, p.widths, p.width_offsets, p.shares, p.of_length, p.of_width,
                  p.load_class, p.load_share, p.load_at, p.load_part, length, width, behind, x.belief[t],
                  x.of_length[t], x.of_width[t], x.kind[t])  # fmt: skip


@compiled
def predict(
    old: Rows, x: Rows, which: NDArray, dt: float, kept: float, keep: float, over_length: NDArray, over_width: NDArray,
    p: Tables, found: Found,
) -> None:  # fmt: skip
    """Motion and size of all rows after dt, from `old` into x; kept and keep: of the mode, and of what was detected."""
    length, width = np.empty(old.length.shape[1:]), np.empty(old.width.shape[1:])
    for t in range(len(which)):
        modes.mix(old.m[t], old.P[t], old.mu[t], kept, x.m[t], x.P[t], x.mu[t])
        for k in range(len(p.modes)):
            modes.move(x.m[t, k], x.P[t, k], dt, p.modes[k], p.common, p.size_walk)
        modes.moments(x.m[t], x.P[t], x.mu[t], found.m[t], found.P[t])
        x.anchor[t] = old.anchor[t]
        x.side[t] = keep * old.side[t]
        grids.forget(old.length[t], keep, over_length, length, x.length[t])
        grids.forget(old.width[t], keep, over_width, width, x.width[t])
        believe(t, x, length, width, p)
        estimate(t, x, which[t], p, found)


@compiled
def locate(
    t: int, x: Rows, which: int, z: Seen, index: NDArray, p: Tables, found: Found, m: NDArray, P: NDArray
) -> int:
    """The place of row t after the detections index (M,): m (7,), P (7, 7); 0, 1 lost, 2 not definite."""
    M = len(index)
    xy, R, sensor = np.empty((M, 2)), np.empty((M, 3)), np.empty((M, 2))
    for i in range(M):
        j = index[i]
        along, across, c, s = z.along[t, j] ** 2, z.across[t, j] ** 2, z.sight[t, j, 0], z.sight[t, j, 1]
        R[i, 0], R[i, 1], R[i, 2] = (
            across + (along - across) * c * c, (along - across) * c * s, across + (along - across) * s * s
        )  # fmt: skip
        for a in range(2):
            sensor[i, a] = z.pose[t, j, a] - found.m[t, a]
            xy[i, a] = sensor[i, a] + z.range[t, j] * z.sight[t, j, a]
    return spline.update(found.m[t], found.P[t], p.mu[which], p.Sigma[which], p.visible[which], xy, R, sensor,
                         p.spline, p.iterations, m, P, found.eps[t], found.S[t])  # fmt: skip


@compiled
def move(t: int, x: Rows, z: Seen, index: NDArray, p: Tables, found: Found, m: NDArray, P: NDArray) -> bool:
    """(MODE.10) to (MODE.23): modes of row t after its place became m (7,), P (7, 7), and the range rates."""
    M, K = len(index), len(p.modes)
    s, Lam, log_l = np.empty(7), np.empty((7, 7)), np.zeros(K)
    least = evidence.likelihood(found.m[t], found.P[t], m, P, s, Lam)
    if least == np.inf:
        return False
    for k in range(K):
        if least < LOST:
            x.m[t, k], x.P[t, k] = m, P
        else:
            log_l[k] = evidence.correct(x.m[t, k], x.P[t, k], found.m[t], s, Lam)
        for a in (LENGTH, LENGTH + 1):
            x.m[t, k, a] = max(x.m[t, k, a], LEAST_SIZE)
    xy, sight, rate, across, std = np.empty((M, 2)), np.empty((M, 2)), np.empty(M), np.empty(M), np.empty(M)
    any_rate = False
    for i in range(M):
        j = index[i]
        rate[i], across[i], std[i] = z.rate[t, j], z.rate_across[t, j], z.rate_std[t, j]
        any_rate |= math.isfinite(rate[i])
        for a in range(2):
            sight[i, a] = z.sight[t, j, a]
            xy[i, a] = z.pose[t, j, a] + z.range[t, j] * z.sight[t, j, a]
    if any_rate:
        evidence.rates(x.mu[t], x.m[t], x.P[t], p.axle, xy, sight, rate, across, std, p.rates[0], p.rates[1],
                       p.rates[2], log_l)  # fmt: skip
    modes.reweight(x.mu[t], log_l)
    modes.forward(x.m[t], x.P[t], x.mu[t], p.backwards, found.m[t], found.P[t])
    return True


@compiled
def resize(
    t: int, x: Rows, whole: bool, turned: bool, z: Seen, index: NDArray, p: Tables, found: Found, length: NDArray,
    width: NDArray,
) -> None:  # fmt: skip
    """(ENDS.2) to (ENDS.22): grids and belief of row t after the detections index (M,), and its modes pinned."""
    M = len(index)
    box, was, shift, std = np.empty(3), found.m[t, LENGTH:].copy(), np.empty(2), np.empty(2)
    box[0], box[1], box[2] = found.m[t, 0], found.m[t, 1], wrap(found.m[t, PHI])
    cos, sin = math.cos(box[2]), math.sin(box[2])
    if turned:
        x.anchor[t] *= -1
    xy, sight, place, noise = np.empty((M, 2)), np.empty((M, 2)), np.empty((M, 2)), np.empty((M, 2))
    pose, which = np.empty((M, 3)), np.empty(M, np.int64)
    for i in range(M):
        j = index[i]
        pose[i], which[i] = z.pose[t, j], z.sensor[t, j]
        ux, uy, dx, dy = z.sight[t, j, 0], z.sight[t, j, 1], pose[i, 0] - box[0], pose[i, 1] - box[1]
        sight[i, 0], sight[i, 1] = cos * ux + sin * uy, cos * uy - sin * ux
        place[i, 0], place[i, 1] = cos * dx + sin * dy, cos * dy - sin * dx
        for a in range(2):
            xy[i, a] = place[i, a] + z.range[t, j] * sight[i, a]
            noise[i, a] = math.sqrt(  # (ENDS.6)
                (z.size_along[t, j] * sight[i, a]) ** 2
                + (z.size_across[t, j] * sight[i, 1 - a]) ** 2
                + p.sheet[which[i], 13] ** 2
            )
        x.side[t] += 1.0 if abs(sight[i, 1]) > SIDE else 0.0
    size.read(x.length[t], x.width[t], x.anchor[t], box, was, whole, xy, sight, place, noise, pose, which,
              p.lengths, p.length_offsets, p.length_near, p.length_far, p.length_cells,
              p.widths, p.width_offsets, p.width_near, p.width_far, p.width_cells, p.sheet, p.size)  # fmt: skip
    grids.to_likelihood(x.length[t], 1.0, length)
    grids.to_likelihood(x.width[t], 1.0, width)
    believe(t, x, length, width, p)
    size.centre(x.length[t], x.width[t], p.lengths[1] - p.lengths[0], p.widths[1] - p.widths[0], x.anchor[t], box, was,
                x.belief[t], shift)  # fmt: skip
    for a in range(2):
        std[a] = max(p.pin[0] * x.belief[t, 0, a], p.pin[1])
    modes.pin(x.m[t], x.P[t], x.mu[t], x.belief[t, 0], std, shift, p.course, found.m[t], found.P[t])


@compiled
def sound(P: NDArray) -> bool:
    """Whether matrices P (K, 7, 7) are positive definite."""
    L = np.empty(P.shape[1:])
    for k in range(len(P)):
        if not cholesky(P[k], L):
            return False
    return True


@compiled
def update(x: Rows, which: NDArray, whole: NDArray, z: Seen, p: Tables, found: Found, state: NDArray) -> None:
    """All rows with detections after them, in place; state (T,) int: 0, 1 where lost, 2 where it cannot be used."""
    m, P, length, width = np.empty(7), np.empty((7, 7)), np.empty(x.length.shape[1:]), np.empty(x.width.shape[1:])
    for t in range(len(which)):
        modes.moments(x.m[t], x.P[t], x.mu[t], found.m[t], found.P[t])
        index = np.flatnonzero(z.mask[t])
        if len(index):
            heading = found.m[t, PHI]
            state[t] = locate(t, x, which[t], z, index, p, found, m, P)
            if state[t] == 2 or not move(t, x, z, index, p, found, m, P) or not sound(x.P[t]):
                state[t] = 2
                continue
            turned = math.cos(found.m[t, PHI] - heading) < 0
            resize(t, x, whole[t], turned, z, index, p, found, length, width)
            if not sound(x.P[t]) or not math.isfinite(found.m[t].sum()):
                state[t] = 2
                continue
            if len(p.mu) > 1:
                which[t] = 1 if x.belief[t, 0, 0] > p.truck_above else 0
        estimate(t, x, which[t], p, found)


predict_all = compiled.first(predict, "prediction of tracks", 10)
update_all = compiled.first(update, "update of tracks", 20)
