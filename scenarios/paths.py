"""Smooth planar paths by arc length, and the highway-env lane that lies on one.

highway-env's polygonal lane has a heading that jumps; a `SmoothPath` interpolates with cubic Hermite pieces. y points
to the driver's right, so a positive lateral offset is to the right and a positive curvature bends to the right.
"""

import math
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from highway_env.road.lane import AbstractLane, LineType
from numpy.typing import ArrayLike, NDArray

from trackers.geometry import perpendicular, unit

STEP = 1.0  # [m] between the nodes of a path


@dataclass(frozen=True, eq=False)
class SmoothPath:
    """A curve with nodes about a metre apart; beyond its ends it goes on straight."""

    s: NDArray  # (n,) [m] arc length
    xy: NDArray  # (n, 2) [m]
    tangent: NDArray  # (n, 2) unit vectors
    bend: NDArray  # (n,) [1/m] curvature

    @property
    def length(self) -> float:
        """Arc length from end to end [m]."""
        return float(self.s[-1])

    def _piece(self, s: ArrayLike) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """Piece index, local parameter in [0, 1], piece length and overshoot beyond the ends of arc lengths s."""
        s = np.asarray(s, float)
        inside = np.clip(s, 0.0, self.s[-1])
        i = np.clip(np.searchsorted(self.s, inside, side="right") - 1, 0, len(self.s) - 2)
        h = self.s[i + 1] - self.s[i]
        return i, ((inside - self.s[i]) / h)[..., None], h[..., None], (s - inside)[..., None]

    def heading(self, s: ArrayLike) -> NDArray:
        """Direction (...) [rad] at arc lengths s (...), wrapped."""
        i, u, h, _ = self._piece(s)
        chord = (self.xy[i + 1] - self.xy[i]) / h
        a, b = self.tangent[i], self.tangent[i + 1]
        d = 6 * u * (1 - u) * chord + (1 - u) * (1 - 3 * u) * a + u * (3 * u - 2) * b
        return np.arctan2(d[..., 1], d[..., 0])

    def curvature(self, s: ArrayLike) -> NDArray:
        """Curvature (...) [1/m], 0 beyond the ends."""
        return np.interp(np.asarray(s, float), self.s, self.bend, left=0.0, right=0.0)

    def position(self, s: ArrayLike, lateral: ArrayLike = 0.0) -> NDArray:
        """Points (..., 2) [m] at arc lengths s (...), `lateral` (...) [m] to the right of the path."""
        i, u, h, over = self._piece(s)
        a, b = self.tangent[i], self.tangent[i + 1]
        blend = u * u * (3 - 2 * u)
        xy = (1 - blend) * self.xy[i] + blend * self.xy[i + 1] + h * u * (1 - u) * ((1 - u) * a - u * b)
        along = unit(self.heading(s))
        return xy + over * along + np.asarray(lateral, float)[..., None] * perpendicular(along)

    @cached_property
    def _floats(self) -> tuple[list[float], list[list[float]]]:
        """Arc lengths of the nodes, and per piece its length, end points and end tangents: lists are read faster."""
        columns = (np.diff(self.s)[:, None], self.xy[:-1], self.xy[1:], self.tangent[:-1], self.tangent[1:])
        return self.s.tolist(), np.hstack(columns).tolist()

    def pose(self, s: float) -> tuple[float, float, float, float]:
        """Point x, y [m] and unit tangent at one arc length; `position` in plain floats, ten times faster."""
        knots, pieces = self._floats
        inside = min(max(s, 0.0), knots[-1])
        i = min(bisect_right(knots, inside) - 1, len(pieces) - 1)
        h, x0, y0, x1, y1, c0, n0, c1, n1 = pieces[i]
        u = (inside - knots[i]) / h
        w, p, q = 6 * u * (1 - u) / h, (1 - u) * (1 - 3 * u), u * (3 * u - 2)
        dx, dy = w * (x1 - x0) + p * c0 + q * c1, w * (y1 - y0) + p * n0 + q * n1
        norm = math.hypot(dx, dy)
        dx, dy = dx / norm, dy / norm
        b, p, q = u * u * (3 - 2 * u), h * u * (1 - u) ** 2, -h * u * u * (1 - u)
        x = x0 + b * (x1 - x0) + p * c0 + q * c1 + (s - inside) * dx
        y = y0 + b * (y1 - y0) + p * n0 + q * n1 + (s - inside) * dy
        return x, y, dx, dy

    def project(self, xy: NDArray) -> tuple[float, float]:
        """Arc length and lateral offset [m] of one point (2,)."""
        px, py = float(xy[0]), float(xy[1])
        i = int(((self.xy[:, 0] - px) ** 2 + (self.xy[:, 1] - py) ** 2).argmin())
        s, lateral, bend = float(self.s[i]), 0.0, float(self.bend[i])
        for _ in range(5):  # Newton on the foot of the perpendicular: two or three steps reach rounding
            x, y, c, n = self.pose(s)
            ahead, lateral = (px - x) * c + (py - y) * n, (py - y) * c - (px - x) * n
            if abs(ahead) < 1e-9:
                break
            s += ahead / max(1.0 - bend * lateral, 0.1) if 0.0 < s + ahead < self.s[-1] else ahead
        return s, lateral

    def offset(self, lateral: float) -> "SmoothPath":
        """The parallel path `lateral` [m] to the right."""
        return from_nodes(self.xy + lateral * perpendicular(self.tangent), self.tangent)

    def __deepcopy__(self, memo: dict) -> "SmoothPath":
        """Nothing in a path ever changes, so planners' copies of the world share it."""
        return self


