"""Closed uniform B-splines: the curve on which the ellipses of a contour are chained.

Equations: docs/methods/spline-pmht.md. Integer knots, period n_c, parameter r in [0, n_c), counter-clockwise around a
vehicle.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

MOST_ELLIPSES = 1000  # of a chain; a body has some dozens


def cardinal(t: NDArray, degree: int) -> NDArray:
    """The B-spline B_d(t) (...) with knots 0, 1, ..., d + 1, at t (...)."""
    if degree == 0:
        return np.where((t >= 0) & (t < 1), 1.0, 0.0)
    rise, fall = t / degree, (degree + 1 - t) / degree
    return rise * cardinal(t, degree - 1) + fall * cardinal(t - 1, degree - 1)  # (PMHT.2)


def basis(r: NDArray, n_c: int, degree: int) -> NDArray:
    """Weights (R, n_c) of the control points at the parameters r (R,); rows sum to 1."""
    if n_c < degree + 1:
        raise ValueError(f"n_c must be at least degree + 1 = {degree + 1}, got {n_c}; take more control points")
    return cardinal((r[:, None] - np.arange(n_c)) % n_c, degree)  # (PMHT.1)


def slope_basis(r: NDArray, n_c: int, degree: int) -> NDArray:
    """Weights (R, n_c) of the control points in the derivative c'(r) at r (R,)."""
    t = (r[:, None] - np.arange(n_c)) % n_c
    return cardinal(t, degree - 1) - cardinal(t - 1, degree - 1)


def parameters(count: int, n_c: int) -> NDArray:
    """Evenly spaced r_l = l n_c / count (count,)."""
    return np.arange(count) * (n_c / count)  # (PMHT.3)


@lru_cache(maxsize=64)
def chain(L: int, n_c: int, degree: int = 3) -> NDArray:
    """N (L, n_c), read-only: mu = N p are the centres of L ellipses, (PMHT.3)."""
    if L > MOST_ELLIPSES:
        raise ValueError(f"L must be at most {MOST_ELLIPSES} ellipses, got {L}")
    if n_c > L:
        raise ValueError(f"L must be at least n_c = {n_c} for every control point to count, got {L}")
    return _frozen(basis(parameters(L, n_c), n_c, degree))


@lru_cache(maxsize=64)
def slopes(L: int, n_c: int, degree: int = 3) -> NDArray:
    """The same (L, n_c) for the tangents c'(r_l)."""
    return _frozen(slope_basis(parameters(L, n_c), n_c, degree))


def _frozen(a: NDArray) -> NDArray:
    a.flags.writeable = False
    return a
