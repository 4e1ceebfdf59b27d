"""Neighbours in file: a vehicle ends before the next one begins, which bounds a length that nothing else tells.

Equations: docs/methods/multi-object-tracking.md, section 3.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from trackers.estimate import Estimate
from trackers.geometry import dot, perpendicular, unit
from trackers.multi.silence import LENGTHS, SHORTEST, Quiet
from trackers.parameters import check_numbers

PARALLEL = 0.9  # cosine between their headings


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
        rows = np.flatnonzero(some & ~known) if known.any() else np.zeros(0, int)
        along = unit(pose[rows, 2])[:, None]
        d = pose[:, :2] - pose[rows, None, :2]  # (R, T, 2)
        ahead = dot(d, along)
        in_file = known & (np.abs(dot(d, perpendicular(along))) < self.lane)
        in_file &= np.cos(pose[:, 2] - pose[rows, 2][:, None]) > PARALLEL
        apart = np.where(ahead > 0, divided[:, 0], divided[:, 1])
        in_file &= apart | (np.minimum(age, age[rows, None]) > self.settled)
        found = in_file.any(-1)
        return InFile(rows[found], np.where(in_file, ahead, np.nan)[found])

    def bound(self, asked: InFile, longest: Estimate, estimate: Estimate) -> Quiet | None:
        """What the room up to the next vehicle says of the lengths of those R asked for, None: nothing.

        longest (R,) are their greatest boxes that are possible, which end where the boxes end at the end in view;
        estimate (T,) are all tracks.
        """
        rows, pose, size, std = asked.rows, estimate.pose, estimate.size, estimate.size_std
        far = np.sign(dot(longest.pose[:, :2] - pose[rows, :2], unit(pose[rows, 2])))  # where the far end is
        ahead = far[:, None] * asked.ahead
        in_file = ahead > 0
        room = np.where(in_file, ahead - (size[:, 0] - size[rows, :1]) / 2, np.inf)  # (MOT.65)
        next_ = room.argmin(-1)
        room = room.min(-1)
        tight = (room > self.least_room) & (room < size[rows, 0] + std[rows, 0])
        if not tight.any():
            return None
        rows, room, next_ = rows[tight], room[tight, None], next_[tight]
        length = SHORTEST + np.linspace(0.0, 1.0, LENGTHS) * (longest.size[tight, :1] - SHORTEST)
        of_room = np.maximum(std[next_, :1], self.least_std)
        log_p = np.maximum(log_ndtr((room - length) / of_room), np.log(self.least))
        return Quiet(rows, length, self.weight * log_p)  # (MOT.66)
