"""The paper's enumeration of all assignments of detections to regions, the best of them; card dra_imm, 6 and 8.

In whitened coordinates, after the matrix inversion lemma: equal to (23)-(28) without a matrix of all measurements.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.dra.looks import Looks
from trackers.dra.matrix3 import inverse_and_log_det
from trackers.dra.measurement import Pieces, Residuals, log_constant, marginal, of_detection, transform
from trackers.dra.posterior import Posterior, softmax
from trackers.dra.regions import REGIONS
from trackers.dra.state import SEEN
from trackers.linalg import outer

TOO_UNLIKELY = 15.0  # below the best hypothesis, in logarithms


class Hypotheses(NamedTuple):
    """H assignments of M detections."""

    region: NDArray  # (B, K, H, M) int
    alive: NDArray  # (B, K, H) bool; the others are padding
    capped: NDArray  # (B,) bool, likely ones were left out


class Terms(NamedTuple):
    """What one detection in one region adds to information and score of u, and to the log likelihood."""

    A: NDArray  # (B, K, M or 1, 5, 9, 9)
    g: NDArray  # (B, K, 5, M, 9)
    constant: NDArray  # (B, K, M, 5)


def terms(pieces: Pieces, seen: Residuals, looks: Looks) -> Terms:
    """A_i = D_i^T B_i^-1 D_i, g_ri = D_i^T B_i^-1 nu_ri, and the rest of log N with the prior."""
    B_inv, log_det = inverse_and_log_det(pieces.B)
    A = pieces.D.mT @ (B_inv @ pieces.D)
    b = transform(seen.nu, B_inv, looks)
    q = np.einsum("...a,...a->...", b, seen.nu).mT + of_detection(log_det, looks)
    real = (np.arange(seen.nu.shape[3]) < looks.n[:, None])[:, None, :]
    g = transform(b * real[:, :, None, :, None], pieces.D, looks)
    constant = seen.log_prior - 0.5 * q - log_constant(looks)[..., None]
    return Terms(of_detection(A, looks), g, np.where(real[..., None], constant, 0.0))


def joint(pieces: Pieces, seen: Residuals, looks: Looks, cap: int) -> Posterior:
    """Mixture over at most `cap` hypotheses of each model, matched by one Gaussian, (23)-(28)."""
    t = terms(pieces, seen, looks)
    found = enumerate_best(marginal(pieces, seen, looks), looks.n, cap)
    B, K, H, M = found.region.shape
    chosen = found.region[..., None] == np.arange(REGIONS)  # (B, K, H, M, 5)
    chosen &= (np.arange(M) < looks.n[:, None])[:, None, None, :, None]
    use = chosen.reshape(B, K, H, -1).astype(float)
    g = use @ np.swapaxes(t.g, 2, 3).reshape(B, K, -1, SEEN)
    each = np.where(use > 0, t.constant.reshape(B, K, 1, -1), 0.0).sum(-1)
    count = chosen.sum(3).astype(float) if t.A.shape[2] == 1 else use
    A = np.eye(SEEN) + (count @ t.A.reshape(B, K, -1, SEEN * SEEN)).reshape(B, K, H, SEEN, SEEN)
    C = np.linalg.inv(A)
    u = (C @ g[..., None])[..., 0]
    log_w = each + 0.5 * ((g * u).sum(-1) - np.linalg.slogdet(A)[1])
    w, log_c1 = softmax(np.where(found.alive, log_w, -np.inf))
    ubar = (w[..., None, :] @ u)[..., 0, :]
    Cbar = (w[..., None, None] * (C + outer(u - ubar[..., None, :]))).sum(-3)
    return Posterior(ubar, (Cbar + Cbar.mT) / 2, log_c1, found.capped)


def enumerate_best(score: NDArray, n: NDArray, cap: int) -> Hypotheses:
    """The `cap` assignments with the largest sum of scores (B, K, M, 5), of the first n (B,) detections.

    Appending one detection after the other and keeping the best is exact, because scores add up.
    """
    B, K, M, _ = score.shape
    score = np.where((np.arange(M) < n[:, None])[:, None, :, None], score, np.where(np.arange(REGIONS), -np.inf, 0.0))
    total, region = np.zeros((B, K, 1)), np.zeros((B, K, 1, 0), int)
    capped = np.zeros(B, bool)
    for r in range(M):
        branch = (total[..., :, None] + score[..., r, None, :]).reshape(B, K, -1)
        likely = branch > branch.max(-1, keepdims=True) - TOO_UNLIKELY
        H = min(int(likely.sum(-1).max()), cap)
        capped |= (likely.sum(-1) > cap).any(-1)
        best = np.argsort(-branch, axis=-1, kind="stable")[..., :H]
        total = np.take_along_axis(np.where(likely, branch, -np.inf), best, -1)
        parent = np.take_along_axis(region, (best // REGIONS)[..., None], -2)
        region = np.concatenate([parent, (best % REGIONS)[..., None]], -1)
    return Hypotheses(region, np.isfinite(total), capped)
