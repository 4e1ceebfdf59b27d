"""Regularised expectation maximisation of a contour from decoupled detections, as in the paper.

Equations: docs/methods/spline-pmht.md. Everything is in the unit frame. The E-step has Sigma_l, not the 4 Sigma_l that
the paper prints in (15): with that the likelihood falls and all ellipses merge at the centre.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import rotation
from trackers.held_gaussian import LENGTH
from trackers.linalg import inverse, outer
from trackers.motion.turn import PHI
from trackers.pmht.association import LOG_2PI, responsibilities
from trackers.pmht.learning import EllipseStatistics, SplineContour, centres
from trackers.pmht.offline import maximise


@dataclass(frozen=True)
class ContourEM:
    """Expectation maximisation with outliers of even density."""

    iterations: int = 60
    tolerance: float = 1e-4  # relative change of the control points at which it stops
    eps: float = 1e-3  # density of outliers per unit area
    floor: float = 1e-6  # least eigenvalue of Sigma_l
    keep_below: float = 2.0  # detections; with fewer an ellipse keeps its Sigma_l

    def run(
        self, start: SplineContour, z: NDArray, mask: NDArray, log_pi: NDArray, stiffness: NDArray | float, off: NDArray
    ) -> SplineContour:
        """The contour of detections z (..., N, 2) under the mask (..., N).

        log_pi (..., N or 1, L) are the log weights of the ellipses; stiffness (...) is lambda, which ties the control
        points to off (..., n_c, 2).
        """
        F = features(np.where(mask[..., None], z, 0.0))
        now = start
        going = np.ones(mask.shape[:-1], bool)
        for _ in range(self.iterations):
            w = responsibilities(log_densities(F, now) + log_pi, mask, self.eps)  # (PMHT.23), R = 0, eps for the inside
            new = maximise(now, statistics(F, w), stiffness, off, self.floor, self.keep_below)
            change = np.sqrt(((new.p - now.p) ** 2).sum((-1, -2)) / (now.p**2).sum((-1, -2)))
            keep = going[..., None, None]
            now = SplineContour(np.where(keep, new.p, now.p), np.where(keep[..., None], new.Sigma, now.Sigma))
            going = going & (change >= self.tolerance)
            if not going.any():
                break
        return now


def features(z: NDArray) -> NDArray:
    """1, x, y, x^2, xy, y^2 (..., N, 6), in which log densities and statistics are linear: both are matrix products."""
    x, y = z[..., 0], z[..., 1]
    return np.stack([np.ones(x.shape), x, y, x * x, x * y, y * y], -1)


def log_densities(F: NDArray, now: SplineContour) -> NDArray:
    """Log N(z_n; mu_l, Sigma_l) (..., N, L) from features F (..., N, 6)."""
    information, mu = inverse(now.Sigma), centres(now.p, now.Sigma.shape[-3])
    pull = (information @ mu[..., None])[..., 0]
    constant = 0.5 * np.linalg.slogdet(information)[1] - 0.5 * (mu * pull).sum(-1) - LOG_2PI
    xx, xy, yy = information[..., 0, 0], information[..., 0, 1], information[..., 1, 1]
    return F @ np.stack([constant, pull[..., 0], pull[..., 1], -xx / 2, -xy, -yy / 2], -2)


def statistics(F: NDArray, w: NDArray) -> EllipseStatistics:
    """Weight sums, means and spreads from features F (..., N, 6) and weights w (..., N, L), (PMHT.25)."""
    total = w.mT @ F  # (..., L, 6)
    M = total[..., 0]
    safe = np.maximum(M, 1e-9)
    zb = total[..., 1:3] / safe[..., None]  # (PMHT.25)
    second = total[..., [3, 4, 4, 5]].reshape(*M.shape, 2, 2)
    return EllipseStatistics(M, zb, second - M[..., None, None] * outer(zb))


def decoupled(m: NDArray, xy: NDArray) -> NDArray:
    """Detections xy (..., M, 2) [m] in the unit frame of states m (..., 7), (PMHT.29)."""
    body = (xy - m[..., None, :2]) @ rotation(m[..., PHI])
    return body / m[..., None, LENGTH:]  # (PMHT.29)