def from_nodes(xy: NDArray, tangent: NDArray) -> SmoothPath:
    """Path through nodes (n, 2) [m] with tangents (n, 2) of any length."""
    tangent = tangent / np.linalg.norm(tangent, axis=-1, keepdims=True)
    heading = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    half = np.diff(heading) / 2
    arc = np.linalg.norm(np.diff(xy, axis=0), axis=-1) / np.sinc(half / np.pi)  # chord to arc of a circle
    s = np.concatenate([[0.0], np.cumsum(arc)])
    return SmoothPath(s, xy, tangent, np.gradient(heading, s))


def through(points: ArrayLike) -> SmoothPath:
    """Natural cubic spline by chord length through the points (p, 2) [m]."""
    p = np.asarray(points, float)
    t = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=-1))])
    h = np.diff(t)
    A = np.eye(len(p))
    rhs = np.zeros_like(p)
    for k in range(1, len(p) - 1):
        A[k, k - 1 : k + 2] = h[k - 1], 2 * (h[k - 1] + h[k]), h[k]
        rhs[k] = 6 * ((p[k + 1] - p[k]) / h[k] - (p[k] - p[k - 1]) / h[k - 1])
    M = np.linalg.solve(A, rhs)  # second derivatives at the points
    q = np.linspace(0.0, t[-1], max(round(t[-1] / STEP), 2) + 1)
    i = np.clip(np.searchsorted(t, q, side="right") - 1, 0, len(h) - 1)
    g, a, b = h[i][:, None], (t[i + 1] - q)[:, None], (q - t[i])[:, None]
    left, right = p[i] / g - M[i] * g / 6, p[i + 1] / g - M[i + 1] * g / 6
    xy = (M[i] * a**3 + M[i + 1] * b**3) / (6 * g) + left * a + right * b
    return from_nodes(xy, (M[i + 1] * b**2 - M[i] * a**2) / (2 * g) - left + right)


