"""A small world without a simulator: boxes on a road with guard rails, in prescribed motion, seen by seven radars.

The kind of world in which the tracker was designed, docs/methods/multi-object-tracking.md. Road coordinates: s [m]
along the ego's lane, d [m] across it, both turned as highway-env draws: y points down, so lane +1 is the one to the
right of the ego's.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.origin import Origin
from sensors.radar import Radar, Sensor
from sensors.rigs import RADARS
from sensors.scene import Ego, Scene, boxes_scene
from testbed.evaluation.tracking import Evaluator, FrameScore
from trackers import MultiObjectTracker, Scan, find
from trackers.geometry import box_corners, perpendicular, unit
from trackers.multi.road import RoadMap
from trackers.multi.tracks import StepInfo, Tracks
from trackers.scan import DepthProfile

LANE = 3.6  # [m]
RAIL = 1.2  # [m] outside the outer lanes
RATE = 15.0  # [1/s]
SIGHT = 180.0  # [m] of guard rail before and behind the ego; the radars reach 174 m
EGO_SIZE = np.array([4.7, 1.9])
CAR, TRUCK = (4.6, 1.86), (12.0, 2.5)

# Of this world alone, so that its cases measure trackers and do not move with the calibration of the catalogue.
AHEAD = Sensor(
    (2.35, 0.0, 0.0), max_range=100.0, fov_deg=110.0, spacing_deg=0.1, sigma_range=0.12, sigma_azimuth_deg=0.4,
    sigma_rate=0.08, count_at_15m=80.0, count_falloff=0.78, count_max=75.0, clutter=8.0, grazing=0.1, share_volume=0.5,
    depth_contour=0.1, depth_volume=0.7, share_scatter=0.6, scatter=0.28,
    profile=DepthProfile(
        inside=0.636, inside_depth=0.567, depth=0.0382, depth_std=0.203, grazing=0.0, surface_std=0.125
    ),
)  # fmt: skip
SEVEN = Radar("seven", "those of `surround` and a high-resolution one ahead", (*RADARS["surround"].sensors, AHEAD))


def with_clutter(radar: Radar, factor: float) -> Radar:
    """The same rig with so many times the false alarms."""
    return replace(radar, sensors=tuple(replace(s, clutter=factor * s.clutter) for s in radar.sensors))


def quintic(tau: NDArray) -> tuple[NDArray, NDArray]:
    """Smooth step from 0 to 1 over tau in [0, 1], with its slope; still at both ends."""
    tau = np.clip(tau, 0.0, 1.0)
    return tau**3 * (10 - 15 * tau + 6 * tau**2), 30 * tau**2 * (1 - tau) ** 2


@dataclass(frozen=True)
class Vehicle:
    """One box and its whole course."""

    s: float = 0.0  # [m] centre at time 0, the ego being at 0
    lane: float = 0.0  # lanes to the right of the ego's
    speed: float = 25.0  # [m/s] at time 0
    size: tuple[float, float] = CAR
    knots: tuple[tuple[float, float], ...] = ()  # (time [s], speed [m/s]) that the speed runs through, straight between
    changes: tuple[tuple[float, float], ...] = ()  # (start [s], new lane), quintic

    @cached_property
    def profile(self) -> tuple[NDArray, NDArray, NDArray]:
        """Times [s], speeds [m/s] and places s [m] of the knots."""
        t, v = np.array([(0.0, self.speed), *self.knots]).T
        way = np.diff(t) * (v[1:] + v[:-1]) / 2
        return t, v, self.s + np.concatenate([[0.0], np.cumsum(way)])

    def course(self, time: float) -> tuple[float, float, float, float]:
        """Place s, d [m] and their rates [m/s] at a time [s]."""
        t, v, s = self.profile
        k = max(int(np.searchsorted(t, time, "right")) - 1, 0)
        speed = float(np.interp(time, t, v))
        lane, rate, last = self.lane, 0.0, self.lane
        lasts = 6.5 if self.size[0] > 6.5 else 4.5  # [s] of a change: truck, car
        for start, target in self.changes:
            share, slope = quintic(np.array((time - start) / lasts))
            lane += (target - last) * float(share)
            rate += (target - last) * float(slope) / lasts
            last = target
        return float(s[k] + (v[k] + speed) / 2 * (time - t[k])), lane * LANE, speed, rate * LANE


@dataclass(frozen=True)
class Road:
    """Lanes beside each other, straight or on a circle."""

    lanes: tuple[int, int] = (-2, 1)  # leftmost and rightmost
    curvature: float = 0.0  # [1/m] positive: to the right as drawn, from x towards y

    def place(self, s: NDArray, d: NDArray) -> tuple[NDArray, NDArray]:
        """World points (..., 2) [m] and directions (...) [rad] of road coordinates (...)."""
        angle = self.curvature * s
        middle = np.stack([s * np.sinc(angle / np.pi), s * np.sinc(angle / 2 / np.pi) * np.sin(angle / 2)], -1)
        return middle + d[..., None] * perpendicular(unit(angle)), angle

    def lines(self, d: NDArray, start: float, end: float) -> NDArray:
        """Lines (L, P, 2) [m] at distances d (L,) from the ego's lane."""
        s = np.linspace(start, end, 2 if self.curvature == 0 else int((end - start) / 6))
        return self.place(np.broadcast_to(s, (len(d), len(s))), np.broadcast_to(d[:, None], (len(d), len(s))))[0]

    def rails(self, s: float) -> NDArray:
        """Guard rails (W, 2, 2) [m] in sight of the ego at s."""
        left, right = self.lanes
        edge = np.array([(left - 0.5) * LANE - RAIL, (right + 0.5) * LANE + RAIL])
        line = self.lines(edge, s - SIGHT, s + SIGHT)
        return np.stack([line[:, :-1], line[:, 1:]], -2).reshape(-1, 2, 2)

    def map(self, way: float) -> RoadMap:
        """What a tracker may know of the road over the `way` [m] that the ego drives."""
        centres = np.arange(self.lanes[0], self.lanes[1] + 1) * LANE
        return RoadMap.of([(line, LANE) for line in self.lines(centres, -SIGHT, way + SIGHT)])


