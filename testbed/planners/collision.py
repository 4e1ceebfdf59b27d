"""The collision check: the time at which a box that moves along a path would touch one of the others."""

import numpy as np
from numpy.typing import NDArray

from testbed.planners.prediction import LanePath, Others, along_path, forecast
from trackers.geometry import unit

STEP = 0.2  # [s] between the instants of a forecast


def instants(horizon: float) -> NDArray:
    """The instants (H,) [s] at which a forecast is evaluated."""
    return np.arange(0.0, horizon, STEP)


def distance_driven(speed: NDArray) -> NDArray:
    """Distances (..., H) [m] at the instants, from speeds (..., H) [m/s] there."""
    return np.concatenate([np.zeros((*speed.shape[:-1], 1)), np.cumsum(speed[..., :-1] * STEP, -1)], -1)


def first_contact(path: LanePath, arc: NDArray, offset: float, size: NDArray, others: Others) -> NDArray:
    """Times (...) [s] of the first contact, inf for none.

    The box of size (2,) [m] is at arc (..., H) [m] of the path at each instant; its offset [m] from the path decays
    with a time constant of 1 s. The exact test is made only for others whose circumcircle meets that of the box.
    """
    times = STEP * np.arange(arc.shape[-1])
    q, g = forecast(others, times)
    p, h = along_path(path, arc, np.broadcast_to(offset * np.exp(-times), arc.shape))
    apart = p[..., None, :, :] - q  # (..., N, H, 2)
    reach = (np.hypot(*size) + np.hypot(*others.size.T)) / 2
    close = (apart**2).sum(-1) < (reach**2)[:, None]
    near = close.any(axis=tuple(i for i in range(close.ndim) if i != close.ndim - 2))
    hit = overlap(p[..., None, :, :], h[..., None, :], size, q[near], g[near], others.size[near, None]).any(-2)
    return np.where(hit.any(-1), times[hit.argmax(-1)], np.inf)


def overlap(p: NDArray, h: NDArray, size: NDArray, q: NDArray, g: NDArray, other: NDArray) -> NDArray:
    """Which boxes overlap, (...) bool, by the separating axis theorem.

    Centres p, q (..., 2) [m], headings h, g (...) [rad], sizes size, other (..., 2) length, width [m]; all broadcast.
    """
    d = q - p
    apart = np.zeros(np.broadcast_shapes(h.shape, g.shape), bool)
    for axis in (h, h + np.pi / 2, g, g + np.pi / 2):
        reach = _half_extent(axis - h, size) + _half_extent(axis - g, other)
        apart |= np.abs((d * unit(axis)).sum(-1)) > reach
    return ~apart


def _half_extent(angle: NDArray, size: NDArray) -> NDArray:
    """Half length (...) [m] of the projection of boxes on an axis at an angle (...) from their heading."""
    return 0.5 * (np.abs(unit(angle)) * size).sum(-1)
