"""Coordinated-turn motion with polar velocity.

Equations: docs/methods/random-matrices.md. x = [px, py, phi, v, omega]: centre [m], heading [rad], speed [m/s], yaw
rate [rad/s].
"""

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import dot, perpendicular, unit
from trackers.linalg import outer, symmetrize

PX, PY, PHI, SPEED, OMEGA = range(5)
I5 = np.eye(5)
ROUNDING = 1e-9 * np.eye(4)  # keeps the covariance of (x, y, vx, vy) regular


def coordinated_turn(m: NDArray, dt: float) -> tuple[NDArray, NDArray]:
    """Exact transition of the mean m (..., 5) over dt [s] and its Jacobian (..., 5, 5)."""
    phi, v, omega = m[..., PHI], m[..., SPEED], m[..., OMEGA]
    x = omega * dt / 2
    small = np.abs(x) < 1e-4
    x_safe = np.where(small, 1.0, x)
    g = dt * np.where(small, 1 - x**2 / 6, np.sin(x_safe) / x_safe)
    g1 = (dt**2 / 2) * np.where(small, -x / 3, (x_safe * np.cos(x_safe) - np.sin(x_safe)) / x_safe**2)
    c, s = np.cos(phi + x), np.sin(phi + x)
    moved = m.copy()
    moved[..., PX] += v * g * c  # (RM.6)
    moved[..., PY] += v * g * s  # (RM.6)
    moved[..., PHI] += omega * dt  # (RM.6)
    G = np.zeros((*m.shape, 5)) + I5
    G[..., PX, PHI], G[..., PY, PHI] = -v * g * s, v * g * c  # (RM.7)
    G[..., PX, SPEED], G[..., PY, SPEED] = g * c, g * s  # (RM.7)
    G[..., PX, OMEGA] = v * (g1 * c - g * dt / 2 * s)  # (RM.7)
    G[..., PY, OMEGA] = v * (g1 * s + g * dt / 2 * c)  # (RM.7)
    G[..., PHI, OMEGA] = dt  # (RM.7)
    return moved, G


def turn_noise(phi: NDArray, dt: float, sigma_v: float, sigma_omega: float) -> NDArray:
    """Process noise (..., 5, 5) of an acceleration sigma_v [m/s^2] and a yaw acceleration sigma_omega [rad/s^2]."""
    Gam = np.zeros((*np.shape(phi), 5, 2))
    Gam[..., :2, 0] = dt**2 / 2 * unit(phi) * sigma_v  # (RM.8)
    Gam[..., SPEED, 0] = dt * sigma_v  # (RM.8)
    Gam[..., PHI, 1], Gam[..., OMEGA, 1] = dt**2 / 2 * sigma_omega, dt * sigma_omega  # (RM.8)
    return Gam @ Gam.mT  # (RM.8)


def cartesian_covariance(m: NDArray, P: NDArray) -> NDArray:
    """Covariance (..., 4, 4) of (x, y, vx, vy) from m (..., 5) and P (..., 5, 5).

    Linearised, but for one term: across the heading the velocity varies with the product of the errors of heading and
    speed, which is all that is left at standstill. `ROUNDING` keeps the matrix regular.
    """
    along = unit(m[..., PHI])
    across = perpendicular(along)
    J = np.zeros((*m.shape[:-1], 4, 5))
    J[..., 0, PX] = J[..., 1, PY] = 1.0
    J[..., 2:, PHI] = m[..., SPEED, None] * across
    J[..., 2:, SPEED] = along
    cov = symmetrize(J @ P @ J.mT) + ROUNDING  # (RM.15)
    product = P[..., PHI, PHI] * P[..., SPEED, SPEED]
    cov[..., 2:, 2:] += product[..., None, None] * outer(across)  # (RM.15)
    return cov


def polar_moments(velocity: NDArray, cov: NDArray, heading: NDArray, heading_std: NDArray) -> tuple[NDArray, NDArray]:
    """Speed along the heading (...) and the joint covariance (..., 4, 4) of (px, py, phi, v).

    velocity (..., 2) [m/s] and cov (..., 4, 4) of (x, y, vx, vy) are projected on the heading (...) [rad], which has a
    variance of its own, uncorrelated: a standing object has a heading but no course.
    """
    along = unit(heading)
    J = np.zeros((*heading.shape, 4, 4))
    J[..., 0, 0] = J[..., 1, 1] = 1.0
    J[..., 3, 2:] = along
    P = J @ cov @ J.mT  # (RM.5)
    P[..., 2, 2] = heading_std**2  # (RM.5)
    return dot(velocity, along), P  # (RM.5)
