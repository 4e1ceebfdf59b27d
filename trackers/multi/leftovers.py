"""Leftovers: the detections that no track owns, sorted into those that may start a track and those of a known one.

Equations: docs/methods/multi-object-tracking.md, section 7.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.geometry import to_frame
from trackers.multi.association import SortedScan
from trackers.multi.window import Loose
from trackers.parameters import check_numbers


class Leftovers(NamedTuple):
    """The use of the detections that no track owns."""

    candidate: NDArray  # (M,) bool, may start a track
    reach: NDArray  # (T, 2) [m] by how much detections lie ahead of and behind the box of a track that may grow, else 0


class Near(NamedTuple):
    """J points beside the boxes of T tracks."""

    inside: NDArray  # (T, J) bool, inside the margins of a box
    beyond: NDArray  # (T, J) bool, just ahead of or behind it, with its range rate
    ahead: NDArray  # (T, J) [m] beyond the nearer end, negative between the ends
    forward: NDArray  # (T, J) [m] along the heading, from the centre


@dataclass(frozen=True)
class Suppression:
    """Where nothing is born: beside tracks, and standing things off the lanes."""

    along: float = 0.8  # [m] margins of a track's box inside which nothing is born
    across: float = 0.5  # [m]
    above: float = 0.3  # existence of a track that suppresses births
    grow_along: float = 3.0  # [m] beyond the ends of a box, within which detections make its track grow
    grow_across: float = 0.4  # [m] beside it
    grow_rate: float = 1.5  # [m/s] difference of the ground range rate from that of the track

    def __post_init__(self) -> None:
        check_numbers(self)

    def leftovers(self, z: SortedScan, owner: NDArray, estimate: Estimate, existence: NDArray) -> Leftovers:
        """Sort the unowned detections into those that may start a track and those that a track should grow over.

        owner (M,) is the row of each detection's track, -1 for none; estimate and existence (T,). A static detection
        may start a track on a lane of the map only, and without a map nowhere.
        """
        free = (owner < 0) & np.isfinite(z.rate) & (~z.static | z.in_lane)  # (MOT.28)
        T = len(existence)
        reach = np.zeros((T, 2))
        j = np.flatnonzero(free)
        if T == 0 or not len(j):
            return Leftovers(free, reach)
        near = self._near(z.xy[j], z.sight[j], z.rate[j], z.var_across[j], estimate, existence)
        free[j] = ~(near.inside | near.beyond).any(0)
        for end, side in enumerate((near.forward > 0, near.forward < 0)):
            reach[:, end] = np.where(near.beyond & side, near.ahead, 0.0).max(1)
        reach[near.beyond.sum(1) < 2] = 0.0
        return Leftovers(free, reach)

    def unexplained(self, loose: Loose, estimate: Estimate, existence: NDArray) -> NDArray:
        """Mask (P,) of remembered detections that no track has come to explain."""
        if not len(existence) or not len(loose.rate):
            return np.ones(len(loose.rate), bool)
        near = self._near(loose.xy, loose.sight, loose.rate, loose.var_across, estimate, existence)
        return ~(near.inside | near.beyond).any(0)

    def _near(
        self, xy: NDArray, sight: NDArray, rate: NDArray, var_across: NDArray, estimate: Estimate, existence: NDArray
    ) -> Near:
        body = to_frame(estimate.pose, xy)  # (T, J, 2)
        outside = np.abs(body) - estimate.size[:, None] / 2
        ahead, aside = outside[..., 0], outside[..., 1]
        sure = (existence > self.above)[:, None]
        inside = sure & (ahead < self.along) & (aside < self.across + 1.5 * np.sqrt(var_across))  # (MOT.29)
        beyond = sure & (ahead < self.grow_along) & (aside < self.grow_across)  # (MOT.30)
        beyond &= (np.abs(rate - estimate.velocity @ sight.T) < self.grow_rate) & (ahead >= 0)  # (MOT.30)
        return Near(inside, beyond, ahead, body[..., 0])
