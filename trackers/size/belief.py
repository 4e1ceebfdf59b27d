"""What the grids of length and width say with the fleet: size, class, and where the ends are.

Equations: docs/methods/size-from-both-ends.md, section 5. Classes enter here only: the grids hold detections.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import vector
from trackers.size.fleet import Prior
from trackers.size.grid import Grid

STRAIGHT = np.zeros(1)  # of `posterior`: not bent
UNLIKELY = 100.0  # [nat] most by which a load makes a length more or less likely


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
    grids: tuple[Grid, Grid],
    fleet: Prior,
    length: NDArray,
    width: NDArray,
    behind: NDArray | None = None,
    bent: NDArray = STRAIGHT,
) -> Belief:
    """Belief from likelihoods length (..., K, N) and width (..., K', N'), greatest ones near 1.

    behind (..., 2, D) are the detections along the body from behind, as of `evidence.from_behind`, none if it is None;
    bent (...) is the probability that it is bent.
    """
    of_length, of_width = with_loads(grids[0], fleet, behind), fleet.width
    l, w = length.sum(-1), width.sum(-1)
    fit_l, fit_w = (of_length @ l[..., None])[..., 0], w @ of_width.T  # (..., C) each, (ENDS.16)
    bends = []
    for c, share, shorter in fleet.bends if bent.any() else ():
        part = share * bent
        fit_l[..., c] += part * ((l @ shorter.T) @ fleet.length[c] - fit_l[..., c])  # (ENDS.33)
        bends.append(((part * fleet.shares[c] * fit_w[..., c])[..., None], c, shorter))
    weight = fleet.shares * fit_l * fit_w
    kind = weight / weight.sum(-1, keepdims=True)  # (ENDS.16)
    joint = length * ((fleet.shares * fit_w)[..., None, :] @ of_length).mT  # (ENDS.17)
    for prior, c, shorter in bends:
        straight, bend = (prior * p[..., c, :] for p in (of_length, fleet.length))
        joint += bend[..., None] * (shorter @ length) - straight[..., None] * length  # (ENDS.33)
    joints = (joint, width * ((fleet.shares * fit_l) @ of_width)[..., None])  # (ENDS.17)
    moments = [_moments(g, p / p.sum((-2, -1), keepdims=True)) for g, p in zip(grids, joints, strict=True)]  # (ENDS.18)
    size, size_var, offset, offset_var, centre_var = (vector(l, w) for l, w in zip(*(m[:5] for m in moments)))
    return Belief(size, size_var, offset, offset_var, centre_var, moments[0][5], moments[1][5], kind)


def with_loads(grid: Grid, fleet: Prior, behind: NDArray | None) -> NDArray:
    """Probabilities (..., C, K) of the lengths given the class, and what detections from behind say of loads."""
    if behind is None or not behind.any():
        return fleet.length
    p = np.broadcast_to(fleet.length, (*behind.shape[:-2], *fleet.length.shape)).copy()
    total = behind.cumsum(-1)
    whole = _before(grid, total, grid.sizes)
    for c, load in fleet.loads:
        inside, ahead = load.log_ratios[..., None]
        shown = _before(grid, total, load.part * grid.sizes)
        log_q = (inside * shown + ahead * (whole - shown)).sum(-2)
        p[..., c, :] *= 1 + load.share * (np.exp(np.clip(log_q, -UNLIKELY, UNLIKELY)) - 1)  # (ENDS.47)
    return p


def _before(grid: Grid, total: NDArray, depth: NDArray) -> NDArray:
    """How many detections (..., 2, K) lie before depths (K,) [m]; total (..., 2, D) lie before ends of cells."""
    cell = (depth / grid.step).astype(int)
    part = depth / grid.step - cell
    return np.asarray((1 - part) * total[..., cell] + part * total[..., np.minimum(cell + 1, grid.depths - 1)])


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
