"""Log likelihoods on a grid of sizes and offsets of the anchor end, and how they change when nothing is detected.

Equations: docs/methods/size-from-both-ends.md, sections 1 and 4. A[k, n] is the logarithm, up to a constant, of the
density of all detections so far given size L_k and offset o_n.
"""

import math
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from trackers.parameters import check_numbers

VACATED = -300.0  # [nat] log likelihood of cells that nothing is known of, below the maximum
LEAST = 1e-300  # probabilities below this count as this before their logarithm is taken
TIMES = 12  # digits of a second that count: steps are differences of times, and differ in what is behind
TERMS = 19  # of a series whose terms fall as 1 / n!


@dataclass(frozen=True)
class Grid:
    """Sizes and offsets of one axis of a body, with one step, and the motion of the offset."""

    first: float  # [m] smallest size
    last: float  # [m] greatest size
    reach: float  # [m] greatest offset, either way
    step: float  # [m]
    birth_std: float  # [m] offset of a new object
    offset_std: float  # [m] stationary spread of the offset
    span: float  # [m] over which detections of something else are spread

    def __post_init__(self) -> None:
        check_numbers(self, positive=[field.name for field in fields(self)])
        whole = [(self.last - self.first) / self.step, self.reach / self.step]
        if not (self.first < self.last and np.allclose(whole, np.round(whole))):
            raise ValueError(
                f"sizes from first to last and the reach must be whole numbers of steps, got {self.first} to "
                f"{self.last} and {self.reach} m in steps of {self.step} m"
            )

    @cached_property
    def sizes(self) -> NDArray:
        """L_k (K,) [m]."""
        return self.first + self.step * np.arange(round((self.last - self.first) / self.step) + 1)

    @cached_property
    def offsets(self) -> NDArray:
        """o_n (N,) [m]."""
        half = round(self.reach / self.step)
        return self.step * np.arange(-half, half + 1)

    @cached_property
    def differences(self) -> NDArray:
        """The values (K + N - 1,) [m] of o_n - L_k, in rising order; that of k, n is number K - 1 - k + n."""
        K, N = len(self.sizes), len(self.offsets)
        return self.offsets[0] - self.sizes[0] + self.step * np.arange(1 - K, N)

    @property
    def depths(self) -> int:
        """How many cells D there are behind an end, up to the greatest size; the first is what lies before it."""
        return round(self.last / self.step) + 1

    @cached_property
    def log_offset(self) -> NDArray:
        """Log density (N,) of the offset of a new object, but for a constant."""
        return np.asarray(-0.5 * (self.offsets / self.birth_std) ** 2)

    def born(self, lead: tuple[int, ...]) -> NDArray:
        """A (..., K, N) of objects without a detection: all sizes alike, the offset that of a new object."""
        return np.zeros((*lead, len(self.sizes), len(self.offsets))) + self.log_offset  # (ENDS.1)

    def restarted(self, log_sizes: NDArray) -> NDArray:
        """A (..., K, N) from log likelihoods (..., K) of the sizes; the offset is that of a new object."""
        return log_sizes[..., None] + self.log_offset  # (ENDS.24)

    def predicted(self, A: NDArray, dt: float, memory: float, offset_tau: float, lost_rate: float) -> NDArray:
        """Probabilities (..., K, N), greatest one near 1, after dt [s]; their logarithms are the new A.

        memory [s] of the detections, offset_tau [s] of the offset, lost_rate [1/s] at which a box is misplaced.
        """
        top = A.max((-2, -1), keepdims=True)
        p = np.exp(np.exp(-dt / memory) * (A - top))  # (ENDS.12)
        return np.maximum(p @ self.transition(dt, offset_tau, lost_rate), LEAST)

    def transition(self, dt: float, offset_tau: float, lost_rate: float) -> NDArray:
        """Probabilities (N, N) of the offset after dt [s] (columns) given the one before (rows)."""
        return _transition(self, round(dt, TIMES), offset_tau, lost_rate)

    def loosened(self, A: NDArray, share: NDArray) -> NDArray:
        """A (T, K, N) where of a share (T,) of the probability of each size the offset is that of a new object."""
        some = share > 0
        if not some.any():
            return A
        new, top = A.copy(), A[some].max((-2, -1), keepdims=True)
        born = np.exp(self.log_offset)
        p = np.exp(A[some] - top)
        p += share[some, None, None] * (p.sum(-1, keepdims=True) * (born / born.sum()) - p)  # (ENDS.42)
        new[some] = np.log(np.maximum(p, LEAST)) + top
        return new

    def rolled(self, A: NDArray, steps: NDArray) -> NDArray:
        """A (T, K, N) about boxes whose anchor end was moved out by whole steps (T,) int; A itself without a step."""
        if not steps.any():
            return A
        N = len(self.offsets)
        old = np.arange(N) + steps[:, None]  # (T, N)
        there = ((old >= 0) & (old < N))[:, None]
        top = A.max((-2, -1), keepdims=True)
        moved = np.take_along_axis(A, np.broadcast_to(np.clip(old, 0, N - 1)[:, None], A.shape), -1)
        return np.where(there, moved, top + VACATED)  # (ENDS.22)

    def flipped(self, A: NDArray, size: NDArray) -> NDArray:
        """A (T, K, N) for the other end as the anchor, size (T,) [m] that of the boxes; cells beyond the rim add up."""
        T, N = len(A), len(self.offsets)
        other = (self.sizes - size[:, None])[..., None] - self.offsets  # (T, K, N) (ENDS.23)
        n = np.clip(np.round((other + self.reach) / self.step).astype(int), 0, N - 1)
        top = A.max((-2, -1), keepdims=True)
        p = np.zeros(A.shape)
        row, k = np.arange(T)[:, None, None], np.arange(len(self.sizes))[:, None]
        np.add.at(p, (row, k, n), np.exp(A - top))
        return np.log(np.maximum(p, LEAST))


