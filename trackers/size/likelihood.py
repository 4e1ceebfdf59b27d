"""Log likelihood of detections along one axis of a body, for all sizes and offsets of a grid at once.

Equations: docs/methods/size-from-both-ends.md, section 2. G detections of H objects are one flat list in the order of
the objects. Size and offset have one step, so the depth before the far end takes K + N - 1 values a detection.
"""

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.special import ndtr

from trackers.size.grid import Grid

TOGETHER = 64  # detections whose likelihoods, of 0.003 or more, are multiplied before the logarithm is taken
FACE_SPREAD = 0.7  # standard deviation of the depth behind a face, as a share of its mean


class Depths(NamedTuple):
    """G detections along one axis, from the anchor end of the box inwards."""

    depth: NDArray  # (G,) [m] behind the anchor end of the box
    sigma: NDArray  # (G,) [m] noise along the axis
    face: NDArray  # (G,) probability to come from the end that faces the sensor
    far: NDArray  # (G,) bool, that is the far end
    room: NDArray  # (G, K) [m] part of a body of size L_k that the sensor could see
    behind: NDArray  # (G,) [m] mean depth behind a face
    rounding: NDArray  # (G, 2) [m] by how much sooner the sides end than the body, and the spread of that


def log_likelihood(grid: Grid, z: Depths, start: NDArray, eps: float) -> NDArray:
    """Sums over the detections of each object, (H, K, N).

    start (H,) is the first detection of each object, eps the share of detections that are of something else.
    """
    K, N = len(grid.sizes), len(grid.offsets)
    d = z.depth[:, None] + grid.offsets  # (G, N) behind the anchor end, (ENDS.2)
    e = z.depth[:, None] - grid.reach - grid.sizes[0] + grid.step * np.arange(1 - K, N)  # (G, K + N - 1): d - L
    inner, spread = z.rounding.T[..., None]
    sigma = z.sigma[:, None]
    to_anchor = ndtr(d / sigma)
    to_far = ndtr((e + inner) / np.hypot(sigma, spread))
    p = to_anchor[:, None] - by_size_and_offset(to_far, N)  # (ENDS.5)
    p *= ((1 - eps) * (1 - z.face)[:, None] / z.room)[..., None]  # (ENDS.5)
    var = z.sigma**2 + (FACE_SPREAD * z.behind) ** 2
    height = (1 - eps) * z.face / np.sqrt(2 * np.pi * var)
    near, far = ~z.far & (z.face > 0), z.far & (z.face > 0)
    floor = np.full(d.shape, eps / grid.span)  # (ENDS.3)
    floor[near] += _bump(d[near], height[near], z.behind[near], var[near])  # (ENDS.4)
    p += floor[:, None]
    if far.any():
        p[far] += by_size_and_offset(_bump(-e[far], height[far], z.behind[far], var[far]), N)  # (ENDS.4)
    return _log_products(p, start)


def by_size_and_offset(values: NDArray, N: int) -> NDArray:
    """A view (G, K, N) of values (G, K + N - 1) of d - L, whose column is K - 1 - k + n."""
    return sliding_window_view(values, N, axis=-1)[:, ::-1]


def _bump(d: NDArray, height: NDArray, mean: NDArray, var: NDArray) -> NDArray:
    return height[:, None] * np.exp(-0.5 * (d - mean[:, None]) ** 2 / var[:, None])


def _log_products(p: NDArray, start: NDArray) -> NDArray:
    """Logarithms (H, K, N) of the products of the rows of each object, in groups that do not underflow."""
    end = np.append(start[1:], len(p))
    groups = np.maximum(-(-(end - start) // TOGETHER), 1)
    first = np.concatenate([[0], np.cumsum(groups)])[:-1]
    part = np.arange(groups.sum()) - np.repeat(first, groups)
    logs = np.log(np.multiply.reduceat(p, np.repeat(start, groups) + TOGETHER * part, axis=0))
    return logs if len(logs) == len(start) else np.add.reduceat(logs, first, axis=0)
