"""Regularised expectation maximisation of a contour from decoupled detections of one to four sides.

Equations: docs/methods/spline-pmht.md. Everything is in the unit frame. Beyond the paper, ellipses weigh by what the
sensor of each detection sees, the known noise of each detection is taken out, detections from inside the body belong to
none of the ellipses, and an ellipse with few detections keeps the spread that it had in the catalogue.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import cross
from trackers.linalg import inverse, outer, symmetrize
from trackers.parameters import check_numbers
from trackers.pmht.association import BOX_COLUMN, RelativeDetections, columns, log_density, matrices, responsibilities
from trackers.pmht.model import DEGREE, chain, curve
from trackers.pmht.visibility import directions, weights
from trackers.pmht.window import Decoupled


class SplineContour(NamedTuple):
    """Control points, and the covariance of the detections of each ellipse."""

    p: NDArray  # (..., n_c, 2) control points
    Sigma: NDArray  # (..., L, 2, 2)


class EllipseStatistics(NamedTuple):
    """Sums over the detections that the M-step takes."""

    M: NDArray  # (..., L) sums of the weights
    zb: NDArray  # (..., L, 2) means
    Zb: NDArray  # (..., L, 2, 2) spreads, sums


def centres(p: NDArray, L: int) -> NDArray:
    """Centres (..., L, 2) of the ellipses."""
    return chain(L, p.shape[-2], DEGREE) @ p


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


@dataclass(frozen=True)
class Refine:
    """How closely a contour follows the detections of its own object."""

    stiffness: float = 2.0  # lambda of (PMHT.27) for each detection; 0.5 in the reproduction of the paper
    symmetric: bool = True  # left and right sides are alike, so what is seen of one is known of the other
    prior: float = 20.0  # detections that the spread of the catalogue counts for, at each ellipse, (PMHT.33)
    eps: float = 1e-3  # density of outliers per unit area
    floor: float = 1e-5  # least eigenvalue of Sigma_l
    unseen: float = 0.002  # share of the detections from ellipses out of sight, (PMHT.22)
    iterations: int = 1  # in one update of the filter

    def __post_init__(self) -> None:
        check_numbers(self, positive=("stiffness", "floor", "iterations"))  # without stiffness unseen sides run away

    def run(
        self, start: SplineContour, off: SplineContour, data: Decoupled, log_pi: NDArray | float, interior: float
    ) -> SplineContour:
        """The contour after some iterations; off is that of the catalogue.

        log_pi (..., D or 1, L) are the log weights of the ellipses, interior is the share of detections from inside.
        """
        detections = RelativeDetections(
            data.z.mT, np.where(data.mask[..., None], data.R, [1.0, 0.0, 1.0]).mT, data.mask
        )
        share = interior / (1 - interior)
        rest = self.eps + share * np.exp(log_density(detections, np.zeros((2, 1)), BOX_COLUMN))  # (PMHT.32)
        stiffness = self.stiffness * data.mask.sum(-1)
        now = start
        for _ in range(self.iterations):
            s = self.expect(now, detections, log_pi, rest)
            now = self.maximise(now, off, with_mirror(s) if self.symmetric else s, stiffness)
        return now

    def expect(
        self, now: SplineContour, detections: RelativeDetections, log_pi: NDArray | float, rest: NDArray
    ) -> EllipseStatistics:
        """Weight sums, means and spreads of the points that the detections came from, without their noise."""
        mu, Sigma = centres(now.p, now.Sigma.shape[-3]).mT, columns(now.Sigma)
        w = responsibilities(
            log_density(detections, mu, Sigma) + log_pi, detections.mask, rest
        )  # (..., D, L), (PMHT.32)
        S = Sigma[..., None, :] + detections.R[..., None]  # (..., 3, D, L)
        det = S[..., 0, :, :] * S[..., 2, :, :] - S[..., 1, :, :] ** 2
        S = S / det[..., None, :, :]
        dx, dy = (detections.z[..., i, :, None] - mu[..., i, None, :] for i in (0, 1))
        ux, uy = S[..., 2, :, :] * dx - S[..., 1, :, :] * dy, S[..., 0, :, :] * dy - S[..., 1, :, :] * dx  # S^-1 d
        M = w.sum(-2)  # (PMHT.25)
        safe = np.maximum(M, 1e-9)[..., None]
        # x = mu + Sigma S^-1 d is linear in u, so the sums over detections come before the products with Sigma.
        u = np.stack([(w * ux).sum(-2), (w * uy).sum(-2)], -1) / safe
        uu = np.stack([(w * ux * ux).sum(-2), (w * ux * uy).sum(-2), (w * uy * uy).sum(-2)], -2)
        inv = np.stack(
            [(w * S[..., 2, :, :]).sum(-2), -(w * S[..., 1, :, :]).sum(-2), (w * S[..., 0, :, :]).sum(-2)], -2
        )
        second = now.Sigma @ (matrices(uu) - matrices(inv)) @ now.Sigma + M[..., None, None] * now.Sigma  # (PMHT.24)
        shift = (now.Sigma @ u[..., None])[..., 0]  # (PMHT.24)
        return EllipseStatistics(M, mu.mT + shift, second - M[..., None, None] * outer(shift))

    def maximise(
        self, now: SplineContour, off: SplineContour, s: EllipseStatistics, stiffness: NDArray
    ) -> SplineContour:
        """Control points, then covariances, which are drawn towards those of the catalogue."""
        p = control_points(now, s, stiffness, off.p)  # (PMHT.27)
        d = s.zb - centres(p, now.Sigma.shape[-3])
        M = s.M[..., None, None]
        total = symmetrize(M * outer(d) + s.Zb + self.prior * off.Sigma)
        Sigma = total / np.maximum(M + self.prior, 1e-9)  # (PMHT.33)
        value, vector = np.linalg.eigh(Sigma)
        return SplineContour(p, (vector * np.maximum(value, self.floor)[..., None, :]) @ vector.mT)

    def log_weights(self, table: NDArray, p: NDArray, L: int, size: NDArray, sensor: NDArray) -> NDArray:
        """Log weights (..., D, L) of the ellipses for sensors (..., D, 2) [m] in the body frame; table (..., A, L)."""
        c = (centres(p, L) * size[..., None, :]).mT
        return np.log(weights(table, directions(c, np.zeros(size.shape[:-1]), sensor), self.unseen))


def with_mirror(s: EllipseStatistics) -> EllipseStatistics:
    """Statistics of the detections and their mirror images; ellipse l mirrors ellipse -l, as 0 is at the front."""
    L = s.M.shape[-1]
    image, flip = -np.arange(L) % L, np.array([1.0, -1.0])
    M, zb, Zb = s.M[..., image], s.zb[..., image, :] * flip, s.Zb[..., image, :, :] * outer(flip)
    both = s.M + M
    mean = (s.M[..., None] * s.zb + M[..., None] * zb) / np.maximum(both, 1e-9)[..., None]
    between = s.M[..., None, None] * outer(s.zb - mean) + M[..., None, None] * outer(zb - mean)
    return EllipseStatistics(both, mean, s.Zb + Zb + between)


def is_simple(p: NDArray) -> NDArray:
    """Whether contours (...) of control points p (..., n_c, 2) run counter-clockwise and do not cross themselves."""
    a = curve(p)
    b = np.roll(a, -1, -2)
    area = cross(a, b).sum(-1)
    n = a.shape[-2]
    i, j = np.triu_indices(n, 2)
    apart = (i > 0) | (j < n - 1)  # the first and the last edge are neighbours
    i, j = i[apart], j[apart]

    def side(of: NDArray, k: NDArray, edge: NDArray) -> NDArray:
        return cross(b[..., edge, :] - a[..., edge, :], of[..., k, :] - a[..., edge, :])

    meet = (side(a, i, j) * side(b, i, j) < 0) & (side(a, j, i) * side(b, j, i) < 0)
    return np.asarray((area > 0) & ~meet.any(-1))
