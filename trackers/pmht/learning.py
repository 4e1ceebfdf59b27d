"""Regularised expectation maximisation of a contour from decoupled detections, as in the paper.

Equations: docs/methods/spline-pmht.md. Everything is in the unit frame. The E-step has Sigma_l, not the 4 Sigma_l that
the paper prints in (15): with that the likelihood falls and all ellipses merge at the centre.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.linalg import inverse
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
