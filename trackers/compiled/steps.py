"""The two compiled calls of a step: prediction and update of all T tracks, with their estimates."""

import math

import numpy as np
from numpy.typing import NDArray

from trackers.compiled import evidence, grids, htg, modes, size, spline
from trackers.compiled.jit import compiled
from trackers.compiled.linear import cholesky, wrap
from trackers.compiled.modes import LENGTH, OMEGA, PHI, SPEED, WIDTH, metres
from trackers.compiled.sized import STRAIGHT, around, curvature, outlined, sized
from trackers.compiled.tables import UNUSABLE, Found, Rows, Tables
from trackers.shade import Shade

AXLE_STD, CREEP, ROUNDING = 0.15, 1.0, 1e-9  # as in `trackers.motion.mixture` and `.turn`
STANDS = 1.0  # [m/s] as in `trackers.size.posterior`
LARGEST = 1e15  # as in `trackers.validation`


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
def estimate(t: int, f: Found, mu: NDArray, axle: NDArray, place_std: NDArray, outline: NDArray, log: bool) -> None:
    """(MODE.24) to (MODE.26), (MODE.31): row t of the box of place and motion, from the moments of the modes in f."""
    m, P, pose, cov, velocity, std = f.m[t], f.P[t], f.pose[0, t], f.cov[0, t], f.velocity[t], f.std[t]
    cos, sin, l, w = math.cos(m[PHI]), math.sin(m[PHI]), metres(m[LENGTH], log), metres(m[WIDTH], log)
    mean = square = 0.0
    for k in range(len(mu)):
        mean += mu[k] * axle[k]
        square += mu[k] * axle[k] ** 2
    d = l * mean
    more = P[PHI, PHI] * P[SPEED, SPEED] + (l * m[OMEGA]) ** 2 * (square - mean**2 + AXLE_STD**2)
    velocity_cov(m, P, d, more, cov)
    around(cov, cos, sin, (l * place_std[0]) ** 2, (w * place_std[1]) ** 2)
    velocity[0], velocity[1] = m[SPEED] * cos - m[OMEGA] * d * sin, m[SPEED] * sin + m[OMEGA] * d * cos
    pose[0], pose[1], pose[2] = m[0], m[1], wrap(m[PHI])
    outlined(outline, pose, l, w, f.contour[0, t])
    slip = (l * m[OMEGA]) ** 2 / max(m[SPEED] ** 2, CREEP**2)
    std[0], std[1] = math.sqrt(P[PHI, PHI] + AXLE_STD**2 * slip), math.sqrt(P[OMEGA, OMEGA])  # (MODE.31)
    std[2], std[3] = math.sqrt(P[LENGTH, LENGTH]), math.sqrt(P[WIDTH, WIDTH])
    if log:
        std[2] *= l
        std[3] *= w
    f.size[0, t, 0], f.size[0, t, 1] = l, w


@compiled
def usable(a: NDArray) -> bool:
    """Whether all numbers are finite and not beyond `LARGEST`."""
    square = 0.0
    for x in a.flat:
        square += x * x
    return square <= LARGEST**2


@compiled
def predict(
    old: Rows, x: Rows, which: NDArray, dt: float, kept: float, keep: float, over_length: NDArray, over_width: NDArray,
    p: Tables, f: Found,
) -> bool:  # fmt: skip
    """Motion and size of all rows after dt, from `old` into x; kept and keep: of the mode, and of what was detected.

    False where some number is not finite or too large.
    """
    length, width = np.empty(old.length.shape[1:]), np.empty(old.width.shape[1:])
    fit = np.empty(len(p.modes))
    for t in range(len(which)):
        x.curvature[t] = bend = old.curvature[t]
        x.ahead[t] = old.ahead[t] + modes.driven(old.m[t], old.P[t], old.mu[t], dt)
        modes.mix(old.m[t], old.P[t], old.mu[t], kept, p.onset, p.common[4], dt, x.m[t], x.P[t], x.mu[t])
        for k in range(len(p.modes)):
            fit[k] = modes.move(x.m[t, k], x.P[t, k], dt, p.modes[k], p.common, p.size_walk, p.log_size, bend)
        modes.reweight(x.mu[t], fit)
        modes.moments(x.m[t], x.P[t], x.mu[t], f.m[t], f.P[t])
        x.anchor[t] = old.anchor[t]
        x.behind[t], x.bent[t], x.aside[t] = keep * old.behind[t], keep * old.bent[t], keep * old.aside[t]
        grids.forget(old.length[t], keep, over_length, length, x.length[t])
        grids.forget(old.width[t], keep, over_width, width, x.width[t])
        bent = 1 - math.exp(-x.bent[t] / p.enough_bent)  # (ENDS.34)
        grids.believe(p.grid_l, p.grid_w, p.shares, p.of_length, p.of_width, p.loads, p.bends, p.bend_at, length,
                      width, x.behind[t], bent, x.belief[t], x.of_length[t], x.of_width[t], x.kind[t])  # fmt: skip
        estimate(t, f, x.mu[t], p.axle, p.place_std, p.outline[which[t]], p.log_size)
        sized(t, f, x.belief[t], x.kind[t], x.anchor[t], x.aside[t], p.outline[which[t]], p)
    return usable(x.m) and usable(x.P)


