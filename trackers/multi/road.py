"""What a map tells a tracker: where lanes are. Only things that stand still need it.

A vehicle that is first seen standing has no Doppler that sets it apart from a guard rail; it is born where lanes
are and nowhere else (card multi_object, pitfall 10).
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
        e = self.b - self.a
        d = xy[:, None] - self.a  # (M, L, 2)
        t = np.clip((d * e).sum(-1) / (e**2).sum(-1), 0, 1)
        off = d - t[..., None] * e
        depth = self.half_width - np.hypot(off[..., 0], off[..., 1])
        best = depth.argmax(-1)
        return depth[np.arange(len(xy)), best], np.arctan2(e[best, 1], e[best, 0])