@dataclass(frozen=True)
class World:
    """The truth at every time."""

    vehicles: tuple[Vehicle, ...] = ()
    ego: Vehicle = Vehicle(size=(4.7, 1.9))
    road: Road = Road()

    def states(self, time: float) -> tuple[NDArray, NDArray, NDArray]:
        """Poses (N+1, 3), velocities (N+1, 2) and yaw rates (N+1,), the ego's first."""
        h = 1e-3  # [s] step of the differences that give the yaw rate
        before, now, after = (self._motion(time + dt) for dt in (-h, 0.0, h))
        return now[0], now[1], (after[0][:, 2] - before[0][:, 2]) / (2 * h)

    def _motion(self, time: float) -> tuple[NDArray, NDArray]:
        s, d, v, side = np.array([a.course(time) for a in (self.ego, *self.vehicles)]).T
        xy, angle = self.road.place(s, d)
        v = v * (1 - self.road.curvature * d)
        velocity = v[:, None] * unit(angle) + side[:, None] * perpendicular(unit(angle))
        return np.concatenate([xy, (angle + np.arctan2(side, v))[:, None]], -1), velocity

    def scene(self, time: float) -> Scene:
        """The scene that the radars scan."""
        pose, velocity, yaw_rate = self.states(time)
        ego = Ego(pose[0], velocity[0], float(yaw_rate[0]), EGO_SIZE, box_corners(pose[0], EGO_SIZE))
        size = np.array([v.size for v in self.vehicles]).reshape(-1, 2)
        scene = boxes_scene(pose[1:], size, velocity[1:], yaw_rate[1:], ego, time, 1 / RATE)
        return scene._replace(walls=self.road.rails(self.ego.course(time)[0]))


class Step(NamedTuple):
    """Everything about one scan."""

    time: float
    scene: Scene
    scan: Scan
    origin: Origin
    tracks: Tracks
    info: StepInfo
    score: FrameScore


class Outcome(NamedTuple):
    """A run and its score."""

    steps: list[Step]
    evaluator: Evaluator

    @property
    def table(self) -> dict[str, float]:
        """The summary of the run."""
        return self.evaluator.summary()

    def ids(self, object: int) -> list[int]:
        """Track ids that held the object, each once, in the order of time."""
        return list(dict.fromkeys(t for t in self.evaluator.histories()[object].track.tolist() if t >= 0))

    def false(self, start: float = 0.0, end: float = np.inf) -> NDArray:
        """Reported tracks without an object at each scan of a span of time."""
        return np.array([step.score.mean["ghosts"] for step in self.steps if start <= step.time < end])


Distortion = Callable[[float, Scene, Scan, Origin, np.random.Generator], Scan]


def tracker_for(world: World, name: str = "rm-feldmann", seconds: float = 10.0) -> MultiObjectTracker:
    """The tracker as the closed loop builds it: data sheets of the radars and the map of the lanes."""
    return MultiObjectTracker(find(name), SEVEN.models, road=world.road.map(world.ego.course(seconds)[0]))


def record(
    world: World,
    seconds: float = 10.0,
    seed: int = 0,
    radar: Callable[[float], Radar] = lambda time: SEVEN,
    distort: Distortion | None = None,
) -> list[tuple[Scene, Scan, Origin]]:
    """What there is and what the radars detect of it; `distort` may change a scan after the radar made it."""
    rng, recorded = np.random.default_rng(seed), []
    for time in np.arange(round(seconds * RATE)) / RATE:
        scene = world.scene(time)
        scan, origin = radar(time).scan(scene, rng)
        recorded.append((scene, scan if distort is None else distort(time, scene, scan, origin, rng), origin))
    return recorded


def follow(tracker: MultiObjectTracker, recorded: list[tuple[Scene, Scan, Origin]]) -> Outcome:
    """Run the tracker on what was recorded."""
    evaluator, tracks, steps = Evaluator("case"), tracker.start(), []
    for k, (scene, scan, origin) in enumerate(recorded):
        tracks, info = tracker.step(tracks, scan, 1 / RATE if k else 0.0)
        score = evaluator.step(scene.time, scene, origin, tracks)
        steps.append(Step(scene.time, scene, scan, origin, tracks, info, score))
    return Outcome(steps, evaluator)


def drive(world: World, tracker: MultiObjectTracker, seconds: float = 10.0, seed: int = 0) -> Outcome:
    """Run the tracker through the world."""
    return follow(tracker, record(world, seconds, seed))
