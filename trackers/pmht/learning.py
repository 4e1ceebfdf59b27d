"""Regularised expectation maximisation of a contour from decoupled detections; card bspline_pmht, section 8.

All in the unit frame. The E-step is with Sigma_l, not the 4 Sigma_l that the paper prints in (15): with that the
likelihood falls and all ellipses merge at the centre [C3].
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.linalg import inverse, outer, symmetrize
from trackers.pmht.association import LOG_2PI, responsibilities
from trackers.pmht.model import DEGREE
from trackers.pmht.spline import chain


class Contour(NamedTuple):
    """What is learned."""

    p: NDArray  # (..., n_c, 2) control points
    Sigma: NDArray  # (..., L, 2, 2)


class Statistics(NamedTuple):
    """What the M-step needs to know of the detections."""

    M: NDArray  # (..., L) sums of the weights
    zb: NDArray  # (..., L, 2) means
    Zb: NDArray  # (..., L, 2, 2) spreads, sums


@dataclass(frozen=True)
class Fit:
    """How far the expectation maximisation goes."""

    iterations: int = 60
    tolerance: float = 1e-4  # relative change of the control points at which it stops
    eps: float = 1e-3  # density of outliers per unit area
    floor: float = 1e-6  # least eigenvalue of Sigma_l
    keep_below: float = 2.0  # detections, with fewer an ellipse keeps its Sigma_l

    def run(
        self, start: Contour, z: NDArray, mask: NDArray, log_pi: NDArray, stiffness: NDArray | float, off: NDArray
    ) -> Contour:
        """The contour of detections z (..., N, 2) under the mask (..., N).

        log_pi (..., N or 1, L) are the log weights of the ellipses; stiffness (...) is lambda, which ties the control
        points to off (..., n_c, 2).
        """
        F = features(np.where(mask[..., None], z, 0.0))
        now = start
        going = np.ones(mask.shape[:-1], bool)
        for _ in range(self.iterations):
            w = responsibilities(log_densities(F, now) + log_pi, mask, self.eps)
            new = self.maximise(now, statistics(F, w), stiffness, off)
            change = np.sqrt(((new.p - now.p) ** 2).sum((-1, -2)) / (now.p**2).sum((-1, -2)))
            keep = going[..., None, None]
            now = Contour(np.where(keep, new.p, now.p), np.where(keep[..., None], new.Sigma, now.Sigma))
            going = going & (change >= self.tolerance)
            if not going.any():
                break
        return now

    def maximise(self, now: Contour, s: Statistics, stiffness: NDArray | float, off: NDArray) -> Contour:
        """First the control points with the old Sigma_l (20), then Sigma_l with the new points (21)."""
        p = control_points(now, s, stiffness, off)
        d = s.zb - centres(p, now.Sigma.shape[-3])
        M = np.maximum(s.M, 1e-9)[..., None, None]
        Sigma = symmetrize(outer(d) + s.Zb / M)  # (21), divisor M_l [C8]
        value, vector = np.linalg.eigh(Sigma)
        Sigma = (vector * np.maximum(value, self.floor)[..., None, :]) @ vector.mT
        return Contour(p, np.where(s.M[..., None, None] >= self.keep_below, Sigma, now.Sigma))


def centres(p: NDArray, L: int) -> NDArray:
    """Centres (..., L, 2) of the ellipses."""
    return chain(L, p.shape[-2], DEGREE) @ p


def features(z: NDArray) -> NDArray:
    """1, x, y, x^2, xy, y^2 (..., N, 6): log densities and statistics are linear in them, so matrix products do all."""
    x, y = z[..., 0], z[..., 1]
    return np.stack([np.ones(x.shape), x, y, x * x, x * y, y * y], -1)


def log_densities(F: NDArray, now: Contour) -> NDArray:
    """Log N(z_n; mu_l, Sigma_l) (..., N, L) from features F (..., N, 6)."""
    information, mu = inverse(now.Sigma), centres(now.p, now.Sigma.shape[-3])
    pull = (information @ mu[..., None])[..., 0]
    constant = 0.5 * np.linalg.slogdet(information)[1] - 0.5 * (mu * pull).sum(-1) - LOG_2PI
    xx, xy, yy = information[..., 0, 0], information[..., 0, 1], information[..., 1, 1]
    return F @ np.stack([constant, pull[..., 0], pull[..., 1], -xx / 2, -xy, -yy / 2], -2)


def statistics(F: NDArray, w: NDArray) -> Statistics:
    """Weight sums, means and spreads from features F (..., N, 6) and weights w (..., N, L)."""
    total = w.mT @ F  # (..., L, 6)
    M = total[..., 0]
    safe = np.maximum(M, 1e-9)
    zb = total[..., 1:3] / safe[..., None]
    second = total[..., [3, 4, 4, 5]].reshape(*M.shape, 2, 2)
    return Statistics(M, zb, second - M[..., None, None] * outer(zb))


def control_points(now: Contour, s: Statistics, stiffness: NDArray | float, off: NDArray) -> NDArray:
    """Control points H^+ h (..., n_c, 2), (20): minus lambda in the objective, where the paper prints plus [C6]."""
    N = chain(now.Sigma.shape[-3], now.p.shape[-2], DEGREE)
    n_c = N.shape[1]
    weight = s.M[..., None, None] * inverse(now.Sigma)  # (..., L, 2, 2)
    pull = (weight @ s.zb[..., None])[..., 0]
    H = np.empty((*s.M.shape[:-1], 2 * n_c, 2 * n_c))
    h = np.empty((*s.M.shape[:-1], 2 * n_c))
    for a in range(2):
        h[..., a * n_c : (a + 1) * n_c] = pull[..., a] @ N
        for b in range(2):
            block = N.T @ (weight[..., a, b, None] * N)
            H[..., a * n_c : (a + 1) * n_c, b * n_c : (b + 1) * n_c] = block
    stiff = np.asarray(stiffness, float)
    if (stiff > 0).all():
        H += 2 * stiff[..., None, None] * np.eye(2 * n_c)
        h += 2 * stiff[..., None] * np.concatenate([off[..., 0], off[..., 1]], -1)
        x = np.linalg.solve(H, h[..., None])[..., 0]
    else:
        x = (np.linalg.pinv(H, hermitian=True) @ h[..., None])[..., 0]
    return np.stack([x[..., :n_c], x[..., n_c:]], -1)


def rectangle_start(L: int = 24, n_c: int = 12) -> Contour:
    """The card's start: a spline through points at equal arc length on a rectangle, counter-clockwise from ahead.

    Made for a body of 5 m by 2 m; in the unit frame it serves them all.
    """
    half = np.array([2.3, 0.8])
    corners = np.array([[1, 0], [1, 1], [-1, 1], [-1, -1], [1, -1], [1, 0]]) * half
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    at = np.arange(L) * (length[-1] / L)
    points = np.stack([np.interp(at, length, corners[:, i]) for i in range(2)], -1) / [5.0, 2.0]
    p = np.linalg.lstsq(chain(L, n_c, DEGREE), points, rcond=None)[0]
    return Contour(p, np.tile(np.diag([(0.3 / 5) ** 2, (0.15 / 2) ** 2]), (L, 1, 1)))
