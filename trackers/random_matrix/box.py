"""Rays against boxes: nearest hits and sectors, with the arguments of `trackers.random_matrix.ellipse`.

A box is a centre c (..., 2) [m] and a root L (..., 2, 2) [m] whose columns are its half axes: c + L [-1, 1]^2.
Equations: docs/methods/virtual-measurements.md.
"""

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import unit, wrap_angle
from trackers.random_matrix.ellipse import solve_root

CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])


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
