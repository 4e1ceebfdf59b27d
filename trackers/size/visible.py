"""The part of a body that a sensor could have seen: without it, a side that leaves its range would seem to end there.

Equations: docs/methods/size-from-both-ends.md, section 3.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import wrap_angle

CELLS, CELL = 20, 1.0  # along the near side from the anchor end; [m]
DEPTHS = CELL * (np.arange(CELLS) + 0.5)  # [m] middles of the cells


def room(points: NDArray, pose: NDArray, max_range: NDArray, fov: NDArray, sizes: NDArray) -> NDArray:
    """Length (G, K) [m] of the cells in view up to each size (K,) [m], at least 1 m.

    points (G, CELLS, 2) [m] are the middles of the cells in the world, pose (G, 3), max_range (G,) [m] and fov (G,)
    [rad] those of the sensor of each detection. A cell counts if the next one is in view, too.
    """
    v = points - pose[:, None, :2]
    near = np.hypot(v[..., 0], v[..., 1]) < max_range[:, None]
    azimuth = np.arctan2(v[..., 1], v[..., 0]) - pose[:, None, 2]
    seen = near & (np.abs(wrap_angle(azimuth)) < fov[:, None] / 2)  # (ENDS.7)
    seen[:, :-1] &= seen[:, 1:].copy()  # (ENDS.8)
    return np.maximum(seen @ shares(tuple(sizes.tolist())), 1.0)  # (ENDS.8)


@lru_cache(maxsize=16)
def shares(sizes: tuple[float, ...]) -> NDArray:
    """Length (CELLS, K) [m] of each cell that belongs to a body of size L_k."""
    edge = CELL * np.arange(CELLS)
    return np.clip(np.array(sizes) - edge[:, None], 0.0, CELL)