@lru_cache(maxsize=256)
def _transition(grid: Grid, dt: float, offset_tau: float, lost_rate: float) -> NDArray:
    rate, powers = _jumps(grid, offset_tau)
    halvings = max(0, math.ceil(math.log2(max(rate * dt, 1.0))))
    mean = rate * dt / 2**halvings
    poisson = np.cumprod(np.r_[np.exp(-mean), mean / np.arange(1, TERMS)])
    P = np.einsum("n,nij->ij", poisson, powers)
    for _ in range(halvings):
        P = P @ P
    kept = np.exp(-lost_rate * dt)
    return kept * P + (1 - kept) / len(P)  # (ENDS.14)


@lru_cache(maxsize=32)
def _jumps(grid: Grid, offset_tau: float) -> tuple[float, NDArray]:
    """Greatest rate [1/s] at which a cell is left, and the powers (TERMS, N, N) of the matrix of jumps at this rate.

    With as many jumps as a Poisson variable says, exp(Q dt) is a sum of positive terms (uniformization). That of scipy
    wakes threads, which for a while take a core each.
    """
    o, h = grid.offsets, grid.step
    jump = grid.offset_std**2 / offset_tau / h**2  # rate [1/s] of steps either way that the spread needs
    pull = o / (h * offset_tau)  # rate [1/s] of steps back to the box
    up = np.maximum(jump - pull / 2, np.maximum(-pull, 0.0))  # (ENDS.13)
    down = up + pull  # (ENDS.13)
    up[-1] = down[0] = 0.0
    rate = float((up + down).max())
    J = (np.diag(up[:-1], 1) + np.diag(down[1:], -1) + np.diag(rate - up - down)) / rate
    powers = [np.eye(len(o))]
    while len(powers) < TERMS:
        powers.append(powers[-1] @ J)
    return rate, np.array(powers)


LENGTH = Grid(first=1.75, last=19.5, reach=2.5, step=0.25, birth_std=1.2, offset_std=0.2, span=12.0)
WIDTH = Grid(first=0.5, last=2.9, reach=0.5, step=0.1, birth_std=0.25, offset_std=0.15, span=4.0)
