"""What detections say about their own columns: how many fit one way to read them and not the way that the page says.

Three sources, each with counts that can be compared: what stands still (its range rates follow from the motion of the
sensor), the next scan (places move as range rates say), and the truth. Equations: docs/methods/plausibility.md.
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from testbed.replay.recording import RecordedFrame
from trackers.geometry import cross, point_velocity, rotation, to_frame, unit, wrap_angle

LAG = (0.2, 0.6)  # [s] to the scan in which a place is looked for again
ALONG, ACROSS = 1.0, 2.0  # [m] within which it is the same place
PAIRS, MOST, SCANS = 40, 200, 200  # pairs of scans of a sensor, detections of one, and scans that are looked at
RATE_LEAST = 0.4  # [m/s] least tolerance of a range rate, as in (RR.9)
BOX = 0.5  # [m] by which the boxes of truth are grown
RATE_NEXT = 2.0  # [m/s] by which the range rate of one place may change between two scans
RATE_TRUTH = 1.0  # [m/s] within which a range rate is that of the box


class Reading(NamedTuple):
    """One way to read range, azimuth and range rate."""

    name: str
    fixes: tuple[str, ...] = ()  # options that make it right
    rate: float = 1.0  # factor to m/s
    ground: bool = False  # range rates have the motion of the ego taken out
    side: int = 1  # -1: azimuth turns the other way
    range: float = 1.0  # factor to m

    @property
    def mirrors(self) -> bool:
        """Whether it changes nothing but the side."""
        return self.side < 0 and self == Reading(self.name, self.fixes, side=-1)


RIGHT = Reading("right")


class Seen(NamedTuple):
    """N detections, in the frames of their sensors."""

    scan: NDArray  # (N,) int
    time: NDArray  # (N,) [s]
    sensor: NDArray  # (N,) int
    polar: NDArray  # (N, 3) range [m], azimuth [rad], range rate [m/s] as they are read today
    velocity: NDArray  # (N, 2) [m/s] of the sensor, in its own frame
    pose: NDArray  # (N, 3) of the sensor
    sigma: NDArray  # (N, 3)

    @classmethod
    def of(cls, frames: Sequence[RecordedFrame]) -> Self:
        """All detections of scans whose sensors have what `Scan` says of them."""
        rows = [len(f.scan.mask) for f in frames]
        scan, time = np.repeat(np.arange(len(frames)), rows), np.repeat([f.scene.time for f in frames], rows)
        wide = [np.broadcast_arrays(f.scan.sensor, f.scan.mask)[0] for f in frames]
        polar, pose, speed, sigma = (
            np.concatenate([np.broadcast_to(getattr(f.scan, n), (len(f.scan.mask), w)) for f in frames])
            for n, w in (("polar", 3), ("pose", 3), ("velocity", 2), ("noise", 3))
        )
        own = (rotation(-pose[:, 2]) @ speed[..., None])[..., 0]
        return cls(scan, time, np.concatenate(wide), polar, own, pose, sigma)

    def take(self, rows: NDArray) -> Self:
        """Some of them."""
        return type(self)(*(column[rows] for column in self))

    def of_sensor(self, s: int) -> Self:
        """Those of one sensor, of scans evenly over the recording."""
        own = self.take(self.sensor == s)
        _, number = np.unique(own.scan, return_inverse=True)
        return own.take(number % max(1, round((number.max() + 1) / SCANS)) == 0)

    @property
    def xy(self) -> NDArray:
        """Places (N, 2) [m] in the frames of the sensors."""
        return self.polar[:, :1] * unit(self.polar[:, 1])

    def read(self, how: Reading) -> NDArray:
        """Range [m], azimuth [rad], range rate [m/s] (N, 3) in another reading."""
        r, a, rate = self.polar.T
        a = how.side * a
        rate = how.rate * rate - (unit(a) * self.velocity).sum(-1) * how.ground
        return np.stack([how.range * r, a, rate], -1)  # (PLA.1)

    def over_ground(self, how: Reading) -> tuple[NDArray, NDArray]:
        """Range rates over ground (N,) [m/s] in a reading, and up to which (N,) [m/s] a thing stands."""
        _, a, rate = self.read(how).T
        u = unit(a)
        across = cross(u, self.velocity) * self.sigma[:, 1]
        return rate + (u * self.velocity).sum(-1), np.maximum(RATE_LEAST, 3 * np.hypot(self.sigma[:, 2], across))


class Counts(NamedTuple):
    """Detections that only one of two readings explains, and all that tell the two apart."""

    other: int
    right: int
    all: int
    spread: int  # cells around the sensor that have one of the other reading


NONE = Counts(0, 0, 0, 0)
CELL, SPREAD = 4.0, 10  # [m], and how many that what stands must be in


def _count(xy: NDArray, other: NDArray, right: NDArray, tells: NDArray) -> Counts:
    only = tells & other & ~right
    cells = np.unique(np.floor(xy[only] / CELL), axis=0)
    return Counts(int(only.sum()), int((tells & right & ~other).sum()), int(tells.sum()), len(cells))


def fits(seen: Seen, how: Reading) -> tuple[NDArray, NDArray, NDArray]:
    """Which detections (N,) stand in a reading, which in the usual one, and which cannot stand in both."""
    (g, t), (g0, t0) = seen.over_ground(how), seen.over_ground(RIGHT)
    scale = abs(how.rate) or 1.0  # errors of the column become smaller with it
    due, due0 = ((unit(side * seen.polar[:, 1]) * seen.velocity).sum(-1) for side in (how.side, 1))
    column = 0.0 * due if how.ground or not how.rate else -due / how.rate
    tells = np.abs(column + due0) > t0 + t
    return np.abs(g) < t * scale, np.abs(g0) < t0, tells & np.isfinite(g)  # (PLA.2)


def standing(seen: Seen, how: Reading) -> Counts:
    """Detections whose range rates are those of standing things in one of two readings alone."""
    return _count(seen.xy, *fits(seen, how))


class Step(NamedTuple):
    """Detections of one scan of a sensor, and those of a later one."""

    first: Seen
    second: Seen


def steps(seen: Seen) -> list[Step]:
    """Pairs of scans of each sensor, evenly over the recording; of each some detections."""
    found = []
    for s in np.unique(seen.sensor):
        own = seen.take(seen.sensor == s)
        scans, start = np.unique(own.scan, return_index=True)
        bounds, time = np.append(start, len(own.scan)), own.time[start]
        then = np.searchsorted(time, time + LAG[0])
        can = np.flatnonzero((then < len(time)) & (time[np.minimum(then, len(time) - 1)] <= time + LAG[1]))
        for k in can[:: max(1, len(can) // PAIRS)]:
            rows = np.arange(bounds[k], bounds[k + 1])
            rows = rows[:: max(1, len(rows) // MOST)]
            found.append(Step(own.take(rows), own.take(np.arange(bounds[then[k]], bounds[then[k] + 1]))))
    return found


def _moved(step: Step, how: Reading) -> tuple[NDArray, NDArray]:
    """Places (N, 2) [m], as they are read today, at which the detections of the first scan are due in the second.

    And how far across (N,) [m] they may be from there: what moves may turn with the sensor, or not.
    """
    a, b = step
    r, azimuth, rate = a.read(how).T
    u, tau = unit(azimuth), b.time[0] - a.time[0]
    g, t = a.over_ground(how)
    still = np.abs(g) < t * abs(how.rate) if np.isfinite(rate).any() else np.ones(len(r), bool)
    v = (a.velocity[0] + rotation(wrap_angle(b.pose[0, 2] - a.pose[0, 2])) @ b.velocity[0]) / 2
    xy = r[:, None] * u + tau * np.where(still[:, None], -v, rate[:, None] * u)
    turn = wrap_angle(a.pose[0, 2] - b.pose[0, 2])
    xy = (rotation(turn) @ xy[..., None])[..., 0] / how.range  # (PLA.3)
    return xy * [1, how.side], ACROSS + np.where(still, 0.0, a.polar[:, 0] * abs(turn))


def _there(step: Step, due: NDArray, room: NDArray) -> NDArray:
    """Which (N,) places have a detection in the second scan so far across, with a like range rate."""
    a, b = step
    far, towards = np.hypot(*due.T), np.arctan2(due[:, 1], due[:, 0])
    i, j = np.nonzero(np.abs(far[:, None] - b.polar[:, 0]) < ALONG)
    across = far[i] * np.abs(wrap_angle(b.polar[j, 1] - towards[i]))
    near = (across < room[i]) & ~(
        np.abs(a.polar[i, 2] - b.polar[j, 2]) > RATE_NEXT
    )  # a rate that is not given is like all
    return np.bincount(i[near], minlength=len(due)) > 0


def continuity(pairs: list[Step], how: Reading, base: list[tuple[NDArray, NDArray]]) -> tuple[Counts, Counts]:
    """Detections that are found again where one of two readings alone says.

    First of those that move in both, then of those that would stand in the other reading alone. `base` is `base_of`.
    """
    parts = []
    for step, (due0, there0) in zip(pairs, base, strict=True):
        (due, room), (still, still0, tells) = _moved(step, how), fits(step.first, how)
        d, u = due - due0, unit(step.first.polar[:, 1])
        apart = (np.abs((d * u).sum(-1)) > 2 * ALONG) | (np.abs(cross(u, d)) > 2 * ACROSS)
        apart &= np.isfinite(due).all(-1) & np.isfinite(due0).all(-1)
        free = ~tells & still & still0 if how.mirrors else ~still & ~still0  # a mover may turn either way
        parts.append((step.first.xy, _there(step, due, room), there0, apart & free, apart & still & ~still0 & tells))
    if not parts:
        return NONE, NONE
    xy, other, right, moving, claimed = map(np.concatenate, zip(*parts, strict=True))
    found = _count(xy, other, right, moving)
    if how.mirrors and found.spread < SPREAD:  # a vehicle that crosses seems to stand
        found = found._replace(other=0)
    return found, _count(xy, other, right, claimed)


def base_of(pairs: list[Step]) -> list[tuple[NDArray, NDArray]]:
    """Where the detections of the first scans are due in the second, and whether there is one."""
    return [(due, _there(step, due, room)) for step in pairs for due, room in [_moved(step, RIGHT)]]


class Boxed(NamedTuple):
    """B boxes of truth at the scans of detections."""

    scan: NDArray  # (B,) int
    pose: NDArray  # (B, 3)
    size: NDArray  # (B, 2) [m]
    velocity: NDArray  # (B, 2) [m/s]
    yaw_rate: NDArray  # (B,) [rad/s]

    @classmethod
    def of(cls, frames: Sequence[RecordedFrame]) -> Self:
        """All of a recording."""
        objects = [f.scene.objects for f in frames]
        scan = np.repeat(np.arange(len(frames)), [len(o.id) for o in objects])
        return cls(scan, *(np.concatenate([getattr(o, n) for o in objects]) for n in cls._fields[1:]))


def in_boxes(seen: Seen, boxes: Boxed, how: Reading) -> tuple[NDArray, NDArray]:
    """Whether each detection (N,) lies in a box of truth in a reading, and its range rate (N,) [m/s] if so."""
    r, a, _ = seen.read(how).T
    u = unit(seen.pose[:, 2] + a)
    xy, rate = seen.pose[:, :2] + r[:, None] * u, np.full(len(r), np.nan)
    bounds = np.searchsorted(seen.scan, [boxes.scan, boxes.scan + 1])
    for b in np.flatnonzero(bounds[1] > bounds[0]):
        rows = slice(*bounds[:, b])
        inside = (np.abs(to_frame(boxes.pose[b], xy[rows])) <= boxes.size[b] / 2 + BOX).all(-1)
        v = point_velocity(boxes.velocity[b], boxes.yaw_rate[b], xy[rows] - boxes.pose[b, :2])
        rate[rows] = np.where(inside, (v * u[rows]).sum(-1), rate[rows])
    own = (unit(a) * seen.velocity).sum(-1)
    return np.isfinite(rate), rate - own


def truth(seen: Seen, how: Reading, right: tuple[NDArray, NDArray], other: tuple[NDArray, NDArray]) -> Counts:
    """Detections that one of two readings alone puts into a box of truth with its range rate.

    `right` and `other` are `in_boxes` of both.
    """
    (inside0, due0), (inside, due) = right, other
    fit, fit0 = (
        at & ~(np.abs(seen.read(h)[:, 2] - rate) > RATE_TRUTH)  # a rate that is not given fits
        for h, at, rate in ((how, inside, due), (RIGHT, inside0, due0))
    )
    return _count(seen.xy, fit, fit0, inside | inside0)
