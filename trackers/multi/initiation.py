"""Initiation: new tracks from a window of detections that no track explains.

Equations: docs/methods/life-cycle-of-tracks.md, sections 2 and 3.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from trackers.batch import take
from trackers.estimate import Estimate, prior
from trackers.geometry import perpendicular, unit
from trackers.multi.association import SortedScan
from trackers.multi.cells import Linkage, cut
from trackers.multi.course import Course, Lanes
from trackers.multi.road import RoadMap
from trackers.multi.sizes import SizePrior
from trackers.multi.window import EMPTY, Loose, Window, join
from trackers.random_matrix.surface import visible_offset


class Births(NamedTuple):
    """B new tracks before their first update, and the window of the next step."""

    estimate: Estimate  # (B,)
    existence: NDArray  # (B,)
    hits: NDArray  # (B,) int, scans with a detection
    detections: NDArray  # (B,) int, in all of these scans
    owner: NDArray  # (M,) row of the birth that takes each detection of the scan, -1 for none
    loose: Loose  # unexplained detections to remember
    crowd: int  # number of candidates where they are too many to be remembered, else 0


class Cells(NamedTuple):
    """C cells of detections, and what they are worth."""

    log_odds: NDArray  # (C,) of a vehicle against clutter, -inf where nothing is born
    standing: NDArray  # (C,) bool


@dataclass(frozen=True)
class Initiation:
    """When a cell of unexplained detections is a new track, and where that track starts."""

    least: int = 3  # detections of a cell in the window, at least one of them of the present scan
    intensity: float = 2e-9  # [1/(m^2 m/s)] new vehicles a scan
    intensity_first: float = 1e-6  # [1/(m^2 m/s)] the same in the first scan
    first_decay: float = 0.3  # [s] in which that fades
    clutter_factor: float = 2.0  # of the cells of a scan, as an estimate of its clutter
    pair_cap: float = 5.0  # greatest log likelihood ratio of one detection
    born_above: float = 0.03  # least existence at birth
    most_sure: float = 0.6  # greatest existence at birth
    most_births: int = 40  # of a scan
    crowd: int = 400  # more candidates than this in a scan are not remembered
    static_existence: float = 0.05  # of a standing cell
    static_least: tuple[int, int] = (3, 2)  # detections of a standing cell in one scan; the same beyond `static_far`
    static_far: float = 80.0  # [m]
    past_weight: float = 0.3  # of a detection of an earlier scan in the mean place
    depth: float = 0.85  # mean of the detections, as a share of the way from the centre to the visible outline
    cut_gap: float = 0.3  # [m] least gap across at which a cell that is wider than any vehicle is cut
    window: Window = field(default_factory=Window)
    linkage: Linkage = field(default_factory=Linkage)
    course: Course = field(default_factory=Course)
    sizes: SizePrior = field(default_factory=SizePrior)

    def births(
        self, z: SortedScan, candidate: NDArray, loose: Loose, false_alarms: NDArray, time: float, dt: float,
        road: RoadMap | None = None,
    ) -> Births:  # fmt: skip
        """New tracks from the candidates (M,) bool of a scan and the window before it, in the order of their place.

        false_alarms (S,) are those expected of each sensor a scan, time [s] since the first scan, dt [s] since the one
        before.
        """
        j, heading = np.flatnonzero(candidate), float(z.scan.platform[2])
        crowded = len(j) > self.crowd
        now = Loose.of(z, j, self.window.courses(z.xy[j], None if crowded else road, heading)[0])
        pool = now if crowded else join(loose, now)
        label = self.linkage.label_crowd(pool) if crowded else self.linkage.label(pool)
        past_scans = self.window.span / dt if dt > 0 else 1.0
        clutter = self._clutter(pool, label, false_alarms)
        fade = np.exp(-time / self.first_decay)
        intensity = self.intensity + (0.0 if crowded else fade) * (self.intensity_first - self.intensity)  # (LIFE.7)
        cells = self._judge(pool, label, clutter, past_scans, intensity)
        cut = self._cut(z, pool, label, cells, road)
        if cut.max(initial=-1) > label.max(initial=-1):
            label, cells = cut, self._judge(pool, cut, clutter, past_scans, intensity)
        best = np.argsort(-cells.log_odds, kind="stable")[: self.most_births]
        best = best[np.isfinite(cells.log_odds[best])]
        W = label == best[:, None]  # (B, P), none where no cell is worth a track
        estimate, order = self._start(z, pool, W, cells.standing[best], road)
        W = W[order]
        row, column = np.nonzero(W[:, len(pool.rate) - len(j) :])
        owner = np.full(len(z.rate), -1)
        owner[j[column]] = row
        return Births(
            estimate=estimate,
            existence=np.minimum(expit(cells.log_odds[best[order]]), self.most_sure),  # (LIFE.8)
            hits=scans(pool, W),
            detections=W.sum(1),
            owner=owner,
            loose=EMPTY if crowded else self.window.keep(take(pool, ~W.any(0))),
            crowd=len(j) if crowded else 0,
        )

    def _clutter(self, loose: Loose, label: NDArray, false_alarms: NDArray) -> NDArray:
        """Clutter intensity (P,) [1/(m^2 m/s)], measured: by the number of cells of each sensor in the present scan."""
        S = len(false_alarms)
        pairs = np.unique((label * S + loose.sensor)[loose.now])
        cells = np.bincount(pairs % S, minlength=S)
        factor = np.maximum(1.0, self.clutter_factor * cells / np.maximum(false_alarms, 1.0))  # (LIFE.4)
        return loose.clutter * factor[loose.sensor]  # (LIFE.4)

    def _judge(self, loose: Loose, label: NDArray, clutter: NDArray, past_scans: float, intensity: float) -> Cells:
        """What cells with labels (P,) are worth."""
        C = label.max(initial=-1) + 1
        n, n_now = np.bincount(label, minlength=C), np.bincount(label[loose.now], minlength=C)
        chance = clutter * self.linkage.volume(loose) * np.where(loose.now, 1.0, past_scans)
        worth = np.minimum(-np.log(np.minimum(chance, 0.9)), self.pair_cap)  # (LIFE.5)
        most, least = np.full(C, -np.inf), np.full(C, np.inf)
        np.maximum.at(most, label, worth)
        np.minimum.at(least, label, clutter)
        log_odds = np.log(intensity / least) + np.bincount(label, worth, C) - most  # (LIFE.6)
        born = (n >= self.least) & (n_now > 0) & (expit(log_odds) > self.born_above)
        standing = np.bincount(label, np.abs(loose.rate), C) / np.maximum(n, 1) < self.window.moving
        distance = np.bincount(label, np.hypot(*(loose.xy - loose.place).T), C) / np.maximum(n, 1)
        enough = n_now >= np.where(distance > self.static_far, self.static_least[1], self.static_least[0])
        log_odds = np.where(standing, np.log(self.static_existence / (1 - self.static_existence)), log_odds)
        return Cells(np.where(np.where(standing, enough, born), log_odds, -np.inf), standing)

    def _lanes(self, z: SortedScan, road: RoadMap | None, mean: NDArray) -> Lanes:
        heading = float(z.scan.platform[2])
        speed = float(z.scan.platform[3:5] @ unit(heading))
        return Lanes(*self.window.courses(mean, road, heading), speed)

    def _cut(self, z: SortedScan, loose: Loose, label: NDArray, cells: Cells, road: RoadMap | None) -> NDArray:
        """Labels (P,) after those cells that may be born and are wider than any vehicle are cut."""
        n = np.bincount(label, minlength=len(cells.log_odds))
        wide = np.flatnonzero(np.isfinite(cells.log_odds) & (n >= 2 * self.least))  # both parts need enough for a birth
        if not len(wide):
            return label
        W = label == wide[:, None]
        mean = W @ loose.xy / n[wide, None]
        heading = self.course.of(loose, W, self._lanes(z, road, mean), cells.standing[wide]).heading
        return cut(loose, label, wide, heading, self.sizes.most[1], self.least, self.cut_gap)

    def _start(
        self, z: SortedScan, loose: Loose, W: NDArray, standing: NDArray, road: RoadMap | None
    ) -> tuple[Estimate, NDArray]:
        """Estimates (B,) of the cells W (B, P) bool before their first update, in the order of their place.

        standing (B,) bool. The second array (B,) is the row of W of each.
        """
        weight = W * np.where(loose.now, 1.0, self.past_weight)
        weight /= weight.sum(1, keepdims=True)
        mean = weight @ loose.xy
        order = np.lexsort((mean[:, 1], mean[:, 0]))
        weight, W, mean, standing = weight[order], W[order], mean[order], standing[order]
        motion = self.course.of(loose, W, self._lanes(z, road, mean), standing)
        along = unit(motion.heading)
        axis = loose.xy @ along.T  # (P, B)
        of_now = (W & loose.now).T
        length = np.where(of_now, axis, -np.inf).max(0, initial=-np.inf)
        length -= np.where(of_now, axis, np.inf).min(0, initial=np.inf)
        size, size_std = self.sizes.at_birth(length)
        pose = np.concatenate([mean, motion.heading[:, None]], -1)
        pose[:, :2] -= self.depth * visible_offset(pose, size, weight @ loose.place)  # (LIFE.16)
        born = prior(
            pose, velocity=motion.velocity, size=size, size_std=size_std, heading_std=motion.heading_std,
            yaw_rate_std=0.1,
        )  # fmt: skip
        M = np.stack([along, perpendicular(along)], -1)
        spread = (0.2 * size) ** 2 + 0.2**2  # (LIFE.17)
        born.cov[:, :2, :2] = (M * spread[:, None]) @ M.mT
        born.cov[:, 2:, 2:] = motion.cov
        return born, order


def scans(loose: Loose, W: NDArray) -> NDArray:
    """Number (B,) of scans that the detections of cells W (B, P) bool come from."""
    _, scan = np.unique(loose.age, return_inverse=True)
    return np.array([len(np.unique(scan[row])) for row in W], int)
