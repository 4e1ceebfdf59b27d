"""A small world for the multi-object tracker: one radar, rear sides of cars, false alarms; no simulator."""

from dataclasses import dataclass, field

import numpy as np

from trackers import Scan, SensorModel
from trackers.geometry import to_world, unit

RADAR = SensorModel(mount=(2.3, 0.0, 0.0), max_range=174.0, fov=np.deg2rad(60), clutter=5.0)


@dataclass
class Road:
    """Cars (N, 4) x, y, heading, speed around an ego that starts at the origin."""

    cars: list
    speed: float = 25.0
    clutter: int = 5
    dt: float = 1 / 15
    seed: int = 0
    hidden: dict = field(default_factory=dict)  # car -> (from, to) [s] without detections

    def __post_init__(self):
        self.cars = np.array(self.cars, float).reshape(-1, 4)
        self.rng = np.random.default_rng(self.seed)
        self.ego = np.array([0.0, 0, 0, self.speed, 0, 0])
        self.time = 0.0

    def advance(self):
        self.time += self.dt
        self.ego[0] += self.speed * self.dt
        self.cars[:, 0] += self.cars[:, 3] * np.cos(self.cars[:, 2]) * self.dt

    def scan(self):
        xy, moving = [np.zeros((0, 2))], [np.zeros((0, 2))]
        for k, car in enumerate(self.cars):
            start, end = self.hidden.get(k, (np.inf, np.inf))
            n = 0 if start <= self.time < end else self.rng.poisson(8)
            near = -np.sign(np.cos(car[2]))  # the end that faces the ego, which is behind
            depth = self.rng.exponential(0.2, n)
            body = np.stack([near * (2.3 - depth), self.rng.uniform(-0.9, 0.9, n)], -1)
            xy.append(to_world(car[:3], body))
            moving.append(np.tile(car[3] * unit(car[2]), (n, 1)))
        xy, moving = np.concatenate(xy), np.concatenate(moving)
        pose, velocity = RADAR.poses(self.ego), RADAR.velocity(self.ego)
        d = xy - pose[:2]
        r = np.hypot(d[:, 0], d[:, 1])
        u = d / r[:, None]
        noise = self.rng.standard_normal((len(r), 3)) * [0.15, 0.01, 0.1]
        polar = np.stack([r, np.arctan2(d[:, 1], d[:, 0]), (u * (moving - velocity)).sum(-1)], -1) + noise
        false = self.rng.uniform([1, -0.5, -60], [174, 0.5, 60], (self.clutter, 3))
        polar = np.concatenate([polar, false])
        return Scan(
            polar,
            np.ones(len(polar), bool),
            pose[None],
            velocity[None],
            np.array([[0.15, 0.01, 0.1]]),
            np.zeros(1, int),
            self.ego.copy(),
        )


def drive(tracker, road, seconds, each=None):
    """Tracks after so many seconds; each(road, scan, tracks, info) is called after every step."""
    tracks, infos = tracker.start(), []
    for k in range(round(seconds / road.dt)):
        if k:
            road.advance()
        scan = road.scan()
        tracks, info = tracker.step(tracks, scan, road.dt if k else 0.0)
        infos.append(info)
        if each:
            each(road, scan, tracks, info)
    return tracks, infos
