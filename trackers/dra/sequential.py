"""Moment matching after every detection: the mixture over its regions is replaced by one Gaussian.

Equations: docs/methods/data-regions.md. Linear in the number of detections. A detection is compared only with the
regions whose gates it passes. Objects and models are one axis n here: first in stacks of matrices, which BLAS
multiplies; last in everything else.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.dra.flat_scan import FlatScan
from trackers.dra.matrix3 import inverse_and_det
from trackers.dra.measurement import LinearisedRegions, RegionResiduals, log_constant
from trackers.dra.posterior import RegionPosterior
from trackers.dra.regions import REGIONS
from trackers.dra.state import OBSERVED

# By the pattern of passed gates as bits: which are passed (32, 5), the regions with these first, and their number
PASSED = (np.arange(2**REGIONS)[:, None] >> np.arange(REGIONS)) % 2
PASSED_FIRST, PASSED_COUNT = np.argsort(-PASSED, axis=-1, kind="stable"), PASSED.sum(-1)


class RegionCandidates(NamedTuple):
    """Regions of each detection, those whose gates it passes first, and where their moments are."""

    most: NDArray  # (M,) largest number of passed gates
    moments: NDArray  # (M, n, 5) rows of D and columns of B
    residual: NDArray  # (M, n, 5) columns of nu and log_prior
    D: NDArray  # (rows, 27)
    B: NDArray  # (9, rows)
    nu: NDArray  # (M, 3, residuals)
    log_prior: NDArray  # (M, residuals)


def sequential(regions: LinearisedRegions, residuals: RegionResiduals, flat: FlatScan) -> RegionPosterior:
    """Posterior after all detections, in their sorted order."""
    B, K, M, _ = residuals.log_prior.shape
    X = np.zeros((B * K, OBSERVED, OBSERVED + 1))  # C and u side by side
    X[..., range(OBSERVED), range(OBSERVED)] = 1.0
    log_p = np.zeros((M, B * K))
    c = candidates(regions, residuals, flat)
    present = K * np.searchsorted(-flat.n, -np.arange(M), side="left")  # objects with more than r detections are first
    for r, (n, R) in enumerate(zip(present.tolist(), c.most.tolist(), strict=True)):
        moments, residual = c.moments[r, :n, :R], c.residual[r, :n, :R].T
        D = c.D.take(moments, axis=0).reshape(n, 3 * R, OBSERVED)
        noise, nu = c.B.take(moments.T, axis=1), c.nu[r].take(residual, axis=1)
        log_p[r, :n] = _absorb(X[:n], D, noise, nu, c.log_prior[r].take(residual))
    real = np.arange(M) < flat.n[:, None]
    log_c1 = log_p.sum(0).reshape(B, K) - np.where(real, log_constant(flat)[:, 0], 0.0).sum(-1)[:, None]  # (DRA.22b)
    X = X.reshape(B, K, OBSERVED, OBSERVED + 1)
    C = X[..., :OBSERVED]
    return RegionPosterior(X[..., OBSERVED], (C + C.mT) / 2, log_c1)


def candidates(regions: LinearisedRegions, residuals: RegionResiduals, flat: FlatScan) -> RegionCandidates:
    """Every detection's regions in the order of `PASSED_FIRST`."""
    B, K, M, _ = residuals.log_prior.shape
    n, S = B * K, regions.D.shape[2]
    pattern = np.packbits(np.isfinite(residuals.log_prior), axis=-1, bitorder="little").reshape(n, M).T
    region = PASSED_FIRST.take(pattern, axis=0)  # (M, n, 5)
    first = np.arange(0, n * REGIONS, REGIONS)[:, None]
    residual = first + region
    group = np.repeat(flat.group, K, 0).T[..., None] * REGIONS  # (M, n, 1)
    return RegionCandidates(
        most=PASSED_COUNT[pattern].max(-1),
        moments=residual if S == 1 else S * first + group + region,
        residual=residual,
        D=regions.D.reshape(-1, 3 * OBSERVED),
        B=np.ascontiguousarray(regions.B.reshape(-1, 9).T),
        nu=np.ascontiguousarray(residuals.nu.reshape(n * REGIONS, M, 3).transpose(1, 2, 0)),
        log_prior=residuals.log_prior.reshape(n, M, REGIONS).swapaxes(0, 1).reshape(M, -1),
    )


def _absorb(X: NDArray, D: NDArray, B: NDArray, nu: NDArray, log_prior: NDArray) -> NDArray:
    """Condition C, u in X (n, 9, 10) on one detection, in place; its log likelihood (n,) but for a constant.

    D (n, 3 R, 9), B (9, R, n), nu (3, R, n), log_prior (R, n). Both sums of (DRA.22) are one product with (D C)^T: the
    loss of C is (D C)^T M (D C), and the step of u is (D C)^T w a.
    """
    n, R = len(D), len(log_prior)
    DX = D @ X
    DC = DX[..., :OBSERVED]
    G = (DC @ np.ascontiguousarray(D.mT)).reshape(n, R, 3, R, 3)
    S = G.diagonal(axis1=1, axis2=3).transpose(1, 2, 3, 0).reshape(9, R, n) + B  # (DRA.22a)
    S_inv, det = inverse_and_det(S)
    S_inv = S_inv.reshape(3, 3, R, n)
    e = nu - DX[..., OBSERVED].reshape(n, R, 3).T  # (DRA.22a)
    a = np.add.reduce(S_inv * e, axis=1)  # (DRA.22a)
    log_w = log_prior - 0.5 * (np.add.reduce(a * e) + np.log(det))  # (DRA.22b)
    top = np.maximum.reduce(log_w)
    w = np.exp(log_w - top)
    total = np.add.reduce(w)
    w /= total
    wa = w * a
    M = wa[:, :, None, None] * wa  # (3, R, 3, R, n)
    own = np.einsum("aibin->abin", M)
    S_inv *= w
    own += S_inv
    own -= wa[:, None] * a  # (DRA.22d), M in brackets
    loss = np.ascontiguousarray(M.transpose(4, 1, 0, 3, 2)).reshape(n, 3 * R, 3 * R) @ DX
    loss[..., OBSERVED].reshape(n, R, 3)[...] = -wa.T
    X -= DC.mT @ loss  # (DRA.22c), (DRA.22d)
    return top + np.log(total)
