"""The detections of a recording as scans: what each sensor measured and delivered, and when.

A sensor without a detection at a time has delivered nothing then, unless the table scans has a scan of it, which then
was empty.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.origin import KINDS
from sensors.reflections import Mounted
from testbed.replay.loaded import Loaded
from testbed.replay.sensor_sheets import SensorSheets
from trackers.geometry import unit
from trackers.scan import Scan
from trackers.validation import MAX_STEP

MOST_AT_ONCE = 20_000  # detections of one time; more take trackers minutes a scan
FASTER, SLOWER = 3.0, 100.0  # how much more, and how much less often than its rate a sensor may deliver


class Scans(NamedTuple):
    """N detections at F times."""

    times: NDArray  # (F,) [s] as in the table
    bounds: NDArray  # (F + 1,) int, the detections of each time
    delivered: NDArray  # (F, S) bool
    sensor: NDArray  # (N,) int
    polar: NDArray  # (N, 3) range [m], azimuth [rad], range rate [m/s]
    object: NDArray  # (N,) text, id of an object of truth; empty: not said
    kind: NDArray  # (N,) int, index into KINDS, -1: not said
    over_ground: NDArray  # (S,) bool: range rates have the motion of the sensor taken out

    def scan(self, f: int, sensors: SensorSheets, platform: NDArray) -> Scan:
        """The scan at time f, of sensors on a platform (6,)."""
        rows = slice(self.bounds[f], self.bounds[f + 1])
        s = self.sensor[rows]
        pose, velocity = Mounted.on(platform, sensors.mount)
        polar = self.polar[rows]
        if self.over_ground.any():
            own = (unit(polar[:, 1] + pose[s, 2]) * velocity[s]).sum(-1)
            polar = polar - np.stack([0 * own, 0 * own, np.where(self.over_ground[s], own, 0.0)], -1)
        return Scan(
            polar, np.ones(len(s), bool), pose[s], velocity[s], sensors.sigma[s], s, platform,
            self.delivered[f],
        )  # fmt: skip


def scans_of(
    detections: Loaded, listed: Loaded | None, sensors: SensorSheets, over_ground: Sequence[str] = ()
) -> Scans:
    """The scans in the table of detections and, if there is one, in that of scans.

    `over_ground` names the sensors whose range rates have their motion taken out; an empty name is all of them.

    Raises ValueError, in one sentence, where times are not sorted, too far apart, or do not fit the rates.
    """
    for table in (detections, listed):
        if table is not None:
            table.check_sorted()
    sensor, time = sensors.rows_of(detections), detections["time"]
    also = np.zeros(0) if listed is None else listed["time"]
    times = np.union1d(time, also)
    if not len(times):
        raise ValueError(f"{detections.file} has no row; give detections, or empty scans in a table scans")
    delivered = np.zeros((len(times), len(sensors.names)), bool)
    delivered[np.searchsorted(times, time), sensor] = True
    if listed is not None:
        delivered[np.searchsorted(times, also), sensors.rows_of(listed)] = True
    bounds = np.append(np.searchsorted(time, times), len(time))
    _check_crowd(detections, times, bounds)
    _check_steps(detections, listed, times)
    _check_rates(detections, sensors, times, delivered)
    of = detections.texts("object")
    ground = np.array(["" in over_ground or name in over_ground for name in sensors.names], bool)
    return Scans(times, bounds, delivered, sensor, _polar(detections), of, _kinds(detections), ground)


def _check_crowd(table: Loaded, times: NDArray, bounds: NDArray) -> None:
    """No scan has more detections than trackers can take."""
    count = np.diff(bounds)
    if count.max() > MOST_AT_ONCE:
        f = int(count.argmax())
        what = f"{count[f]} detections have the time {times[f]} s, the most is {MOST_AT_ONCE}"
        raise table.fault("time", int(bounds[f]), what, "give each scan its time, or thin it out")


def _check_steps(table: Loaded, listed: Loaded | None, times: NDArray) -> None:
    """No gap between two scans is longer than a tracker can bridge."""
    long = np.append(False, np.diff(times) > MAX_STEP)
    if long.any():
        after = times[long.argmax()]
        place = table if after in table["time"] or listed is None else listed
        what = f"no scan is within {MAX_STEP:g} s before {after} s"
        remedy = "times are in seconds, not in milliseconds; split a recording with pauses"
        raise place.fault("time", int(np.searchsorted(place["time"], after)), what, remedy)


def _check_rates(table: Loaded, sensors: SensorSheets, times: NDArray, delivered: NDArray) -> None:
    """Each sensor delivers about as often as its rate says."""
    for s in np.flatnonzero(~np.isnan(sensors.rate)):
        own = times[delivered[:, s]]
        period = float(np.median(np.diff(own))) if len(own) > 2 else 1 / sensors.rate[s]
        if not 1 / FASTER <= period * sensors.rate[s] <= SLOWER:
            what = f"{sensors.names[s]} has a scan every {period:g} s, but a rate of {sensors.rate[s]:g} a second"
            remedy = "times are in seconds, one for all detections of a scan; or correct the rate"
            row = min(int(np.searchsorted(table["time"], own[1])), table.rows - 1)
            raise table.fault("time", row, what, remedy)


def _polar(table: Loaded) -> NDArray:
    """Range [m], azimuth [rad] and range rate [m/s], (N, 3), of these or of x and y."""
    r, a, x, y, rate = (table.numbers(name, np.nan) for name in ("range", "azimuth", "x", "y", "range_rate"))
    absent = np.isnan(r) | np.isnan(a)
    r, a = np.where(absent, np.hypot(x, y), r), np.where(absent, np.arctan2(y, x), a)
    table.check("range", np.isnan(r), lambda row: "there is neither range and azimuth nor x and y", "give one pair")
    return np.stack([r, a, rate], -1)


def _kinds(table: Loaded) -> NDArray:
    names, of = np.unique(table.texts("kind"), return_inverse=True)
    known = np.array([KINDS.index(name) if name in KINDS else -1 if not name else -2 for name in names.tolist()], int)
    kind = known[of]
    wrong = f"choose one of {', '.join(KINDS)}, or none"
    table.check("kind", kind == -2, lambda row: f"there is no kind {str(table['kind'][row])!r}", wrong)
    return kind
