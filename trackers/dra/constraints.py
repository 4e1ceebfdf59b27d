"""Pseudo-measurements that keep the body a rectangle along its velocity.

Equations: docs/methods/data-regions.md.
"""

import numpy as np
from numpy.typing import NDArray

from trackers.dra.state import P1, P2, VELOCITY
from trackers.geometry import dot, perpendicular, wrap_angle

SLOW = 2.0  # [m/s] speed at which the variance of (DRA.31) is twice that of a fast body
CLEARLY = 2.0  # standard deviations of the velocity in (DRA.38)
STANDING = 1e-3  # [m/s] least speed in (DRA.31)


def rectangle(m: NDArray, P: NDArray, std: float) -> tuple[NDArray, NDArray]:
    """Moments (..., 11), (..., 11, 11) given equal diagonals, which make a rectangle; std [m^2] of |p1|^2 - |p2|^2."""
    p1, p2 = m[..., P1], m[..., P2]
    H = np.zeros(m.shape)
    H[..., P1], H[..., P2] = 2 * p1, -2 * p2  # (DRA.30)
    return _condition(m, P, H, dot(p2, p2) - dot(p1, p1), np.full(m.shape[:-1], std**2))  # (DRA.30)


def heading(m: NDArray, P: NDArray, std: float, least_speed: float) -> tuple[NDArray, NDArray]:
    """Moments (..., 11), (..., 11, 11) given that the length points along the velocity, with an error std [rad].

    The moments stay where the speed is not clearly above least_speed [m/s], (DRA.38); 0 leaves that test out.
    """
    a, v = m[..., P1] + m[..., P2], m[..., VELOCITY]
    a2, v2 = np.maximum(dot(a, a), 1e-6), np.maximum(dot(v, v), STANDING**2)
    H = np.zeros(m.shape)
    H[..., P1] = H[..., P2] = perpendicular(a) / a2[..., None]  # (DRA.31)
    H[..., VELOCITY] = -perpendicular(v) / v2[..., None]  # (DRA.31)
    turn = wrap_angle(np.arctan2(v[..., 1], v[..., 0]) - np.arctan2(a[..., 1], a[..., 0]))
    new = _condition(m, P, H, turn, std**2 * (1 + SLOW**2 / v2))  # (DRA.31)
    if least_speed == 0:
        return new
    spread = P[..., VELOCITY, VELOCITY].sum(-1)
    moving = v2 > least_speed**2 + CLEARLY**2 * spread  # (DRA.38)
    return np.where(moving[..., None], new[0], m), np.where(moving[..., None, None], new[1], P)


def _condition(m: NDArray, P: NDArray, H: NDArray, eps: NDArray, R: NDArray) -> tuple[NDArray, NDArray]:
    """Update by one number with residual eps (...), row H (..., 11) and variance R (...) > 0."""
    PH = (P @ H[..., None])[..., 0]
    S = (H * PH).sum(-1) + R  # (DRA.32)
    K = PH / S[..., None]  # (DRA.32)
    return m + K * eps[..., None], P - K[..., :, None] * PH[..., None, :]  # (DRA.32)
