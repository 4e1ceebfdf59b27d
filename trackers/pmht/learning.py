"""Regularised expectation maximisation of a contour from decoupled detections, as in the paper.

Equations: docs/methods/spline-pmht.md. Everything is in the unit frame. The E-step has Sigma_l, not the 4 Sigma_l that
the paper prints in (15): with that the likelihood falls and all ellipses merge at the centre.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.linalg import inverse, outer, symmetrize
from trackers.pmht.association import LOG_2PI, responsibilities
from trackers.pmht.model import DEGREE
from trackers.pmht.spline import chain


class SplineContour(NamedTuple):
    """Control points, and the covariance of the detections of each ellipse."""

    p: NDArray  # (..., n_c, 2) control points
    Sigma: NDArray  # (..., L, 2, 2)


class EllipseStatistics(NamedTuple):
    """Sums over the detections that the M-step takes."""

    M: NDArray  # (..., L) sums of the weights
    zb: NDArray  # (..., L, 2) means
    Zb: NDArray  # (..., L, 2, 2) spreads, sums


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
            new = self.maximise(now, statistics(F, w), stiffness, off)
            change = np.sqrt(((new.p - now.p) ** 2).sum((-1, -2)) / (now.p**2).sum((-1, -2)))
            keep = going[..., None, None]
            now = SplineContour(np.where(keep, new.p, now.p), np.where(keep[..., None], new.Sigma, now.Sigma))
            going = going & (change >= self.tolerance)
            if not going.any():
                break
        return now

    def maximise(
        self, now: SplineContour, s: EllipseStatistics, stiffness: NDArray | float, off: NDArray
    ) -> SplineContour:
        """First the control points with the old Sigma_l, then Sigma_l with the new points."""
        p = control_points(now, s, stiffness, off)
        d = s.zb - centres(p, now.Sigma.shape[-3])
        M = np.maximum(s.M, 1e-9)[..., None, None]
        Sigma = symmetrize(outer(d) + s.Zb / M)  # (PMHT.28), divisor M_l where the paper prints M_l + 1
        value, vector = np.linalg.eigh(Sigma)
        Sigma = (vector * np.maximum(value, self.floor)[..., None, :]) @ vector.mT
        return SplineContour(p, np.where(s.M[..., None, None] >= self.keep_below, Sigma, now.Sigma))


def centres(p: NDArray, L: int) -> NDArray:
    """Centres (..., L, 2) of the ellipses."""
    return chain(L, p.shape[-2], DEGREE) @ p


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


def control_points(now: SplineContour, s: EllipseStatistics, stiffness: NDArray | float, off: NDArray) -> NDArray:
    """Control points H^+ h (..., n_c, 2) from the maximum of (PMHT.26)."""
    N = chain(now.Sigma.shape[-3], now.p.shape[-2], DEGREE)
    n_c = N.shape[1]
    weight = s.M[..., None, None] * inverse(now.Sigma)  # (..., L, 2, 2)
    pull = (weight @ s.zb[..., None])[..., 0]
    H = np.empty((*s.M.shape[:-1], 2 * n_c, 2 * n_c))
    h = np.empty((*s.M.shape[:-1], 2 * n_c))
    for a in range(2):
        h[..., a * n_c : (a + 1) * n_c] = pull[..., a] @ N  # (PMHT.27)
        for b in range(2):
            block = N.T @ (weight[..., a, b, None] * N)
            H[..., a * n_c : (a + 1) * n_c, b * n_c : (b + 1) * n_c] = block  # (PMHT.27)
    stiff = np.asarray(stiffness, float)
    if (stiff > 0).all():
        H += 2 * stiff[..., None, None] * np.eye(2 * n_c)  # (PMHT.27)
        h += 2 * stiff[..., None] * np.concatenate([off[..., 0], off[..., 1]], -1)  # (PMHT.27)
        x = np.linalg.solve(H, h[..., None])[..., 0]
    else:
        x = (np.linalg.pinv(H, hermitian=True) @ h[..., None])[..., 0]
    return np.stack([x[..., :n_c], x[..., n_c:]], -1)


def rectangle_start(L: int = 24, n_c: int = 12) -> SplineContour:
    """A spline through points at equal arc length on a rectangle, counter-clockwise from ahead: a start for learning.

    Made for a body of 5 m by 2 m; in the unit frame it serves bodies of every size.
    """
    half = np.array([2.3, 0.8])
    corners = np.array([[1, 0], [1, 1], [-1, 1], [-1, -1], [1, -1], [1, 0]]) * half
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    at = np.arange(L) * (length[-1] / L)
    points = np.stack([np.interp(at, length, corners[:, i]) for i in range(2)], -1) / [5.0, 2.0]
    p = np.linalg.lstsq(chain(L, n_c, DEGREE), points, rcond=None)[0]
    return SplineContour(p, np.tile(np.diag([(0.3 / 5) ** 2, (0.15 / 2) ** 2]), (L, 1, 1)))
