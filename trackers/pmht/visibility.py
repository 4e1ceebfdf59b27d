"""Which part of a contour a sensor sees: prior weights of the ellipses, for each detection from its own sensor.

Equations: docs/methods/spline-pmht.md. The paper's sensor sees every side at once; ours sees one to three, and equal
weights would explain a one-sided scan by ellipses of all sides. Rays from far away, in each of A directions, say which
share of the outline's lit arc lies at each ellipse. Shares are interpolated between the directions, and each ellipse
has its own direction: seen from beside a long vehicle, its front and its rear lie at different angles.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from trackers.geometry import cross, dot, unit, wrap_angle
from trackers.pmht.model import basis, slope_basis
from trackers.scan import Scan, SensorModel

DIRECTIONS = 36
POINTS = 4  # on the arc of an ellipse
CLEAR = 0.05  # [m] an edge hides points that lie farther than this behind it
EDGE = 0.3  # [m] softness of the edges of a field of view: place and extent of an ellipse are not exact
LEAST_COVER = 1e-3  # share of an ellipse out of range and view


class View(NamedTuple):
    """The sensors of M detections, and what they cover."""

    place: NDArray  # (..., M or 1, 2) [m] relative to the same point as the ellipses
    heading: NDArray  # (..., M or 1) [rad]
    half: NDArray  # (..., M or 1) [rad] half the opening angle
    max_range: NDArray  # (..., M or 1) [m]

    @classmethod
    def of(cls, scan: Scan, origin: NDArray, sensors: tuple[SensorModel, ...]) -> "View":
        """That of a scan, relative to origin (..., 2) [m]; without data sheets sensors see everywhere."""
        pose = scan.pose
        place = pose[..., :2] - origin[..., None, :]
        if not sensors:
            everywhere = np.full(pose.shape[:-1], np.inf)
            return cls(place, pose[..., 2], everywhere, everywhere)
        if scan.sensor.max(initial=0) >= len(sensors):
            raise ValueError(
                f"scan.sensor must index the {len(sensors)} data sheets of the filter, got up to {scan.sensor.max()}; "
                "give it those of the radar by on_sensors(radar.models)"
            )
        half, reach = (np.array(a)[scan.sensor] for a in ([s.fov / 2 for s in sensors], [s.max_range for s in sensors]))
        return cls(place, pose[..., 2], half, reach)

    def cover(self, c: NDArray) -> NDArray:
        """Share (..., M, L) of ellipses at c (..., 2, L) [m] within range and field of view."""
        d = c[..., None, :, :] - self.place[..., None]
        r = np.hypot(d[..., 0, :], d[..., 1, :])
        azimuth = np.abs(wrap_angle(np.arctan2(d[..., 1, :], d[..., 0, :]) - self.heading[..., None]))
        inside = np.minimum(self.max_range[..., None] - r, (self.half[..., None] - azimuth) * r)
        return np.maximum(ndtr(inside / EDGE), LEAST_COVER)  # (PMHT.40)


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


def weights(table: NDArray, direction: NDArray, unseen: float, cover: NDArray | float = 1.0) -> NDArray:
    """Weights (..., M, L) of the ellipses for directions (..., M, L) [rad] to the sensor in the body frame.

    table (..., A, L) of `visibility_table`; the share `unseen` is spread over all ellipses; cover (..., M, L) is the
    share of each that its sensor covers. Rows sum to 1.
    """
    A, L = table.shape[-2:]
    at = (direction % (2 * np.pi)) * (A / (2 * np.pi))
    low = np.floor(at).astype(int)
    part = at - low
    low, high = low % A, (low + 1) % A
    flat = table.reshape(-1)
    first = L * A * np.arange(flat.size // (A * L)).reshape(*table.shape[:-2], 1, 1) + np.arange(L)  # of each table
    share = cover * ((1 - part) * flat[first + low * L] + part * flat[first + high * L])
    share = share / np.maximum(share.sum(-1, keepdims=True), 1e-12)
    return (1 - unseen) * share + unseen / L  # (PMHT.22)


def directions(c: NDArray, phi: NDArray, sensor: NDArray) -> NDArray:
    """Body-frame directions (..., M, L) [rad] from the ellipses at c (..., 2, L) [m] to sensors (..., M, 2) [m].

    Positions are relative to the same point; phi (...) [rad] is the heading.
    """
    d = sensor[..., None] - c[..., None, :, :]
    return np.arctan2(d[..., 1, :], d[..., 0, :]) - phi[..., None, None]
