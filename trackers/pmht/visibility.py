"""Which part of a contour a sensor sees: prior weights of the ellipses, for each detection from its own sensor.

Equations: docs/methods/spline-pmht.md. The paper's sensor sees every side at once; ours sees one to three, and equal
weights would explain a one-sided scan by ellipses of all sides. Rays from far away, in each of A directions, say which
share of the outline's lit arc lies at each ellipse. Shares are interpolated between the directions, and each ellipse
has its own direction: seen from beside a long vehicle, its front and its rear lie at different angles.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import cross, dot, unit
from trackers.pmht.model import basis, slope_basis

DIRECTIONS = 36
POINTS = 4  # on the arc of an ellipse
CLEAR = 0.05  # [m] an edge hides points that lie farther than this behind it


@lru_cache(maxsize=8)
def arc_bases(L: int, n_c: int, degree: int, points: int = POINTS) -> tuple[NDArray, NDArray]:
    """Weights (L points, n_c) of points spread over the arcs of the ellipses, and of the tangents there."""
    r = ((np.arange(L)[:, None] + (np.arange(points) + 0.5) / points - 0.5) * (n_c / L)).ravel() % n_c
    return basis(r, n_c, degree), slope_basis(r, n_c, degree)


def visibility_table(
    p: NDArray, size: NDArray, L: int, degree: int = 3, grazing: float = 0.5, points: int = POINTS
) -> NDArray:
    """Share (..., A, L) of the outline's arc that is lit from each direction and lies at each ellipse.

    Rows of directions 2 pi a / A, counter-clockwise from ahead, sum to 1. p (..., n_c, 2) control points, size (..., 2)
    [m]. An arc counts with its length times cos(angle of incidence)^(1 - grazing): `grazing` 0 spreads detections
    evenly over the projected outline, 1 over its true length. The cost grows with the square of `points` on each arc.
    """
    at, tangents = arc_bases(L, p.shape[-2], degree, points)
    q = (at @ p) * size[..., None, :]  # (..., Q, 2)
    t = (tangents @ p) * size[..., None, :]
    length = np.sqrt(dot(t, t))
    toward = unit(np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS))  # (A, 2)
    turn = np.sign(cross(q, np.roll(q, -1, -2)).sum(-1))[..., None, None]  # 1 where the curve is counter-clockwise
    incidence = turn * cross(toward[:, None], t[..., None, :, :]) / np.maximum(length, 1e-12)[..., None, :]
    lit = ~hidden(q, toward) & (incidence > 0)
    arc = np.where(lit, length[..., None, :] * np.maximum(incidence, 1e-12) ** (1 - grazing), 0.0)  # (PMHT.21)
    share = arc.reshape(*arc.shape[:-1], L, points).sum(-1)
    return share / np.maximum(share.sum(-1, keepdims=True), 1e-12)  # (PMHT.21)


def hidden(q: NDArray, toward: NDArray) -> NDArray:
    """Which corners (..., A, Q) the polygon q (..., Q, 2) itself hides from sensors far away at unit vectors (A, 2)."""
    side = cross(toward[:, None], q[..., None, :, :])  # (..., A, Q) across the line of sight
    depth = dot(toward[:, None], q[..., None, :, :])  # towards the sensor
    side_b, depth_b = np.roll(side, -1, -1), np.roll(depth, -1, -1)
    a, b = side[..., None, :] - side[..., None], side_b[..., None, :] - side[..., None]  # (..., A, Q, Q)
    crosses = (a < 0) != (b < 0)
    share = np.where(crosses, a / np.where(crosses, a - b, 1.0), 0.0)
    ahead = depth[..., None, :] + share * (depth_b - depth)[..., None, :] - depth[..., None]
    return (crosses & (ahead > CLEAR)).any(-1)


def weights(table: NDArray, direction: NDArray, unseen: float) -> NDArray:
    """Weights (..., M, L) of the ellipses for directions (..., M, L) [rad] to the sensor in the body frame.

    table (..., A, L) of `visibility_table`; the share `unseen` is spread over all ellipses. Rows sum to 1.
    """
    A, L = table.shape[-2:]
    at = (direction % (2 * np.pi)) * (A / (2 * np.pi))
    low = np.floor(at).astype(int)
    part = at - low
    low, high = low % A, (low + 1) % A
    flat = table.reshape(-1)
    first = L * A * np.arange(flat.size // (A * L)).reshape(*table.shape[:-2], 1, 1) + np.arange(L)  # of each table
    share = (1 - part) * flat[first + low * L] + part * flat[first + high * L]
    share = share / np.maximum(share.sum(-1, keepdims=True), 1e-12)
    return (1 - unseen) * share + unseen / L  # (PMHT.22)


def directions(c: NDArray, phi: NDArray, sensor: NDArray) -> NDArray:
    """Body-frame directions (..., M, L) [rad] from the ellipses at c (..., 2, L) [m] to sensors (..., M, 2) [m].

    Positions are relative to the same point; phi (...) [rad] is the heading.
    """
    d = sensor[..., None] - c[..., None, :, :]
    return np.arctan2(d[..., 1, :], d[..., 0, :]) - phi[..., None, None]
