"""The random-matrix update of the papers: detections that the hole swallowed are imagined back.

The hole leaves a Gaussian if its content is put back, and for a Gaussian the random matrix is exact. So n detections
become N = n / c_D with the mean and spread of the whole; card htg_rm, section 4.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import perpendicular, unit
from trackers.linalg import inverse, inverse_sqrtm, outer, sqrtm, symmetrize
from trackers.random_matrix import NU_MIN, RMState, masked_mean, moments
from trackers.scan import Scan


class Sample(NamedTuple):
    """Detections of each object as the random matrix sees them."""

    n: NDArray  # (...) count
    mean: NDArray  # (..., 2) [m]
    spread: NDArray  # (..., 2, 2) [m^2] a sum
    sensor: NDArray  # (..., 2) [m] mean position of the sensors that saw them
    noise: NDArray  # (..., 2, 2) [m^2] mean noise that the scan tells


class Hole(NamedTuple):
    """What is missing, in unit coordinates."""

    share: NDArray  # (...) c_D: how much of the Gaussian is seen
    mean: NDArray  # (..., 2)
    cov: NDArray  # (..., 2, 2)


def sample_of(scan: Scan, sigma: float) -> Sample:
    """Moments of the scan; a detection that does not tell its noise has sigma [m]."""
    n, mean, spread = moments(scan.xy, scan.mask)
    where = np.broadcast_to(scan.pose[..., :2], (*scan.mask.shape, 2))
    noise = masked_mean(scan.position_noise(sigma), scan.mask, axes=2)
    return Sample(n, mean, spread, masked_mean(where, scan.mask, axes=1), noise)


def mean_extent(state: RMState) -> NDArray:
    """X^ (..., 2, 2) [m^2]."""
    return state.V / (state.nu - 6)[..., None, None]


def frame(X: NDArray, phi: NDArray) -> NDArray:
    """World from unit coordinates, A (..., 2, 2) [m] with A A^T = X.

    The axes are eigenvectors of X (..., 2, 2), the first is the one nearest to the heading phi (...).
    """
    a, b, d = X[..., 0, 0], X[..., 0, 1], X[..., 1, 1]
    principal = 0.5 * np.arctan2(2 * b, a - d)
    off = principal - phi
    off = off - np.pi / 2 * np.round(off / (np.pi / 2))  # the four half axes are a quarter turn apart
    e = unit(phi + off)
    axes = np.stack([e, perpendicular(e)], -1)
    root = np.sqrt((axes * (X @ axes)).sum(-2))
    return axes * root[..., None, :]


def inverse_frame(A: NDArray) -> NDArray:
    """Unit from world coordinates, the inverse of a frame A (..., 2, 2) [m]; its columns are orthogonal."""
    return A.mT / (A * A).sum(-2)[..., None]


def length(A: NDArray) -> NDArray:
    """Full length (...) [m] of a body with the unit coordinates of A (..., 2, 2)."""
    return 2 * np.hypot(A[..., 0, 0], A[..., 1, 0])


def fill(s: Sample, hole: Hole, centre: NDArray, A: NDArray, noise: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Count N (...), mean (..., 2) and spread (..., 2, 2), a sum, of detections and imagined ones together.

    centre (..., 2) and A (..., 2, 2) of the iterate; noise (..., 2, 2) [m^2] of a detection beyond hole.cov.
    """
    c = hole.share
    missing = s.n * (1 - c) / c
    z_c = centre + (A @ hole.mean[..., None])[..., 0]
    C_c = A @ hole.cov @ A.mT + noise
    z_cv = c[..., None] * s.mean + (1 - c)[..., None] * z_c
    seen = outer(s.mean - z_cv) * s.n[..., None, None]
    imagined = (C_c + outer(z_c - z_cv)) * missing[..., None, None]
    return s.n + missing, z_cv, s.spread + seen + imagined


class Scale(NamedTuple):
    """The covariance of one detection, and what brings spreads of detections to the scale of the extent."""

    Y: NDArray  # (..., 2, 2) [m^2]
    root: NDArray  # (..., 2, 2) [m] X^^1/2
    B: NDArray  # (..., 2, 2) X^^1/2 Y^-1/2


def scale_of(state: RMState, Y: NDArray) -> Scale:
    """The scale of the state before the update, with detections of covariance Y (..., 2, 2) [m^2]."""
    root = sqrtm(mean_extent(state))
    return Scale(Y, root, root @ inverse_sqrtm(Y))


def correct(
    state: RMState, scale: Scale, count: NDArray, mean: NDArray, spread: NDArray
) -> tuple[RMState, NDArray, NDArray]:
    """Random-matrix update with a fractional count (...), card section 2; also the innovation and its covariance."""
    m, P, nu, V = state
    eps = mean - m[..., :2]
    S = P[..., :2, :2] + scale.Y / np.maximum(count, 1e-9)[..., None, None]
    K = P[..., :, :2] @ inverse(S)
    A, B = scale.root @ inverse_sqrtm(S), scale.B
    new = RMState(
        m=m + (K @ eps[..., None])[..., 0],  # (15a)
        P=symmetrize(P - K @ P[..., :2, :]),  # (15b)
        nu=nu + count,  # (15c)
        V=symmetrize(V + A @ outer(eps) @ A.mT + B @ spread @ B.mT),  # (15d)
    )
    return new, eps, S


def recount(state: RMState, new: RMState, scale: Scale, n: NDArray) -> RMState:
    """The update `new` of `state` with the weight of its n true detections: imagined ones inform about nothing.

    The papers count them in P and nu, (15b) and (15c), and become over-confident four to ten times.
    """
    _, P, nu, _ = state
    S = P[..., :2, :2] + scale.Y / np.maximum(n, 1)[..., None, None]
    K = P[..., :, :2] @ inverse(S)
    nu_new = nu + n
    return RMState(
        m=new.m,
        P=symmetrize(P - K @ P[..., :2, :]),
        nu=nu_new,
        V=mean_extent(new) * (np.maximum(nu_new, NU_MIN) - 6)[..., None, None],
    )
