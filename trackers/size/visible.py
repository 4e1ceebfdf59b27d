"""The part of a body that a sensor could have seen: without it, a side that leaves its range would seem to end there.

Equations: docs/methods/size-from-both-ends.md, section 3. Cells lie along an axis of the body, from outside of the
anchor end of its box inwards.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import wrap_angle
from trackers.size.grid import Grid

NOTHING = 1e-9  # share of a face that is rounding: a face of which nothing else is in view has no detections


class Cells(NamedTuple):
    """C cells along an axis; depths [m] are counted from the anchor end of the box."""

    first: float  # [m] where they begin
    step: float  # [m]
    number: int

    @property
    def edges(self) -> NDArray:
        """Depths (C,) [m] at which they begin."""
        return self.first + self.step * np.arange(self.number)

    @property
    def middles(self) -> NDArray:
        """Depths (C,) [m] of their middles."""
        return self.edges + self.step / 2


class Room(NamedTuple):
    """Length [m] of the cells in view of R detections, up to each end that a body may have."""

    rows: NDArray  # (R,) which detections
    near: NDArray  # (R, N) up to the anchor end of a body with offset o_n
    far: NDArray  # (R, K + N - 1) up to its other end, in the order of `likelihood.by_size_and_offset`
    share: NDArray  # (R,) of the face of the box along which the cells lie
    shaded: NDArray  # (R,) bool, others hide some of it: what is seen through the end is seen all the same


def in_view(points: NDArray, pose: NDArray, max_range: NDArray, fov: NDArray) -> NDArray:
    """Mask (G, C) of the points (G, C, 2) within range (G,) [m] and field of view (G,) [rad] of sensors (G, 3)."""
    v = points - pose[:, None, :2]
    near = np.hypot(v[..., 0], v[..., 1]) < max_range[:, None]
    azimuth = np.arctan2(v[..., 1], v[..., 0]) - pose[:, None, 2]
    return near & (np.abs(wrap_angle(azimuth)) < fov[:, None] / 2)  # (ENDS.7)


def room(grid: Grid, cells: Cells, seen: NDArray, rows: NDArray, size: NDArray, shaded: NDArray) -> Room:
    """What the detections rows (R,) leave room for, whose sensors see so much of each cell, seen (R, C) from 0 to 1.

    size (R,) [m] are those of the boxes, shaded (R,) bool as in `Room`.
    """
    near, far = shares_of_cells(grid, cells)
    inner, outer = (np.clip(x - cells.edges, 0.0, cells.step) for x in (np.zeros(1), size[:, None]))
    share = (seen * (outer - inner)).sum(-1) / size  # (ENDS.8)
    return Room(rows, seen @ near, seen @ far, np.where(share > NOTHING, share, 0.0), shaded)


@lru_cache(maxsize=16)
def shares_of_cells(grid: Grid, cells: Cells) -> tuple[NDArray, NDArray]:
    """Length [m] of each cell before the anchor ends (C, N) and before the other ends (C, K + N - 1)."""
    near, far = (np.clip(x - cells.edges[:, None], 0.0, cells.step) for x in (-grid.offsets, -grid.differences))
    return near, far
