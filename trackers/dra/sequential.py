"""Moment matching after every detection: the mixture over its region becomes one Gaussian; card dra_imm, section 10.

Linear in the number of detections. A detection is held against the regions whose gates it passes, and no others.
Objects and models are one axis n here: first in stacks of matrices, which BLAS multiplies; last in all else.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.dra.looks import Looks
from trackers.dra.matrix3 import inverse_and_det
from trackers.dra.measurement import Pieces, Residuals, log_constant
from trackers.dra.posterior import Posterior
from trackers.dra.regions import REGIONS
from trackers.dra.state import SEEN

# By the pattern of open gates as bits: which are open (32, 5), the regions with these first, and their number
OPEN = (np.arange(2**REGIONS)[:, None] >> np.arange(REGIONS)) % 2
OPEN_FIRST, OPEN_COUNT = np.argsort(-OPEN, axis=-1, kind="stable"), OPEN.sum(-1)


class Candidates(NamedTuple):
    """What each detection may be: regions by how its gates are passed, and where to find their pieces."""

    most: NDArray  # (M,) largest number of open gates
    piece: NDArray  # (M, n, 5) rows of D and columns of B
    residual: NDArray  # (M, n, 5) columns of nu and log_prior
    D: NDArray  # (pieces, 27)
    B: NDArray  # (9, pieces)
    nu: NDArray  # (M, 3, residuals)
    log_prior: NDArray  # (M, residuals)


def sequential(pieces: Pieces, seen: Residuals, looks: Looks) -> Posterior:
    """Posterior after all detections, in the order of the looks."""
    B, K, M, _ = seen.log_prior.shape
    X = np.zeros((B * K, SEEN, SEEN + 1))  # C and u side by side
    X[..., range(SEEN), range(SEEN)] = 1.0
    log_p = np.zeros((M, B * K))
    c = candidates(pieces, seen, looks)
    present = K * np.searchsorted(-looks.n, -np.arange(M), side="left")  # objects with more than r detections are first
    for r, (n, R) in enumerate(zip(present.tolist(), c.most.tolist(), strict=True)):
        piece, residual = c.piece[r, :n, :R], c.residual[r, :n, :R].T
        D = c.D.take(piece, axis=0).reshape(n, 3 * R, SEEN)
        noise, nu = c.B.take(piece.T, axis=1), c.nu[r].take(residual, axis=1)
        log_p[r, :n] = _absorb(X[:n], D, noise, nu, c.log_prior[r].take(residual))
    real = np.arange(M) < looks.n[:, None]
    loglik = log_p.sum(0).reshape(B, K) - np.where(real, log_constant(looks)[:, 0], 0.0).sum(-1)[:, None]
    X = X.reshape(B, K, SEEN, SEEN + 1)
    C = X[..., :SEEN]
    return Posterior(X[..., SEEN], (C + C.mT) / 2, loglik, np.zeros(B, bool))


def candidates(pieces: Pieces, seen: Residuals, looks: Looks) -> Candidates:
    """Every detection's regions in the order of `OPEN_FIRST`."""
    B, K, M, _ = seen.log_prior.shape
    n, S = B * K, pieces.D.shape[2]
    pattern = np.packbits(np.isfinite(seen.log_prior), axis=-1, bitorder="little").reshape(n, M).T
    region = OPEN_FIRST.take(pattern, axis=0)  # (M, n, 5)
    first = np.arange(0, n * REGIONS, REGIONS)[:, None]
    residual = first + region
    look = np.repeat(looks.look, K, 0).T[..., None] * REGIONS  # (M, n, 1)
    return Candidates(
        most=OPEN_COUNT[pattern].max(-1),
        piece=residual if S == 1 else S * first + look + region,
        residual=residual,
        D=pieces.D.reshape(-1, 3 * SEEN),
        B=np.ascontiguousarray(pieces.B.reshape(-1, 9).T),
        nu=np.ascontiguousarray(seen.nu.reshape(n * REGIONS, M, 3).transpose(1, 2, 0)),
        log_prior=seen.log_prior.reshape(n, M, REGIONS).swapaxes(0, 1).reshape(M, -1),
    )


def _absorb(X: NDArray, D: NDArray, B: NDArray, nu: NDArray, log_prior: NDArray) -> NDArray:
    """Condition C, u in X (n, 9, 10) on one detection, in place; its log likelihood (n,) but for a constant.

    D (n, 3 R, 9), B (9, R, n), nu (3, R, n), log_prior (R, n). The mean moves by sum_i w_i K_i e_i, and C loses
    sum_i w_i (K_i D_i C - du_i du_i^T) + dbar dbar^T, here as (D C)^T M (D C).
    """
    n, R = len(D), len(log_prior)
    DX = D @ X
    DC = DX[..., :SEEN]
    G = (DC @ np.ascontiguousarray(D.mT)).reshape(n, R, 3, R, 3)
    S = G.diagonal(axis1=1, axis2=3).transpose(1, 2, 3, 0).reshape(9, R, n) + B
    S_inv, det = inverse_and_det(S)
    S_inv = S_inv.reshape(3, 3, R, n)
    e = nu - DX[..., SEEN].reshape(n, R, 3).T
    a = np.add.reduce(S_inv * e, axis=1)
    log_w = log_prior - 0.5 * (np.add.reduce(a * e) + np.log(det))
    top = np.maximum.reduce(log_w)
    w = np.exp(log_w - top)
    total = np.add.reduce(w)
    w /= total
    wa = w * a
    M = wa[:, :, None, None] * wa  # (3, R, 3, R, n)
    own = np.einsum("aibin->abin", M)
    S_inv *= w
    own += S_inv
    own -= wa[:, None] * a
    loss = np.ascontiguousarray(M.transpose(4, 1, 0, 3, 2)).reshape(n, 3 * R, 3 * R) @ DX
    loss[..., SEEN].reshape(n, R, 3)[...] = -wa.T
    X -= DC.mT @ loss
    return top + np.log(total)
