"""The state update with all ellipses at once, in information form.

Equations: docs/methods/spline-pmht.md. Augmented unscented transform of [x; xi_l] in closed form: x and xi_l are
independent and a detection is linear in xi_l, so the points that move xi_l contribute exactly A Sigma_l A^T. Everything
is in whitened coordinates u, x = m + T u with T T^T = P, so that no covariance of the state is inverted.
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from trackers.filter import Note
from trackers.geometry import rotation
from trackers.held_gaussian import LENGTH
from trackers.linalg import I2, quadratic, symmetrize
from trackers.motion.turn import PHI
from trackers.pmht.association import (
    LEAST_WEIGHT,
    RelativeDetections,
    SyntheticDetections,
    determinant,
    matrices,
    upright,
)
from trackers.pmht.state import N, rotating_root
from trackers.unscented import STANDARD

AUGMENTED = N + 2
I7 = np.eye(N)
REACH = float(np.sqrt(STANDARD.reach(AUGMENTED)))
WEIGHTS_MEAN, WEIGHTS_COV = STANDARD.weights(AUGMENTED)
WEIGHTS = np.full((2 * N + 1, 1), WEIGHTS_COV[1])
WEIGHTS[0] = WEIGHTS_COV[0] + 4 * WEIGHTS_COV[1]  # (PMHT.12): the four points that move xi_l leave the state at m


class PredictedEllipses(NamedTuple):
    """The centres of the ellipses under a Gaussian N(m, P) of the state."""

    T: NDArray  # (..., 7, 7) root of P
    c: NDArray  # (..., 2, L) [m] expected centres relative to that of m
    h: NDArray  # (..., 7, 2, L) [m] their slopes in u
    C: NDArray  # (..., 3, L) [m^2] covariances C^x_l


class Doubt(NamedTuple):
    """Which ellipse made which detection is known by probabilities only."""

    w: NDArray  # (..., M, L)
    detections: RelativeDetections
    share: float  # of the information that is missing for it, which is taken away; the rest counts as there


class EllipseUpdate(Protocol):
    """A form of the update that is not built in, such as `studies.papers.yao2021.sequential.OneByOne`."""

    def update(
        self, m: NDArray, P: NDArray, mu: NDArray, E: NDArray, z: SyntheticDetections
    ) -> tuple[NDArray, NDArray]:
        """Moments (..., 7), (..., 7, 7) from the prediction N(m, P) and the synthetic detections z.

        z is relative to the centre of m; mu (..., 2, L) in the unit frame; E (..., 3, L) [m^2] as in `update`.
        """


def predict_ellipses(m: NDArray, P: NDArray, mu: NDArray) -> PredictedEllipses:
    """Moments of A mu_l + centre for ellipses mu (..., 2, L) in the unit frame, m (..., 7), P (..., 7, 7)."""
    T = rotating_root(P)
    d = np.zeros((*m.shape[:-1], 2 * N + 1, N))
    d[..., 1 : N + 1, :] = REACH * T.mT
    d[..., N + 1 :, :] = -d[..., 1 : N + 1, :]
    A = rotation(m[..., None, PHI] + d[..., PHI]) * (m[..., None, LENGTH:] + d[..., LENGTH:])[..., None, :]
    rows = A.reshape(*m.shape[:-1], 2 * (2 * N + 1), 2) @ mu
    y = rows.reshape(*m.shape[:-1], 2 * N + 1, 2, mu.shape[-1]) + d[..., :2, None]  # (..., 15, 2, L)
    first = y[..., 0, :, :]
    c = first + WEIGHTS_MEAN[1] * (y.sum(-3) - (2 * N + 1) * first)  # (PMHT.12)
    e = y - c[..., None, :, :]
    ex, ey = e[..., 0, :], e[..., 1, :]
    wx = WEIGHTS * ex
    C = upright((wx * ex).sum(-2), (wx * ey).sum(-2), (WEIGHTS * ey * ey).sum(-2))  # (PMHT.12)
    h = (y[..., 1 : N + 1, :, :] - y[..., N + 1 :, :, :]) / (2 * REACH)  # (PMHT.13)
    return PredictedEllipses(T, c, h, C)


def update(
    m: NDArray, expected: PredictedEllipses, E: NDArray, z: SyntheticDetections, doubt: Doubt | None = None
) -> tuple[NDArray, NDArray]:
    """Moments (..., 7), (..., 7, 7) after the synthetic detections z, relative to the centre of m.

    E (..., 3, L) [m^2] are the covariances A Sigma_l A^T of the detections of each ellipse. Without a doubt detections
    are taken for those of their ellipses.
    """
    h, g = expected.h, np.empty(expected.h.shape)
    hx, hy = h[..., 0, :], h[..., 1, :]
    V = (E + z.R) / np.maximum(z.M, LEAST_WEIGHT)[..., None, :]  # (PMHT.14)
    bent = upright((hx * hx).sum(-2), (hx * hy).sum(-2), (hy * hy).sum(-2))
    W = expected.C - bent + V  # (PMHT.14)
    W = W * ((z.M > LEAST_WEIGHT) / determinant(W))[..., None, :]
    xx, xy, yy = W[..., None, 0, :], W[..., None, 1, :], W[..., None, 2, :]
    g[..., 0, :], g[..., 1, :] = yy * hx - xy * hy, xx * hy - xy * hx  # W^-1 h
    flat = (*h.shape[:-2], 2 * h.shape[-1])
    h, g = h.reshape(flat), g.reshape(flat)
    r = (z.z - expected.c).reshape(*flat[:-2], flat[-1], 1)
    information = symmetrize(h @ g.mT)
    inverse = np.linalg.inv(I7 + information)
    u = inverse @ (g @ r)
    if doubt is not None:
        value, U = np.linalg.eigh(information - doubt.share * missing(expected, E + z.R, doubt, u[..., 0]))
        inverse = (U / (1 + np.maximum(value, 0.0))[..., None, :]) @ U.mT  # (PMHT.39)
    return m + (expected.T @ u)[..., 0], symmetrize(expected.T @ inverse @ expected.T.mT)  # (PMHT.15b), (PMHT.15a)


def missing(expected: PredictedEllipses, S: NDArray, doubt: Doubt, u: NDArray) -> NDArray:
    """Information (..., 7, 7) about u that is missing where u (..., 7) is true, (PMHT.38).

    S (..., 3, L) [m^2] is the covariance of one detection of each ellipse.
    """
    hx, hy = expected.h[..., 0, :], expected.h[..., 1, :]  # (..., 7, L)
    c = expected.c + (expected.h * u[..., None, None]).sum(-3)
    d = doubt.detections.z[..., None] - c[..., None, :]  # (..., 2, M, L)
    S = (S / determinant(S)[..., None, :])[..., None, :]
    ax = S[..., 2, :, :] * d[..., 0, :, :] - S[..., 1, :, :] * d[..., 1, :, :]
    ay = S[..., 0, :, :] * d[..., 1, :, :] - S[..., 1, :, :] * d[..., 0, :, :]
    wx, wy = doubt.w * ax, doubt.w * ay
    xx, xy, yy = ((a * b).sum(-2)[..., None, :] for a, b in ((wx, ax), (wx, ay), (wy, ay)))
    each = (hx * xx + hy * xy) @ hx.mT + (hx * xy + hy * yy) @ hy.mT
    score = hx @ wx.mT + hy @ wy.mT  # (..., 7, M)
    return symmetrize(each - score @ score.mT)  # (PMHT.38)


class SplineInfo(NamedTuple):
    """Innovation of the centroid, and how well the ellipses explained the detections."""

    n: NDArray  # (...) detections used
    eps: NDArray  # (..., 2) [m] innovation
    S: NDArray  # (..., 2, 2) [m^2] its covariance
    share: NDArray  # (...) of the detections that the predicted ellipses explain, NaN without a detection
    lost: NDArray  # (...) bool, the share was so small that the object was searched in the neighbourhood
    notes: tuple[Note, ...] = ()

    @property
    def nis(self) -> NDArray:
        """Normalised innovation squared (...), NaN without a detection."""
        return np.where(self.n > 0, quadratic(self.eps, self.S), np.nan)


def innovation(
    expected: PredictedEllipses, w: NDArray, E: NDArray, detections: RelativeDetections, share: NDArray, lost: NDArray
) -> SplineInfo:
    """Innovation of the mean detection under the ellipses that the detections were shared out to, (PMHT.19)."""
    n = detections.mask.sum(-1)
    part = w.sum(-2)
    part = (part / np.maximum(part.sum(-1, keepdims=True), 1e-12))[..., None]  # (..., L, 1)
    count = np.maximum(n, 1)[..., None]
    each = (detections.mask / count)[..., None]
    eps = (detections.z @ each - expected.c @ part)[..., 0]  # (PMHT.19)
    h = (expected.h @ part[..., None, :, :])[..., 0]  # (..., 7, 2)
    R = detections.R @ each if detections.R.shape[-1] == each.shape[-2] else detections.R
    noise = (E @ part + R) / count[..., None]
    S = h.mT @ h + matrices(noise)[..., 0, :, :]  # (PMHT.19)
    some = n > 0
    S = np.where(some[..., None, None], S, I2)
    return SplineInfo(n, np.where(some[..., None], eps, 0.0), S, np.where(some, share, np.nan), lost, notes_of(lost))


def notes_of(lost: NDArray) -> tuple[Note, ...]:
    """The note about the objects (...) that were lost."""
    return (Note("lost", "contour explained too little of the scan, searched around", lost),) if lost.any() else ()


def nothing(n: NDArray) -> SplineInfo:
    """Information of an update without a detection."""
    zero = np.zeros(n.shape)
    return SplineInfo(n, zero[..., None] * np.ones(2), zero[..., None, None] + I2, zero * np.nan, n > 0)
