"""The update by all detections of a scan, in two forms: moment matching after each, or soft weights of all at once.

Equations: docs/methods/data-regions.md. `sequential` replaces the mixture over the regions of a detection by one
Gaussian; it is linear in the number of detections, and compares each only with the regions whose gates it passes. There
objects and models are one axis n: first in stacks of matrices, which BLAS multiplies; last in everything else. `soft`
divides each detection among the regions, in a few passes: the cheapest form, good for 20 detections and more.
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from trackers.dra.measurement import (
    FlatScan,
    LinearisedRegions,
    RegionResiduals,
    log_constant,
    marginal,
    of_detection,
    transform,
)
from trackers.dra.regions import REGIONS
from trackers.dra.state import OBSERVED
from trackers.linalg import inverse_and_det, inverse_and_log_det

# By the pattern of passed gates as bits: which are passed (32, 5), the regions with these first, and their number
PASSED = (np.arange(2**REGIONS)[:, None] >> np.arange(REGIONS)) % 2
PASSED_FIRST, PASSED_COUNT = np.argsort(-PASSED, axis=-1, kind="stable"), PASSED.sum(-1)


class RegionPosterior(NamedTuple):
    """p(x) = N(xhat + L u; mean u, covariance C) after all detections of B objects under K models, (DRA.21).

    L has the columns that detections depend on; along the others mean 0 and covariance I stay.
    """

    u: NDArray  # (B, K, 9)
    C: NDArray  # (B, K, 9, 9)
    log_c1: NDArray  # (B, K) log likelihood of all detections


class RegionUpdate(Protocol):
    """A form of the update that is not built in, such as `studies.papers.xu2023.enumeration.Enumeration`."""

    def posterior(self, regions: LinearisedRegions, residuals: RegionResiduals, flat: FlatScan) -> RegionPosterior:
        """The posterior of all objects and models, which start at u ~ N(0, I)."""


def softmax(log_w: NDArray, axis: int = -1) -> tuple[NDArray, NDArray]:
    """Weights (..., n, ...) that sum to one along the axis, and the log (...) of their sum; not all may be -inf."""
    top = log_w.max(axis, keepdims=True)
    w = np.exp(log_w - top)
    total = w.sum(axis, keepdims=True)
    return w / total, (top + np.log(total)).squeeze(axis)


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


class InformationTerms(NamedTuple):
    """What one detection in one region adds to information and score of u, and to the log likelihood."""

    A: NDArray  # (B, K, M or 1, 5, 9, 9)
    g: NDArray  # (B, K, 5, M, 9)
    constant: NDArray  # (B, K, M, 5)


def information_terms(regions: LinearisedRegions, residuals: RegionResiduals, flat: FlatScan) -> InformationTerms:
    """Terms of every detection in every region; 0 for padding."""
    B_inv, log_det = inverse_and_log_det(regions.B)
    A = regions.D.mT @ (B_inv @ regions.D)  # (DRA.23)
    b = transform(residuals.nu, B_inv, flat)
    q = np.einsum("...a,...a->...", b, residuals.nu).mT + of_detection(log_det, flat)
    real = (np.arange(residuals.nu.shape[3]) < flat.n[:, None])[:, None, :]
    g = transform(b * real[:, :, None, :, None], regions.D, flat)  # (DRA.23)
    constant = residuals.log_prior - 0.5 * q - log_constant(flat)[..., None]  # (DRA.23)
    return InformationTerms(of_detection(A, flat), g, np.where(real[..., None], constant, 0.0))


def soft(regions: LinearisedRegions, residuals: RegionResiduals, flat: FlatScan, passes: int) -> RegionPosterior:
    """Posterior of information matrices weighted by the probabilities of the regions."""
    t = information_terms(regions, residuals, flat)
    B, K, _, M = residuals.nu.shape[:4]
    real = (np.arange(M) < flat.n[:, None])[:, None, None]
    one = t.A.shape[2] == 1
    A_flat, g_flat = t.A.reshape(B, K, -1, OBSERVED * OBSERVED), t.g.reshape(B, K, -1, OBSERVED)
    constant = np.ascontiguousarray(t.constant.mT)  # weights are (B, K, 5, M): sums over regions run along M
    w, _ = softmax(np.ascontiguousarray(marginal(regions, residuals, flat).mT), axis=-2)
    for k in range(passes):
        w = np.where(real, w, 0.0)
        load = w.sum(-1) if one else w.mT.reshape(B, K, -1)
        A = np.eye(OBSERVED) + (load[..., None, :] @ A_flat).reshape(B, K, OBSERVED, OBSERVED)  # (DRA.24a)
        C = np.linalg.inv(A)  # (DRA.24a)
        g = (w.reshape(B, K, 1, -1) @ g_flat)[..., 0, :]
        u = (C @ g[..., None])[..., 0]  # (DRA.24a)
        second = (A_flat @ (C + u[..., :, None] * u[..., None, :]).reshape(B, K, -1, 1)).reshape(B, K, -1, 5).mT
        log_w = constant + (g_flat @ u[..., None]).reshape(B, K, 5, M) - 0.5 * second  # (DRA.24b)
        if k < passes - 1:
            w, _ = softmax(log_w, axis=-2)
    weighted = w[..., None] * t.g
    gm = weighted.sum(2)
    spread = weighted.reshape(B, K, -1, OBSERVED).mT @ g_flat - gm.mT @ gm  # (DRA.25), G
    _, each = softmax(log_w, axis=-2)
    away = np.trace(C, axis1=-2, axis2=-1) + (u * u).sum(-1) - OBSERVED - np.linalg.slogdet(C)[1]
    log_c1 = np.where(real[:, 0], each, 0.0).sum(-1) - away / 2  # (DRA.26)
    C = C + C @ spread @ C  # (DRA.25)
    return RegionPosterior(u, (C + C.mT) / 2, log_c1)
