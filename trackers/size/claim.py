"""The density of detections over a body of uncertain size: with which likelihood a track claims a detection.

A far detection of a long vehicle is claimed before its length is known. Equations:
docs/methods/size-from-both-ends.md, section 7.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from trackers.size.belief import Belief
from trackers.size.grid import Grid
from trackers.size.hits import Boxes, Hits, faces, lit
from trackers.size.likelihood import FACE_SPREAD

LEAST_DENSITY = 1e-300


def log_claim(grids: tuple[Grid, Grid], hits: Hits, boxes: Boxes, belief: Belief, place_var: NDArray) -> NDArray:
    """Log density (G,) [1/m^2] of detections under the objects that `hits.row` names.

    boxes, belief (T,) and place_var (T, 2) [m^2], the variance of the box along its axes, are those of all objects.
    """
    row = hits.row
    end, shown = lit(hits, boxes)
    face = faces(hits, shown)
    var = hits.sigma**2 + (belief.offset_var + place_var)[row]  # (ENDS.25)
    d = boxes.size[row] / 2 + belief.offset[row] - boxes.anchor[row] * hits.xy
    d_far = belief.size[row] - d
    depth = np.where(end < 0, d_far, d) - hits.sensor.depth[:, None]
    var_face = var + (FACE_SPREAD * hits.sensor.depth[:, None]) ** 2
    near = np.exp(-0.5 * depth**2 / var_face) / np.sqrt(2 * np.pi * var_face)  # (ENDS.25)
    even = np.empty(d.shape)
    for axis, (grid, p) in enumerate(zip(grids, (belief.length, belief.width), strict=True)):
        s = np.sqrt(var[:, axis])
        far = ndtr((d[:, axis, None] - grid.sizes) / s[:, None])
        even[:, axis] = ((ndtr(d[:, axis] / s)[:, None] - far) * (p / grid.sizes)[row]).sum(-1)  # (ENDS.26)
    inside = 1 - face.sum(-1)
    density = face[:, 0] * near[:, 0] * even[:, 1] + face[:, 1] * even[:, 0] * near[:, 1]  # (ENDS.27)
    return np.log(np.maximum(density + inside * even[:, 0] * even[:, 1], LEAST_DENSITY))  # (ENDS.27)
