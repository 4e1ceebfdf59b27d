"""Prior probabilities of the regions that a detection may come from.

Equations: docs/methods/data-regions.md, after Xu et al. (2023).
"""

import numpy as np
from numpy.typing import NDArray

from trackers.dra.regions import FROM, REGIONS, TO, corners
from trackers.dra.state import PLACE
from trackers.geometry import cross, dot, perpendicular

LEAST = 1e-6


def uniform(shape: tuple[int, ...]) -> NDArray:
    """Probabilities (..., 5), the same for all regions.

    Not 1 / (number of hypotheses), as printed: that favours models whose gates leave fewer of them.
    """
    return np.full((*shape, REGIONS), 1 / REGIONS)  # (DRA.11)


def rays(m: NDArray, sensor: NDArray, near: float, far: float) -> NDArray:
    """Probabilities (..., 5) from the angles under which a sensor (..., 2) [m] sees the sides of a state m (..., 11).

    The visible sides share `near`, the hidden ones `far`, and the interior has the rest. A sensor inside the body makes
    all regions equally likely.
    """
    p = corners(m)
    a, b = p[..., FROM, :], p[..., TO, :]
    eye = (sensor - m[..., PLACE])[..., None, :]
    u, v = a - eye, b - eye
    angle = np.abs(np.arctan2(cross(u, v), dot(u, v)))  # (DRA.12)
    # Sides run counter-clockwise around p1, p4, p3, p2 where p1 is left of p2: their outward normal is to the right.
    normal = -perpendicular(b - a) * np.sign(cross(p[..., 1, :], p[..., 0, :]))[..., None, None]
    visible = dot(normal, eye - (a + b) / 2) > 0  # (DRA.12)
    P = _share(angle, visible, near) + _share(angle, ~visible, far)  # (DRA.13)
    rest = np.full((*P.shape[:-1], 1), 1 - near - far)  # (DRA.13)
    P = np.where(visible.any(-1, keepdims=True), np.concatenate([P, rest], -1), 1 / REGIONS)  # else inside
    P = np.maximum(P, LEAST)
    return P / P.sum(-1, keepdims=True)


def _share(angle: NDArray, where: NDArray, total: float) -> NDArray:
    """Shares (..., 4) of a probability in proportion to the angles there, (DRA.13)."""
    angle = np.where(where, angle, 0.0)
    return total * angle / np.maximum(angle.sum(-1, keepdims=True), 1e-12)
