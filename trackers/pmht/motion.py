"""Coordinated turn of the state by the unscented transform.

Equations: docs/methods/spline-pmht.md.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trackers.motion.turn import OMEGA, PHI, PX, PY, SPEED
from trackers.parameters import check_numbers
from trackers.pmht.state import LENGTH, WIDTH, N, rotating_root
from trackers.unscented import STANDARD, Transformed, moments


@dataclass(frozen=True)
class Walk:
    """Process noise: random walks of speed, yaw rate and size, as densities, so that two half steps are one step.

    The defaults are the paper's numbers, which it gives for steps of 1 s.
    """

    speed: float = 0.1  # [m/s / sqrt(s)]
    yaw_rate: float = 0.035  # [rad/s / sqrt(s)]
    size: float = 1e-5  # [m / sqrt(s)] of length and width

    def __post_init__(self) -> None:
        check_numbers(self)  # 0 keeps the quantity

    def covariance(self, dt: float) -> NDArray:
        """Q (7, 7) over dt [s]."""
        Q = np.zeros((N, N))
        Q[SPEED, SPEED], Q[OMEGA, OMEGA] = self.speed**2 * dt, self.yaw_rate**2 * dt  # (PMHT.6)
        Q[LENGTH, LENGTH] = Q[WIDTH, WIDTH] = self.size**2 * dt  # (PMHT.6)
        return Q


def turned(X: NDArray, dt: float) -> NDArray:
    """States X (..., 7) after dt [s] at constant speed and yaw rate."""
    h = X[..., OMEGA] * (dt / 2)
    s = X[..., SPEED] * dt * np.sinc(h / np.pi)  # (PMHT.5)
    Y = X.copy()
    Y[..., PX] += s * np.cos(X[..., PHI] + h)  # (PMHT.5)
    Y[..., PY] += s * np.sin(X[..., PHI] + h)  # (PMHT.5)
    Y[..., PHI] += 2 * h  # (PMHT.5)
    return Y


def predicted(m: NDArray, P: NDArray, walk: Walk, dt: float) -> Transformed:
    """Moments after dt [s] with process noise, and the cross covariance of the states before and after, (SM.3)."""
    reach = np.sqrt(STANDARD.reach(N)) * rotating_root(P).mT
    centre = m[..., None, :]
    X = np.concatenate([centre, centre + reach, centre - reach], -2)
    moved = moments(X, turned(X, dt))
    return moved._replace(cov=moved.cov + walk.covariance(dt))  # (PMHT.6), with the noise that the paper leaves out
