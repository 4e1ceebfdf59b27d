"""Exclusion: two vehicles cannot overlap. Duplicates are dropped, pieces of one vehicle become one track.

Equations: docs/methods/multi-object-tracking.md, section 9.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.batch import take
from trackers.estimate import Estimate
from trackers.geometry import UNIT_BOX, to_frame, to_world, unit
from trackers.parameters import check_numbers

GRID = np.stack(np.meshgrid(np.linspace(-0.4, 0.4, 5), np.linspace(-1 / 3, 1 / 3, 3), indexing="ij"), -1).reshape(-1, 2)
PARALLEL = 0.9  # cosine between the headings of two in file


class ExclusionResult(NamedTuple):
    """Which of T tracks are kept, and the boxes of those that took in another."""

    keep: NDArray  # (T,) bool
    into: NDArray  # (T,) row of the track that took a dropped one in, -1 for a kept one
    joined: NDArray  # (T,) bool, kept, and to be started again from `estimate`
    estimate: Estimate  # (T,) union boxes where joined


@dataclass(frozen=True)
class Exclusion:
    """When two tracks are one vehicle."""

    overlap: float = 0.4  # share of either box
    overlap_speed: float = 5.0  # [m/s] difference up to which that holds
    overlap_sure: float = 0.7  # whatever the velocity
    lane: float = 1.6  # [m] across
    speed: float = 1.5  # [m/s] difference
    gap: tuple[float, float, float] = (7.5, 0.8, 0.0125)  # bumper gap below min(a, b + c v^2) [m]: one vehicle
    longest: float = 20.5  # [m] of a union
    short: float = 5.5  # [m] of a union, with centres and lengths alone, of tracks that were divided

    def __post_init__(self) -> None:
        check_numbers(self)

    def apply(
        self,
        estimate: Estimate,
        score: NDArray,
        divided: NDArray | None = None,
        two: Callable[[Estimate, NDArray, NDArray], NDArray] | None = None,
        reaches: bool = False,
    ) -> ExclusionResult:
        """Go through T tracks from the best score (T,) down; each drops, or unites with, the worse ones it excludes.

        divided (T, 2) bool: tracks with empty ground behind and before them. Over it they are united with others only
        to what is no longer than `short`, elsewhere with what hardly any gap separates. two says of pairs, rows (P,)
        and (P,), which are two vehicles (P,) bool and not united. reaches: the gates of tracks reach as far as they may
        be long, so that a union within that changes none.
        """
        T = len(score)
        keep, into, joined = np.ones(T, bool), np.full(T, -1), np.zeros(T, bool)
        same, one = self.overlapping(estimate), self.one_vehicle(estimate)
        if divided is not None and one.any():
            i, j = np.nonzero(one)
            free = ~(divided[i, ahead(estimate, i, j)] | divided[j, ahead(estimate, j, i)])
            alone = ~(divided[i].any(-1) | divided[j].any(-1))
            one[i, j] = alone | (free & self._touching(estimate, i, j)) | (extent(estimate, i, j) < self.short)
            one &= one.T
        if two is not None and one.any():
            i, j = np.nonzero(np.triu(one))
            one[i, j] = one[j, i] = ~two(estimate, i, j)
        if not (same | one).any():
            return ExclusionResult(keep, into, joined, estimate)
        estimate = take(estimate, np.arange(T))  # a copy: unions are written into it
        for a in np.argsort(-score, kind="stable"):
            if not keep[a]:
                continue
            rivals = keep & (score <= score[a])
            rivals[a] = False
            for b in np.flatnonzero(rivals & (same[a] | one[a])):
                if not same[a, b]:
                    length = union_length(estimate, a, b)
                    if joined[a] or length > self.longest:
                        continue
                    if not reaches or length > estimate.size[a, 0] + estimate.size_std[a, 0]:  # (MOT.58)
                        unite(estimate, a, b)
                        joined[a] = True
                keep[b], into[b] = False, a
        return ExclusionResult(keep, into, joined, estimate)

    def overlapping(self, estimate: Estimate) -> NDArray:
        """Pairs (T, T) bool of boxes that overlap too much to be two vehicles."""
        pose, size = estimate.pose, estimate.size
        radius = np.hypot(size[:, 0], size[:, 1]) / 2
        near = distances(pose[:, :2]) < radius[:, None] + radius
        np.fill_diagonal(near, False)
        share = np.zeros(near.shape)
        a, b = np.nonzero(near)  # P pairs
        if len(a):
            points = to_frame(pose[b], to_world(pose[a], GRID * size[a, None]))  # (P, 15, 2)
            share[a, b] = (np.abs(points) < size[b, None] / 2).all(-1).mean(-1)
        share = np.maximum(share, share.T)  # (MOT.42)
        speed = distances(estimate.velocity)
        return ((share > self.overlap) & (speed < self.overlap_speed)) | (share > self.overlap_sure)  # (MOT.43)

    def one_vehicle(self, estimate: Estimate) -> NDArray:
        """Pairs (T, T) bool in one lane, one behind the other, nearer than two vehicles drive at their speed."""
        length = estimate.size[:, 0]
        ahead, pairs = in_file(estimate.pose, estimate.pose, self.lane)  # b from a
        gap = np.abs(ahead) - (length[:, None] + length) / 2
        most, base, slope = self.gap
        limit = np.minimum(most, base + slope * (estimate.velocity**2).sum(-1))  # (MOT.44)
        pairs &= (gap < limit[:, None]) & (distances(estimate.velocity) < self.speed)  # (MOT.44)
        pairs &= pairs.T
        np.fill_diagonal(pairs, False)
        return pairs

    def _touching(self, estimate: Estimate, a: NDArray, b: NDArray) -> NDArray:
        """Whether the gap of P pairs in file is one that nobody keeps at their speed, even in a column, (P,)."""
        along = np.abs(to_frame(estimate.pose[a], estimate.pose[b, None, :2])[:, 0, 0])
        gap = along - (estimate.size[a, 0] + estimate.size[b, 0]) / 2
        _, base, slope = self.gap
        return np.asarray((gap < base) & (slope * (estimate.velocity[a] ** 2).sum(-1) > base))  # (MOT.52)


def in_file(pose: NDArray, others: NDArray, lane: float) -> tuple[NDArray, NDArray]:
    """How far ahead (R, T) [m] of poses (R, 3) others (T, 3) are, and whether in a lane [m] with them, and parallel."""
    forth, aside = np.moveaxis(to_frame(pose, others[:, :2]), -1, 0)
    parallel = np.cos(pose[:, 2][:, None] - others[:, 2]) > PARALLEL
    return forth, (np.abs(aside) < lane) & parallel  # (MOT.44)


def ahead(estimate: Estimate, a: NDArray, b: NDArray) -> NDArray:
    """Whether the second of P pairs of tracks is ahead of the first, int (P,)."""
    d = estimate.pose[b, :2] - estimate.pose[a, :2]
    return (np.sum(d * unit(estimate.pose[a, 2]), -1) > 0).astype(int)


def extent(estimate: Estimate, a: NDArray, b: NDArray) -> NDArray:
    """Length (P,) [m] over both of P pairs of tracks in file."""
    d = estimate.pose[a, :2] - estimate.pose[b, :2]
    return np.asarray(np.hypot(*d.T) + (estimate.size[a, 0] + estimate.size[b, 0]) / 2)


def distances(a: NDArray) -> NDArray:
    """Lengths (T, T) of the differences of plane vectors (T, 2), in their unit."""
    d = a[:, None] - a
    return np.hypot(d[..., 0], d[..., 1])


def reach(estimate: Estimate, a: np.intp, b: np.intp) -> NDArray:
    """Rearmost and foremost point (2,) [m] of both boxes along the heading of a, from its centre."""
    corners = to_world(estimate.pose[[a, b]], UNIT_BOX * estimate.size[[a, b], None]).reshape(-1, 2)
    along = (corners - estimate.pose[a, :2]) @ unit(estimate.pose[a, 2])
    return np.array([along.min(), along.max()])


def union_length(estimate: Estimate, a: np.intp, b: np.intp) -> float:
    """Length [m] of the box of a when it reaches over b."""
    return float(np.ptp(reach(estimate, a, b)))


def unite(estimate: Estimate, a: np.intp, b: np.intp) -> None:
    """Make the box of a the union of both, in place, with an uncertain length and 1 m^2 more variance along."""
    low, high = reach(estimate, a, b)
    along = unit(estimate.pose[a, 2])
    estimate.pose[a, :2] += along * (low + high) / 2  # (MOT.45)
    estimate.size[a] = high - low, max(estimate.size[a, 1], estimate.size[b, 1])  # (MOT.45)
    estimate.size_std[a] = np.maximum(estimate.size_std[a], (0.2 * (high - low), 0.1))  # (MOT.46)
    estimate.cov[a, :2, :2] += np.outer(along, along)  # (MOT.46)
