"""The density of detections over a body of uncertain size: with which likelihood a track claims a detection.

A far detection of a long vehicle is claimed before its length is known. Equations:
docs/methods/size-from-both-ends.md, section 7.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from trackers.size.belief import Belief
from trackers.size.grid import Grid
from trackers.size.hits import Boxes, Hits, face_depth, faces, inside_depth, lit
from trackers.size.likelihood import decay

LEAST_DENSITY = 1e-300


def log_spatial(grids: tuple[Grid, Grid], hits: Hits, boxes: Boxes, belief: Belief, place_var: NDArray) -> NDArray:
    """Log density (G,) [1/m^2] of detections under the objects that `hits.row` names.

    boxes, belief (T,) and place_var (T, 2) [m^2], the variance of the box along its axes, are those of all objects.
    """
    row = hits.row
    end, shown = lit(hits, boxes)
    face, entered = faces(hits, shown)
    var = hits.sigma**2 + (belief.offset_var + place_var)[row]  # (ENDS.25)
    d = boxes.size[row] / 2 + belief.offset[row] - boxes.anchor[row] * hits.xy
    even = np.empty(d.shape)
    for axis, (grid, p) in enumerate(zip(grids, (belief.length, belief.width), strict=True)):
        s = np.sqrt(var[:, axis])
        far = ndtr((d[:, axis, None] - grid.sizes) / s[:, None])
        even[:, axis] = ((ndtr(d[:, axis] / s)[:, None] - far) * (p / grid.sizes)[row]).sum(-1)  # (ENDS.26)
    behind = np.where(end < 0, belief.size[row] - d, d)
    depth, inside = (of(hits.sensor, hits.sight) for of in (face_depth, inside_depth))
    found = density(face, entered, depth, behind, belief.size[row], var, even, inside)
    return np.log(np.maximum(found, LEAST_DENSITY))


def density(
    face: NDArray, entered: NDArray, depth: NDArray, behind: NDArray, size: NDArray, var: NDArray, even: NDArray,
    inside: NDArray,
) -> NDArray:  # fmt: skip
    """Density (G,) [1/m^2] of detections in the axes of their bodies, (ENDS.27).

    face and entered (G, 2) as of `hits.faces`, depth (G, 2, 2) as of `hits.face_depth`; behind (G, 2) [m] depth behind
    the end and the side that face the sensor, size (G, 2) [m], var (G, 2) [m^2] noise, even (G, 2) [1/m] densities of
    what is spread over the body, inside (G, 2) [m] mean depth of what is not.
    """
    mean, spread = np.moveaxis(depth, -1, 0)
    var_face = var + spread**2
    near = np.exp(-0.5 * (behind - mean) ** 2 / var_face) / np.sqrt(2 * np.pi * var_face)  # (ENDS.25)
    deep = np.where(np.isinf(inside), even, shallow(behind, size, np.sqrt(var), inside))
    through = face * near + entered * deep
    rest = 1 - face.sum(-1) - entered.sum(-1)
    return (through * even[:, ::-1]).sum(-1) + rest * even[:, 0] * even[:, 1]  # (ENDS.27)


def shallow(behind: NDArray, size: NDArray, sigma: NDArray, mean: NDArray) -> NDArray:
    """Density [1/m] of detections from inside, at depth `behind` in bodies of a size, all (G, 2) [m], (ENDS.31)."""
    mean = np.where(np.isinf(mean), 1.0, mean)
    fall = np.exp(-size / mean)
    return (decay(behind, sigma, mean) - fall * decay(behind - size, sigma, mean)) / (mean * (1 - fall))  # (ENDS.31)
