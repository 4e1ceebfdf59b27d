"""State of the filters on a spline, x = [px, py, phi, v, omega, l, w] and the contour of each object, and its motion.

Equations: docs/methods/spline-pmht.md. Components in the order of `trackers.motion`; the paper has the speed before the
heading.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.geometry import to_world
from trackers.held_gaussian import LENGTH, WIDTH, box_estimate
from trackers.motion.turn import OMEGA, PHI, PX, PY, SPEED
from trackers.parameters import check_numbers
from trackers.unscented import STANDARD, Transformed, moments, root

N = 7
LEAST_SIZE = 0.3  # [m]


class SplineState(NamedTuple):
    """p(x) = N(x; m, P), and the contour in the unit frame."""

    m: NDArray  # (..., 7) px, py [m], phi [rad] unwrapped, v [m/s], omega [rad/s], l, w [m]
    P: NDArray  # (..., 7, 7)
    p: NDArray  # (..., n_c, 2) control points
    Sigma: NDArray  # (..., L, 2, 2)
    visible: NDArray  # (..., A, L) share of each ellipse in the lit outline from A directions, see `visibility.py`


def rotating_root(P: NDArray) -> NDArray:
    """Root T (..., 7, 7) of P = T T^T whose columns turn with the world.

    The position enters all models additively, so the order of x and y does not matter once they come last.
    """
    return root(P[..., ::-1, ::-1])[..., ::-1, :]  # (PMHT.7)


def estimate_of(m: NDArray, P: NDArray, outline: NDArray) -> Estimate:
    """Box along the heading from m (..., 7), P (..., 7, 7), with an outline (..., C, 2) in the unit frame."""
    size = m[..., LENGTH:].copy()
    size_std = np.sqrt(P.diagonal(axis1=-2, axis2=-1)[..., LENGTH:])
    found = box_estimate(m, P, size, size_std)
    return found._replace(contour=to_world(found.pose, outline * size[..., None, :]))


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
