"""The paper's enumeration of all assignments of detections to regions, the best of them; card dra_imm, 6 and 8.

In whitened coordinates, after the matrix inversion lemma: equal to (23)-(28) without a matrix of all measurements.
Only hypotheses that are likely are worked on, in one list F of all objects and models, and this list is the last axis:
what numpy does to one it does to all. The information depends on how many detections each region has and not on
which, so hypotheses with the same counts share a matrix. Symmetric matrices are their 45 entries on and below the
diagonal, row by row.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.dra.looks import Looks
from trackers.dra.matrix3 import inverse_and_log_det
from trackers.dra.measurement import Pieces, Residuals, log_constant, marginal, of_detection, transform
from trackers.dra.posterior import Posterior
from trackers.dra.regions import REGIONS
from trackers.dra.state import SEEN

TOO_UNLIKELY = 15.0  # below the best hypothesis, in logarithms
ROWS, COLUMNS = np.tril_indices(SEEN)
DIAGONAL = np.nonzero(ROWS == COLUMNS)[0]
ENTRY = np.empty((SEEN, SEEN), int)  # where each entry of a symmetric matrix is kept
ENTRY[ROWS, COLUMNS] = ENTRY[COLUMNS, ROWS] = np.arange(len(ROWS))


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


class Sums(NamedTuple):
    """The terms of F hypotheses, summed over their detections."""

    A: NDArray  # (45, U) information, of U <= F different ones
    which: NDArray  # (F,) of them
    first: NDArray  # (n,) where the matrices of each object and model begin
    g: NDArray  # (9, F) score
    constant: NDArray  # (F,)


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
    found = enumerate_best(marginal(pieces, seen, looks), looks.n, cap)
    B, K = found.alive.shape[:2]
    alive = found.alive.reshape(B * K, -1)
    owner = np.nonzero(alive)[0]
    begin = np.searchsorted(owner, np.arange(B * K))
    s = sums(terms(pieces, seen, looks), found.region[found.alive], owner, looks.n[owner // K])
    C, log_det = inverse(s.A)
    u = product(C.take(s.which, axis=1), s.g)
    log_w = s.constant + 0.5 * (np.add.reduce(s.g * u) - log_det[s.which])
    top = np.maximum.reduceat(log_w, begin)
    w = np.exp(log_w - top[owner])
    total = np.add.reduceat(w, begin)
    w /= total[owner]
    ubar = np.add.reduceat(w * u, begin, axis=-1)
    d = u - ubar[:, owner]
    C *= np.bincount(s.which, w, C.shape[1])
    Cbar = np.add.reduceat(C, s.first, axis=-1) + np.add.reduceat((w * d)[ROWS] * d[COLUMNS], begin, axis=-1)
    log_c1 = (top + np.log(total)).reshape(B, K)
    return Posterior(ubar.T.reshape(B, K, SEEN), Cbar[ENTRY].T.reshape(B, K, SEEN, SEEN), log_c1, found.capped)


def sums(t: Terms, region: NDArray, owner: NDArray, n: NDArray) -> Sums:
    """Sums over the first n (F,) detections of regions (F, M), with the terms of object and model owner (F,)."""
    B, K, _, M = t.g.shape[:4]
    detection = np.arange(M)
    place = owner[:, None] * REGIONS * M
    g = t.g.reshape(-1, SEEN).take(place + region * M + detection, axis=0).sum(1)
    constant = t.constant.take(place + detection * REGIONS + region).sum(-1)
    some = which = np.arange(len(owner))
    piece, weight = (place + detection * REGIONS + region).T, (detection < n[:, None]).T
    if t.A.shape[2] == 1:
        some, which = alike(region, owner)
        piece = owner[some] * REGIONS + np.arange(REGIONS)[:, None]
        weight = np.add.reduce(region[some] == np.arange(REGIONS)[:, None, None], axis=-1)
        weight[0] -= M - n[some]  # padding is in region 0
    entries = np.ascontiguousarray(t.A[..., ROWS, COLUMNS].reshape(-1, len(ROWS)).T)
    A = np.zeros((len(ROWS), len(some)))
    A[DIAGONAL] = 1.0
    for p, factor in zip(piece, weight, strict=True):
        A += factor * entries.take(p, axis=1)
    return Sums(A, which, np.searchsorted(owner[some], np.arange(B * K)), g.T, constant)


def alike(region: NDArray, owner: NDArray) -> tuple[NDArray, NDArray]:
    """The first hypotheses (U,) with their numbers of detections in each region (F, M), and which each (F,) equals."""
    base = region.shape[1] + 1
    power = np.append(base ** np.arange(REGIONS - 1), 0)  # the other four tell the number of the fifth
    name = owner * base ** (REGIONS - 1) + power.take(region).sum(-1)
    _, first, which = np.unique(name, return_index=True, return_inverse=True)
    return first, which


def inverse(A: NDArray) -> tuple[NDArray, NDArray]:
    """Inverse (45, U), in place, and log determinant (U,) of symmetric positive definite A (45, U), by sweeping."""
    log_det = np.zeros(A.shape[1])
    for k in range(SEEN):
        c = A[ENTRY[k]]
        b = c / c[k]
        log_det += np.log(c[k])
        for i in range(SEEN):
            if i != k:
                A[ENTRY[i, 0] : ENTRY[i, 0] + i + 1] -= b[i] * c[: i + 1]
        b[k] = -1 / c[k]
        A[ENTRY[k]] = b
    np.negative(A, out=A)
    return A, log_det


def product(A: NDArray, v: NDArray) -> NDArray:
    """Symmetric A (45, F) times v (9, F)."""
    out = A[ENTRY[0]] * v[0]
    for row, x in zip(ENTRY[1:], v[1:], strict=True):
        out += A[row] * x
    return out


def enumerate_best(score: NDArray, n: NDArray, cap: int) -> Hypotheses:
    """The `cap` assignments with the largest sum of scores (B, K, M, 5), of the first n (B,) detections, n falling.

    Appending one detection after the other and keeping the best is exact, because scores add up.
    """
    B, K, M, _ = score.shape
    score = score.reshape(B * K, M, REGIONS)
    total, region = np.full((B * K, cap), -np.inf), np.zeros((B * K, cap, M), np.int8)
    total[:, 0] = 0.0
    capped = np.zeros(B * K, bool)
    present = K * np.searchsorted(-n, -np.arange(M), side="left")  # objects with more than r detections are first
    H = 1
    for r, m in enumerate(present.tolist()):
        branch = (total[:m, :H, None] + score[:m, None, r]).reshape(m, -1)
        likely = branch > branch.max(-1, keepdims=True) - TOO_UNLIKELY
        number = likely.sum(-1)
        capped[:m] |= number > cap
        H = min(int(number.max()), cap)
        best = np.argsort(-branch, axis=-1, kind="stable")[:, :H]
        row = np.arange(m)[:, None]
        total[:m] = -np.inf
        total[:m, :H] = np.where(likely, branch, -np.inf).take(best + branch.shape[1] * row)
        parent, last = np.divmod(best, REGIONS)
        region[:m, :H] = region.reshape(-1, M).take(parent + cap * row, axis=0)
        region[:m, :H, r] = last
    alive = np.isfinite(total)
    H = int(alive.sum(-1).max())
    alive, region = alive[:, :H].reshape(B, K, H), region[:, :H].reshape(B, K, H, M).astype(int)
    return Hypotheses(region, alive, np.logical_or.reduce(capped.reshape(B, K), axis=-1))
