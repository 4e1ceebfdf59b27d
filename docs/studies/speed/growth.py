"""What more tracks and detections cost: the default tracker on a wide motorway, all vehicles detected in every scan."""

import tracemalloc
from dataclasses import replace
from statistics import median
from time import process_time
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trackers import DEFAULT, build
from trackers.multi.road import RoadMap
from trackers.scan import Scan, SensorModel

OBJECTS = (10, 20, 50, 100, 200)
LANES, LANE, GAP = 20, 5.0, 25.0  # number, width [m], and distance [m] of vehicles in a lane
SIZE = np.array([4.7, 1.8])  # [m]
SPEED, STEP = 25.0, 0.1  # [m/s] of all, the radar too; [s]
EACH = 6  # detections a vehicle and scan, anywhere in its box
DETECTIONS, AMONG = (4, 10, 20, 60), 20  # other numbers of them, of so many vehicles
SENSOR = SensorModel(max_range=200.0, fov=2 * np.pi, sigma_azimuth=0.004)


class Growth(NamedTuple):
    """A step of the tracker with so many objects in sight, and so many detections of each."""

    objects: int
    each: int
    tracks: int  # reported at the end
    seconds: float  # CPU time [s], median
    peak: float  # [bytes] that a step needs for a while


def motorway(objects: int) -> NDArray:
    """Centres (objects, 2) [m] of the vehicles nearest to a radar in the middle of the road, none at its place."""
    across = LANE * (np.arange(LANES) - LANES / 2 + 0.5)
    along = GAP * np.arange(-LANES, LANES + 1)
    places = np.stack(np.meshgrid(along + 0.37 * GAP, across, indexing="ij"), -1).reshape(-1, 2)
    return places[np.hypot(*places.T).argsort(kind="stable")[:objects]]


def scan_of(objects: NDArray, each: int, x: float, rng: np.random.Generator) -> Scan:
    """Detections, so many of each vehicle (N, 2) [m] around a radar at x [m] that is as fast as they are."""
    xy = np.repeat(objects, each, 0) + rng.uniform(-SIZE / 2, SIZE / 2, (len(objects) * each, 2))
    polar = np.stack([np.hypot(*xy.T), np.arctan2(xy[:, 1], xy[:, 0]), np.zeros(len(xy))], -1)
    noise = np.array([[SENSOR.sigma_range, SENSOR.sigma_azimuth, SENSOR.sigma_rate]])
    polar += noise * rng.standard_normal(polar.shape)
    platform = np.array([x, 0.0, 0.0, SPEED, 0.0, 0.0])
    return Scan(polar, np.ones(len(xy), bool), platform[None, :3], platform[None, 3:5], noise, platform=platform)


def growth(objects: int, each: int = EACH, tracker: str = DEFAULT, warm_up: int = 15, steps: int = 10) -> Growth:
    """Time and memory of a step with so many objects and detections of each, after `warm_up` steps."""
    places, rng = motorway(objects), np.random.default_rng(0)
    far = GAP * LANES + SPEED * STEP * (warm_up + steps)
    lanes: list[tuple[ArrayLike, float]] = [
        (np.array([[-far, y], [far, y]]), LANE) for y in LANE * (np.arange(LANES) - LANES / 2 + 0.5)
    ]
    multi = replace(build(tracker, (SENSOR,)), road=RoadMap.of(lanes))
    tracks, times = multi.start(), []
    for k in range(warm_up + steps):
        scan = scan_of(places, each, SPEED * STEP * k, rng)
        start = process_time()
        tracks, _ = multi.step(tracks, scan, STEP if k else 0.0)
        times.append(process_time() - start)
    tracemalloc.start()
    try:
        multi.step(tracks, scan_of(places, each, SPEED * STEP * len(times), rng), STEP)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    return Growth(objects, each, len(tracks.reported.id), median(times[warm_up:]), float(peak))


def exponent(x: NDArray, y: NDArray) -> float:
    """The b of a power y = a x^b through points (N,), least squares of the logarithms."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
