"""The random-matrix update of the papers, by pseudo-measurements for what the hole has cut out.

A source without a hole is Gaussian, and for a Gaussian the random matrix is exact. So the statistics of n detections
are completed by those of n_c pseudo-measurements inside the hole, N = n + n_c = n / c_D.
Equations: docs/methods/hierarchical-truncated-gaussians.md.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import rotation
from trackers.linalg import inverse, inverse_sqrtm, outer, symmetrize
from trackers.random_matrix.feldmann import RMState, masked_mean, moments
from trackers.scan import Scan


class Sample(NamedTuple):
    """The statistics of the detections of each object that a random matrix needs."""

    n: NDArray  # (...) count
    mean: NDArray  # (..., 2) [m]
    spread: NDArray  # (..., 2, 2) [m^2] a sum
    sensor: NDArray  # (..., 2) [m] mean position of the sensors that made them
    noise: NDArray  # (..., 2, 2) [m^2] mean sensor noise


class Hole(NamedTuple):
    """The part of the source that the hole cuts out, in unit coordinates."""

    share: NDArray  # (...) c_D, share of the source outside the hole
    mean: NDArray  # (..., 2)
    cov: NDArray  # (..., 2, 2)


def sample_of(scan: Scan, sigma: float) -> Sample:
    """Moments of the scan; sigma [m] is the noise of detections whose scan does not state it."""
    n, mean, spread = moments(scan.xy, scan.mask)
    where = np.broadcast_to(scan.pose[..., :2], (*scan.mask.shape, 2))
    noise = masked_mean(scan.position_noise(sigma), scan.mask, axes=2)
    return Sample(n, mean, spread, masked_mean(where, scan.mask, axes=1), noise)


def mean_extent(state: RMState) -> NDArray:
    """Mean extent (..., 2, 2) [m^2]."""
    return state.V / (state.nu - 6)[..., None, None]  # (RM.1)


def body_axes(X: NDArray, phi: NDArray) -> NDArray:
    """World from unit coordinates, A (..., 2, 2) [m] with A A^T = X, (HTG.16).

    Its columns are eigenvectors of X (..., 2, 2), the one nearest to the heading phi (...) first.
    """
    principal = 0.5 * np.arctan2(2 * X[..., 0, 1], X[..., 0, 0] - X[..., 1, 1])
    quarters = np.round((phi - principal) / (np.pi / 2))  # the four half axes are a quarter turn apart
    axes = rotation(principal + np.pi / 2 * quarters)
    root = np.sqrt((axes * (X @ axes)).sum(-2))
    return axes * root[..., None, :]


def inverse_axes(A: NDArray) -> NDArray:
    """Unit from world coordinates, the inverse of A (..., 2, 2) [m]; the columns of A are orthogonal."""
    return A.mT / (A * A).sum(-2)[..., None]


def length(A: NDArray) -> NDArray:
    """Full length (...) [m] of a body with the unit coordinates of A (..., 2, 2)."""
    return 2 * np.hypot(A[..., 0, 0], A[..., 1, 0])


def fill(s: Sample, hole: Hole, centre: NDArray, A: NDArray, noise: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Count N (...), mean (..., 2) and spread (..., 2, 2), a sum, of detections and pseudo-measurements together.

    centre (..., 2) and A (..., 2, 2) of the iterate; noise (..., 2, 2) [m^2] of a detection beyond hole.cov.
    """
    c = hole.share[..., None, None]
    count = s.n / hole.share  # (HTG.17a)
    missing = count * (1 - hole.share)
    z_c = centre + (A @ hole.mean[..., None])[..., 0]  # (HTG.16)
    C_c = A @ hole.cov @ A.mT + noise  # (HTG.16)
    d = s.mean - z_c
    mean = z_c + c[..., 0] * d  # (HTG.17b)
    # About it, the means of both kinds spread by n (1 - c)^2 + (N - n) c^2 = (N - n) c times d d^T.
    return count, mean, s.spread + missing[..., None, None] * (C_c + c * outer(d))  # (HTG.17c)


class Scale(NamedTuple):
    """The covariance of one detection, and the matrices that bring spreads of detections to the scale of the extent."""

    Y: NDArray  # (..., 2, 2) [m^2]
    root: NDArray  # (..., 2, 2) [m] X^^1/2
    B: NDArray  # (..., 2, 2) X^^1/2 Y^-1/2


def scale_of(root: NDArray, Y: NDArray) -> Scale:
    """The scale for a predicted extent of this root (..., 2, 2) [m], detections of covariance Y (..., 2, 2) [m^2]."""
    return Scale(Y, root, root @ inverse_sqrtm(Y))


class Iterate(NamedTuple):
    """The part of an update that the next iteration needs; the covariance is worked out once, at the end."""

    m: NDArray  # (..., 5)
    X: NDArray  # (..., 2, 2) [m^2] mean extent
    eps: NDArray  # (..., 2) [m] innovation
    S: NDArray  # (..., 2, 2) [m^2] its covariance


def correct(state: RMState, scale: Scale, count: NDArray, mean: NDArray, spread: NDArray) -> Iterate:
    """Random-matrix update of the predicted state by a fractional count (...), (HTG.18) and (HTG.19)."""
    m, P, nu, V = state
    eps = mean - m[..., :2]  # (HTG.18)
    S = P[..., :2, :2] + scale.Y / count[..., None, None]  # (HTG.18)
    root = inverse_sqrtm(S)
    white = root @ eps[..., None]
    along = scale.root @ white
    return Iterate(
        m=m + (P[..., :2] @ (root @ white))[..., 0],  # (HTG.19a)
        X=symmetrize(V + along @ along.mT + scale.B @ spread @ scale.B.mT)  # (HTG.19d)
        / (nu + count - 6)[..., None, None],
        eps=eps,
        S=S,
    )


def posterior(state: RMState, last: Iterate, scale: Scale, count: NDArray) -> RMState:
    """The predicted state moved to the iterate `last`, with the information of `count` (...) detections.

    The papers count the N of (HTG.17a), but pseudo-measurements carry no information; n alone is the repair (HTG.20).
    """
    _, P, nu, _ = state
    S = P[..., :2, :2] + scale.Y / count[..., None, None]
    K = P[..., :2] @ inverse(S)
    nu_new = nu + count  # (HTG.19c) or (HTG.20)
    V = last.X * (nu_new - 6)[..., None, None]
    return RMState(last.m, symmetrize(P - K @ P[..., :2, :]), nu_new, V)  # (HTG.19b) or (HTG.20)
