"""What the grids of length and width say with the fleet: size, class, and where the ends are.

Equations: docs/methods/size-from-both-ends.md, section 5. Classes enter here only: the grids hold detections.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import vector
from trackers.size.fleet import Prior
from trackers.size.grid import Grid

SHOWN = np.zeros(2)  # of `posterior`: neither seen from behind only nor bent


class Belief(NamedTuple):
    """Posterior of size and class; axes of vectors (..., 2) are length and width."""

    size: NDArray  # (..., 2) [m] mean
    size_var: NDArray  # (..., 2) [m^2]
    offset: NDArray  # (..., 2) [m] mean of the offset of the anchor end
    offset_var: NDArray  # (..., 2) [m^2]
    centre_var: NDArray  # (..., 2) [m^2] of the centre between both ends
    length: NDArray  # (..., K) probabilities of the lengths
    width: NDArray  # (..., K') of the widths
    kind: NDArray  # (..., C) of the classes


def posterior(
    grids: tuple[Grid, Grid], fleet: Prior, length: NDArray, width: NDArray, hidden: NDArray = SHOWN
) -> Belief:
    """Belief from likelihoods length (..., K, N) and width (..., K', N'), greatest ones near 1.

    hidden (..., 2) is the probability that all detections were made from behind, and that the body is bent.
    """
    of_length, of_width = fleet.length, fleet.width
    l, w = length.sum(-1), width.sum(-1)
    fit_l, fit_w = l @ of_length.T, w @ of_width.T  # (..., C) each, (ENDS.16)
    loads = []
    for c, share, bent, shorter in fleet.loads if hidden.any() else ():
        part = share * hidden[..., int(bent)]
        fit_l[..., c] += part * ((l @ shorter.T - l) @ of_length[c])  # (ENDS.33)
        loads.append((part * fleet.shares[c] * fit_w[..., c], of_length[c], shorter))
    weight = fleet.shares * fit_l * fit_w
    kind = weight / weight.sum(-1, keepdims=True)  # (ENDS.16)
    joint = length * ((fleet.shares * fit_w) @ of_length)[..., None]  # (ENDS.17)
    for prior, p, shorter in loads:
        joint += (prior[..., None] * p)[..., None] * (shorter @ length - length)  # (ENDS.33)
    joints = (joint, width * ((fleet.shares * fit_l) @ of_width)[..., None])  # (ENDS.17)
    moments = [_moments(g, p / p.sum((-2, -1), keepdims=True)) for g, p in zip(grids, joints, strict=True)]  # (ENDS.18)
    size, size_var, offset, offset_var, centre_var = (vector(l, w) for l, w in zip(*(m[:5] for m in moments)))
    return Belief(size, size_var, offset, offset_var, centre_var, moments[0][5], moments[1][5], kind)


def _moments(grid: Grid, p: NDArray) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray, NDArray]:
    """Mean and variance of the size, of the offset, variance of the centre, and p(L) (..., K), of p (..., K, N)."""
    L, o = grid.sizes, grid.offsets
    of_size, of_offset = p.sum(-1), p.sum(-2)
    size, offset = of_size @ L, of_offset @ o
    L_c, o_c = L - size[..., None], o - offset[..., None]
    size_var, offset_var = (of_size * L_c**2).sum(-1), (of_offset * o_c**2).sum(-1)
    both = (((p @ o) - of_size * offset[..., None]) * L_c).sum(-1)  # covariance of size and offset
    cell = grid.step**2 / 12
    centre_var = offset_var + size_var / 4 - both + cell / 4  # (ENDS.20)
    return size, size_var + cell, offset, offset_var, centre_var, of_size  # (ENDS.19)
