"""The laws of a radar, a planner and a scenario.

A radar is tried on boxes around the ego, a planner in the scenario `hard-brake` on tracks, a scenario by its worlds.
"""

from contextlib import closing
from itertools import combinations, pairwise
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Polygon

from scenarios import Scenario
from scenarios.bodies import parts
from sensors.radar import fault_of_mount
from sensors.scene import Scene, boxes_scene
from testbed.check.draws import Broken, check_equal
from testbed.environment.registration import env_id
from testbed.planners import begin, settings
from trackers.geometry import box_corners

BEARINGS = np.radians([0.0, 60.0, 120.0, 180.0, -60.0, -120.0])  # of cars around the ego
DECISIONS = 10


def ring(distance: float) -> Scene:
    """Six cars around the ego, at a distance [m]."""
    pose = np.stack([distance * np.cos(BEARINGS), distance * np.sin(BEARINGS), np.zeros(6)], -1)
    return boxes_scene(pose, np.tile([4.6, 1.86], (6, 1)))


# -- radars -----------------------------------------------------------------------------------------------------------


def a_scan_fits_the_data_sheets(radar: Any) -> None:
    """Rows agree, each detection has a sensor of `models`, lies within its range, and its origin is in the scene."""
    if radar.rate is not None and not radar.rate > 0:
        raise Broken(f"rate must be positive, in scans a second, or None for one every frame, got {radar.rate!r}")
    for distance in (8.0, 20.0, 60.0):
        scan, origin = radar.scan(ring(distance), np.random.default_rng(1))
        count = len(scan.mask)
        for name, rows in (("polar", scan.polar), ("origin.object", origin.object), ("origin.kind", origin.kind)):
            if len(rows) != count:
                raise Broken(f"{name} has {len(rows)} rows for {count} detections")
        sensor = np.broadcast_to(scan.sensor, count)[scan.mask]
        if not ((sensor >= 0) & (sensor < len(radar.models))).all():
            raise Broken(f"sensor must index the {len(radar.models)} models, got {sorted({*sensor.tolist()})}")
        polar = scan.polar[scan.mask]
        if not np.isfinite(polar[:, :2]).all():
            raise Broken("a detection has a range or an azimuth that is not finite")
        reach = np.array([m.max_range + 6 * m.sigma_range for m in radar.models])[sensor]
        if (far := polar[:, 0] > reach).any():
            raise Broken(f"a detection at {polar[far, 0].max():.1f} m is beyond max_range of its sensor's model")
        if not ((origin.object >= -1) & (origin.object < 6)).all():
            raise Broken("origin.object must be a row of the scene's objects, or -1")


def mounts_lie_on_a_vehicle(radar: Any) -> None:
    """Places are in metres and headings in rad, from the vehicle's centre."""
    for number, model in enumerate(radar.models):
        if fault := fault_of_mount(model.mount):
            raise Broken(f"the mount of sensor {number} {fault}")


def the_same_generator_gives_the_same_scan(radar: Any) -> None:
    """All that is random comes from the generator that `scan` gets, and nothing is kept between scans."""
    first, again = (radar.scan(ring(20.0), np.random.default_rng(2)) for _ in range(2))
    law = "two scans of one scene with one seed differ; draw from the generator that scan gets"
    check_equal(first, again, 0, 0, law)


def a_car_in_view_is_detected_and_an_empty_road_has_none(radar: Any) -> None:
    """Twenty scans of cars all around have some detection of one; without cars none is of an object."""
    rng = np.random.default_rng(3)
    if not any((radar.scan(ring(12.0), rng)[1].object >= 0).any() for _ in range(20)):
        raise Broken("twenty scans of six cars at 12 m all around have no detection of any of them")
    empty = boxes_scene(np.zeros((0, 3)), np.zeros((0, 2)))
    if (radar.scan(empty, rng)[1].object >= 0).any():
        raise Broken("a scan of an empty road has a detection of an object")


# -- planners ---------------------------------------------------------------------------------------------------------


