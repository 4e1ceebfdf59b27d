"""The papers' courses on a road, against those of the reproduced experiments."""

from functools import cache

import numpy as np
import pytest

from scenarios.adapter import SceneReader
from scenarios.highway import ScenarioEnv
from scenarios.registry import find
from sensors import find as find_radar
from studies.papers.xia2020.generators import FOLLOWING, RIGHT_TURN, S_CURVE, drive
from testbed import planners
from tests.scenarios.episodes import world_only
from trackers.geometry import to_frame, wrap_angle

IDLE = 1
COURSES = {"xia2020-lane": FOLLOWING, "xia2020-right-turn": RIGHT_TURN, "xia2020-s-curve": S_CURVE}


@cache
def ride(name):
    """Scenes of an episode in which the ego keeps lane and speed."""
    env = world_only(name)
    env.reset(seed=0)
    reader, scenes = SceneReader(), []
    scenes.append(reader.read(env))
    truncated = False
    while not truncated:
        _, _, terminated, truncated, _ = env.step(IDLE)
        assert not terminated
        scenes.append(reader.read(env))
    return tuple(scenes)


def relative(ego, pose):
    """Position (T, 2) [m] in the frame of the ego and relative heading (T,) [rad]."""
    return to_frame(ego, pose[:, None, :2])[:, 0], wrap_angle(pose[:, 2] - ego[:, 2])


@pytest.mark.parametrize("name", COURSES)
def test_the_car_stays_where_the_experiment_has_it_relative_to_the_ego(name):
    course, scenes = COURSES[name], ride(name)
    t = np.array([s.time for s in scenes])
    car = drive(course.start, course.turns, t) * [1, -1, -1, 1, -1]  # y to the right
    ego = drive((0, 0, 0, course.start[3]), course.ego, t) * [1, -1, -1, 1, -1]
    want, want_turn = relative(ego[:, :3], car[:, :3])
    got, turn = relative(np.array([s.ego.pose for s in scenes]), np.array([s.objects.pose[0] for s in scenes]))
    # the ego has a steering of its own, speeds differ by 0.5 m/s and onsets are smooth
    assert np.abs(got - want).max() < 2.0
    assert np.degrees(np.abs(wrap_angle(turn - want_turn))).max() < 12.0


@pytest.mark.parametrize("name", COURSES)
def test_ego_and_car_turn_as_far_as_in_the_experiment(name):
    course, scenes = COURSES[name], ride(name)
    for turns, pose in ((course.ego, "ego"), (course.turns, "car")):
        total = -sum(t.duration * t.yaw_rate for t in turns)
        last = scenes[-1].ego.pose if pose == "ego" else scenes[-1].objects.pose[0]
        assert abs(wrap_angle(last[2] - total)) < 0.03


def test_the_car_of_the_right_turn_changes_from_the_left_to_the_right_of_the_ego():
    scenes = ride("xia2020-right-turn")
    got, _ = relative(np.array([s.ego.pose for s in scenes]), np.array([s.objects.pose[0] for s in scenes]))
    assert got[0, 1] == pytest.approx(-4.0, abs=0.01)
    assert got[-1, 1] == pytest.approx(4.5, abs=0.7)  # it turns 0.6 s of driving earlier than the ego
    assert (got[:, 0] < -7.0).all()


def test_the_ego_stands_while_the_car_turns_back_beside_it():
    scenes = ride("hoher2022-u-turn")
    ego = np.array([s.ego.pose for s in scenes])
    car = np.array([s.objects.pose[0] for s in scenes])
    np.testing.assert_array_equal(ego, np.zeros_like(ego))
    np.testing.assert_allclose(car[0], [25.0, -26.0, -np.pi], atol=0.01)
    assert car[-1, 1] == pytest.approx(-6.0, abs=0.2)
    assert car[:, 0].min() == pytest.approx(-18.0, abs=0.3)  # turn_x minus radius
    speed = np.array([np.linalg.norm(s.objects.velocity[0]) for s in scenes])
    np.testing.assert_allclose(speed, 5.0, atol=0.02)


@pytest.mark.parametrize("name", [*COURSES, "hoher2022-u-turn"])
def test_a_surround_radar_sees_the_car_most_of_the_time(name):
    radar, rng = find_radar("surround"), np.random.default_rng(0)
    scenes = ride(name)[::5]
    seen = [np.any(radar.scan(scene, rng)[1].object == 0) for scene in scenes]
    assert np.mean(seen) > 0.75


def test_the_car_of_xu2023_goes_through_the_stages_of_table_1_on_its_own_lane():
    world = find("xu2023").build(np.random.default_rng(0))
    assert [(p.name, p.end) for p in world.phases] == [("CV", 10), ("CA", 30), ("CV again", 40), ("CT", 50)]
    rows = next(v for v in world.road.vehicles if hasattr(v, "table")).table.rows
    np.testing.assert_allclose(rows[-1, 4:6], (0.0, 20.0), atol=1e-6)
    lane = world.ego.road.network.get_lane(("a", "b", 1))
    offset = [lane.local_coordinates(row[1:3])[1] for row in rows[::50]]
    assert np.abs(offset).max() < 0.05
    gap = rows[0, 1] - world.ego.position[0]
    assert 40.0 <= gap <= 50.0


@pytest.mark.parametrize(("name", "kind"), [("yao2021-truck", "truck"), ("yao2021-tractor", "tractor")])
def test_the_vehicles_of_yao2021_drive_half_a_circle_each_way(name, kind):
    world = find(name).build(np.random.default_rng(0))
    course = next(v for v in world.road.vehicles if hasattr(v, "table"))
    assert course.contour == kind
    np.testing.assert_allclose((course.LENGTH, course.WIDTH), (5.0, 2.0), rtol=0.06)
    end = course.table.rows[np.searchsorted(course.table.rows[:, 0], (101.0, 222.0, 242.0))]
    np.testing.assert_allclose(end[:, 3], [np.pi, 0.0, 0.0], atol=0.02)  # one second of ramp
    assert end[0, 2] == pytest.approx(2 * 11.2 * 101 / np.pi, abs=6.0)  # the diameter


def test_the_ego_keeps_up_with_the_vehicle_of_yao2021():
    env, planner = ScenarioEnv("yao2021-truck", {"duration": 30.0}), planners.find("truth")  # of 242 s
    env.reset(seed=0)
    truck = next(v for v in env.road.vehicles if hasattr(v, "table"))
    over = False
    while not over:
        _, _, terminated, truncated, _ = env.step(planner.choose(env).action)
        over = terminated or truncated
    assert np.linalg.norm(truck.position - env.vehicle.position) < 35.0  # it began 26 m behind
