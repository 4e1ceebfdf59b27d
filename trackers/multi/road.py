"""The road map of a tracker: where the lanes are and which way they lead.

It is used for births of standing vehicles only: their range rate does not set them apart from a guard rail, so they
are born on a lane and nowhere else. Equations: docs/methods/multi-object-tracking.md, section 7.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


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
        if not len(self.a):
            return np.full(len(xy), -np.inf), np.zeros(len(xy))
        ex, ey = (self.b - self.a).T
        dx, dy = xy[:, 0, None] - self.a[:, 0], xy[:, 1, None] - self.a[:, 1]  # (M, L), apart: both are large
        t = np.clip((dx * ex + dy * ey) / (ex**2 + ey**2), 0, 1)  # (MOT.27)
        depth = self.half_width - np.hypot(dx - t * ex, dy - t * ey)  # (MOT.27)
        best = depth.argmax(-1)
        return depth[np.arange(len(xy)), best], np.arctan2(ey[best], ex[best])
