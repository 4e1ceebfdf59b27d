"""Initiation: new tracks from a window of detections that no track explains, and where they start.

Equations: docs/methods/life-cycle-of-tracks.md, sections 2 and 3.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from trackers.batch import take
from trackers.estimate import Estimate, prior
from trackers.geometry import dot, perpendicular, unit
from trackers.multi.association import SortedScan
from trackers.multi.beside import Taken
from trackers.multi.cells import Linkage, cut
from trackers.multi.course import Course, Lanes
from trackers.multi.evidence import Cells, Evidence
from trackers.multi.road import Bend, RoadMap
from trackers.multi.sizes import BirthSize
from trackers.multi.way import Way
from trackers.multi.window import EMPTY, Unexplained, Window, join
from trackers.parameters import check_numbers
from trackers.random_matrix.feldmann import visible_offset

EMPTY_ESTIMATE = prior(np.zeros((0, 3)))


class Births(NamedTuple):
    """B new tracks before their first update, and the window of the next step."""

    estimate: Estimate  # (B,)
    length: NDArray  # (B,) [m] of the cell, along the heading, in this scan
    mean: NDArray  # (B, 2) [m] of the detections
    place: NDArray  # (B, 2) [m] of the sensors
    existence: NDArray  # (B,)
    hits: NDArray  # (B,) int, scans with a detection
    detections: NDArray  # (B,) int, in all of these scans
    owner: NDArray  # (M,) row of the birth that takes each detection of the scan, -1 for none
    unexplained: Unexplained  # unexplained detections to remember
    crowd: int  # number of candidates where they are too many to be remembered, else 0


@dataclass(frozen=True)
class Initiation:
    """Which cells of unexplained detections become tracks, and where these start."""

    most_sure: float = 0.6  # greatest existence at birth
    most_births: int = 40  # of a scan
    crowd: int = 400  # more candidates than this in a scan are not remembered
    past_weight: float = 0.3  # of a detection of an earlier scan in the mean place
    begin: float = 0.1  # share of the detections of many scans before the near end, by noise
    depth: float = 0.85  # mean of the detections, as a share of the way from the centre to the visible outline
    cut_gap: float = 0.3  # [m] least gap across at which a cell that is wider than any vehicle is cut
    window: Window = field(default_factory=Window)
    linkage: Linkage = field(default_factory=Linkage)
    evidence: Evidence = field(default_factory=Evidence)
    course: Course = field(default_factory=Course)
    sizes: BirthSize = field(default_factory=BirthSize)
    widest: float = 2.9  # [m] cells wider than any vehicle are cut

    def __post_init__(self) -> None:
        check_numbers(self, positive=("most_births", "crowd"))

    @property
    def least_existence(self) -> float:
        """The least existence of a new track."""
        return min(self.evidence.born_above, *self.evidence.static_existence)

    def births(
        self, z: SortedScan, candidate: NDArray, points: Unexplained, false_alarms: NDArray, time: float, dt: float,
        road: RoadMap | None = None, bend: Bend | None = None, way: Way | None = None,
    ) -> Births:  # fmt: skip
        """New tracks from the candidates (M,) bool of a scan and the window before it, in the order of their place.

        false_alarms (S,) are those expected of each sensor a scan, time [s] since the first scan, dt [s] since the one
        before. What is born turns with its lane, of the curvature that bend gives (B,) [1/m] at poses (B, 3).
        Off the lanes of the map others drive along the way.
        """
        j = self._born_here(z, np.flatnonzero(candidate), road)
        crowd = len(j) if len(j) > self.crowd else 0
        way = way or Way.of(z.scan.platform)
        now = self.window.candidates(z, j, None if crowd else road, way)
        pool = now if crowd else join(points, now)
        if not len(pool.rate):
            return self._none(len(z.rate), pool, crowd)
        lanes = partial(self._lanes, way, road, bend)
        label, cells = self._cells(z, pool, false_alarms, time, dt, lanes, crowd > 0)
        best = np.argsort(-cells.log_odds, kind="stable")[: self.most_births]
        best = best[np.isfinite(cells.log_odds[best])]
        if not len(best):
            return self._none(len(z.rate), EMPTY if crowd else self.window.keep(pool), crowd)
        W = label == best[:, None]  # (B, P)
        weight = W * np.where(pool.now, 1.0, self.past_weight)
        weight /= weight.sum(1, keepdims=True)
        mean = weight @ pool.xy
        order = np.lexsort((mean[:, 1], mean[:, 0]))
        best, W, mean, place = best[order], W[order], mean[order], weight[order] @ pool.place
        estimate, length = self._start(pool, W, mean, place, cells.standing[best], lanes(mean))
        row, column = np.nonzero(W[:, len(pool.rate) - len(j) :])
        owner = np.full(len(z.rate), -1)
        owner[j[column]] = row
        existence = np.minimum(expit(cells.log_odds[best]), self.most_sure)  # (LIFE.9)
        rest = EMPTY if crowd else self.window.keep(take(pool, ~W.any(0)))
        return Births(
            estimate, length, mean, place, existence, cells.scans[best], cells.detections[best], owner, rest, crowd
        )

    def _born_here(self, z: SortedScan, j: NDArray, road: RoadMap | None) -> NDArray:
        """Of the candidates j those with range rate, and those near the lanes of a map or, if it is empty, anywhere.

        What has no range rate may be a wall, and most of what stands beside the lanes is.
        """
        silent = np.isnan(z.rate[j])
        if road is None or not len(road.a) or not silent.any():
            return j
        return j[~silent | (road.locate(z.xy[j])[0] > -self.window.beside_lane)]

    def _none(self, detections: int, points: Unexplained, crowd: int) -> Births:
        """No new track of a scan with so many detections."""
        none, count, xy = np.zeros(0), np.zeros(0, int), np.zeros((0, 2))
        return Births(EMPTY_ESTIMATE, none, xy, xy, none, count, count, np.full(detections, -1), points, crowd)

    def _cells(
        self, z: SortedScan, points: Unexplained, false_alarms: NDArray, time: float, dt: float,
        lanes: Callable[[NDArray], Lanes], crowded: bool,
    ) -> tuple[NDArray, Cells]:  # fmt: skip
        """Cell (P,) of each detection, and what the cells are worth."""
        label = self.linkage.label_crowd(points) if crowded else self.linkage.label(points)
        clutter = self.evidence.clutter(points, label, false_alarms, crowded)
        scans = np.where(points.now, 1.0, self.window.span / dt if dt > 0 else 1.0)
        chance = clutter * self.linkage.volume(points) * scans  # (LIFE.5)
        newcomers = self.evidence.newcomers(np.inf if crowded else time)
        cells = self.evidence.judge(points, label, clutter, chance, newcomers)
        cut = self._cut(points, label, cells, lanes)
        if cut.max(initial=-1) > label.max(initial=-1):
            return cut, self.evidence.judge(points, cut, clutter, chance, newcomers)
        return label, cells

    def _lanes(self, way: Way, road: RoadMap | None, bend: Bend | None, mean: NDArray) -> Lanes:
        direction, on_lane = self.window.courses(mean, road, way)
        if road is None:
            sure, std = np.full(len(mean), self.course.uncrossed(way.speed)), way.direction_std(mean)
        else:
            sure, std = on_lane.astype(float), np.zeros(len(mean))
        curvature = None if bend is None else bend(np.concatenate([mean, direction[:, None]], -1))
        return Lanes(direction, sure, way.speed, std, curvature, road is not None)

    def _cut(self, points: Unexplained, label: NDArray, cells: Cells, lanes: Callable[[NDArray], Lanes]) -> NDArray:
        """Labels (P,) after those cells that may be born and are wider than any vehicle are cut."""
        least = self.evidence.least  # both parts need enough for a birth
        wide = np.flatnonzero(np.isfinite(cells.log_odds) & (cells.detections >= 2 * least))
        if not len(wide):
            return label
        W = label == wide[:, None]
        mean = W @ points.xy / cells.detections[wide, None]
        heading = self.course.of(points, W, lanes(mean), cells.standing[wide]).heading
        return cut(points, label, wide, heading, self.widest, least, self.cut_gap)

    def sized(self, births: Births, size: NDArray, size_std: NDArray) -> Estimate:
        """Estimates (B,) of births whose size (B, 2) [m] and its std (B, 2) are known from elsewhere."""
        return self._behind(births.estimate._replace(size=size, size_std=size_std), births.mean, births.place)

    def parted(self, whole: Estimate, seen: Sequence[Taken]) -> Estimate:
        """Estimates (D,) of parts of whole (D,), of which this was seen, one record each; they move as whole does.

        The near end is where the detections begin, which lie all along a long vehicle.
        """
        along = unit(np.arctan2(whole.velocity[:, 1], whole.velocity[:, 0]))
        x = [one.xy @ u for one, u in zip(seen, along, strict=True)]
        size, size_std = self.sizes.of(np.array([np.ptp(each) for each in x]))
        mean, place = (np.array([getattr(one, name).mean(0) for one in seen]) for name in ("xy", "place"))
        away = np.sign(np.sum((mean - place) * along, -1))
        near = np.array([np.quantile(each * side, self.begin) * side for each, side in zip(x, away, strict=True)])
        off = near + away * size[:, 0] / 2 - np.sum(mean * along, -1)  # (LIFE.43)
        pose = np.concatenate([mean + off[:, None] * along, np.arctan2(along[:, 1], along[:, 0])[:, None]], -1)
        cov = np.zeros(whole.cov.shape)
        cov[:, :2, :2], cov[:, 2:, 2:] = _spread(along, size), whole.cov[:, 2:, 2:]
        return whole._replace(pose=pose, size=size, size_std=size_std, cov=cov, contour=None, class_probability=None)

    def _behind(self, estimate: Estimate, mean: NDArray, place: NDArray) -> Estimate:
        """The boxes where detections about the means (B, 2) [m] from sensors at places (B, 2) have them."""
        pose = estimate.pose.copy()
        pose[:, :2] = mean - self.depth * visible_offset(pose, estimate.size, place)  # (LIFE.17)
        return estimate._replace(pose=pose)

    def _start(
        self, points: Unexplained, W: NDArray, mean: NDArray, place: NDArray, standing: NDArray, lanes: Lanes
    ) -> tuple[Estimate, NDArray]:
        """Estimates (B,) of the cells W (B, P) bool before their first update, and their lengths (B,) [m] in this scan.

        mean and place (B, 2) [m] are the means of the detections and of their sensors, standing (B,) bool.
        """
        motion = self.course.of(points, W, lanes, standing)
        along = unit(motion.heading)
        axis, of_now = points.xy @ along.T, (W & points.now).T  # (P, B)
        length = np.where(of_now, axis, -np.inf).max(0, initial=-np.inf)
        length -= np.where(of_now, axis, np.inf).min(0, initial=np.inf)
        size, size_std = self.sizes.of(length)
        pose = np.concatenate([mean, motion.heading[:, None]], -1)
        turns = 0.0 if lanes.curvature is None else lanes.curvature * dot(motion.velocity, unit(lanes.direction))
        born = prior(
            pose, velocity=motion.velocity, yaw_rate=turns, size=size, size_std=size_std,
            heading_std=motion.heading_std, yaw_rate_std=0.1,
        )  # fmt: skip
        born.cov[:, :2, :2] = _spread(along, size)
        born.cov[:, 2:, 2:] = motion.cov
        return self._behind(born, mean, place), length


def _spread(along: NDArray, size: NDArray) -> NDArray:
    """Covariances (B, 2, 2) [m^2] of centres of boxes of a size (B, 2) [m], along unit vectors (B, 2) and across."""
    M = np.stack([along, perpendicular(along)], -1)
    spread = (0.2 * size) ** 2 + 0.2**2  # (LIFE.18)
    return np.asarray((M * spread[:, None]) @ M.mT)
