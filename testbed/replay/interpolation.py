"""States of vehicles between the times at which they are known, linearly; at these times to the last bit.

And the vehicle that carries the sensors at the times of scans.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.scene import Ego
from testbed.replay.loaded import Loaded
from trackers.geometry import box_corners, unit, wrap_angle

GAP = 0.5  # [s] between two rows of the ego that are interpolated
SIZE = (4.7, 1.9)  # [m] of the ego where the table has none
HELD = 0.01  # [s] for which the first and the last state stand for times before and after


class Between(NamedTuple):
    """K times, each between two of N rows."""

    first: NDArray  # (K,) int
    second: NDArray  # (K,) int
    share: NDArray  # (K,) of the way from the first to the second
    known: NDArray  # (K,) bool: both are near enough

    def of(self, value: NDArray) -> NDArray:
        """Values (K, ...) of a column (N, ...)."""
        a, b = value[self.first], value[self.second]
        share = self.share.reshape(-1, *(1,) * (value.ndim - 1))
        return np.where(share == 0, a, a + share * (b - a))

    def angle(self, value: NDArray) -> NDArray:
        """The same for angles (N,) [rad], the shorter way round."""
        a, b = value[self.first], value[self.second]
        return np.where(self.share == 0, a, a + self.share * wrap_angle(b - a))


def between(times: NDArray, at: NDArray, longest: float) -> Between:
    """Where the times `at` (K,) [s] lie among the growing `times` (N,) [s], N at least 1.

    Known are times between two rows at most `longest` [s] apart, and those up to `HELD` before the first or after the
    last row.
    """
    last = len(times) - 1
    first = np.clip(np.searchsorted(times, at, "right") - 1, 0, last)
    exact = times[first] == at
    second = np.where(exact, first, np.minimum(first + 1, last))
    gap = times[second] - times[first]
    share = np.where(gap > 0, (at - times[first]) / np.where(gap > 0, gap, 1.0), 0.0)
    outside = (at < times[0]) | (at > times[-1])
    off = np.maximum(times[0] - at, at - times[-1])
    known = np.where(outside, off <= HELD, gap <= longest)
    return Between(first, np.where(outside, first, second), np.where(outside, 0.0, share), known)


def check_motion(table: Loaded) -> None:
    """Raise ValueError, in one sentence, for a row without a speed and without both components of a velocity."""
    speed, vx, vy = (table.numbers(name, np.nan) for name in ("speed", "vx", "vy"))
    absent = np.isnan(speed) & (np.isnan(vx) | np.isnan(vy))
    table.check("speed", absent, lambda row: "there is neither a speed nor vx and vy", "give one of them in m/s")


def velocities(table: Loaded, where: Between, heading: NDArray) -> NDArray:
    """Velocity (K, 2) [m/s]: the components of the table, or its speed along the heading (K,) [rad]."""
    vx, vy, speed = (where.of(table.numbers(name, np.nan)) for name in ("vx", "vy", "speed"))
    given = np.stack([vx, vy], -1)
    return np.where(np.isnan(given).any(-1, keepdims=True), speed[:, None] * unit(heading), given)


def egos(table: Loaded, times: NDArray) -> list[Ego]:
    """The ego at each of the times (F,) [s].

    Raises:
        ValueError: its times do not grow, or there is none near enough to one of the times; in one sentence.
    """
    if not table.rows:
        raise ValueError(f"{table.file} has no row; give the vehicle at the times of the scans, also where it stands")
    check_motion(table)
    table.check_sorted(once=True)
    where = between(table["time"], times, GAP)
    if not where.known.all():
        at = times[~where.known][0]
        what = f"the scan at {at} s is not between two rows at most {GAP} s apart, this is the nearest"
        remedy = "give the ego at these times, or leave the scans out with --from and --to"
        raise table.fault("time", int(np.abs(table["time"] - at).argmin()), what, remedy)
    heading, rate = where.angle(table["heading"]), where.of(table["yaw_rate"])
    pose = np.stack([where.of(table["x"]), where.of(table["y"]), heading], -1)
    velocity = velocities(table, where, heading)
    size = np.stack([table.numbers(n, d)[where.first] for n, d in zip(("length", "width"), SIZE, strict=True)], -1)
    corners = box_corners(pose, size)
    return [Ego(pose[k], velocity[k], float(rate[k]), size[k], corners[k]) for k in range(len(times))]
