"""What detections say about their own columns: how many fit one way to read them and not the way that the page says.

Three sources: what stands still (range rates follow from the motion of the sensor), the next scan (places move as
range rates say), and the truth. Equations: docs/methods/plausibility.md.
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from testbed.replay.recording import RecordedFrame
from trackers.geometry import cross, dot, point_velocity, rotation, to_frame, unit, wrap_angle

LAG, LATEST = (0.2, 0.6), 0.8  # [s] to the scan in which a place is looked for again
STRIDE, SLOW = 4.0, 1.0  # [m] way of the sensor until then; [m/s] speed below which it tells nothing
ALONG, ACROSS = 1.0, 2.0  # [m] within which it is the same place
PAIRS, MOST, SCANS = 40, 200, 200  # pairs of scans of a sensor, detections of one, and scans that are looked at
RATE_LEAST, RATE_NEXT, RATE_TRUTH = 0.4, 2.0, 1.0  # [m/s] least tolerance, (RR.9); of the next scan; of a box
BOX = 0.5  # [m] by which the boxes of truth are grown
CELL, SPREAD = 4.0, 10  # [m], and in how many cells what stands must be: one vehicle is not enough
FAR = 1e6  # [m] beyond all ranges


class Reading(NamedTuple):
    """One way to read range, azimuth and range rate."""

    name: str
    fixes: tuple[str, ...] = ()  # options that make it right
    rate: float = 1.0  # factor to m/s
    ground: bool = False  # range rates have the motion of the ego taken out
    side: int = 1  # -1: azimuth turns the other way
    range: float = 1.0  # factor to m


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
        """All detections."""
        rows = [len(f.scan.mask) for f in frames]
        scan, time = np.repeat(np.arange(len(frames)), rows), np.repeat([f.scene.time for f in frames], rows)
        sensor = np.concatenate([np.broadcast_to(f.scan.sensor, f.scan.mask.shape) for f in frames])
        polar, pose, speed, sigma = (
            np.concatenate([np.broadcast_to(getattr(f.scan, n), (len(f.scan.mask), w)) for f in frames])
            for n, w in (("polar", 3), ("pose", 3), ("velocity", 2), ("noise", 3))
        )
        return cls(scan, time, sensor, polar, turned(speed, -pose[:, 2]), pose, sigma)

    def take(self, rows: NDArray) -> Self:
        """Some of them."""
        return type(self)(*(column[rows] for column in self))

    def thinned(self) -> Self:
        """Those of about `SCANS` scans of each sensor, evenly over the recording."""
        keep = np.zeros(len(self.scan), bool)
        for s in np.unique(self.sensor):
            rows = self.sensor == s
            _, number = np.unique(self.scan[rows], return_inverse=True)
            keep[rows] = number % max(1, round((number.max() + 1) / SCANS)) == 0
        return self.take(keep)

    def read(self, how: Reading) -> NDArray:
        """Range [m], azimuth [rad], range rate [m/s] (N, 3) in another reading."""
        a = how.side * self.polar[:, 1]
        rate = how.rate * self.polar[:, 2] - dot(unit(a), self.velocity) * how.ground
        return np.stack([how.range * self.polar[:, 0], a, rate], -1)  # (PLA.1)

    def places(self, how: Reading) -> NDArray:
        """Places (N, 2) [m] in the world in a reading."""
        return self.pose[:, :2] + how.range * self.polar[:, :1] * unit(self.pose[:, 2] + how.side * self.polar[:, 1])

    def over_ground(self, how: Reading) -> tuple[NDArray, NDArray]:
        """Range rates over ground (N,) [m/s] in a reading, and up to which (N,) [m/s] a thing stands."""
        _, a, rate = self.read(how).T
        u = unit(a)
        sigma = np.hypot(self.sigma[:, 2], cross(u, self.velocity) * self.sigma[:, 1])
        return rate + dot(u, self.velocity), np.maximum(RATE_LEAST, 3 * sigma)

    def tally(self, other: NDArray, right: NDArray, tells: NDArray, sensors: int) -> NDArray:
        """Counts (S, 4) of the sensors, from masks (N,) of what two readings explain and what tells them apart.

        What the other alone explains, what the usual one alone explains, what tells: cells of scans, for detections of
        one vehicle in one scan are not independent; and cells of the first at all times.
        """
        xy = np.floor(self.polar[:, :1] * unit(self.polar[:, 1]) / CELL).astype(int) % 2**14
        cell = self.sensor + sensors * (xy[:, 0] + 2**14 * xy[:, 1])
        keys, only = cell + (sensors << 28) * self.scan, tells & other & ~right
        rows = (keys[only], keys[tells & right & ~other], keys[tells], cell[only])
        return np.stack([np.bincount(np.unique(of) % sensors, minlength=sensors) for of in rows], -1)


def turned(v: NDArray, angle: NDArray) -> NDArray:
    """Vectors (N, 2) turned by angles (N,) [rad]."""
    return (rotation(angle) @ v[..., None])[..., 0]


def _joined(low: NDArray, high: NDArray) -> tuple[NDArray, NDArray]:
    """Rows i and j of all pairs with low[i] <= j < high[i]."""
    count = high - low
    i = np.repeat(np.arange(len(low)), count)
    return i, np.arange(len(i)) - np.repeat(np.cumsum(count) - count - low, count)


def standing(seen: Seen, how: Reading) -> tuple[NDArray, NDArray, NDArray]:
    """Which detections (N,) stand in a reading, which in the usual one, and which cannot stand in both."""
    (g, t), (g0, t0) = seen.over_ground(how), seen.over_ground(RIGHT)
    due, due0 = (dot(unit(side * seen.polar[:, 1]), seen.velocity) for side in (how.side, 1))
    column = 0.0 if how.ground else -due / how.rate
    tells = np.abs(column + due0) > t0 + t
    return np.abs(g) < t * abs(how.rate), np.abs(g0) < t0, tells & np.isfinite(g)  # (PLA.2)


class Pairs(NamedTuple):
    """Detections of scans, and of a later scan of the same sensor each."""

    first: Seen  # (N,)
    pair: NDArray  # (N,) int, which pair of scans
    second: Seen  # (M,), of each pair by range
    low: NDArray  # (M,) [m] range and `FAR` times the pair
    tau: NDArray  # (N,) [s] between the two
    turn: NDArray  # (N,) [rad] of the sensor until then
    velocity: NDArray  # (N, 2) [m/s] of the sensor meanwhile, in its first frame
    half: NDArray  # (N,) [rad] half of the field of view of the sensor
    size: NDArray  # (P,) detections of the first scans, of which `first` has some

    @classmethod
    def of(cls, seen: Seen, fov: NDArray, stride: float = STRIDE) -> Self:
        """Pairs evenly over the recording, of S sensors with fields of view (S,) [rad]; 0 for the least time apart."""
        found: list[tuple[NDArray, NDArray]] = []
        for s in np.unique(seen.sensor):
            own = np.flatnonzero(seen.sensor == s)
            _, start = np.unique(seen.scan[own], return_index=True)
            scans, time = np.split(own, start[1:]), seen.time[own[start]]
            speed = np.hypot(*seen.velocity[own[start]].T)
            lag = np.where(speed > SLOW, np.clip(stride / np.maximum(speed, SLOW), *LAG), LAG[0])
            then = np.searchsorted(time, time + lag)
            can = np.flatnonzero(np.append(time, np.inf)[then] <= time + LATEST)
            found += [(scans[k], scans[then[k]]) for k in can[:: max(1, len(can) // PAIRS)]]
        size = np.array([len(a) for a, _ in found], int)
        some = [a[:: max(1, len(a) // MOST)] for a, _ in found]
        rows, later = (np.concatenate([np.zeros(0, int), *part]) for part in (some, [b for _, b in found]))
        pair, of = (np.repeat(np.arange(len(found)), [len(p) for p in part]) for part in (some, [b for _, b in found]))
        low = FAR * of + seen.polar[later, 0]
        order = np.argsort(low, kind="stable")
        a, b = seen.take(rows), seen.take(np.array([b[0] for _, b in found], int)[pair])
        turn = wrap_angle(b.pose[:, 2] - a.pose[:, 2])
        v = (a.velocity + turned(b.velocity, turn)) / 2
        return cls(a, pair, seen.take(later[order]), low[order], b.time - a.time, turn, v, fov[a.sensor] / 2, size)

    def again(self, how: Reading) -> tuple[NDArray, NDArray, NDArray]:
        """Places (N, 2) [m], as read today, where the detections are due in the second scan, and which (N,) are there.

        What moves may turn with the sensor, or not. Last which (N,) are due in sight even if they move along the road.
        """
        due, still, aside = self._due(how)
        far, towards = np.hypot(*due.T), np.arctan2(due[:, 1], due[:, 0])
        wide = np.where(aside**2 < ALONG * far, aside, 0.0)  # else it cannot be said where it is
        further = wide**2 / np.maximum(2 * far, ALONG)  # what moves aside is further away then
        at = FAR * self.pair + far
        i, j = _joined(*(np.searchsorted(self.low, at + d) for d in (-ALONG, ALONG + further)))
        across = far[i] * np.abs(wrap_angle(self.second.polar[j, 1] - towards[i]))
        room = ACROSS + wide + np.where(still, 0.0, self.first.polar[:, 0] * np.abs(self.turn))
        before, later = (dot(unit(how.side * a), v) for a, v in ((self.first.polar[:, 1], self.velocity),
                         (towards, turned(self.velocity, -self.turn))))  # fmt: skip
        change = np.where(still & (not how.ground), (before - later) / how.rate, 0.0)
        off = np.abs(self.first.polar[i, 2] + change[i] - self.second.polar[j, 2])
        near = (across < room[i]) & ~(off > RATE_NEXT)  # a rate that is not given is like all
        sure = (aside**2 < ALONG * far) & (np.abs(towards) + aside / np.maximum(far, ALONG) < self.half)
        return due, np.bincount(i[near], minlength=len(due)) > 0, sure

    def _due(self, how: Reading) -> tuple[NDArray, NDArray, NDArray]:
        """Places (N, 2) [m] as in `again`, what stands (N,), and how far (N,) [m] from there what moves may be, across.

        That is if it moves along the way of the sensor; range rates do not say it.
        """
        r, azimuth, rate = self.first.read(how).T
        u, (g, t) = unit(azimuth), self.first.over_ground(how)
        still = ~(np.abs(g) >= t * abs(how.rate))  # also what has no range rate
        xy = r[:, None] * u + self.tau[:, None] * np.where(still[:, None], -self.velocity, rate[:, None] * u)
        tan = cross(u, self.velocity) / np.maximum(np.abs(dot(u, self.velocity)), 1e-6)
        aside = np.abs(np.where(still, 0.0, rate * self.tau * tan))
        return turned(xy, -self.turn) / how.range * [1, how.side], still, aside  # (PLA.3)

    def counts(self, how: Reading, usual: tuple[NDArray, ...], sensors: int) -> NDArray:
        """Counts (2, S, 4) of what is found again where one of two readings alone says; `usual` is that of `RIGHT`.

        First of what moves in both, then of what would stand in the other reading alone.
        """
        (due0, there0, sure0), (due, there, sure), u = usual, self.again(how), unit(self.first.polar[:, 1])
        still, still0, tells = standing(self.first, how)
        apart = (np.abs(dot(due - due0, u)) > 2 * ALONG) | (np.abs(cross(u, due - due0)) > 2 * ACROSS)
        apart &= sure & sure0
        mirrors = how.fixes == ("azimuth=mirrored",)  # what moves may turn either way, and a vehicle that crosses too
        free = ~tells & still & still0 if mirrors else ~still & ~still0
        moving = self.first.tally(there, there0, apart & free, sensors)
        claimed = self.first.tally(there, there0, apart & still & ~still0 & tells, sensors)
        return np.stack([moving, claimed])


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

    def at(self, scan: NDArray) -> tuple[NDArray, NDArray]:
        """All pairs of scans (N,) and boxes at them, as rows of both."""
        return _joined(*(np.searchsorted(self.scan, scan + k) for k in (0, 1)))

    def hits(self, seen: Seen, how: Reading) -> tuple[NDArray, NDArray]:
        """All pairs of detections and boxes in which these lie in a reading, as rows of both."""
        xy = seen.places(how)
        i, b = self.at(seen.scan)
        near = np.abs(xy[i, 0] - self.pose[b, 0]) <= np.hypot(*self.size.T)[b] / 2 + 2 * BOX  # most are not
        i, b = i[near], b[near]
        inside = (np.abs(to_frame(self.pose[b], xy[i, None])[:, 0]) <= self.size[b] / 2 + BOX).all(-1)
        return i[inside], b[inside]

    def due(self, seen: Seen, how: Reading) -> NDArray:
        """Range rates (N,) [m/s] of the boxes in which the detections lie in a reading, NaN outside of all."""
        (i, b), due, a = self.hits(seen, how), np.full(len(seen.scan), np.nan), how.side * seen.polar[:, 1]
        v = point_velocity(self.velocity[b], self.yaw_rate[b], seen.places(how)[i] - self.pose[b, :2])
        due[i] = dot(v, unit(seen.pose[:, 2] + a)[i]) - dot(unit(a), seen.velocity)[i]
        return due


def explained(seen: Seen, how: Reading, due: NDArray) -> NDArray:
    """Which detections (N,) of boxes with range rates `due` (N,) [m/s] have these, or none, in a reading."""
    return np.isfinite(due) & ~(np.abs(seen.read(how)[:, 2] - due) > RATE_TRUTH)
