"""The vehicle that carries the sensors, at the times of scans, from its table."""

import numpy as np
from numpy.typing import NDArray

from sensors.scene import Ego
from testbed.replay.interpolation import between, check_motion, velocities
from testbed.replay.loaded import Loaded
from trackers.geometry import box_corners

GAP = 0.5  # [s] between two rows that are interpolated
SIZE = (4.7, 1.9)  # [m] where the table has none


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
