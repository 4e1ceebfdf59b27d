"""Where the sides of the hole are: a small mixture, fitted to the detections of every object at once; card section 4a.

Source: slides of the hierarchical truncated Gaussian with online bounds. A detection that side k made has, along the
outward axis of that side, its source beyond the bound b_k, and the density Phi((mu_k - b_k) / sg_k) / Phi(-b_k / s)
up to a factor without b_k. Both terms are tails, Phi(-y) with y = b scale - reach, so they stand in one list: the D
detections of all T objects, then the T sources themselves. The sides come first: rear, right, front, left.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfcx

PSEUDO_COUNT = 0.1  # of a side, in its share of the detections
FARTHEST = 36.0  # [standard deviations] beyond a bound; farther, the scaled error function overflows
STEPS = 40  # at most; two or three do from the bounds before
SETTLED = 1e-3  # [standard deviations] of a step; the error that it leaves goes with its cube


class Sides(NamedTuple):
    """Detections and sources against the sides; every object has a detection."""

    reach: NDArray  # (4, D + T) mu / sg: how far outwards the source of a detection probably is; 0 for a source
    scale: NDArray  # (4, D + T) 1 / sg, then 1 / s
    facing: NDArray  # (4, T) which sides can be seen
    owner: NDArray  # (D + T,) object of each, ascending in either part
    first: NDArray  # (T,) first detection of each object

    @property
    def detections(self) -> int:
        """Their number D."""
        return len(self.owner) - len(self.first)


class Tails(NamedTuple):
    """Normal distributions cut off at the bounds."""

    y: NDArray  # (..., 4, D + T) where, in standard deviations
    h: NDArray  # (..., 4, D + T) hazard there; Phi(-y) = phi_n(y) / h


def hazard(y: NDArray) -> NDArray:
    """phi_n(y) / Phi(-y), the inverse Mills ratio, to the last digit in either tail."""
    return np.sqrt(2 / np.pi) / erfcx(y * np.sqrt(0.5))


def tails(sides: Sides, b: NDArray) -> Tails:
    """The tails beyond the bounds b (..., 4, T)."""
    y = np.maximum(b.take(sides.owner, -1) * sides.scale - sides.reach, -FARTHEST)
    return Tails(y, hazard(y))


def fit(sides: Sides, b: NDArray, cap: float, rounds: int, least_weight: float) -> NDArray:
    """Bounds (4, T) in [0, cap] after some rounds of expectation-maximisation that begin at b (4, T).

    Sides with less than least_weight detections, among them those that cannot be seen, keep theirs.
    """
    y, h = tails(sides, np.stack([b, np.zeros_like(b), np.full_like(b, cap)]))
    at, ends, weight = Tails(y[0], h[0]), h[1:], np.ones_like(b)
    for k in range(rounds):
        at = tails(sides, b) if k else at
        g = responsibilities(sides, at, weight)
        W = np.add.reduceat(g, sides.first, -1)
        at_zero, at_cap = slope(sides, g, W, ends)
        keep = least_weight > W
        inside = (at_zero > 0) & (at_cap < 0)
        best = np.where(inside, climb(sides, g, W, b, at, cap, inside & ~keep), np.where(at_zero > 0, cap, 0.0))
        b = np.where(keep, b, best)
        weight = W + PSEUDO_COUNT
    return b


def responsibilities(sides: Sides, at: Tails, weight: NDArray) -> NDArray:
    """Which side made which detection, (4, D), columns sum to one; weight (4, T) is proportional to the priors."""
    D = sides.detections
    log_tail = -np.log(at.h) - 0.5 * at.y * at.y
    prior = np.where(sides.facing, np.log(weight) - log_tail[:, D:], -np.inf)
    log_g = log_tail[:, :D] + prior.take(sides.owner[:D], -1)
    g = np.exp(log_g - log_g.max(0))
    return g / g.sum(0)


def slope(sides: Sides, g: NDArray, W: NDArray, h: NDArray) -> NDArray:
    """Derivative (..., 4, T) in b of sum_j g_j [log Phi((mu_j - b) / sg) - log Phi(-b / s)], with W = sum_j g_j.

    h (..., 4, D + T) are the hazards; their derivatives times `scale` give those of the slope.
    """
    term, D = h * sides.scale, sides.detections
    return W * term[..., D:] - np.add.reduceat(g * term[..., :D], sides.first, -1)


def climb(sides: Sides, g: NDArray, W: NDArray, b: NDArray, at: Tails, cap: float, todo: NDArray) -> NDArray:
    """Bounds (4, T) between 0 and cap at which that sum is largest, for the sides todo (4, T) that have one there.

    Halley's method in a bracket that shrinks; it begins at b, where the tails `at` are known.
    """
    low, high = np.zeros_like(b), np.full_like(b, cap)
    scale = sides.scale[:, sides.first]
    for _ in range(STEPS):
        if not todo.any():
            break
        f, f1, f2 = slope(sides, g, W, with_derivatives(at, sides.scale))
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = f / f1
            curved = 1 - 0.5 * newton * f2 / f1
            new = b - newton / np.minimum(np.maximum(curved, 0.5), 2.0)  # clipped: no false rest where f1 is 0
        short = np.abs(new - b) * scale < SETTLED
        if not (todo & ~short).any():
            return np.minimum(np.maximum(new, 0.0), cap)
        low, high = np.where(f > 0, b, low), np.where(f > 0, high, b)
        b = np.where((new >= low) & (new <= high), new, 0.5 * (low + high))
        at = tails(sides, b)
    return b


def with_derivatives(at: Tails, scale: NDArray) -> NDArray:
    """Hazards and their first two derivatives in b, (3, 4, D + T); h' = h (h - y)."""
    y, h = at
    out = np.empty((3, *h.shape))
    e = h - y
    out[0] = h
    out[1] = h * e * scale
    out[2] = (out[1] * (h + e) - h * scale) * scale
    return out
