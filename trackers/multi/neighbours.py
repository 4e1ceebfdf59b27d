"""Neighbours in file: a vehicle ends before the next one begins, which bounds a length that nothing else tells.

Equations: docs/methods/multi-object-tracking.md, section 3.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from trackers.batch import take
from trackers.estimate import Estimate
from trackers.geometry import to_frame
from trackers.multi.exclusion import in_file
from trackers.multi.silence import Quiet, tried
from trackers.parameters import check_numbers


class InFile(NamedTuple):
    """Tracks of unknown length, and those in file with them of known length."""

    rows: NDArray  # (R,) of the former
    ahead: NDArray  # (R, T) [m] how far ahead of them the latter are, NaN for all others


@dataclass(frozen=True)
class Neighbours:
    """Which tracks bound the length of another one, and how firmly."""

    unsure: float = 0.5  # [m] standard deviation of a length from which on it is bounded, up to which it bounds others
    lane: float = 1.6  # [m] across, between the centres
    settled: float = 2.0  # [s] age of both, where no ground between them was seen to be empty
    least_room: float = 3.5  # [m] for a car: where there is less, one of the boxes is wrong
    least_std: float = 0.3  # [m] of the room
    weight: float = 0.5  # of a scan
    least: float = 0.1  # probability of a length, however far beyond the next vehicle it reaches

    def __post_init__(self) -> None:
        check_numbers(self, positive=("least_std", "least"))

    def asked(self, estimate: Estimate, some: NDArray, age: NDArray, divided: NDArray) -> InFile:
        """Who of the tracks with detections, some (T,) bool, has a length that is not sure, and which others bound it.

        estimate (T,) are all tracks, age (T,) [s] theirs, divided (T, 2) bool where empty ground is behind and before
        them.
        """
        pose, std = estimate.pose, estimate.size_std[:, 0]
        known = std <= self.unsure
        rows = np.flatnonzero(some & ~known)
        if not len(rows):
            return InFile(rows, np.zeros((0, len(std))))
        ahead, bounds = in_file(pose[rows], pose, self.lane)
        apart = np.where(ahead > 0, divided[:, 0], divided[:, 1])
        bounds &= known & (apart | (np.minimum(age, age[rows, None]) > self.settled))
        found = bounds.any(-1)
        return InFile(rows[found], np.where(bounds, ahead, np.nan)[found])

    def bound(self, asked: InFile, longest: Estimate, estimate: Estimate) -> Quiet | None:
        """What the room up to the next vehicle says of the lengths of those R asked for, None: nothing.

        longest (R,) are their greatest boxes that are possible, which end where the boxes end at the end in view;
        estimate (T,) are all tracks.
        """
        rows, pose, size, std = asked.rows, estimate.pose, estimate.size, estimate.size_std
        far = np.sign(to_frame(pose[rows], longest.pose[:, None, :2])[..., 0])  # (R, 1) where the far end is
        away = far * asked.ahead
        rooms = np.where(away > 0, away - (size[:, 0] - size[rows, :1]) / 2, np.inf)  # (MOT.65)
        next_, room = rooms.argmin(-1), rooms.min(-1)
        tight = (room > self.least_room) & (room < size[rows, 0] + std[rows, 0])
        if not tight.any():
            return None
        rows, room, next_ = rows[tight], room[tight, None], next_[tight]
        length = tried(take(longest, tight))
        of_room = np.maximum(std[next_, :1], self.least_std)
        log_p = np.maximum(log_ndtr((room - length) / of_room), np.log(self.least))
        return Quiet(rows, length, self.weight * log_p)  # (MOT.66)
