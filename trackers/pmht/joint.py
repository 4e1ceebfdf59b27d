"""The state update with all ellipses at once, in information form; card bspline_pmht, section 6.

Augmented unscented transform of [x; xi_l] in closed form: because x and xi_l are independent and a detection is linear
in xi_l, the points that move xi_l contribute exactly A Sigma_l A^T. All is in whitened coordinates u, x = m + T u with
T T^T = P, so that no covariance of the state is inverted.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import rotation
from trackers.linalg import symmetrize
from trackers.motion import PHI
from trackers.pmht.association import LEAST_WEIGHT, Synthetic
from trackers.pmht.state import LENGTH, N, arms
from trackers.pmht.symmetric import determinant
from trackers.unscented import STANDARD

AUGMENTED = N + 2
I7 = np.eye(N)
REACH = float(np.sqrt(STANDARD.reach(AUGMENTED)))
WEIGHTS_MEAN, WEIGHTS_COV = STANDARD.weights(AUGMENTED)
WEIGHTS = np.full((2 * N + 1, 1), WEIGHTS_COV[1])
WEIGHTS[0] = WEIGHTS_COV[0] + 4 * WEIGHTS_COV[1]  # the four points that move xi_l leave the state where it is


class Look(NamedTuple):
    """The centres of the ellipses as the belief m, P about the state has them."""

    T: NDArray  # (..., 7, 7) root of P
    c: NDArray  # (..., 2, L) [m] expected centres relative to that of m
    h: NDArray  # (..., 7, 2, L) [m] their slopes in u
    C: NDArray  # (..., 3, L) [m^2] covariances, H P H^T to first order


def look(m: NDArray, P: NDArray, mu: NDArray) -> Look:
    """Moments of A mu_l + centre for ellipses mu (..., 2, L) in the unit frame, m (..., 7), P (..., 7, 7)."""
    T = arms(P)
    d = np.zeros((*m.shape[:-1], 2 * N + 1, N))
    d[..., 1 : N + 1, :] = REACH * T.mT
    d[..., N + 1 :, :] = -d[..., 1 : N + 1, :]
    A = rotation(m[..., None, PHI] + d[..., PHI]) * (m[..., None, LENGTH:] + d[..., LENGTH:])[..., None, :]
    rows = A.reshape(*m.shape[:-1], 2 * (2 * N + 1), 2) @ mu
    y = rows.reshape(*m.shape[:-1], 2 * N + 1, 2, mu.shape[-1]) + d[..., :2, None]  # (..., 15, 2, L)
    first = y[..., 0, :, :]
    c = first + WEIGHTS_MEAN[1] * (y.sum(-3) - (2 * N + 1) * first)
    e = y - c[..., None, :, :]
    ex, ey = e[..., 0, :], e[..., 1, :]
    wx = WEIGHTS * ex
    C = np.stack([(wx * ex).sum(-2), (wx * ey).sum(-2), (WEIGHTS * ey * ey).sum(-2)], -2)
    return Look(T, c, (y[..., 1 : N + 1, :, :] - y[..., N + 1 :, :, :]) / (2 * REACH), C)


def update(m: NDArray, look: Look, E: NDArray, z: Synthetic) -> tuple[NDArray, NDArray]:
    """Moments (..., 7), (..., 7, 7) after the synthetic detections z, relative to the centre of m.

    E (..., 3, L) [m^2] are the covariances A Sigma_l A^T of the detections of each ellipse.
    """
    h, g = look.h, np.empty(look.h.shape)
    hx, hy = h[..., 0, :], h[..., 1, :]
    V = (E + z.R) / np.maximum(z.M, LEAST_WEIGHT)[..., None, :]
    bent = np.stack([(hx * hx).sum(-2), (hx * hy).sum(-2), (hy * hy).sum(-2)], -2)
    W = look.C - bent + V  # what the slopes leave of the covariance, and the noise
    W = W * ((z.M > LEAST_WEIGHT) / determinant(W))[..., None, :]
    xx, xy, yy = W[..., None, 0, :], W[..., None, 1, :], W[..., None, 2, :]
    g[..., 0, :], g[..., 1, :] = yy * hx - xy * hy, xx * hy - xy * hx  # W^-1 h
    flat = (*h.shape[:-2], 2 * h.shape[-1])
    h, g = h.reshape(flat), g.reshape(flat)
    r = (z.z - look.c).reshape(*flat[:-2], flat[-1], 1)
    inverse = np.linalg.inv(I7 + symmetrize(h @ g.mT))
    return m + (look.T @ (inverse @ (g @ r)))[..., 0], symmetrize(look.T @ inverse @ look.T.mT)
