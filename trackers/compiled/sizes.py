"""What detections say of length and width: the loops of `trackers.size.likelihood` over its grids.

Equations: docs/methods/size-from-both-ends.md. The numpy form is the reference; functions here are named after theirs.
"""

from math import erfc
from typing import NamedTuple

import numpy as np

from trackers.compiled.algebra import compiled
from trackers.size.likelihood import TOGETHER


class Depths(NamedTuple):
    """G detections along one axis, as in `trackers.size.likelihood`."""

    depth: np.ndarray  # (G,) [m]
    sigma: np.ndarray  # (G,) [m]
    face: np.ndarray  # (G,)
    far: np.ndarray  # (G,) bool
    least: np.ndarray  # (G,) [m]
    behind: np.ndarray  # (G, 2) [m]
    rounding: np.ndarray  # (G, 2) [m]


@compiled
def ndtr(x):
    """Probability that a standard normal number is less than x."""
    return 0.5 * erfc(-x / np.sqrt(2.0))


@compiled
def bump(d, height, mean, var):
    """A Gaussian of that height."""
    return height * np.exp(-0.5 * (d - mean) ** 2 / var)


@compiled
def multiply(p, offsets, sizes, differences, z, g, room, near_room, far_room, eps, span):
    """Multiply p (K, N) by the likelihood of detection g; room is its row of the two last arrays, -1 for none."""
    K, N = p.shape
    sigma, inner, spread, least, var = z.sigma[g], z.rounding[g, 0], z.rounding[g, 1], z.least[g], 0.0
    var = sigma**2 + z.behind[g, 1] ** 2
    height, even = (1 - eps) * z.face[g] / np.sqrt(2 * np.pi * var), (1 - eps) * (1 - z.face[g])
    to_anchor, floor = np.empty(N), np.full(N, eps / span)  # (ENDS.3)
    to_far, face = np.empty(K + N - 1), np.zeros(K + N - 1)
    for n in range(N):
        d = z.depth[g] + offsets[n]  # (ENDS.2)
        to_anchor[n] = ndtr(d / sigma)
        if not z.far[g]:
            floor[n] += bump(d, height, z.behind[g, 0], var)  # (ENDS.4)
    for j in range(K + N - 1):
        e = z.depth[g] + differences[j]
        to_far[j] = ndtr((e + inner) / np.hypot(sigma, spread))
        if z.far[g]:
            face[j] = bump(-e, height, z.behind[g, 0], var)  # (ENDS.4)
    for k in range(K):
        length = max(sizes[k] - inner, least)
        for n in range(N):
            j = K - 1 - k + n
            if room >= 0:
                length = max(far_room[room, j] - near_room[room, n] - inner, least)  # (ENDS.5)
            p[k, n] *= even * (to_anchor[n] - to_far[j]) / length + floor[n] + face[j]  # (ENDS.5)


@compiled
def log_likelihood(offsets, sizes, differences, z, start, room, near_room, far_room, eps, span):
    """Sums (H, K, N) over the detections of each object of their log likelihoods."""
    H, G = len(start), len(z.depth)
    out, p = np.zeros((H, len(sizes), len(offsets))), np.empty((len(sizes), len(offsets)))
    for h in range(H):
        end = start[h + 1] if h + 1 < H else G
        for first in range(start[h], end, TOGETHER):
            p[:] = 1.0
            for g in range(first, min(first + TOGETHER, end)):
                multiply(p, offsets, sizes, differences, z, g, room[g], near_room, far_room, eps, span)
            out[h] += np.log(p)
    return out
