"""Rows of simulated drives; the ego, driven by the planner that knows the truth, is a leader but has no rows."""

from collections.abc import Iterator
from contextlib import closing
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from scenarios import SCENARIOS
from scenarios.adapter import SceneReader
from scenarios.highway import ScenarioEnv
from scenarios.record import Scenario
from sensors.scene import Scene
from studies.traffic.rows import EVERY, FARTHEST, Row
from testbed.environment.registration import scenario_of
from testbed.frame import TRUTH
from testbed.planners import find as find_planner

CATALOGUE, NATIVE = "catalogue", "highway-v0"
SCENES = tuple(name for name, scenario in SCENARIOS.items() if scenario.vehicles > 1)  # a single vehicle is no traffic
SEEDS = range(10)  # whose first frames count
DRIVEN = {CATALOGUE: 5, NATIVE: 3}  # seeds that are driven to their ends


class Place(NamedTuple):
    """Where a vehicle is on the road."""

    lane: tuple[str, str, int]  # start, end, number
    s: float  # [m] of its centre along the lane
    length: float  # [m] of the vehicle


def driven(source: str, scenario: str, seed: int) -> list[Row]:
    """Rows of one drive, its first frame included; of that alone for seeds that are not driven."""
    planner, reader = find_planner(TRUTH), SceneReader()
    rows: list[Row] = []
    with closing(_plain(scenario)) as env:
        inner: Any = env.unwrapped
        env.reset(seed=seed)
        frequency = inner.config["policy_frequency"]
        step, done = 0, False
        while not done:
            if step % round(EVERY * frequency) == 0:
                rows += _rows(source, scenario, seed, step / frequency, reader.read(inner), inner.road.network)
            if seed >= DRIVEN[source]:
                break
            _, _, terminated, truncated, _ = env.step(planner.choose(env).action)
            step, done = step + 1, terminated or truncated
    return rows


def _plain(scenario: str) -> gym.Env:
    """The environment without radar and tracks: the planner sees its vehicles as they are."""
    found = scenario_of(scenario)
    return ScenarioEnv(found) if isinstance(found, Scenario) else found.make({})


def _rows(source: str, scenario: str, seed: int, time: float, scene: Scene, network: Any) -> Iterator[Row]:
    gap = gaps(scene, network)
    objects = scene.objects
    speed = np.hypot(*objects.velocity.T)
    for k, kind in enumerate(objects.kind):
        length, width = objects.size[k].tolist()
        yield Row(source, scenario, seed, str(objects.id[k]), kind, time, length, width, float(speed[k]), float(gap[k]))


def gaps(scene: Scene, network: Any) -> NDArray:
    """Gap (N,) [m] along the lane from each object to the next vehicle ahead on its lane or the one after it, or NaN.

    A vehicle is on the lane that is nearest to its centre.
    """
    poses, sizes = (np.vstack([own, *others]) for own, others in (
        (scene.ego.pose, scene.objects.pose), (scene.ego.size, scene.objects.size)
    ))  # fmt: skip
    places = [_place(pose, size, network) for pose, size in zip(poses, sizes, strict=True)]
    found = []
    for own in places[1:]:
        ahead = [
            distance(own, other, network) - (own.length + other.length) / 2 for other in places if other is not own
        ]
        gap = min((gap for gap in ahead if np.isfinite(gap)), default=np.inf)
        found.append(gap if gap < FARTHEST else np.nan)
    return np.array(found)


def _place(pose: NDArray, size: NDArray, network: Any) -> Place:
    index = network.get_closest_lane_index(pose[:2], pose[2])
    return Place(index, float(network.get_lane(index).local_coordinates(pose[:2])[0]), float(size[0]))


def distance(own: Place, other: Place, network: Any) -> float:
    """Distance [m] along the lane from one vehicle to another that is ahead of it, infinite for any other."""
    if other.lane == own.lane:
        return other.s - own.s if other.s > own.s else np.inf
    lanes = len(network.graph[other.lane[0]][other.lane[1]])
    if other.lane[0] == own.lane[1] and (other.lane[2] == own.lane[2] or lanes == 1):
        return float(network.get_lane(own.lane).length) - own.s + other.s
    return np.inf
