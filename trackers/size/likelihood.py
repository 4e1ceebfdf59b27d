"""Log likelihood of detections along one axis of a body, for all sizes and offsets of a grid at once.

Equations: docs/methods/size-from-both-ends.md, section 2. G detections of H objects are one flat list in the order of
the objects. Size and offset have one step, so the depth before the far end takes K + N - 1 values a detection.
"""

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray
from scipy.special import log_ndtr, ndtr

from trackers.size.grid import Grid
from trackers.size.visible import Room

TOGETHER = 64  # detections whose likelihoods, of 0.003 or more, are multiplied before the logarithm is taken


class Depths(NamedTuple):
    """G detections along one axis, from the anchor end of the box inwards."""

    depth: NDArray  # (G,) [m] behind the anchor end of the box
    sigma: NDArray  # (G,) [m] noise along the axis
    face: NDArray  # (G,) probability to come from the end that faces the sensor
    far: NDArray  # (G,) bool, that is the far end
    entered: NDArray  # (G,) probability to come from inside, through that end
    inside: NDArray  # (G,) [m] mean depth along the axis of those; inf: even over the body
    through: NDArray  # (G,) share of what is even over the body that a sensor sees wherever its side is in the shade
    rooms: list[Room]  # of those whose sensors could not see all of the body
    least: NDArray  # (G,) [m] least room
    behind: NDArray  # (G, 2) [m] mean depth behind a face, and its spread
    rounding: NDArray  # (G, 2) [m] by how much sooner the sides end than the body, and the spread of that


def log_likelihood(grid: Grid, z: Depths, start: NDArray, eps: float) -> NDArray:
    """Sums over the detections of each object, (H, K, N).

    start (H,) is the first detection of each object, eps the share of detections that are of something else.
    """
    N = len(grid.offsets)
    d = z.depth[:, None] + grid.offsets  # (G, N) behind the anchor end, (ENDS.2)
    e = z.depth[:, None] + grid.differences  # (G, K + N - 1): d - L
    inner, spread = z.rounding.T[..., None]
    sigma = z.sigma[:, None]
    to_anchor = ndtr(d / sigma)
    to_far = ndtr((e + inner) / np.hypot(sigma, spread))
    p = to_anchor[:, None] - by_size_and_offset(to_far, N)  # (ENDS.5)
    shallow = np.isfinite(z.inside) & (z.entered > 0)
    even = 1 - z.face - np.where(shallow, z.entered, 0.0)
    length = np.maximum(grid.sizes - inner, z.least[:, None])
    for room in z.rooms:
        g = room.rows
        shown = by_size_and_offset(room.far, N) - room.near[:, None]  # in place from here on: a large array
        shown -= inner[g, None]
        np.maximum(shown, z.least[g, None, None], out=shown)
        np.divide(length[g, :, None], shown, out=shown)
        if room.shaded.any():
            shown += z.through[g, None, None] * (1 - shown)  # (ENDS.51)
        p[g] *= shown  # (ENDS.5)
    p *= ((1 - eps) * even[:, None] / length)[..., None]  # (ENDS.5)
    behind, var = z.behind[:, 0], z.sigma**2 + z.behind[:, 1] ** 2
    height = (1 - eps) * z.face / np.sqrt(2 * np.pi * var)
    near, far = ~z.far & (z.face > 0), z.far & (z.face > 0)
    floor = np.full(d.shape, eps / grid.span)  # (ENDS.3)
    floor[near] += _bump(d[near], height[near], behind[near], var[near])  # (ENDS.4)
    p += floor[:, None]
    if far.any():
        p[far] += by_size_and_offset(_bump(-e[far], height[far], behind[far], var[far]), N)  # (ENDS.4)
    if shallow.any():
        _add_shallow(grid, z, np.flatnonzero(shallow), 1 - eps, d, e, p)
    return _log_products(p, start)


def _add_shallow(grid: Grid, z: Depths, rows: NDArray, share: float, d: NDArray, e: NDArray, p: NDArray) -> None:
    """Add the densities (ENDS.31) of the detections rows (R,) to p (G, K, N), in place."""
    N, mean, far = d.shape[-1], z.inside[rows, None], z.far[rows, None, None]
    sigma = z.sigma[rows, None]
    fall = np.exp(-grid.sizes / mean)  # (R, K)
    ends = decay(np.where(far[..., 0], -d[rows], d[rows]), sigma, mean)[:, None]
    others = by_size_and_offset(decay(np.where(far[..., 0], -e[rows], e[rows]), sigma, mean), N)
    first, last = np.where(far, others, ends), np.where(far, ends, others)
    height = share * z.entered[rows, None] / (mean * (1 - fall))
    p[rows] += height[..., None] * (first - fall[..., None] * last)  # (ENDS.31)


def decay(x: NDArray, sigma: NDArray, mean: NDArray) -> NDArray:
    """exp(-x / mean) for x > 0, blurred by noise of std sigma, (ENDS.31)."""
    blur = sigma / mean
    return np.exp(np.minimum(0.5 * blur**2 - x / mean + log_ndtr(x / sigma - blur), 0.0))


def by_size_and_offset(values: NDArray, N: int) -> NDArray:
    """A view (G, K, N) of values (G, K + N - 1) of d - L, whose column is K - 1 - k + n."""
    G, D = values.shape
    row, column = values.strides
    return as_strided(values[:, D - N :], (G, D - N + 1, N), (row, -column, column), writeable=False)


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