def along(start: ArrayLike, pieces: tuple[tuple[float, float], ...], ramp: float = 0.0) -> SmoothPath:
    """Path from pieces of constant curvature.

    start (3,): x, y [m], heading [rad]; pieces: (length [m], curvature [1/m]). The curvature passes from piece to piece
    over `ramp` [m] (a clothoid), centred on the joint.
    """
    x, y, heading = np.asarray(start, float)
    total = sum(length for length, _ in pieces)
    n = max(round(total / STEP), 2)
    fine = np.linspace(0.0, total, 20 * n + 1)
    ends = np.cumsum([length for length, _ in pieces])
    turn_at = np.concatenate([[0.0], np.cumsum([length * k for length, k in pieces])])
    knots, shifts = np.concatenate([[0.0], ends]), np.linspace(-ramp / 2, ramp / 2, 41)
    primitive = (np.interp(fine + e, knots, turn_at) for e in shifts)
    theta = heading + np.mean(list(primitive), axis=0)  # box-filtered heading: box-filtered curvature
    rate = unit(theta)
    step = np.diff(fine)[:, None] * (rate[1:] + rate[:-1]) / 2
    xy = np.array([x, y]) + np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
    return from_nodes(xy[::20], rate[::20])


def of_lanes(lanes: tuple[AbstractLane, ...], smooth: float = 8.0) -> SmoothPath:
    """Drivable path along consecutive lanes.

    The centre lines are averaged over `smooth` [m]: the curvature is continuous where lanes of different kinds meet,
    and a bend of radius R is cut by smooth^2 / (24 R).
    """
    points = []
    for lane in lanes:
        n = max(round(lane.length / (STEP / 4)), 2)
        points.append(np.array([lane.position(s, 0.0) for s in np.linspace(0.0, lane.length, n)[:-1]]))
    last = lanes[-1]
    raw = np.vstack([*points, last.position(last.length, 0.0)[None]])
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(raw, axis=0), axis=-1))])
    q = np.linspace(0.0, s[-1], max(round(s[-1] / STEP), 2) + 1)
    shifts = np.linspace(-smooth / 2, smooth / 2, 41)
    first, final = (raw[1] - raw[0]) / (s[1] - s[0]), (raw[-1] - raw[-2]) / (s[-1] - s[-2])

    def at(where: NDArray) -> NDArray:
        inside = np.stack([np.interp(where, s, raw[:, k]) for k in (0, 1)], -1)
        return inside + np.minimum(where, 0)[:, None] * first + np.maximum(where - s[-1], 0)[:, None] * final

    xy = np.mean([at(q + e) for e in shifts], axis=0)
    return from_nodes(xy, np.gradient(xy, q, axis=0, edge_order=2))


class PathLane(AbstractLane):
    """A lane of constant width on a `SmoothPath`, with highway-env's lane interface."""

    priority = 0

    def __init__(
        self,
        path: SmoothPath,
        width: float = AbstractLane.DEFAULT_WIDTH,
        line_types: tuple[int, int] = (LineType.STRIPED, LineType.STRIPED),
        forbidden: bool = False,
        speed_limit: float = 20.0,
    ) -> None:
        self.path = path
        self.length = path.length
        self.width = width
        self.line_types = line_types
        self.forbidden = forbidden
        self.speed_limit = speed_limit

    def position(self, longitudinal: float, lateral: float) -> NDArray:
        """World point (2,) [m]."""
        x, y, c, s = self.path.pose(float(longitudinal))
        return np.array([x - lateral * s, y + lateral * c])

    def local_coordinates(self, position: NDArray) -> tuple[float, float]:
        """Longitudinal and lateral coordinate [m] of a world point (2,)."""
        return self.path.project(position)

    def heading_at(self, longitudinal: float) -> float:
        """Direction [rad], wrapped."""
        _, _, c, s = self.path.pose(float(longitudinal))
        return math.atan2(s, c)

    def width_at(self, longitudinal: float) -> float:
        """Width [m], the same everywhere."""
        return self.width

    def to_config(self) -> dict[str, Any]:
        """Refuse: a path has no short description that highway-env's own lanes could be rebuilt from."""
        raise TypeError("a PathLane cannot be written as a highway-env lane config; rebuild the scenario from its seed")
