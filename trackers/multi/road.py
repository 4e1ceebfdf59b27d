"""The road map of a tracker: where the lanes are and which way they lead.

Standing vehicles are born on a lane and nowhere else, since their range rate does not set them apart from a guard rail,
and vehicles turn as their lane does. Equations: docs/methods/multi-object-tracking.md, section 7.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trackers.geometry import cross

ARC = 8.0  # [m] along a lane, back and ahead, over which its curvature is taken: the pieces of a map are rough
STRAIGHT, SHARPEST = 1e-4, 0.15  # [1/m] curvatures of a map below that are none, and above that are a corner's
ALONG = 0.7  # least cosine between a body and the lane that it drives on

Bend = Callable[[NDArray], NDArray]  # curvature (M,) [1/m] of the road that bodies at poses (M, 3) drive along


class RoadMap(NamedTuple):
    """Lanes as L straight pieces a -> b in the direction of travel."""

    a: NDArray  # (L, 2) [m]
    b: NDArray  # (L, 2) [m]
    half_width: NDArray  # (L,) [m]

    @classmethod
    def of(cls, lanes: list[tuple[ArrayLike, float]]) -> "RoadMap":
        """Map of lanes given as centre line (P, 2) [m] and full width [m]."""
        lines = [(np.asarray(line, float), width) for line, width in lanes if len(np.asarray(line)) > 1]
        if not lines:
            return cls(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
        a, b = (np.concatenate([line[part] for line, _ in lines]) for part in (slice(None, -1), slice(1, None)))
        half = np.repeat([width / 2 for _, width in lines], [len(line) - 1 for line, _ in lines])
        long = (a != b).any(-1)  # a repeated point is no piece of road
        return cls(a[long], b[long], half[long])

    def locate(self, xy: NDArray) -> tuple[NDArray, NDArray]:
        """Depth (M,) [m] of points (M, 2) inside the nearest lane, negative outside, and its direction (M,) [rad]."""
        depth, piece = self.nearest(xy)
        return depth, self.course(piece) if len(self.a) else np.zeros(len(xy))

    def course(self, piece: NDArray) -> NDArray:
        """Direction (M,) [rad] of the pieces with these rows (M,)."""
        ex, ey = (self.b[piece] - self.a[piece]).T
        return np.arctan2(ey, ex)

    def nearest(self, xy: NDArray) -> tuple[NDArray, NDArray]:
        """Depth (M,) [m] of points (M, 2) inside the nearest lane, negative outside, and its piece (M,) int."""
        if not len(self.a):
            return np.full(len(xy), -np.inf), np.zeros(len(xy), int)
        ex, ey = (self.b - self.a).T
        dx, dy = xy[:, 0, None] - self.a[:, 0], xy[:, 1, None] - self.a[:, 1]  # (M, L), apart: both are large
        t = np.clip((dx * ex + dy * ey) / (ex**2 + ey**2), 0, 1)  # (MOT.27)
        depth = self.half_width - np.hypot(dx - t * ex, dy - t * ey)  # (MOT.27)
        best = depth.argmax(-1)
        return depth[np.arange(len(xy)), best], best


class Bends(NamedTuple):
    """How the lanes of a map bend."""

    road: RoadMap
    curvature: NDArray  # (L,) [1/m] of the lanes at the pieces, positive to the left

    @classmethod
    def of(cls, road: RoadMap | None) -> "Bends | None":
        """Those of a map, None where all lanes are straight or there is no map."""
        if road is None or not len(road.a):
            return None
        first = np.flatnonzero(np.append(True, (road.b[:-1] != road.a[1:]).any(-1)))
        last = np.append(first[1:], len(road.a))
        lines = [np.concatenate([road.a[i:j], road.b[j - 1 : j]]) for i, j in zip(first, last, strict=True)]
        curvature = np.concatenate([_curvature(line) for line in lines])
        curvature[np.abs(curvature) < STRAIGHT] = 0.0
        return cls(road, curvature) if curvature.any() else None

    def at(self, pose: NDArray, beside: float = 0.0) -> NDArray:
        """Curvature (M,) [1/m] of the lane that bodies at pose (M, 3) drive along, up to beside [m] from it, else 0."""
        depth, piece = self.road.nearest(pose[:, :2])
        along = np.cos(self.road.course(piece) - pose[:, 2])
        on = (depth > -beside) & (np.abs(along) > ALONG)
        return np.where(on, np.sign(along) * self.curvature[piece], 0.0)


def _curvature(line: NDArray) -> NDArray:
    """Curvature (P - 1,) [1/m] in the middle of the pieces of a line (P, 2) [m]: of a circle through three points."""
    s = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    arc = min(ARC, s[-1] / 2)
    middle = np.clip((s[1:] + s[:-1]) / 2, arc, s[-1] - arc)  # at its ends that of where the arc begins
    p, q, r = (np.stack([np.interp(middle + d, s, x) for x in line.T], -1) for d in (-arc, 0.0, arc))
    sides = np.hypot(*(q - p).T) * np.hypot(*(r - q).T) * np.hypot(*(r - p).T)
    return np.clip(2 * cross(q - p, r - q) / np.maximum(sides, 1e-9), -SHARPEST, SHARPEST)  # (MOT.63)
