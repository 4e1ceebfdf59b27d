"""From detections and grids to the arrays of `trackers.compiled.sizes`, and back."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from trackers.compiled import kernels


def compiled_likelihood(grid: Any, z: Any, start: NDArray, eps: float) -> NDArray | None:
    """`likelihood.log_likelihood`, or None: to be done in numpy."""
    sizes = kernels("sizes")
    if sizes is None or bool((np.isfinite(z.inside) & (z.entered > 0)).any()):
        return None
    room = np.full(len(z.depth), -1)
    near, far = np.zeros((0, len(grid.offsets))), np.zeros((0, len(grid.differences)))
    for one in z.rooms:  # at most one
        room[one.rows] = np.arange(len(one.rows))
        near, far = one.near, one.far
    detections = sizes.Depths(
        *(np.ascontiguousarray(a) for a in (z.depth, z.sigma, z.face, z.far, z.least, z.behind, z.rounding))
    )
    found: NDArray = sizes.log_likelihood(
        grid.offsets, grid.sizes, grid.differences, detections, start, room, near, far, float(eps), float(grid.span)
    )
    return found
