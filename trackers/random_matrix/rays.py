"""Rays against ellipses and boxes: nearest hits, sectors and fans of rays.

Either is a centre c (..., 2) [m] and a root L (..., 2, 2) [m]. An ellipse is c + L u over all unit vectors u, with the
matrix A = L L^T and det L > 0: in the coordinates q = L^-1 (z - c) it is the unit circle. A box is c + L [-1, 1]^2.
Equations: docs/methods/virtual-measurements.md.
"""

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import rotation, unit, wrap_angle

CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])


def root_of(size: NDArray, tilt: NDArray) -> NDArray:
    """Root L (..., 2, 2) [m] of ellipses with full length and width size (..., 2) [m] along tilt (...) [rad]."""
    return rotation(tilt) * (size / 2)[..., None, :]  # (VM.1)


def outline(centre: NDArray, L: NDArray, count: int = 25) -> NDArray:
    """Closed outlines (..., count, 2) [m] that begin at c + L e_x, the front end where L comes from `root_of`."""
    return centre[..., None, :] + unit(np.linspace(0, 2 * np.pi, count)) @ L.mT  # (VM.1)


def solve_root(L: NDArray, d: NDArray) -> NDArray:
    """L^-1 d (..., 2) for vectors d (..., 2), written out because the arrays are many and small."""
    a, b, c, e = L[..., 0, 0], L[..., 0, 1], L[..., 1, 0], L[..., 1, 1]
    det = a * e - b * c
    return np.stack([(e * d[..., 0] - b * d[..., 1]) / det, (a * d[..., 1] - c * d[..., 0]) / det], -1)


def near_hits(sensor: NDArray, bearing: NDArray, centre: NDArray, L: NDArray) -> NDArray:
    """Range (..., B) [m] at which each ray first meets the ellipse, inf for no hit.

    sensor (..., 2) [m], bearing (..., B) [rad]. A sensor inside has one hit in front of every ray.
    """
    o = solve_root(L, sensor - centre)[..., None, :]
    b = solve_root(L[..., None, :, :], unit(bearing))
    qa, qb, qc = (b * b).sum(-1), (b * o).sum(-1), (o * o).sum(-1) - 1
    disc = qb**2 - qa * qc
    root = np.sqrt(np.maximum(disc, 0.0))
    inside = qc < 0
    forward = -qb + root
    # Outside, the quotient keeps the digits that the difference -qb - root loses at grazing incidence.
    t = np.where(inside, forward / qa, qc / np.where(forward > 0, forward, 1.0))  # (VM.2)
    return np.where((disc >= 0) & (inside | (qb < 0)), t, np.inf)


def tangent_sector(sensor: NDArray, centre: NDArray, L: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Bearing of the centre (...), and the two tangents relative to it, right (...) <= 0 <= left (...) [rad].

    From inside the ellipse they are -pi and pi.
    """
    middle = np.arctan2(centre[..., 1] - sensor[..., 1], centre[..., 0] - sensor[..., 0])
    q = solve_root(L, centre - sensor)
    rho = np.hypot(q[..., 0], q[..., 1])
    inside = rho <= 1
    alpha = np.arcsin(1 / np.where(inside, 1.0, rho))
    psi = np.arctan2(q[..., 1], q[..., 0])
    sides = []
    for sign in (-1.0, 1.0):
        d = (L @ unit(psi + sign * alpha)[..., None])[..., 0]
        sides.append(np.where(inside, sign * np.pi, wrap_angle(np.arctan2(d[..., 1], d[..., 0]) - middle)))  # (VM.3)
    return middle, sides[0], sides[1]


def sector_fan(middle: NDArray, right: NDArray, left: NDArray, rays: int) -> NDArray:
    """Bearings (..., rays) [rad] at the midpoints of equal parts of the sector: smooth in the ellipse."""
    share = (np.arange(rays) + 0.5) / rays
    return middle[..., None] + right[..., None] + (left - right)[..., None] * share  # (VM.4)


def box_hits(sensor: NDArray, bearing: NDArray, centre: NDArray, L: NDArray) -> NDArray:
    """Range (..., B) [m] at which each ray first meets the box, inf for no hit; from inside, at which it leaves."""
    o = solve_root(L, sensor - centre)[..., None, :]
    b = solve_root(L[..., None, :, :], unit(bearing))
    b = np.where(np.abs(b) < 1e-12, 1e-12, b)  # parallel to a side: enters that slab far away, on one side or the other
    first, last = (-1 - o) / b, (1 - o) / b
    enter, leave = np.minimum(first, last).max(-1), np.maximum(first, last).min(-1)  # (VM.5)
    t = np.where(enter > 0, enter, leave)  # (VM.5)
    return np.where((enter <= leave) & (leave > 0), t, np.inf)


def box_sector(sensor: NDArray, centre: NDArray, L: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Bearing of the centre (...), and the outermost corners relative to it, right (...) <= 0 <= left (...) [rad]."""
    middle = np.arctan2(centre[..., 1] - sensor[..., 1], centre[..., 0] - sensor[..., 0])
    inside = (np.abs(solve_root(L, sensor - centre)) <= 1).all(-1)
    d = (centre - sensor)[..., None, :] + CORNERS @ L.mT
    turn = wrap_angle(np.arctan2(d[..., 1], d[..., 0]) - middle[..., None])
    return middle, np.where(inside, -np.pi, turn.min(-1)), np.where(inside, np.pi, turn.max(-1))  # (VM.6)


def box_outline(centre: NDArray, L: NDArray, count: int = 25) -> NDArray:
    """Closed outlines (..., count, 2) [m], evenly spaced over the four sides; count - 1 must be divisible by 4."""
    ring = np.concatenate([CORNERS, CORNERS[:1]])
    at = np.linspace(0, 4, count)
    points = np.stack([np.interp(at, np.arange(5), ring[:, i]) for i in range(2)], -1)
    return centre[..., None, :] + points @ L.mT
