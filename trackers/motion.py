"""Coordinated-turn motion with polar velocity; card htg_rm, section 2.

x = [px, py, phi, v, omega]: centre [m], heading [rad], speed [m/s], yaw rate [rad/s].
"""

import numpy as np
from numpy.typing import NDArray

from trackers.linalg import outer, symmetrize

PX, PY, PHI, SPEED, OMEGA = range(5)


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
    moved[..., PX] += v * g * c
    moved[..., PY] += v * g * s
    moved[..., PHI] += omega * dt
    G = np.zeros((*m.shape, 5)) + np.eye(5)
    G[..., PX, PHI], G[..., PY, PHI] = -v * g * s, v * g * c
    G[..., PX, SPEED], G[..., PY, SPEED] = g * c, g * s
    G[..., PX, OMEGA] = v * (g1 * c - g * dt / 2 * s)
    G[..., PY, OMEGA] = v * (g1 * s + g * dt / 2 * c)
    G[..., PHI, OMEGA] = dt
    return moved, G


def turn_noise(phi: NDArray, dt: float, sigma_v: float, sigma_omega: float) -> NDArray:
    """Process noise (..., 5, 5) of an acceleration sigma_v [m/s^2] and a yaw acceleration sigma_omega [rad/s^2]."""
    zero, one = np.zeros_like(phi), np.ones_like(phi)
    along = np.stack([dt**2 / 2 * np.cos(phi), dt**2 / 2 * np.sin(phi), zero, dt * one, zero], -1) * sigma_v
    turn = np.stack([zero, zero, dt**2 / 2 * one, zero, dt * one], -1) * sigma_omega
    Gam = np.stack([along, turn], -1)
    return Gam @ Gam.mT


def cartesian_covariance(m: NDArray, P: NDArray) -> NDArray:
    """Covariance (..., 4, 4) of (x, y, vx, vy) from m (..., 5) and P (..., 5, 5).

    Linear, but for one term: across the heading the velocity varies with the product of the errors of heading and
    speed, and at standstill with nothing else. A rounding's worth of identity keeps it regular.
    """
    phi, v = m[..., PHI], m[..., SPEED]
    c, s = np.cos(phi), np.sin(phi)
    J = np.zeros((*phi.shape, 4, 5))
    J[..., 0, PX] = J[..., 1, PY] = 1.0
    J[..., 2, PHI], J[..., 3, PHI] = -v * s, v * c
    J[..., 2, SPEED], J[..., 3, SPEED] = c, s
    cov = symmetrize(J @ P @ J.mT) + 1e-9 * np.eye(4)
    product = P[..., PHI, PHI] * P[..., SPEED, SPEED]
    cov[..., 2:, 2:] += product[..., None, None] * outer(np.stack([-s, c], -1))
    return cov


def polar_moments(velocity: NDArray, cov: NDArray, heading: NDArray, heading_std: NDArray) -> tuple[NDArray, NDArray]:
    """Speed along the heading (...) and the joint covariance (..., 4, 4) of (px, py, phi, v).

    velocity (..., 2) [m/s] and cov (..., 4, 4) of (x, y, vx, vy) are projected on the heading; the heading keeps its
    own variance, uncorrelated, because a standing object has a heading but no course.
    """
    along = np.stack([np.cos(heading), np.sin(heading)], -1)
    J = np.zeros((*heading.shape, 4, 4))
    J[..., 0, 0] = J[..., 1, 1] = 1.0
    J[..., 3, 2], J[..., 3, 3] = along[..., 0], along[..., 1]
    P = J @ cov @ J.mT
    P[..., 2, 2] = heading_std**2
    return (velocity * along).sum(-1), P
