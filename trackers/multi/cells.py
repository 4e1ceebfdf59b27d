"""Cells: unexplained detections near each other in place and range rate, by single linkage.

Equations: docs/methods/life-cycle-of-tracks.md, section 2.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from trackers.geometry import dot, perpendicular, unit
from trackers.multi.window import Unexplained
from trackers.parameters import check_numbers


@dataclass(frozen=True)
class Linkage:
    """Which detections are linked."""

    along: float = 2.5  # [m] half axes, along the lane
    across: float = 0.7  # [m] narrow on purpose: a wide linkage makes one vehicle of two abreast
    rate: float = 2.0  # [m/s] greatest difference of the ground range rates within a scan
    rate_between: float = 1.0  # [m/s] the same between scans
    thin: float = 0.25  # [m] and [m/s] grid of crowded scans, of which each cell is linked as one detection

    def __post_init__(self) -> None:
        check_numbers(self, positive=("along", "across", "rate", "rate_between", "thin"))

    def label(self, points: Unexplained) -> NDArray:
        """Cell (P,) of each detection, counted from 0."""
        a, b = self._pairs(points)
        d = points.xy[a] - points.xy[b]
        along = unit(points.course[np.maximum(a, b)])
        reach = (points.sigma[a] + points.sigma[b]) / 2
        near = (dot(d, along) / (self.along + reach)) ** 2 + (
            dot(d, perpendicular(along)) / (self.across + reach)
        ) ** 2 < 1  # (LIFE.3)
        limit, rate = np.where(points.age[a] == points.age[b], self.rate, self.rate_between), points.filled_rate
        near &= np.abs(rate[a] - rate[b]) < limit  # (LIFE.3)
        return components(len(points.rate), a[near], b[near])

    def label_crowd(self, points: Unexplained) -> NDArray:
        """The same in bounded time and memory: detections in one cell of a fine grid are linked as one."""
        fine = [self.thin, self.thin, self.thin, 1]
        grid = np.floor(np.c_[points.xy, points.filled_rate, points.sensor] / fine).astype(int)
        _, first, back = np.unique(grid, axis=0, return_index=True, return_inverse=True)
        return self.label(Unexplained(*(leaf[first] for leaf in points)))[back.ravel()]

    def volume(self, points: Unexplained) -> NDArray:
        """Volume (P,) [m^2 m/s] in which a detection is linked to each of these, [m^2] without range rate."""
        sigma = points.sigma
        rates = np.where(points.measured, 2 * np.where(points.now, self.rate, self.rate_between), 1.0)
        return np.pi * (self.along + sigma) * (self.across + sigma) * rates  # (LIFE.5)

    def _pairs(self, points: Unexplained) -> tuple[NDArray, NDArray]:
        """Rows of all pairs that may be linked, each pair once."""
        if len(points.rate) < 2:
            return np.zeros((2, 0), int)  # type: ignore[return-value]
        radius = self.along + points.sigma.max()
        points = np.c_[points.xy, points.filled_rate * radius / self.rate]
        return cKDTree(points).query_pairs(radius, p=np.inf, output_type="ndarray").T


def components(P: int, a: NDArray, b: NDArray) -> NDArray:
    """Connected component (P,) of each of P points linked in pairs a, b (L,), counted in the order of first points."""
    first = np.arange(P)  # the least point known to be in the component of each
    while (first[a] != first[b]).any():
        least = np.minimum(first[a], first[b])
        np.minimum.at(first, first[a], least)
        np.minimum.at(first, first[b], least)
        first = first[first]
    return np.unique(first, return_inverse=True)[1]


def cut(
    points: Unexplained, label: NDArray, wide: NDArray, heading: NDArray, widest: float, least: int, gap: float
) -> NDArray:
    """Labels (P,) after those of the cells `wide` (B,) that are wider than any vehicle are cut.

    A few stray points of a dense radar bridge the linkage of two vehicles abreast. The width is taken across the
    cell's own course, heading (B,) [rad], so that crossing vehicles are not cut in two. Both parts keep `least`
    detections and are at least `gap` [m] apart; widest [m] is the width of the widest vehicle.
    """
    label = label.copy()
    for cell, across in zip(wide, perpendicular(unit(heading)), strict=True):
        offset, waiting = points.xy @ across, [cell]
        while waiting:
            mine = np.flatnonzero(label == waiting.pop())
            mine = mine[np.argsort(offset[mine], kind="stable")]
            if len(mine) < 2 * least or np.ptp(offset[mine]) < widest + 4 * points.sigma[mine].mean():
                continue
            gaps = np.diff(offset[mine])[least - 1 : len(mine) - least]
            if gaps.max() < gap:
                continue
            other = label.max() + 1
            waiting += [label[mine[0]], other]
            label[mine[gaps.argmax() + least :]] = other  # (LIFE.10)
    return label
