"""Pseudo-measurements that keep the body a rectangle along its velocity; card dra_imm, section 12, items 2 and 4."""

import numpy as np
from numpy.typing import NDArray

from trackers.dra.state import P1, P2, VELOCITY
from trackers.geometry import dot, perpendicular, wrap_angle

SLOW = 2.0  # [m/s] at this speed the variance of the course is twice that at speed
STANDING = 1e-3  # [m/s] slower is taken as this


def rectangle(m: NDArray, P: NDArray, std: float) -> tuple[NDArray, NDArray]:
    """Condition N(m, P) on 0 = |p1|^2 - |p2|^2 + e, std of e [m^2]: with equal diagonals it is a rectangle."""
    p1, p2 = m[..., P1], m[..., P2]
    H = np.zeros(m.shape)
    H[..., P1], H[..., P2] = 2 * p1, -2 * p2
    return _condition(m, P, H, dot(p2, p2) - dot(p1, p1), np.full(m.shape[:-1], std**2))


def heading(m: NDArray, P: NDArray, std: float) -> tuple[NDArray, NDArray]:
    """Condition N(m, P) on the length pointing along the velocity, with an error of std [rad] at speed."""
    a, v = m[..., P1] + m[..., P2], m[..., VELOCITY]
    a2, v2 = np.maximum(dot(a, a), 1e-6), np.maximum(dot(v, v), STANDING**2)
    H = np.zeros(m.shape)
    H[..., P1] = H[..., P2] = perpendicular(a) / a2[..., None]
    H[..., VELOCITY] = -perpendicular(v) / v2[..., None]
    turn = wrap_angle(np.arctan2(v[..., 1], v[..., 0]) - np.arctan2(a[..., 1], a[..., 0]))
    return _condition(m, P, H, turn, std**2 * (1 + SLOW**2 / v2))


def _condition(m: NDArray, P: NDArray, H: NDArray, eps: NDArray, R: NDArray) -> tuple[NDArray, NDArray]:
    """Update by one number with residual eps (...), row H (..., 11) and variance R (...) > 0."""
    PH = (P @ H[..., None])[..., 0]
    S = (H * PH).sum(-1) + R
    K = PH / S[..., None]
    return m + K * eps[..., None], P - K[..., :, None] * PH[..., None, :]
