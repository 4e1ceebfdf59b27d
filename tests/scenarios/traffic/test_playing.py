"""Recorded vehicles keep to their record, come and go with it, and react behind an ego that has left its own."""

import copy
import json

import numpy as np
import pytest

from scenarios import find
from scenarios.traffic.road import RecordedRoad, leaders
from scenarios.vehicles import CourseVehicle, SizedIDM
from testbed.environment.registration import make
from testbed.experiments.identity import own_code, own_names
from tests.scenarios.traffic.recorded import own, traffic

SLOWER = 4  # the action


def episode(path, parameters=":ego=5"):
    """World and names of its vehicles."""
    world = find(f"replay:{path}{parameters}").build(np.random.default_rng(0))
    return world, {part.id: vehicle for vehicle, part in world.road._playing}


def drive(world, seconds, speed=None, dt=0.1):
    for _ in range(round(seconds / dt)):
        if speed is not None:
            world.ego.target_speed = speed
        world.road.act()
        world.road.step(dt)


def test_vehicles_are_where_they_were(tmp_path):
    world, names = episode(own(tmp_path / "a.csv"))
    start = {name: v.position.copy() for name, v in names.items()}
    drive(world, 3.0)
    for name, vehicle in names.items():
        np.testing.assert_allclose(vehicle.position - start[name], [60.0, 0.0], atol=1e-6)
    assert world.road.events == []


def test_the_ego_has_place_speed_and_size_of_its_vehicle(tmp_path):
    world, names = episode(own(tmp_path / "a.csv"))
    assert "5" not in names
    assert len(names) == 11
    assert world.road.vehicles[0] is world.ego
    assert world.ego.speed == pytest.approx(20.0)
    assert world.ego.lane_index == ("a", "b", 1)
    assert (world.ego.LENGTH, world.ego.WIDTH) == (4.4, 1.8)
    np.testing.assert_allclose(names["8"].position - world.ego.position, [30.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(names["4"].position - world.ego.position, [-5.0, -3.7], atol=1e-6)


def test_who_is_behind_an_ego_off_its_record_reacts_and_nobody_else(tmp_path):
    world, names = episode(own(tmp_path / "a.csv"))
    follower = names["2"]
    drive(world, 5.0, speed=8.0)
    assert isinstance(follower, SizedIDM)
    assert follower is names["2"]
    assert sum(isinstance(v, SizedIDM) for v in names.values()) == 1
    (at, text), (then, reacts) = world.road.events
    assert 0.5 < at <= then < 3.0
    assert "from its record" in text
    assert reacts == "vehicle 2 of the recording reacts"
    assert follower.speed < 17.0
    assert not world.ego.crashed
    assert not follower.crashed


def test_nobody_reacts_where_that_is_off(tmp_path):
    world, names = episode(own(tmp_path / "a.csv"), ":ego=5,react=off")
    drive(world, 4.0, speed=8.0)
    assert world.road.events == []
    assert all(isinstance(v, CourseVehicle) for v in names.values())


def test_vehicles_come_and_go_with_their_records(tmp_path):
    rows = [row for row in traffic() if not (row[1] == 9 and row[0] < 2.0) and not (row[1] == 3 and row[0] > 3.0)]
    world, names = episode(own(tmp_path / "a.csv", rows))
    assert "9" not in names
    assert "3" in names
    drive(world, 2.5)
    late = {part.id: vehicle for vehicle, part in world.road._playing}
    np.testing.assert_allclose(late["9"].position - names["6"].position, [30.0, 0.0], atol=1e-6)
    drive(world, 1.0)
    assert names["3"] not in world.road.vehicles
    assert late["9"] in world.road.vehicles


def test_a_copy_of_the_road_goes_on_alike(tmp_path):
    world, names = episode(own(tmp_path / "a.csv"))
    twin: RecordedRoad = copy.deepcopy(world.road)
    for road in (world.road, twin):
        for _ in range(20):
            road.act()
            road.step(0.1)
    for ours, theirs in zip(world.road.vehicles, twin.vehicles, strict=True):
        np.testing.assert_array_equal(ours.position, theirs.position)


def test_leaders_are_next_ahead_in_the_way():
    xy = np.array([[0.0, 0.0], [30.0, 0.5], [20.0, 3.7], [60.0, 0.0]])
    gap, leader = leaders(xy, np.array([[4.0, 2.0]] * 4))
    assert leader.tolist() == [1, 3, -1, -1]
    assert gap[:2].tolist() == [26.0, 26.0]


def test_an_environment_is_made_of_a_recording(tmp_path):
    path = own(tmp_path / "a.csv")
    with make(f"replay:{path}:ego=5", tracker="rm-koch") as env:
        env.reset(seed=0)
        _, _, terminated, truncated, _ = env.step(1)
        assert not terminated
        assert not truncated
        assert len(env.truth.objects.id) == 11


def test_nobody_is_gone_before_the_last_decision_ends(tmp_path):
    path = own(tmp_path / "a.csv", traffic(seconds=2.3))
    with make(f"replay:{path}:ego=5", tracker="rm-koch") as env:
        env.reset(seed=0)
        truncated = False
        while not truncated:
            _, _, terminated, truncated, _ = env.step(1)
            assert not terminated
        assert env.truth.time == pytest.approx(2.2)
        assert len(env.truth.objects.id) == 11


def test_another_recording_under_the_same_name_is_another_scenario(tmp_path):
    path = own(tmp_path / "a.csv")
    names = own_names([f"replay:{path}:ego=5", "cut-in"])
    before = own_code(names)
    assert list(before) == [f"code of scenario replay:{path}:ego=5"]
    assert own_code(names) == before
    own(path, traffic(speed=21.0))
    assert own_code(names) != before


def test_a_run_says_when_the_ego_left_its_record(tmp_path):
    text = f"replay:{own(tmp_path / 'a.csv')}:ego=5,react=2"
    env = make(text, {"duration": 2.0}, tracker="rm-koch", out=str(tmp_path), log="off", metrics=False)
    with env:
        env.reset(seed=0)
        over = False
        while not over:
            *_, terminated, over, _ = env.step(SLOWER)
            assert not terminated
    (written,) = tmp_path.glob("*.json")
    first, second = json.loads(written.read_text())["run"]["events"]
    assert 0.3 < first["time"] < 2.0
    assert first["text"].startswith("ego is 2.")
    assert second["text"] == "vehicle 2 of the recording reacts"
