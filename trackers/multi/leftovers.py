"""Leftovers: the detections that no track owns, and which of them may start a track.

Equations: docs/methods/multi-object-tracking.md, section 7.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.geometry import to_frame
from trackers.multi.association import SortedScan
from trackers.multi.window import Unexplained
from trackers.parameters import check_numbers


@dataclass(frozen=True)
class Suppression:
    """Where nothing is born: beside tracks, and standing things off the lanes."""

    along: float = 0.8  # [m] margins of a track's box inside which nothing is born
    across: float = 0.5  # [m]
    above: float = 0.3  # existence of a track that suppresses births
    end_along: float = 3.0  # [m] beyond the ends of a box, within which what moves like it is of the same vehicle
    end_across: float = 0.4  # [m] beside it
    end_rate: float = 1.5  # [m/s] difference of the ground range rate from that of the track

    def __post_init__(self) -> None:
        check_numbers(self)

    def candidates(self, z: SortedScan, owner: NDArray, estimate: Estimate, existence: NDArray) -> NDArray:
        """Mask (M,) of the unowned detections that may start a track.

        owner (M,) is the row of each detection's track, -1 for none; estimate and existence (T,). A static detection
        may start a track on a lane of the map only, and without a map nowhere; of one without range rate it is not
        known whether it is static.
        """
        free = (owner < 0) & (~z.static | z.in_lane)  # (MOT.28)
        j = np.flatnonzero(free)
        free[j] = ~self._near(z.xy[j], z.sight[j], z.rate[j], z.var_across[j], estimate, existence)
        return free

    def unexplained(self, points: Unexplained, estimate: Estimate, existence: NDArray) -> NDArray:
        """Mask (P,) of remembered detections that no track has come to explain."""
        return ~self._near(points.xy, points.sight, points.rate, points.var_across, estimate, existence)

    def _near(
        self, xy: NDArray, sight: NDArray, rate: NDArray, var_across: NDArray, estimate: Estimate, existence: NDArray
    ) -> NDArray:
        """Mask (J,) of the points inside the margins of a track's box, or just beyond its ends unless rates differ."""
        if not (len(existence) and len(rate)):
            return np.zeros(len(rate), bool)
        body = to_frame(estimate.pose, xy)  # (T, J, 2)
        outside = np.abs(body) - estimate.size[:, None] / 2
        ahead, aside = outside[..., 0], outside[..., 1]
        sure = (existence > self.above)[:, None]
        inside = sure & (ahead < self.along) & (aside < self.across + 1.5 * np.sqrt(var_across))  # (MOT.29)
        beyond = sure & (ahead < self.end_along) & (aside < self.end_across)  # (MOT.30)
        unlike = np.abs(rate - estimate.velocity @ sight.T) >= self.end_rate  # never without range rate
        beyond &= ~unlike & (ahead >= 0)  # (MOT.30)
        return np.asarray((inside | beyond).any(0))
