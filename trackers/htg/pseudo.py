"""The random-matrix update of the papers: detections that the hole swallowed are imagined back.

The hole leaves a Gaussian if its content is put back, and for a Gaussian the random matrix is exact. So n detections
become N = n / c_D with the mean and spread of the whole; card htg_rm, section 4.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import rotation
from trackers.linalg import inverse, inverse_sqrtm, outer, symmetrize
from trackers.random_matrix.feldmann import RMState, masked_mean, moments
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
    principal = 0.5 * np.arctan2(2 * X[..., 0, 1], X[..., 0, 0] - X[..., 1, 1])
    quarters = np.round((phi - principal) / (np.pi / 2))  # the four half axes are a quarter turn apart
    axes = rotation(principal + np.pi / 2 * quarters)
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
    c = hole.share[..., None, None]
    count = s.n / hole.share
    missing = count * (1 - hole.share)
    z_c = centre + (A @ hole.mean[..., None])[..., 0]
    C_c = A @ hole.cov @ A.mT + noise
    d = s.mean - z_c
    # about the common mean z_c + c d, what is seen and what is imagined spread by n (1 - c)^2 + (N - n) c^2 = (N - n) c
    return count, z_c + c[..., 0] * d, s.spread + missing[..., None, None] * (C_c + c * outer(d))


class Scale(NamedTuple):
    """The covariance of one detection, and what brings spreads of detections to the scale of the extent."""

    Y: NDArray  # (..., 2, 2) [m^2]
    root: NDArray  # (..., 2, 2) [m] X^^1/2
    B: NDArray  # (..., 2, 2) X^^1/2 Y^-1/2


def scale_of(root: NDArray, Y: NDArray) -> Scale:
    """The scale of the state before the update, whose extent has this root, with detections of covariance Y."""
    return Scale(Y, root, root @ inverse_sqrtm(Y))


class Iterate(NamedTuple):
    """An update as far as the next iteration needs it: without its covariance."""

    m: NDArray  # (..., 5)
    X: NDArray  # (..., 2, 2) [m^2] mean extent
    eps: NDArray  # (..., 2) [m] innovation
    S: NDArray  # (..., 2, 2) [m^2] its covariance


def correct(state: RMState, scale: Scale, count: NDArray, mean: NDArray, spread: NDArray) -> Iterate:
    """Random-matrix update with a fractional count (...), card section 2."""
    m, P, nu, V = state
    eps = mean - m[..., :2]
    S = P[..., :2, :2] + scale.Y / count[..., None, None]
    root = inverse_sqrtm(S)
    white = root @ eps[..., None]
    along = scale.root @ white
    return Iterate(
        m=m + (P[..., :2] @ (root @ white))[..., 0],  # (15a)
        X=symmetrize(V + along @ along.mT + scale.B @ spread @ scale.B.mT) / (nu + count - 6)[..., None, None],  # (15d)
        eps=eps,
        S=S,
    )


def posterior(state: RMState, last: Iterate, scale: Scale, count: NDArray) -> RMState:
    """The update of `state` to the iterate `last`, with the weight of so many detections (...)."""
    _, P, nu, _ = state
    S = P[..., :2, :2] + scale.Y / count[..., None, None]
    K = P[..., :2] @ inverse(S)
    nu_new = nu + count  # (15c)
    V = last.X * (nu_new - 6)[..., None, None]
    return RMState(last.m, symmetrize(P - K @ P[..., :2, :]), nu_new, V)  # (15b)


def recount(state: RMState, last: Iterate, scale: Scale, n: NDArray) -> RMState:
    """The same with the weight of the n true detections: imagined ones inform about nothing.

    The papers count them in P and nu, (15b) and (15c), and become over-confident four to ten times.
    """
    new = posterior(state, last, scale, n)
    return new._replace(V=last.X * (new.nu - 6)[..., None, None])
