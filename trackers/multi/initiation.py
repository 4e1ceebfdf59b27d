"""Initiation: new tracks from the detections that no track owns, and which of those a track should grow over instead.

Equations: docs/methods/multi-object-tracking.md, sections 7 and 8.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate, prior
from trackers.geometry import dot, perpendicular, to_frame, unit
from trackers.multi.association import SortedScan
from trackers.multi.road import RoadMap
from trackers.multi.sizes import SizePrior
from trackers.parameters import check_numbers
from trackers.random_matrix.surface import visible_offset


class Births(NamedTuple):
    """B new tracks before their first update."""

    estimate: Estimate  # (B,)
    existence: NDArray  # (B,)
    owner: NDArray  # (M,) row of the birth that takes each detection, -1 for none


class Leftovers(NamedTuple):
    """The use of the detections that no track owns."""

    candidate: NDArray  # (M,) bool, may start a track
    reach: NDArray  # (T, 2) [m] by how much detections lie ahead of and behind the box of a track that may grow, else 0


def components(near: NDArray) -> NDArray:
    """Labels (J,), counted from 0, of the connected components of a symmetric relation near (J, J) bool.

    Every node takes the least label next to it, until nothing changes. For the few dozen candidates of a scan that is
    ten times cheaper than building a sparse graph.
    """
    J = len(near)
    label = np.arange(J)
    while True:
        least = np.where(near, label, J).min(1, initial=J)
        least = np.minimum(label, least)
        if (least == label).all():
            return (np.cumsum(label == np.arange(J)) - 1)[label]  # each is labelled by its least node
        label = least[least]  # also the least of the least: chains shrink by halves


@dataclass(frozen=True)
class Initiation:
    """Cells, velocities and first sizes of new tracks."""

    link_along: float = 2.5  # [m] half axes of the linkage, along the direction of travel
    link_across: float = 0.7  # [m] narrow on purpose: a wide linkage makes one vehicle of two abreast
    link_rate: float = 2.0  # [m/s] greatest difference of the ground range rates of linked detections
    cut_gap: float = 0.3  # [m] least gap across at which a cell that is wider than any vehicle is cut
    least: int = 3  # detections of a cell
    least_far: int = 2  # the same beyond `far`
    far: float = 80.0  # [m]
    sigma_rate: float = 0.3  # [m/s] range rate in the fit of the velocity
    lane_std: tuple[float, float] = (12.0, 1.0)  # [m/s] prior along and across, around the ego's speed, either way
    crossing_std: float = 15.0  # [m/s] prior of crossing traffic, around standstill, any direction
    crossing_log_odds: float = -3.0  # of crossing traffic against traffic along the lane
    course_above: float = 4.0  # [m/s] the heading follows the velocity above this speed
    depth: float = 0.85  # mean of the detections, as a share of the way from the centre to the visible outline
    fast_existence: tuple[float, float, float] = (0.03, 2.5, 0.4)  # q = min(first * second^(n - 2), third), (MOT.41)
    static_existence: float = 0.05  # of a standing cell
    standing_rate: float = 1.0  # [m/s] a cell stands if the mean magnitude of its ground range rates is below
    standing_std: float = 1.0  # [m/s] of the velocity of a standing cell
    static_inside: float = 0.5  # [m] least depth inside a lane, plus one standard deviation, of a static candidate
    most_candidates: int = 2000  # more unowned detections than this are a disturbance, not traffic
    suppress_along: float = 0.8  # [m] margins of a track's box inside which nothing is born
    suppress_across: float = 0.5  # [m]
    suppress_above: float = 0.3  # existence of a track that suppresses births
    grow_along: float = 3.0  # [m] beyond the ends of a box, within which detections make its track grow
    grow_across: float = 0.4  # [m] beside it
    grow_rate: float = 1.5  # [m/s] difference of the ground range rate from that of the track
    sizes: SizePrior = field(default_factory=SizePrior)

    def __post_init__(self) -> None:
        check_numbers(
            self,
            positive=("link_along", "link_across", "link_rate", "sigma_rate", "lane_std", "crossing_std"),
            signed=("crossing_log_odds",),
        )

    def leftovers(
        self, z: SortedScan, owner: NDArray, estimate: Estimate, existence: NDArray, road: RoadMap | None
    ) -> Leftovers:
        """Sort the unowned detections into those that may start a track and those that a track should grow over.

        owner (M,) is the row of each detection's track, -1 for none; estimate and existence (T,). A static detection
        may start a track on a lane of the map only, and without a map nowhere.
        """
        free = (owner < 0) & np.isfinite(z.rate)
        standing = np.flatnonzero(free & z.static)
        free[standing] = False
        if road is not None and len(standing):
            margin = self.static_inside + np.sqrt(np.maximum(z.var_along, z.var_across)[standing])
            free[standing] = road.locate(z.xy[standing])[0] > margin  # (MOT.28)
        T = len(existence)
        if T == 0 or not free.any():
            return Leftovers(free, np.zeros((T, 2)))
        j = np.flatnonzero(free)
        body = to_frame(estimate.pose, z.xy[j])  # (T, J, 2)
        forward = body[..., 0]
        outside = np.abs(body) - estimate.size[:, None] / 2
        ahead, aside = outside[..., 0], outside[..., 1]
        sure = (existence > self.suppress_above)[:, None]
        noise = np.sqrt(z.var_across[j])
        inside = sure & (ahead < self.suppress_along) & (aside < self.suppress_across + 1.5 * noise)  # (MOT.29)
        rate = estimate.velocity @ z.sight[j].T
        beyond = sure & (ahead < self.grow_along) & (aside < self.grow_across)  # (MOT.30)
        beyond &= (np.abs(z.rate[j] - rate) < self.grow_rate) & (ahead >= 0)  # (MOT.30)
        free[j] = ~(inside | beyond).any(0)
        reach = np.zeros((T, 2))
        for end, side in enumerate((forward > 0, forward < 0)):
            reach[:, end] = np.where(beyond & side, ahead, 0.0).max(1)
        reach[beyond.sum(1) < 2] = 0.0
        return Leftovers(free, reach)

    def overload(self, candidate: NDArray) -> int:
        """Number of candidates (M,) bool where they are too many for births, else 0."""
        count = int(candidate.sum())
        return count if count > self.most_candidates else 0

    def births(self, z: SortedScan, candidate: NDArray, road: RoadMap | None = None) -> Births | None:
        """New tracks from the candidates (M,) bool, in the order of their mean position; None without any."""
        j = np.flatnonzero(candidate)
        if len(j) < self.least_far or self.overload(candidate):
            return None
        label = self._cut(z, j, self._cells(z, j))
        n = np.bincount(label)
        if n.max() < min(self.least, self.least_far):
            return None
        W = label == np.arange(len(n))[:, None]  # (B, J)
        mean = (W @ z.xy[j]) / n[:, None]
        distance = (W @ z.scan.polar[j, 0]) / n
        keep = n >= np.where(distance > self.far, self.least_far, self.least)
        order = np.flatnonzero(keep)
        if not len(order):
            return None
        order = order[np.lexsort((mean[order, 1], mean[order, 0]))]
        W, n, mean = W[order], n[order], mean[order]
        owner = np.full(len(z.rate), -1)
        row, column = np.nonzero(W)
        owner[j[column]] = row
        first, factor, most = self.fast_existence
        standing = (W @ np.abs(z.rate[j])) / n < self.standing_rate
        existence = np.minimum(first * factor ** np.minimum(n - 2, 9), most)  # (MOT.41)
        heading = np.full(len(n), z.scan.platform[2])
        if road is not None:
            heading = np.where(standing, road.locate(mean)[1], heading)
        estimate = self._priors(z, j, W, mean, heading, standing)
        return Births(estimate, np.where(standing, self.static_existence, existence), owner)

    def _cells(self, z: SortedScan, j: NDArray) -> NDArray:
        """Cell (J,) of each candidate: single linkage in an ellipse along the ego's heading."""
        along = unit(z.scan.platform[2])
        xy, rate = z.xy[j], z.rate[j]
        sigma = np.sqrt(z.var_along[j] + z.var_across[j])
        reach = (sigma[:, None] + sigma) / 2
        d = xy[:, None] - xy
        near = (d @ along / (self.link_along + reach)) ** 2 + (
            d @ perpendicular(along) / (self.link_across + reach)
        ) ** 2 < 1  # (MOT.31)
        near &= np.abs(rate[:, None] - rate) < self.link_rate  # (MOT.31)
        return components(near)

    def _cut(self, z: SortedScan, j: NDArray, label: NDArray) -> NDArray:
        """Cells (J,) after those wider than any vehicle are cut.

        A few stray points of a dense radar bridge the linkage of two vehicles abreast. The width is taken across the
        cell's own course, so that crossing vehicles are not cut in two.
        """
        waiting = list(np.flatnonzero(np.bincount(label) >= 2 * self.least))  # both parts need enough for a birth
        if not waiting:
            return label
        W = label == np.arange(label.max() + 1)[:, None]
        heading, _ = self._course(self._velocity(z, j, W)[0], np.full(len(W), z.scan.platform[2]))
        offset = dot(z.xy[j], perpendicular(unit(heading))[label])  # (J,)
        sigma = np.sqrt(z.var_along[j] + z.var_across[j])
        label = label.copy()
        while waiting:
            mine = np.flatnonzero(label == waiting.pop())
            mine = mine[np.argsort(offset[mine], kind="stable")]
            widest = self.sizes.most[1] + 4 * sigma[mine].mean()
            if len(mine) < 2 * self.least or offset[mine[-1]] - offset[mine[0]] < widest:
                continue
            gap = np.diff(offset[mine])[self.least - 1 : len(mine) - self.least]
            if gap.max() < self.cut_gap:
                continue
            other = label.max() + 1
            waiting += [label[mine[0]], other]
            label[mine[gap.argmax() + self.least :]] = other  # (MOT.32)
        return label

    def _course(self, velocity: NDArray, slow_heading: NDArray) -> tuple[NDArray, NDArray]:
        """Heading (B,) [rad], of the velocity (B, 2) above `course_above`, else slow_heading; and bool (B,) which."""
        moving = np.hypot(velocity[:, 0], velocity[:, 1]) > self.course_above
        return np.where(moving, np.arctan2(velocity[:, 1], velocity[:, 0]), slow_heading), moving  # (MOT.37)

    def _priors(
        self, z: SortedScan, j: NDArray, W: NDArray, mean: NDArray, slow_heading: NDArray, standing: NDArray
    ) -> Estimate:
        """Estimates (B,) of the cells W (B, J) bool with mean positions (B, 2), before their first update.

        slow_heading (B,) [rad] is that of cells too slow for a heading from their velocity, standing (B,) bool.
        """
        velocity, cov = self._velocity(z, j, W)
        velocity = np.where(standing[:, None], 0.0, velocity)  # abeam, range rates would leave the speed undetermined
        cov = np.where(standing[:, None, None], self.standing_std**2 * np.eye(2), cov)
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        heading, moving = self._course(velocity, slow_heading)
        across = perpendicular(unit(heading))
        across_std = np.sqrt(np.einsum("bi,bij,bj->b", across, cov, across))
        course_std = across_std / np.maximum(speed, self.course_above)  # (MOT.37)
        axis = ((z.xy[j] - mean[:, None]) * unit(heading)[:, None]).sum(-1)  # (B, J)
        length = np.where(W, axis, -np.inf).max(1) - np.where(W, axis, np.inf).min(1)
        size, size_std = self.sizes.at_birth(length)
        sensor = (W @ z.scan.pose[j, :2]) / W.sum(1)[:, None]
        pose = np.concatenate([mean, heading[:, None]], -1)
        pose[:, :2] -= self.depth * visible_offset(pose, size, sensor)  # (MOT.39)
        born = prior(
            pose,
            velocity=velocity,
            size=size,
            size_std=size_std,
            heading_std=np.clip(np.where(moving, course_std, 0.1), 0.03, 0.3),
            yaw_rate_std=0.1,
        )
        M = np.stack([unit(heading), across], -1)
        spread = np.stack([0.2 * size[:, 0], 0.2 * size[:, 1]], -1) ** 2 + 0.2**2  # (MOT.40)
        born.cov[:, :2, :2] = (M * spread[:, None]) @ M.mT
        born.cov[:, 2:, 2:] = cov
        return born

    def _velocity(self, z: SortedScan, j: NDArray, W: NDArray) -> tuple[NDArray, NDArray]:
        """Velocity (B, 2) [m/s] and covariance (B, 2, 2) by least squares of the range rates on the lines of sight.

        One radar sees a far vehicle under almost one direction, so the fit needs a prior. Of three, along the ego's
        lane, against it, and crossing, each cell takes the one with the greatest evidence.
        """
        along = unit(z.scan.platform[2])
        M = np.stack([along, perpendicular(along)], -1)
        lane = M @ np.diag(np.square(self.lane_std)) @ M.T
        ahead = (z.scan.platform[3:5] @ along) * along
        across = self.crossing_std**2 * np.eye(2)
        priors = ((ahead, lane, 0.0), (-ahead, lane, 0.0), (np.zeros(2), across, self.crossing_log_odds))
        fits = [self._fit(z, j, W, mean, cov) for mean, cov, _ in priors]
        best = np.argmax([fit[2] + odds for fit, (_, _, odds) in zip(fits, priors, strict=True)], 0)  # (MOT.36)
        b = np.arange(len(W))
        return np.stack([fit[0] for fit in fits])[best, b], np.stack([fit[1] for fit in fits])[best, b]

    def _fit(
        self, z: SortedScan, j: NDArray, W: NDArray, mean: NDArray, cov: NDArray
    ) -> tuple[NDArray, NDArray, NDArray]:
        """Velocity (B, 2), covariance (B, 2, 2) and log evidence (B,) under a Gaussian prior: mean (2,), cov (2, 2)."""
        u, g = z.sight[j], z.rate[j] - z.sight[j] @ mean
        information = np.linalg.inv(cov) + np.einsum("bj,jk,jl->bkl", W, u, u) / self.sigma_rate**2  # (MOT.33)
        score = np.einsum("bj,jk,j->bk", W, u, g) / self.sigma_rate**2  # (MOT.33)
        posterior = np.linalg.inv(information)  # (MOT.34)
        shift = (posterior @ score[..., None])[..., 0]  # (MOT.34)
        chi2 = W @ g**2 / self.sigma_rate**2 - (score * shift).sum(-1)  # (MOT.35)
        log_det = np.linalg.slogdet(information)[1] + np.linalg.slogdet(cov)[1]  # (MOT.35)
        return mean + shift, posterior, -0.5 * (chi2 + log_det)
