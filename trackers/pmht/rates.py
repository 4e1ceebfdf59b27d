"""Range rates of a turning body correct its heading, speed and yaw rate; card multi_object, step 7."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import cross, dot, unit
from trackers.linalg import symmetrize
from trackers.motion import OMEGA, PHI, SPEED
from trackers.scan import Scan


@dataclass(frozen=True)
class RangeRates:
    """How much a range rate says; weight 0 leaves them out."""

    weight: float = 0.3  # information of a range rate, because those of one vehicle are not independent
    std: float = 0.5  # [m/s] scattering on the body included; larger than the radar's own
    clip: float = 1.5  # [m/s] larger residuals count as this

    def __post_init__(self) -> None:
        if not (self.weight >= 0 and self.std > 0 and self.clip > 0):
            raise ValueError(
                f"weight must be >= 0, std and clip positive, got {self.weight}, {self.std}, {self.clip}; "
                "weight 0 leaves range rates out"
            )

    def correct(self, m: NDArray, P: NDArray, scan: Scan, xy: NDArray) -> tuple[NDArray, NDArray]:
        """Moments m (..., n), P (..., n, n) after ground range rates g = u . (v e_phi + omega J (z - c)).

        xy (..., M, 2) [m] are the detections of the scan.
        """
        g = scan.ground_rate
        use = scan.mask & np.isfinite(g)
        if not self.weight or not use.any():
            return m, P
        phi, v, omega = (m[..., i, None] for i in (PHI, SPEED, OMEGA))
        u, e = scan.sight, unit(phi)
        h = np.stack([v * cross(e, u), dot(u, e), cross(xy - m[..., None, :2], u)], -1)
        residual = np.clip(g - v * h[..., 1] - omega * h[..., 2], -self.clip, self.clip)
        h, residual = np.where(use[..., None], h, 0.0), np.where(use, residual, 0.0)
        information = self.weight / self.std**2
        J, score = np.zeros(P.shape), np.zeros(m.shape)
        J[..., PHI : OMEGA + 1, PHI : OMEGA + 1] = information * (h.mT @ h)
        score[..., PHI : OMEGA + 1] = information * (h * residual[..., None]).sum(-2)
        P = symmetrize(np.linalg.solve(np.eye(P.shape[-1]) + P @ J, P))  # (P^-1 + J)^-1 without the inverse of P
        return m + (P @ score[..., None])[..., 0], P
