"""Range rates of a rigid body: what a radar should measure, and the correction of heading, speed and yaw rate by it.

Equations: docs/methods/range-rates.md, which also has a table of all models in the project. A range rate over ground is
that of `Scan.ground_rate`, 0 for everything that stands still.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import cross, dot, unit
from trackers.linalg import symmetrize
from trackers.motion.turn import OMEGA, PHI, SPEED
from trackers.parameters import check_numbers
from trackers.scan import Scan

Pair = NDArray | tuple[NDArray, NDArray]


def over_ground(u: NDArray, velocity: NDArray, yaw_rate: NDArray, lever: NDArray) -> NDArray:
    """Range rate over ground (...) [m/s] of a point of a turning body, along the unit line of sight u (..., 2).

    velocity (..., 2) [m/s] of the centre, yaw_rate (...) [rad/s], lever (..., 2) [m] from the centre to the point.
    """
    return dot(u, velocity) + yaw_rate * cross(lever, u)  # (RR.2)


def polar_gradient(u: Pair, e: Pair, v: NDArray, lever: Pair) -> tuple[NDArray, NDArray, NDArray]:
    """Gradient (...) of the range rate over ground in heading, speed and yaw rate, for speed v (...) along the heading.

    Line of sight u, unit vector e of the heading and lever arm [m] come as their x and y (...).
    """
    return v * (e[0] * u[1] - e[1] * u[0]), u[0] * e[0] + u[1] * e[1], lever[0] * u[1] - lever[1] * u[0]  # (RR.3)


@dataclass(frozen=True)
class RangeRates:
    """How much a range rate counts in the correction of heading, speed and yaw rate; weight 0 leaves it out."""

    weight: float = 0.3  # share of its information, because the range rates of one vehicle do not err independently
    std: float = 0.5  # [m/s] with scattering on the body; larger than the radar's own
    clip: float = 1.5  # [m/s] larger residuals count as this

    def __post_init__(self) -> None:
        check_numbers(self, positive=("std", "clip"), unlimited=("clip",))  # weight 0 leaves range rates out

    def correct(self, m: NDArray, P: NDArray, scan: Scan, xy: NDArray) -> tuple[NDArray, NDArray]:
        """Moments m (..., n), P (..., n, n) after the range rates of the scan; components as in `trackers.motion`.

        xy (..., M, 2) [m] are the detections of the scan. The centre is held: a range rate informs about motion, not
        about the place.
        """
        use = scan.mask & np.isfinite(scan.polar[..., 2])
        if not self.weight or not use.any():
            return m, P
        g = scan.ground_rate
        phi, v, omega = (m[..., i, None] for i in (PHI, SPEED, OMEGA))
        u, e, lever = ((a[..., 0], a[..., 1]) for a in (scan.sight, unit(phi), xy - m[..., None, :2]))
        h = np.stack(polar_gradient(u, e, v, lever), -1)
        residual = np.clip(g - v * h[..., 1] - omega * h[..., 2], -self.clip, self.clip)
        h, residual = np.where(use[..., None], h, 0.0), np.where(use, residual, 0.0)
        information = self.weight / self.std**2
        J, score = np.zeros(P.shape), np.zeros(m.shape)
        J[..., PHI : OMEGA + 1, PHI : OMEGA + 1] = information * (h.mT @ h)  # (RR.4a)
        score[..., PHI : OMEGA + 1] = information * (h * residual[..., None]).sum(-2)  # (RR.4b)
        P = symmetrize(np.linalg.solve(np.eye(P.shape[-1]) + P @ J, P))  # (RR.4a), (P^-1 + J)^-1 without P^-1
        return m + (P @ score[..., None])[..., 0], P  # (RR.4b)
