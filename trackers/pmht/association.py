"""The ellipses of objects in the plane, and which of them made which detection.

Equations: docs/methods/spline-pmht.md. Arrays over detections and ellipses are (..., M, L); positions are relative to
the object's centre, because expanded squares lose digits far from the origin. Covariances are columns xx, xy, yy
(..., 3, K) and points (..., 2, K): thousands of symmetric 2 x 2 matrices at the cost of few.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import rotation
from trackers.held_gaussian import LENGTH
from trackers.linalg import I2
from trackers.motion.turn import PHI


def upright(xx: NDArray, xy: NDArray, yy: NDArray) -> NDArray:
    """Columns (..., 3, K) of their entries (..., K); `np.stack` costs several times as much."""
    S = np.empty((*xx.shape[:-1], 3, xx.shape[-1]))
    S[..., 0, :], S[..., 1, :], S[..., 2, :] = xx, xy, yy
    return S


def columns(A: NDArray) -> NDArray:
    """Columns (..., 3, K) of matrices A (..., K, 2, 2)."""
    return upright(A[..., 0, 0], A[..., 0, 1], A[..., 1, 1])


def matrices(S: NDArray) -> NDArray:
    """Matrices (..., K, 2, 2) of columns S (..., 3, K); the inverse of `columns`."""
    xx, xy, yy = S[..., 0, :], S[..., 1, :], S[..., 2, :]
    return np.stack([xx, xy, xy, yy], -1).reshape(*xx.shape, 2, 2)


def determinant(S: NDArray) -> NDArray:
    """Determinants (..., K)."""
    return S[..., 0, :] * S[..., 2, :] - S[..., 1, :] * S[..., 1, :]


def congruence(A: NDArray) -> NDArray:
    """The map (..., 3, 3) that takes the columns of Sigma to those of A Sigma A^T, A (..., 2, 2)."""
    a, b, c, d = A[..., 0, 0], A[..., 0, 1], A[..., 1, 0], A[..., 1, 1]
    K = np.empty((*A.shape[:-2], 3, 3))
    K[..., 0, 0], K[..., 0, 1], K[..., 0, 2] = a * a, 2 * a * b, b * b
    K[..., 1, 0], K[..., 1, 1], K[..., 1, 2] = a * c, a * d + b * c, b * d
    K[..., 2, 0], K[..., 2, 1], K[..., 2, 2] = c * c, 2 * c * d, d * d
    return K


def polar_noise(along: NDArray, across: NDArray, sight: NDArray) -> NDArray:
    """Covariances (..., 3, M) [m^2] of variances along and across (..., M) the lines of sight (..., M, 2)."""
    c, s = sight[..., 0], sight[..., 1]
    difference = along - across
    return upright(across + difference * c * c, difference * c * s, across + difference * s * s)


def squares(s: NDArray) -> NDArray:
    """What scales columns (..., 3, 1) from the unit frame to sizes s (..., 2)."""
    return np.stack([s[..., 0] ** 2, s[..., 0] * s[..., 1], s[..., 1] ** 2], -1)[..., None]


LOG_2PI = float(np.log(2 * np.pi))
LEAST_WEIGHT = 1e-9  # of an ellipse, below which it has no detection
BOX = I2 / 12  # covariance of points even over the unit box
BOX_COLUMN = columns(BOX[None])  # (3, 1)


class RelativeDetections(NamedTuple):
    """Detections of objects, each relative to a point of its object."""

    z: NDArray  # (..., 2, M) [m], 0 for padding
    R: NDArray  # (..., 3, M or 1) noise [m^2], the identity for padding
    mask: NDArray  # (..., M)


class SyntheticDetections(NamedTuple):
    """One detection for each ellipse, made of those that it got a share of."""

    M: NDArray  # (..., L) sum of the weights
    z: NDArray  # (..., 2, L) [m] mean; without a detection anything
    R: NDArray  # (..., 3, L or 1) mean noise [m^2]


def log_density(detections: RelativeDetections, c: NDArray, C: NDArray) -> NDArray:
    """Log N(z_i; c_l, C_l + R_i) (..., M, L) for centres c (..., 2, L) [m] and covariances C (..., 3, L) [m^2]."""
    d = detections.z[..., None] - c[..., None, :]
    S = C[..., None, :] + detections.R[..., None]
    dx, dy, xx, xy, yy = d[..., 0, :, :], d[..., 1, :, :], S[..., 0, :, :], S[..., 1, :, :], S[..., 2, :, :]
    det = xx * yy - xy * xy
    S = S / (-2 * det)[..., None, :, :]
    log_norm = -0.5 * np.log(det) - LOG_2PI
    value = dx * S[..., 2, :, :]  # in place from here on: these are the large arrays of the filter
    cross = dy * S[..., 1, :, :]
    cross *= 2
    value -= cross
    value *= dx
    dy *= dy
    dy *= S[..., 0, :, :]
    value += dy
    value += log_norm  # (PMHT.10), log N
    return value


def responsibilities(log_joint: NDArray, mask: NDArray, rest: NDArray | float) -> NDArray:
    """Probability w (..., M, L) of each ellipse, from log pi_l N_il and the density rest (..., M, 1) of all else."""
    with np.errstate(divide="ignore"):
        log_rest = np.log(rest)
    top = np.maximum(log_joint.max(-1, keepdims=True), log_rest)
    w = log_joint - top
    np.exp(w, out=w)
    w *= mask[..., None] / (w.sum(-1, keepdims=True) + np.exp(log_rest - top))  # (PMHT.10)
    return w


def synthesise(w: NDArray, detections: RelativeDetections) -> SyntheticDetections:
    """One synthetic detection for each ellipse, from the weights w (..., M, L)."""
    M = w.sum(-2)  # (PMHT.11)
    share = w / np.maximum(M, LEAST_WEIGHT)[..., None, :]  # (PMHT.11)
    each = detections.R.shape[-1] == share.shape[-2]  # each detection has its own noise
    return SyntheticDetections(M, detections.z @ share, detections.R @ share if each else detections.R)  # (PMHT.11)


class UnitEllipses(NamedTuple):
    """The ellipses of objects in the unit frame, and a box that detections come from anywhere in."""

    mu: NDArray  # (..., 2, L) centres of the ellipses
    Sigma: NDArray  # (..., 3, L + 1) their covariances, and that of the box


class PlacedEllipses(NamedTuple):
    """The same in the plane, relative to some point."""

    c: NDArray  # (..., 2, L) [m]
    E: NDArray  # (..., 3, L) [m^2]
    centre: NDArray  # (..., 2, 1) [m]
    box: NDArray  # (..., 3, 1) [m^2]


def unit_ellipses(N: NDArray, p: NDArray, Sigma: NDArray) -> UnitEllipses:
    """The ellipses of control points p (..., n_c, 2) of weights N (L, n_c), and covariances Sigma (..., L, 2, 2)."""
    box = np.broadcast_to(BOX_COLUMN, (*Sigma.shape[:-3], 3, 1))
    return UnitEllipses((N @ p).mT, np.concatenate([columns(Sigma), box], -1))  # (PMHT.3)


def place(ellipses: UnitEllipses, m: NDArray, origin: NDArray) -> PlacedEllipses:
    """The ellipses at the states m (..., 7), relative to origin (..., 2) [m]."""
    A = rotation(m[..., PHI]) * m[..., None, LENGTH:]  # (PMHT.3)
    centre = (m[..., :2] - origin)[..., None]
    E = congruence(A) @ ellipses.Sigma  # (PMHT.8)
    return PlacedEllipses(A @ ellipses.mu + centre, E[..., :-1], centre, E[..., -1:])  # (PMHT.8)


def interior_density(placed: PlacedEllipses, detections: RelativeDetections, share: float) -> NDArray:
    """Density f (..., M, 1) [1/m^2] of detections from anywhere inside, a `share` of them, beside the ellipses'."""
    if not share:
        return np.zeros((1, 1))
    return share / (1 - share) * np.exp(log_density(detections, placed.centre, placed.box))  # (PMHT.9)
