"""The bounds of the hole of every object at once: a mixture over its sides, fitted to the detections of one scan.

A detection that side k made has its source beyond the bound b_k, and the density Phi((mu_k - b_k) / s_k) /
Phi(-b_k / sqrt(rho)) up to a factor without b_k, (HTG.21). Both terms are tails Phi(-y) with y = b scale - reach, so
they stand in one list: the D detections of all T objects, then the T sources. The first axis is the side: rear, right,
front, left. Equations: docs/methods/hierarchical-truncated-gaussians.md.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfcx

PSEUDO_COUNT = 0.1  # of a side, in its share of the detections
FARTHEST = 36.0  # [standard deviations] beyond a bound; farther, the scaled error function overflows
STEPS = 40  # at most; two or three do from the bounds before
SETTLED = 1e-3  # [standard deviations] of a step; the error that it leaves goes with its cube


class BoundProblem(NamedTuple):
    """Everything the likelihood of the bounds depends on; every object has a detection."""

    reach: NDArray  # (4, D + T) mu / s_k: how far outwards the source of a detection probably is; 0 for a source
    scale: NDArray  # (4, D + T) 1 / s_k, then 1 / sqrt(rho)
    facing: NDArray  # (4, T) which sides face the sensor
    owner: NDArray  # (D + T,) object of each, ascending in either part
    first: NDArray  # (T,) first detection of each object

    @property
    def detections(self) -> int:
        """Their number D."""
        return len(self.owner) - len(self.first)


class Tails(NamedTuple):
    """Normal distributions cut off at the bounds."""

    y: NDArray  # (..., 4, D + T) the bounds in standard deviations
    h: NDArray  # (..., 4, D + T) hazard there; Phi(-y) = phi_n(y) / h


def hazard(y: NDArray) -> NDArray:
    """Hazard h(y) = phi_n(y) / Phi(-y), the inverse Mills ratio, to the last digit in either tail."""
    return np.sqrt(2 / np.pi) / erfcx(y * np.sqrt(0.5))  # (HTG.24)


def tails(problem: BoundProblem, b: NDArray) -> Tails:
    """The tails beyond the bounds b (..., 4, T)."""
    y = np.maximum(b.take(problem.owner, -1) * problem.scale - problem.reach, -FARTHEST)
    return Tails(y, hazard(y))


def fit(problem: BoundProblem, b: NDArray, cap: float, rounds: int, least_weight: float) -> NDArray:
    """Bounds (4, T) in [0, cap] after some rounds of expectation-maximisation that begin at b (4, T).

    Sides with less than least_weight detections keep their bounds, as do open sides.
    """
    y, h = tails(problem, np.stack([b, np.zeros_like(b), np.full_like(b, cap)]))
    at, ends, weight = Tails(y[0], h[0]), h[1:], np.ones_like(b)
    for k in range(rounds):
        at = tails(problem, b) if k else at
        g = responsibilities(problem, at, weight)
        W = np.add.reduceat(g, problem.first, -1)  # (HTG.22)
        at_zero, at_cap = slope(problem, g, W, ends)
        keep = least_weight > W
        inside = (at_zero > 0) & (at_cap < 0)
        best = np.where(inside, climb(problem, g, W, b, at, cap, inside & ~keep), np.where(at_zero > 0, cap, 0.0))
        b = np.where(keep, b, best)
        weight = W + PSEUDO_COUNT  # (HTG.22)
    return b


def responsibilities(problem: BoundProblem, at: Tails, weight: NDArray) -> NDArray:
    """Probability (4, D) of each side to have made a detection; weight (4, T) is proportional to the priors."""
    D = problem.detections
    log_tail = -np.log(at.h) - 0.5 * at.y * at.y
    prior = np.where(problem.facing, np.log(weight) - log_tail[:, D:], -np.inf)
    log_g = log_tail[:, :D] + prior.take(problem.owner[:D], -1)  # (HTG.21)
    g = np.exp(log_g - log_g.max(0))
    return g / g.sum(0)  # (HTG.22)


def slope(problem: BoundProblem, g: NDArray, W: NDArray, h: NDArray) -> NDArray:
    """Derivative (..., 4, T) of the log-likelihood (HTG.23) in b, with W = sum_j g_j.

    h (..., 4, D + T) are the hazards; with their derivatives in b instead, the result is that of the slope.
    """
    term, D = h * problem.scale, problem.detections
    return W * term[..., D:] - np.add.reduceat(g * term[..., :D], problem.first, -1)  # (HTG.24)


def climb(problem: BoundProblem, g: NDArray, W: NDArray, b: NDArray, at: Tails, cap: float, todo: NDArray) -> NDArray:
    """Bounds (4, T) of the largest likelihood (HTG.23), for the sides todo (4, T) that have it between 0 and cap.

    Halley's method in a bracket that shrinks, from b, where the tails are `at`; each side stops by itself.
    """
    low, high = np.zeros_like(b), np.full_like(b, cap)
    scale = problem.scale[:, problem.first]
    for k in range(STEPS):
        if not todo.any():
            break
        at = tails(problem, b) if k else at
        f, f1, f2 = slope(problem, g, W, with_derivatives(at, problem.scale))
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = f / f1
            curved = 1 - 0.5 * newton * f2 / f1
            new = b - newton / np.minimum(np.maximum(curved, 0.5), 2.0)  # clipped: no false rest where f1 is 0
        short = np.abs(new - b) * scale < SETTLED
        low, high = np.where(f > 0, b, low), np.where(f > 0, high, b)
        step = np.where((new >= low) & (new <= high), new, 0.5 * (low + high))
        b = np.where(todo, np.where(short, np.minimum(np.maximum(new, 0.0), cap), step), b)
        todo = todo & ~short
    return b


def with_derivatives(at: Tails, scale: NDArray) -> NDArray:
    """Hazards and their first two derivatives in b, (3, 4, D + T); h' = h (h - y)."""
    y, h = at
    out = np.empty((3, *h.shape))
    e = h - y
    out[0] = h
    out[1] = h * e * scale  # (HTG.24)
    out[2] = (out[1] * (h + e) - h * scale) * scale
    return out
