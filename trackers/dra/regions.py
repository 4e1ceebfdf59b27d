"""The five regions of the body and the gates around them.

Equations: docs/methods/data-regions.md, after Xu et al. (2023). A point of region i is q = alpha p1 + beta p2 from the
centroid, alpha and beta linear in s1, s2, both even on [0, 1].

                left
        p4 ------------- p1
    rear |   interior    |  front     sides run p2 to p1, p3 to p2, p4 to p3, p1 to p4
        p3 ------------- p2
               right
"""

import numpy as np
from numpy.typing import NDArray

from trackers.dra.state import P1, P2, PLACE, Axes, axes
from trackers.geometry import cross
from trackers.linalg import outer

REGIONS = 5
FRONT, RIGHT, REAR, LEFT, INTERIOR = range(REGIONS)
# (DRA.4): alpha and beta (region, 3) as weights of 1, s1, s2
ALPHA = np.array([[0, 1, 0], [-1, 1, 0], [0, -1, 0], [1, -1, 0], [1, -1, -1]], float)
BETA = np.array([[1, -1, 0], [0, 1, 0], [-1, 1, 0], [0, -1, 0], [0, 1, -1]], float)
MIDDLE = np.array([1.0, 0.5, 0.5])  # the mean of 1, s1, s2
# Corners (4, 2) that a side joins, as weights of p1, p2: p1, p2, p3, p4
CORNERS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]], float)
FROM, TO = [1, 2, 3, 0], [0, 1, 2, 3]  # corners at s1 = 0 and s1 = 1 of the four sides
TIE = 1e-6  # [m] off a corner two sides are as near: the first is taken, whatever the rounding
LEAST_SINE = 1e-3  # between the axes; a flat parallelogram has no coordinates


def corners(m: NDArray) -> NDArray:
    """The four corners (..., 4, 2) [m] p1, p2, p3, p4 from the centroid, of states m (..., 11)."""
    p = np.stack([m[..., P1], m[..., P2]], -2)
    return CORNERS @ p


def region_moments(m: NDArray) -> tuple[NDArray, NDArray]:
    """Mean (..., 5, 2) [m] from the centroid and covariance (..., 5, 2, 2) [m^2] of points of each region."""
    p = np.stack([m[..., P1], m[..., P2]], -2)
    weight = np.stack([ALPHA, BETA], -1)  # (5, 3, 2)
    q = weight @ p[..., None, :, :]  # (..., 5, 3, 2): constant, along s1, along s2
    return MIDDLE @ q, (outer(q[..., 1, :]) + outer(q[..., 2, :])) / 12  # (DRA.6)


def gates(m: NDArray, xy: NDArray, R: NDArray, t: float, interior: float, sigmas: float) -> NDArray:
    """Which regions (..., M, 5) the detections xy (..., M, 2) [m] may come from; R (..., M, 2, 2) is their noise.

    t and `interior` scale the gates of sides and interior, `sigmas` their margins. Gates grow with the side that they
    belong to; the paper prints the width's for all four. A detection outside all gates belongs to the nearest side.
    """
    a = axes(m)
    e = oblique(a, xy - m[..., None, PLACE])
    half = np.stack([a.length, a.width])[..., None] / 2  # (2, ..., 1) along the length, along the width
    margin = sigmas * np.sqrt(np.stack([_spread(R, a.along), _spread(R, a.left)]))  # (DRA.8)
    beside = np.abs(e) <= (1 + 2 * t) * half + margin  # (2, ..., M) not beyond the ends
    thick = 2 * t * half + margin
    above, below = np.abs(e - half) <= thick, np.abs(e + half) <= thick
    inside = np.abs(e) <= interior * half + margin
    along, across = 0, 1
    found = np.empty((*e.shape[1:], REGIONS), bool)
    found[..., FRONT] = above[along] & beside[across]  # (DRA.9a)
    found[..., RIGHT] = below[across] & beside[along]  # (DRA.9a)
    found[..., REAR] = below[along] & beside[across]  # (DRA.9a)
    found[..., LEFT] = above[across] & beside[along]  # (DRA.9a)
    found[..., INTERIOR] = inside[along] & inside[across]  # (DRA.9b)
    lost = ~found.any(-1)
    if lost.any():
        nearest = (side_distance(e[:, lost], np.broadcast_to(half, e.shape)[:, lost]) + TIE * np.arange(4)).argmin(-1)
        found[(*np.nonzero(lost), nearest)] = True
    return found


def oblique(a: Axes, d: NDArray) -> NDArray:
    """Coordinates (2, ..., M) [m] of the vectors d (..., M, 2) along the axes of a parallelogram."""
    u, v = a.along[..., None, :], a.left[..., None, :]
    sine = cross(u, v)
    sine = np.where(np.abs(sine) < LEAST_SINE, LEAST_SINE, sine)
    return np.stack([cross(d, v), cross(u, d)]) / sine  # (DRA.7)


def side_distance(e: NDArray, half: NDArray) -> NDArray:
    """Distance (..., 4) [m] of oblique coordinates e (2, ...) [m] from the sides of a body of half axes half (2, ...).

    As if the axes were at right angles, like the gates: by the distance on the ground a sheared body that lags behind
    would shear more, and the error of a single motion model in the turn of Xu et al. (2023) grows by half.
    """
    along, across = e
    half_length, half_width = half
    past_end, past_flank = np.maximum(np.abs(e) - half, 0.0)
    front, rear = (np.hypot(along - s * half_length, past_flank) for s in (1, -1))  # (DRA.10)
    left, right = (np.hypot(across - s * half_width, past_end) for s in (1, -1))  # (DRA.10)
    return np.stack([front, right, rear, left], -1)


def _spread(R: NDArray, axis: NDArray) -> NDArray:
    """Variance (..., M) of noise R (..., M, 2, 2) along axis (..., 2)."""
    u, v = axis[..., None, 0], axis[..., None, 1]
    return u * u * R[..., 0, 0] + 2 * u * v * R[..., 0, 1] + v * v * R[..., 1, 1]