def drive(planner: Any, spoil: bool = False) -> NDArray:
    """Actions of some decisions; with `spoil` the planner also decides in another episode on the way."""
    found = []
    tracker = "truth" if planner.knows_truth else "rm-feldmann"
    with closing(gym.make(env_id("hard-brake"), config=settings(planner), tracker=tracker)) as env:
        if spoil:
            env.reset(seed=8)
            begin(planner, env)
            for _ in range(3):
                env.step(planner.choose(env).action)
        env.reset(seed=7)
        begin(planner, env)
        for _ in range(DECISIONS):
            before = [(*v.position, v.heading, v.speed) for v in env.unwrapped.road.vehicles]  # type: ignore[attr-defined]
            choice = planner.choose(env)
            after = [(*v.position, v.heading, v.speed) for v in env.unwrapped.road.vehicles]  # type: ignore[attr-defined]
            if before != after:
                raise Broken("the planner moves vehicles of the road that it reads; work on a copy")
            if np.ndim(choice.plan) != 2 or np.shape(choice.plan)[-1] != 2:
                raise Broken(f"plan must be points (P, 2) in metres, got shape {np.shape(choice.plan)}")
            if choice.action is None:
                raise Broken("the action is None, which drives on unchanged; is a return missing?")
            found.append(np.ravel(choice.action))
            over = env.step(choice.action)[2:4]
            if any(over):
                break
    return np.array(found, float)


def every_action_is_in_the_action_space(planner: Any) -> None:
    """Ten decisions are made and taken by the environment."""
    drive(planner)


def the_same_drive_has_the_same_actions(planner: Any) -> None:
    """A second drive, after another episode, is the first again: what is kept is reset in `begin`."""
    law = "a drive of the same seed has other actions the second time; keep nothing, or reset it in begin(env)"
    check_equal(drive(planner, spoil=True), drive(planner), 0, 0, law)


# -- scenarios --------------------------------------------------------------------------------------------------------


def snapshot(scenario: Scenario, seed: int) -> NDArray:
    """Place, heading, speed and size of all vehicles (V, 6) of a world."""
    world = scenario.build(np.random.default_rng(seed))
    return np.array([(*v.position, v.heading, v.speed, v.LENGTH, v.WIDTH) for v in world.road.vehicles])


def a_world_repeats_under_its_seed(scenario: Scenario) -> None:
    """Every draw comes from the generator of the builder."""
    law = "two worlds of one seed differ; draw from the generator that the builder gets"
    check_equal(snapshot(scenario, 3), snapshot(scenario, 3), 0, 0, law)


def it_has_the_vehicles_that_it_promises(scenario: Scenario) -> None:
    """`vehicles` counts those besides the ego, which is among the vehicles of the road once."""
    world = scenario.build(np.random.default_rng(3))
    if (count := len(world.road.vehicles) - 1) != scenario.vehicles:
        raise Broken(f"vehicles is {scenario.vehicles}, and the road has {count} besides the ego")
    if sum(v is world.ego for v in world.road.vehicles) != 1:
        raise Broken("the ego must be on the road once; make it with stage.ego")


def nobody_starts_in_a_collision(scenario: Scenario, seed: int = 0) -> None:
    """All bodies are apart at the start."""
    vehicles = scenario.build(np.random.default_rng(seed)).road.vehicles
    boxes = [[Polygon(box_corners(p.pose, p.size)) for p in parts(v)] for v in vehicles]
    for (i, a), (j, b) in combinations(enumerate(boxes), 2):
        if any(p.intersects(q) for p in a for q in b):
            raise Broken(f"vehicles {i} and {j} of the road overlap at the start")


def phases_follow_each_other_from_the_start(scenario: Scenario) -> None:
    """The first begins at 0 s and each ends where the next one begins."""
    phases = scenario.build(np.random.default_rng(5)).phases
    if not phases or phases[0].start != 0.0 or any(a.end != b.start for a, b in pairwise(phases)):
        raise Broken(f"the phases must follow each other from 0 s on, got {[tuple(p) for p in phases]}")
