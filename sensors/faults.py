"""Faults of mounted radars: what a healthy rig has measured, turned into what a faulty one delivers.

A fault never touches the healthy radar, its generator, or the detections of other sensors. Equations:
docs/methods/radar-faults.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite, isnan
from typing import Protocol
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from sensors.origin import CLUTTER, GHOSTS, Origin
from sensors.returns import false_alarms
from sensors.scene import Scene
from trackers.geometry import point_velocity, unit, wrap_angle
from trackers.scan import Scan, SensorModel

FAULT_STREAM = 4  # spawn key of the seed of a run; others: docs/random-streams.md
EVERYWHERE = "surround"
PLACES = (EVERYWHERE, "front", "rear", "corners", "left", "right")
AHEAD = np.radians(30.0)  # [rad] a sensor within this of the heading of the car looks to the front
CAUSES = ("rain", "dirt")


class Fault(Protocol):
    """What can be wrong with some of the sensors for some time; `str` of it is its text, which seeds its stream."""

    @property
    def sensors(self) -> str:
        """Which sensors, see `chosen`."""

    @property
    def start(self) -> float:
        """When it begins [s]."""

    @property
    def end(self) -> float:
        """From when on it is over [s]."""

    def apply(
        self, scene: Scene, scan: Scan, origin: Origin, on: NDArray, models: Sequence[SensorModel],
        rng: np.random.Generator,
    ) -> tuple[Scan, Origin]:  # fmt: skip
        """The scan and its origin with the fault in the sensors of the mask `on` (S,)."""


@dataclass(frozen=True)
class Outage:
    """Sensors deliver no scan at all, and trackers see that."""

    start: float  # [s]
    end: float  # [s]
    sensors: str = EVERYWHERE

    def __post_init__(self) -> None:
        check_window(self)

    def __str__(self) -> str:
        return spell("outage", self.sensors, self.start, self.end)

    def apply(
        self, scene: Scene, scan: Scan, origin: Origin, on: NDArray, models: Sequence[SensorModel],
        rng: np.random.Generator,
    ) -> tuple[Scan, Origin]:  # fmt: skip
        """Without their detections, and not delivered."""
        return without_sensors(scan, origin, on)


@dataclass(frozen=True)
class Dropout:
    """Scans of single sensors are lost now and then, each with the same probability."""

    share: float  # of the scans of a sensor
    sensors: str = EVERYWHERE
    start: float = 0.0  # [s]
    end: float = inf  # [s]

    def __post_init__(self) -> None:
        check_share(self, self.share)
        check_window(self)

    def __str__(self) -> str:
        return spell("drop", self.sensors, self.share, *window(self))

    def apply(
        self, scene: Scene, scan: Scan, origin: Origin, on: NDArray, models: Sequence[SensorModel],
        rng: np.random.Generator,
    ) -> tuple[Scan, Origin]:  # fmt: skip
        """Without the lost scans, which are not delivered."""
        return without_sensors(scan, origin, on & (rng.random(len(on)) < self.share))  # (FLT.1)


@dataclass(frozen=True)
class Misalignment:
    """Sensors are turned in their mounts by an angle that nobody knows, from x towards y."""

    yaw_deg: float
    sensors: str = EVERYWHERE
    start: float = 0.0  # [s]
    end: float = inf  # [s]

    def __post_init__(self) -> None:
        if not abs(self.yaw_deg) <= 90:
            raise ValueError(f"fault yaw: the angle must be within -90 and 90 degrees, got {self.yaw_deg}")
        check_window(self)

    def __str__(self) -> str:
        return spell("yaw", self.sensors, self.yaw_deg, *window(self))

    def apply(
        self, scene: Scene, scan: Scan, origin: Origin, on: NDArray, models: Sequence[SensorModel],
        rng: np.random.Generator,
    ) -> tuple[Scan, Origin]:  # fmt: skip
        """With azimuths in the frames of the turned sensors, within their fields of view; false alarms stay."""
        turned = on[scan.sensor] & (origin.kind != CLUTTER)
        before = scan.polar[:, 1]
        azimuth = np.where(turned, wrap_angle(before - np.radians(self.yaw_deg)), before)  # (FLT.2)
        half = np.array([model.fov for model in models])[scan.sensor] / 2
        outside = (half < np.pi) & (np.abs(azimuth) > half) & (np.abs(azimuth) > np.abs(before))
        polar = np.column_stack([scan.polar[:, 0], azimuth, scan.polar[:, 2]])
        return keep(scan._replace(polar=polar), origin, ~outside)


@dataclass(frozen=True)
class ClockOffset:
    """Sensors measured some time before the time on their scans, negative: after it."""

    seconds: float
    sensors: str = EVERYWHERE
    start: float = 0.0  # [s]
    end: float = inf  # [s]

    def __post_init__(self) -> None:
        if not abs(self.seconds) <= 1:
            raise ValueError(f"fault clock: the offset must be within -1 and 1 s, got {self.seconds}")
        check_window(self)

    def __str__(self) -> str:
        return spell("clock", self.sensors, self.seconds, *window(self))

    def apply(
        self, scene: Scene, scan: Scan, origin: Origin, on: NDArray, models: Sequence[SensorModel],
        rng: np.random.Generator,
    ) -> tuple[Scan, Origin]:  # fmt: skip
        """Detections where they were, from where the sensor was, moved with constant velocity and yaw rate."""
        late, tau, bodies = on[scan.sensor] & (origin.kind != CLUTTER), self.seconds, scene.bodies
        ghost = np.isin(origin.kind, GHOSTS)  # only the motion along the line of sight is known of what it shows
        point, carried = scan.xy, origin.body >= 0
        body = origin.body[carried]
        velocity = np.zeros_like(point)
        velocity[carried] = point_velocity(
            bodies.velocity[body], bodies.yaw_rate[body], point[carried] - bodies.pose[body, :2]
        )
        sight = point - scan.pose[:, :2] - tau * (velocity - scan.velocity)  # (FLT.3)
        bearing = np.arctan2(sight[:, 1], sight[:, 0])
        heading = scan.pose[:, 2] - tau * scan.platform[5]  # (FLT.4)
        turn = unit(bearing) - scan.sight
        rate = scan.polar[:, 2] + (turn * (velocity - scan.velocity)).sum(-1)  # (FLT.5)
        earlier = np.stack([np.hypot(sight[:, 0], sight[:, 1]), wrap_angle(bearing - heading), rate], -1)
        along = np.stack([scan.polar[:, 0] - tau * scan.polar[:, 2], scan.polar[:, 1], scan.polar[:, 2]], -1)
        earlier = np.where(ghost[:, None], np.maximum(along, [0.0, -np.inf, -np.inf]), earlier)
        return scan._replace(polar=np.where(late[:, None], earlier, scan.polar)), origin


@dataclass(frozen=True)
class Interference:
    """Another transmitter fills scans with false alarms."""

    start: float  # [s]
    count: float  # expected false alarms of all these sensors together in one scan
    seconds: float = 0.5  # [s] that it lasts
    sensors: str = EVERYWHERE

    def __post_init__(self) -> None:
        if not 0 <= self.count <= 1e4:
            raise ValueError(f"fault burst: the count must be within 0 and 10000, got {self.count}")
        if not self.seconds > 0:
            raise ValueError(f"fault burst: it must last longer than 0 s, got {self.seconds}")
        check_window(self)

    @property
    def end(self) -> float:
        """From when on it is over [s]."""
        return self.start + self.seconds

    def __str__(self) -> str:
        return spell("burst", self.sensors, self.start, self.count, *([] if self.seconds == 0.5 else [self.seconds]))

    def apply(
        self, scene: Scene, scan: Scan, origin: Origin, on: NDArray, models: Sequence[SensorModel],
        rng: np.random.Generator,
    ) -> tuple[Scan, Origin]:  # fmt: skip
        """With more false alarms, shared evenly, drawn as those of the healthy radar."""
        reached = on & scan.delivered
        mean = np.where(reached, self.count / max(int(on.sum()), 1), 0.0)  # (FLT.6)
        reach, fov, rate = (np.array([getattr(m, name) for m in models]) for name in ("max_range", "fov", "max_rate"))
        alarms = false_alarms(mean, reach, fov, rate, rng)
        s = alarms.sensor
        pose = np.array([model.poses(scan.platform) for model in models])
        velocity = np.array([model.velocity(scan.platform) for model in models])
        noise = np.array([(m.sigma_range, m.sigma_azimuth, m.sigma_rate) for m in models])
        more = Scan(alarms.polar, np.ones(len(s), bool), pose[s], velocity[s], noise[s], s)
        joined = {name: np.concatenate([getattr(scan, name), getattr(more, name)]) for name in PER_DETECTION}
        known = {name: np.concatenate([getattr(origin, name), getattr(alarms, name)]) for name in ORIGINS}
        order = np.lexsort((joined["polar"][:, 0], joined["sensor"]))  # the place in the scan says nothing
        return keep(scan._replace(**joined), origin._replace(**known), order)


@dataclass(frozen=True)
class Blindness:
    """Sensors see less, and trackers do not know: rain takes range and detections, dirt takes detections."""

    cause: str  # rain or dirt
    share: float  # what is left: of the range in rain, of the detections behind dirt
    sensors: str = EVERYWHERE
    start: float = 0.0  # [s]
    end: float = inf  # [s]

    def __post_init__(self) -> None:
        if self.cause not in CAUSES:
            raise ValueError(f"fault blind: the cause must be {' or '.join(CAUSES)}, got {self.cause!r}")
        check_share(self, self.share)
        check_window(self)

    def __str__(self) -> str:
        return spell("blind", self.sensors, self.cause, self.share, *window(self))

    def apply(
        self, scene: Scene, scan: Scan, origin: Origin, on: NDArray, models: Sequence[SensorModel],
        rng: np.random.Generator,
    ) -> tuple[Scan, Origin]:  # fmt: skip
        """Without what is too far away or too weak; the scan is delivered."""
        weakened, x = on[scan.sensor], rng.random(len(scan.polar))
        real = origin.kind != CLUTTER
        if self.cause == "dirt":
            return keep(scan, origin, ~(weakened & real & (x >= self.share)))  # (FLT.9)
        reach = self.share * np.array([m.max_range for m in models])[scan.sensor]  # (FLT.7)
        heard = self.share ** np.array([m.count_falloff for m in models])[scan.sensor]  # (FLT.8)
        return keep(scan, origin, ~(weakened & ((scan.polar[:, 0] >= reach) | (real & (x >= heard)))))


PER_DETECTION = ("polar", "mask", "pose", "velocity", "noise", "sensor")
ORIGINS = ("object", "body", "edge", "kind")


def keep(scan: Scan, origin: Origin, rows: NDArray) -> tuple[Scan, Origin]:
    """The detections with these rows, int or bool."""
    left = scan._replace(**{name: getattr(scan, name)[rows] for name in PER_DETECTION})
    return left, origin._replace(**{name: getattr(origin, name)[rows] for name in ORIGINS})


def without_sensors(scan: Scan, origin: Origin, out: NDArray) -> tuple[Scan, Origin]:
    """Without the scans of the sensors of the mask `out` (S,), which count as not delivered."""
    return keep(scan._replace(delivered=scan.delivered & ~out), origin, ~out[scan.sensor])


def chosen(sensors: str, models: Sequence[SensorModel]) -> NDArray:
    """Mask (S,) of the sensors of a word: one of `PLACES`, or the number of a sensor in its rig, from 0 on.

    Raises:
        ValueError: the rig has no such sensor.
    """
    heading = np.array([wrap_angle(model.mount[2]) for model in models])
    front, rear = np.abs(heading) <= AHEAD + 1e-9, np.abs(heading) >= np.pi - AHEAD - 1e-9
    corners = ~front & ~rear
    masks = {
        EVERYWHERE: np.ones(len(models), bool), "front": front, "rear": rear, "corners": corners,
        "left": corners & (heading < 0), "right": corners & (heading > 0),
        **{str(k): np.arange(len(models)) == k for k in range(len(models))},
    }  # fmt: skip
    if sensors in masks and masks[sensors].any():
        return masks[sensors]
    there = [word for word in PLACES if masks[word].any()]
    raise ValueError(
        f"fault sensors: this rig has no {sensors!r}; it has {', '.join(there)}, and the numbers 0 to {len(models) - 1}"
    )


def streams(faults: Sequence[Fault], seed: int, episode: int = 0) -> tuple[np.random.Generator, ...]:
    """A generator for each fault, from the seed of the run and the text of the fault: other faults change none."""
    keys = [(episode, FAULT_STREAM, crc32(str(fault).encode())) for fault in faults]
    return tuple(np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key)) for key in keys)


def is_active(fault: Fault, time: float) -> bool:
    """Whether a fault is there at a time [s]."""
    return fault.start - 1e-9 <= time < fault.end - 1e-9


def apply_faults(
    faults: Sequence[Fault], rngs: Sequence[np.random.Generator], models: Sequence[SensorModel], scene: Scene,
    scan: Scan, origin: Origin,
) -> tuple[Scan, Origin]:  # fmt: skip
    """The scan (M,) of a healthy rig and its origin with all active faults, one after the other, in their order.

    What was visible and expected of the objects stays that of the healthy rig: an object that a fault hides is missed.
    """
    active = [(fault, rng) for fault, rng in zip(faults, rngs, strict=True) if is_active(fault, scene.time)]
    if not active:
        return scan, origin
    M = len(scan.polar)
    spread = {
        name: np.broadcast_to(a, (M, *a.shape[1:])) for name in PER_DETECTION if len(a := getattr(scan, name)) != M
    }
    here = np.ones(len(models), bool) if scan.delivered is None else scan.delivered
    scan = scan._replace(**spread, delivered=here)
    for fault, rng in active:
        scan, origin = fault.apply(scene, scan, origin, chosen(fault.sensors, models), models, rng)
    return scan, origin


def check_window(fault: Fault) -> None:
    """Raise ValueError for times that are no span."""
    if not (isfinite(fault.start) and 0 <= fault.start < fault.end):
        raise ValueError(
            f"fault: it must begin at 0 s or later and before it ends, got {fault.start} s to {fault.end} s"
        )


def check_share(fault: Fault, share: float) -> None:
    """Raise ValueError for what is no share."""
    if isnan(share) or not 0 <= share <= 1:
        raise ValueError(f"fault {type(fault).__name__.lower()}: the share must be within 0 and 1, got {share}")


def window(fault: Fault) -> list[float]:
    """Start and end [s], nothing where it is always there."""
    return [] if (fault.start, fault.end) == (0.0, inf) else [fault.start, fault.end]


def spell(kind: str, sensors: str, *values: float | str) -> str:
    """The text of a fault."""
    words = [value if isinstance(value, str) else f"{value:.12g}" for value in values]
    return ":".join([*([] if sensors == EVERYWHERE else [sensors]), kind, *words])
