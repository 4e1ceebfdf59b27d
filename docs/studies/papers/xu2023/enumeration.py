"""The paper's update: all assignments of detections to regions, the best of them.

Equations: docs/methods/data-regions.md. In whitened coordinates, after the matrix inversion lemma, equal to eq. (23) to
(28) of the paper without a matrix of all measurements.

Only likely hypotheses are worked on, in one list F of all objects and models, which is the last axis. The information
depends on how many detections each region has and not on which, so hypotheses with the same counts share a matrix.
Symmetric matrices are their 45 entries on and below the diagonal, row by row.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.dra.forms import InformationTerms, RegionPosterior, information_terms
from trackers.dra.measurement import FlatScan, LinearisedRegions, RegionResiduals, marginal
from trackers.dra.regions import REGIONS
from trackers.dra.state import OBSERVED

TOO_UNLIKELY = 15.0  # below the best hypothesis, in logarithms
ROWS, COLUMNS = np.tril_indices(OBSERVED)
DIAGONAL = np.nonzero(ROWS == COLUMNS)[0]
ENTRY = np.empty((OBSERVED, OBSERVED), int)  # where each entry of a symmetric matrix is kept
ENTRY[ROWS, COLUMNS] = ENTRY[COLUMNS, ROWS] = np.arange(len(ROWS))


@dataclass(frozen=True)
class Enumeration:
    """A form of the update for `trackers.dra.DataRegion`: a mixture over at most `cap` hypotheses of each model."""

    cap: int = 32

    def __post_init__(self) -> None:
        if self.cap < 1:
            raise ValueError(f"cap must be at least 1, got {self.cap}; it is a number of hypotheses")

    def posterior(self, regions: LinearisedRegions, residuals: RegionResiduals, flat: FlatScan) -> RegionPosterior:
        """Posterior of the mixture, matched by one Gaussian."""
        found = enumerate_best(marginal(regions, residuals, flat), flat.n, self.cap)
        B, K = found.alive.shape[:2]
        alive = found.alive.reshape(B * K, -1)
        owner = np.nonzero(alive)[0]
        begin = np.searchsorted(owner, np.arange(B * K))
        terms = information_terms(regions, residuals, flat)
        s = sums(terms, found.region[found.alive], owner, flat.n[owner // K])
        C, log_det = inverse(s.A)  # (DRA.27)
        u = product(C.take(s.which, axis=1), s.g)  # (DRA.27)
        log_w = s.constant + 0.5 * (np.add.reduce(s.g * u) - log_det[s.which])  # (DRA.28)
        top = np.maximum.reduceat(log_w, begin)
        w = np.exp(log_w - top[owner])
        total = np.add.reduceat(w, begin)
        w /= total[owner]
        ubar = np.add.reduceat(w * u, begin, axis=-1)  # (DRA.29)
        d = u - ubar[:, owner]
        C *= np.bincount(s.which, w, C.shape[1])
        spread = np.add.reduceat((w * d)[ROWS] * d[COLUMNS], begin, axis=-1)
        Cbar = np.add.reduceat(C, s.first, axis=-1) + spread  # (DRA.29)
        log_c1 = (top + np.log(total)).reshape(B, K)  # (DRA.28)
        u_rows, C_rows = ubar.T.reshape(B, K, OBSERVED), Cbar[ENTRY].T.reshape(B, K, OBSERVED, OBSERVED)
        return RegionPosterior(u_rows, C_rows, log_c1)


class Hypotheses(NamedTuple):
    """H assignments of M detections."""

    region: NDArray  # (B, K, H, M) int
    alive: NDArray  # (B, K, H) bool; the others are padding


class HypothesisSums(NamedTuple):
    """The terms of F hypotheses, summed over their detections."""

    A: NDArray  # (45, U) information, of U <= F different ones
    which: NDArray  # (F,) of them
    first: NDArray  # (n,) where the matrices of each object and model begin
    g: NDArray  # (9, F) score
    constant: NDArray  # (F,)


def sums(t: InformationTerms, region: NDArray, owner: NDArray, n: NDArray) -> HypothesisSums:
    """Sums over the first n (F,) detections of regions (F, M), with the terms of object and model owner (F,)."""
    B, K, _, M = t.g.shape[:4]
    detection = np.arange(M)
    place = owner[:, None] * REGIONS * M
    g = t.g.reshape(-1, OBSERVED).take(place + region * M + detection, axis=0).sum(1)
    constant = t.constant.take(place + detection * REGIONS + region).sum(-1)
    some = which = np.arange(len(owner))
    rows, weight = (place + detection * REGIONS + region).T, (detection < n[:, None]).T
    if t.A.shape[2] == 1:
        some, which = alike(region, owner)
        rows = owner[some] * REGIONS + np.arange(REGIONS)[:, None]
        weight = np.add.reduce(region[some] == np.arange(REGIONS)[:, None, None], axis=-1)
        weight[0] -= M - n[some]  # padding is in region 0
    entries = np.ascontiguousarray(t.A[..., ROWS, COLUMNS].reshape(-1, len(ROWS)).T)
    A = np.zeros((len(ROWS), len(some)))
    A[DIAGONAL] = 1.0
    for row, factor in zip(rows, weight, strict=True):
        A += factor * entries.take(row, axis=1)  # (DRA.27)
    return HypothesisSums(A, which, np.searchsorted(owner[some], np.arange(B * K)), g.T, constant)


def alike(region: NDArray, owner: NDArray) -> tuple[NDArray, NDArray]:
    """Hypotheses (U,) that differ in their numbers of detections a region, and which of them each (F,) equals.

    region (F, M) of each detection, owner (F,) object and model, ascending.
    """
    base = region.shape[1] + 1
    power = np.append(base ** np.arange(REGIONS - 1), 0)  # the number of the fifth follows from the other four
    name = owner * base ** (REGIONS - 1) + power.take(region).sum(-1)
    _, first, which = np.unique(name, return_index=True, return_inverse=True)
    return first, which


def inverse(A: NDArray) -> tuple[NDArray, NDArray]:
    """Inverse (45, U), in place, and log determinant (U,) of symmetric positive definite A (45, U), by sweeping."""
    log_det = np.zeros(A.shape[1])
    for k in range(OBSERVED):
        c = A[ENTRY[k]]
        b = c / c[k]
        log_det += np.log(c[k])
        for i in range(OBSERVED):
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
    present = K * np.searchsorted(-n, -np.arange(M), side="left")  # objects with more than r detections are first
    H = 1
    for r, m in enumerate(present.tolist()):
        branch = (total[:m, :H, None] + score[:m, None, r]).reshape(m, -1)
        likely = branch > branch.max(-1, keepdims=True) - TOO_UNLIKELY
        number = likely.sum(-1)
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
    return Hypotheses(region, alive)
