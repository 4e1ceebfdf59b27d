"""The history of one object over a run: when it counted, and which track was assigned to it.

Pure functions of the F scans of one object; a scan stands for the time until the next one. Definitions:
docs/methods/metrics.md, "Over a run".
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

LOST_AFTER = 1.0  # [s] counted and without a track
NEVER_AFTER = 2.0  # [s] counted in all and never assigned
TIME_ROUNDING = 1e-9  # [s] times are sums or quotients of decimal steps


class History(NamedTuple):
    """One object, scan by scan."""

    time: NDArray  # (F,) [s]
    counted: NDArray  # (F,) bool, was expected to be detected within the last second
    plain: NDArray  # (F,) bool, in plain view
    covered: NDArray  # (F,) bool, the centre of some reported track lies in its box
    track: NDArray  # (F,) int, id of the assigned reported track, -1 for none

    @property
    def held(self) -> NDArray:
        """Scans (F,) at which the object was counted and had a track."""
        return self.counted & (self.track >= 0)


def periods(time: NDArray, where: NDArray) -> NDArray:
    """Start and end (S, 2) [s] of each period of scans under `where` (F,); a period ends with the first scan after it.

    >>> periods(np.array([0.0, 1.0, 2.0, 3.0]), np.array([False, True, True, False])).tolist()
    [[1.0, 3.0]]
    """
    edge = np.diff(np.concatenate([[False], where, [False]]).astype(int))
    start, stop = np.flatnonzero(edge > 0), np.flatnonzero(edge < 0)
    return np.stack([time[start], time[np.minimum(stop, len(time) - 1)]], -1)


def longest(time: NDArray, where: NDArray) -> float:
    """Length [s] of the longest period of scans under `where` (F,), 0 without one."""
    return float(np.max(periods(time, where) @ np.array([-1.0, 1.0]), initial=0.0))


def switches(history: History) -> NDArray:
    """Times [s] at which the object's track id differs from the one it had before."""
    held = np.flatnonzero(history.held)
    changed = np.flatnonzero(np.diff(history.track[held]))  # (MET.14)
    return history.time[held[changed + 1]]


def losses(history: History) -> NDArray:
    """Times [s] at which a once tracked, counted object had been without a track for `LOST_AFTER`."""
    once = np.logical_or.accumulate(history.held)
    gaps = periods(history.time, once & history.counted & (history.track < 0))
    long = gaps[:, 1] - gaps[:, 0] >= LOST_AFTER - TIME_ROUNDING  # (MET.15)
    return gaps[long, 0] + LOST_AFTER


def first_counted(history: History) -> float:
    """Time [s] at which the object was first counted, NaN if it never was."""
    return float(history.time[history.counted.argmax()]) if history.counted.any() else np.nan


def birth_delay(history: History) -> float:
    """Time [s] from first counted to first assigned, NaN if it never was."""
    if not history.held.any():
        return np.nan
    return float(history.time[history.held.argmax()] - first_counted(history))  # (MET.17)


def unborn(history: History) -> NDArray:
    """Scans (F,) at which the object counted and had not had a track yet."""
    return history.counted & ~np.logical_or.accumulate(history.held)  # (MET.32)


def never_tracked(history: History) -> bool:
    """Whether it was counted for `NEVER_AFTER` and never assigned."""
    counted = np.diff(history.time) @ history.counted[:-1]
    return bool(counted >= NEVER_AFTER - TIME_ROUNDING and not history.held.any())  # (MET.16)


def plain_view_gap(history: History) -> float:
    """Longest time [s] in plain view without an assigned track."""
    return longest(history.time, history.plain & (history.track < 0))  # (MET.18)


def uncovered_gap(history: History) -> float:
    """Longest time [s] in plain view without an assigned track and with no track centre inside its box.

    Shorter than `plain_view_gap` where a track was there with a size or place too wrong to be assigned.
    """
    return longest(history.time, history.plain & (history.track < 0) & ~history.covered)  # (MET.19)
