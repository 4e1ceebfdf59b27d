"""The vehicle that carries the sensors, at the times of scans, from its table."""

import numpy as np
from numpy.typing import NDArray

from sensors.scene import Ego
from testbed.replay.interpolation import between, check_motion, velocities
from testbed.replay.tables import Loaded
from trackers.geometry import box_corners, unit

GAP = 0.5  # [s] between two rows that are interpolated
SIZE = (4.7, 1.9)  # [m] where the table has none
SECOND = 1.0  # [s] over which places and velocities are compared, less where a recording is shorter
DRIVING = 5.0  # [m/s] below which the noise of places may be more than the way
APART = 0.5  # share of the way that both may differ by: odometers are better, km/h and standing places are not
OFTEN = 0.1  # share of the rows that must be of a vehicle that drives


def egos(table: Loaded, times: NDArray) -> list[Ego]:
    """The ego at each of the times (F,) [s].

    Raises:
        ValueError: its times do not grow, there is none near enough to one of the times, or its places do not move as
            its velocities say; in one sentence.
    """
    if not table.rows:
        raise ValueError(f"{table.file} has no row; give the vehicle at the times of the scans, also where it stands")
    check_motion(table)
    table.check_sorted(once=True)
    _check_way(table)
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


def _check_way(table: Loaded) -> None:
    """Raise the error about places that do not move as speed and heading say: another unit, sign or frame."""
    time = table["time"]
    last = len(time) - 1
    length = min(SECOND, time[last] - time[0])
    start = np.flatnonzero(time + length <= time[last])
    end = np.searchsorted(time, time[start] + length)
    ahead = unit(table["heading"])
    velocity = velocities(table, between(time, time, GAP), table["heading"])
    velocity = (velocity * ahead).sum(-1, keepdims=True) * ahead  # a vehicle has no speed across its heading
    step = np.diff(time, prepend=time[0])
    driven = np.cumsum(step[:, None] * (velocity + np.roll(velocity, 1, 0)) / 2, axis=0)
    paused = np.cumsum(step > GAP)  # nothing is known of a gap
    places = np.stack([table["x"], table["y"]], -1)
    moved, said = (np.hypot(*(way[end] - way[start]).T) for way in (places, driven))
    off = np.hypot(*(places[end] - places[start] - driven[end] + driven[start]).T)
    way = np.maximum(moved, said)
    drives = (way > DRIVING * length) & (paused[end] == paused[start])
    if length > 0 and drives.mean() > OFTEN and np.median(off[drives] / way[drives]) > APART:
        k = int(np.argmax(drives & (off > APART * way)))
        ways = f"x and y go {moved[k]:.1f} m, velocity and heading {said[k]:.1f} m, {off[k]:.1f} m apart"
        remedy = "places are in metres in a frame that stands, speeds in m/s, headings in radians from x towards y"
        raise table.fault("x", int(start[k]), f"in {length:g} s from here {ways}", remedy)