@compiled
def sound(P: NDArray) -> bool:
    """Whether matrices P (K, 7, 7) are positive definite."""
    L = np.empty(P.shape[1:])
    for k in range(len(P)):  # noqa: SIM110 - numba has no generators here
        if not cholesky(P[k], L):
            return False
    return True


@compiled
def update(
    x: Rows, which: NDArray, whole: NDArray, z: NDArray, start: NDArray, shade: Shade, p: Tables, f: Found,
    state: NDArray,
) -> None:  # fmt: skip
    """All rows with detections after them, in place; state (T,) int: 0, 1 where lost, 2 where it cannot be used.

    Detections of row t are start[t] to start[t + 1] of z; shade is what of other rows hides them.
    """
    m, P, length, width = np.empty(7), np.empty((7, 7)), np.empty(x.length.shape[1:]), np.empty(x.width.shape[1:])
    box, was, shift, std = np.empty(3), np.empty(2), np.empty(2), np.empty(2)
    for t in range(len(which)):
        modes.moments(x.m[t], x.P[t], x.mu[t], f.m[t], f.P[t])
        mine, q = z[start[t] : start[t + 1]], which[t]
        if len(mine):
            before = f.m[t, :3].copy()
            if len(p.bins):
                state[t] = htg.update(f.m[t], f.P[t], p.bins, p.scores, mine, p.htg, m, P, f.eps[t], f.S[t])
            else:
                state[t] = spline.update(f.m[t], f.P[t], p.mu[q], p.Sigma[q], p.visible[q], mine, p.cover, p.spline,
                                         p.iterations, m, P, f.eps[t], f.S[t])  # fmt: skip
            good = state[t] < UNUSABLE and evidence.move(
                x.mu[t], x.m[t], x.P[t], p.log_size, f.m[t], f.P[t], m, P, p.axle, mine, p.rates, x.ahead[t : t + 1]
            )
            if not good or not sound(x.P[t]):
                state[t] = UNUSABLE
                continue
            box[0], box[1], box[2] = f.m[t, 0], f.m[t, 1], wrap(f.m[t, PHI])
            was[0], was[1] = metres(f.m[t, LENGTH], p.log_size), metres(f.m[t, WIDTH], p.log_size)
            if math.cos(f.m[t, PHI] - before[2]) < 0:  # front and rear changed places
                x.anchor[t] *= -1
                x.behind[t] = 0.0
            speed = math.hypot(f.m[t, SPEED], f.m[t, OMEGA] * was[0] * np.dot(x.mu[t], p.axle))
            off_axis, beside = size.read(x.length[t], x.width[t], x.behind[t], x.anchor[t], before, box, was, whole[t],
                                         mine, p.grid_l, p.near_l, p.far_l, p.grid_w, p.near_w, p.far_w, p.sheet,
                                         p.size, speed < STANDS, x.belief[t, 1, 0], shade, t)  # fmt: skip
            x.aside[t] += beside
            if curvature(f.m[t, OMEGA], math.sqrt(f.P[t, OMEGA, OMEGA]), speed) < STRAIGHT:
                x.bent[t] = max(x.bent[t] - off_axis, 0.0)
            else:
                x.bent[t] += len(mine)  # (ENDS.34)
            grids.to_likelihood(x.length[t], 1.0, length)
            grids.to_likelihood(x.width[t], 1.0, width)
            bent = 1 - math.exp(-x.bent[t] / p.enough_bent)  # (ENDS.34)
            grids.believe(p.grid_l, p.grid_w, p.shares, p.of_length, p.of_width, p.loads, p.bends, p.bend_at, length,
                          width, x.behind[t], bent, x.belief[t], x.of_length[t], x.of_width[t], x.kind[t])  # fmt: skip
            size.centre(x.length[t], x.width[t], p.grid_l[1], p.grid_w[1], x.anchor[t], box, was, x.belief[t], shift)
            for a in range(2):
                std[a] = max(p.pin[0] * x.belief[t, 0, a], p.pin[1])
            modes.pin(x.m[t], x.P[t], x.mu[t], x.belief[t, 0], std, p.log_size, shift, p.course, f.m[t], f.P[t])
            if not (sound(x.P[t]) and usable(x.m[t]) and usable(x.P[t])):
                state[t] = UNUSABLE
                continue
            if len(p.mu) > 1:
                which[t] = 1 if x.belief[t, 0, 0] > p.truck_above else 0
        estimate(t, f, x.mu[t], p.axle, p.place_std, p.outline[which[t]], p.log_size)
        sized(t, f, x.belief[t], x.kind[t], x.anchor[t], x.aside[t], p.outline[which[t]], p)


predict_all = compiled.first(predict, "prediction of tracks", 8)
update_all = compiled.first(update, "update of tracks", 20)
