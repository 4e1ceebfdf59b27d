"""Planners on hand-made roads: what they choose, and that they change nothing."""

from copy import deepcopy

import gymnasium as gym
import numpy as np
import pytest
from highway_env.road.lane import CircularLane
from highway_env.vehicle.controller import MDPVehicle

from scenarios.vehicles import EgoVehicle
from testbed.planners.collision import overlap
from testbed.planners.prediction import (
    Others,
    along_path,
    forecast,
    is_oncoming,
    lane_table,
    on_path,
    path_ahead,
    relate,
)
from testbed.planners.registry import PLANNERS, IdmPlanner, find, settings
from testbed.planners.track_vehicle import TrackVehicle
from tests.testbed.planners.roads import SPEEDS, blocked, place, world

PLANNER = IdmPlanner()


def action(env: gym.Env) -> str:
    return PLANNER.decide(env).action


def acceleration(env: gym.Env) -> float:
    return PLANNER.decide(env).acceleration


def test_an_empty_road_is_driven_up_to_the_limit():
    assert action(world(speed=15.0)) == "FASTER"
    assert action(world(speed=30.0)) == "IDLE"
    env = world(speed=32.5)
    assert acceleration(env) < 0
    assert action(env) == "SLOWER"


def test_it_brakes_for_what_stands_ahead_the_harder_the_closer():
    near, far = (world({"x": 200.0 + d, "y": 4.0}, blocked(0.0), blocked(8.0)) for d in (40.0, 90.0))
    assert action(near) == "SLOWER"
    assert acceleration(near) < acceleration(far) < acceleration(world())


def test_gaps_are_measured_from_bumper_to_bumper():
    car, truck = (
        world({"x": 250.0, "y": 4.0, "vx": 15.0, "size": (length, 2.0)}, blocked(0.0), blocked(8.0))
        for length in (5.0, 17.0)
    )
    shifted = world({"x": 244.0, "y": 4.0, "vx": 15.0, "size": (5.0, 2.0)}, blocked(0.0), blocked(8.0))
    assert acceleration(truck) < acceleration(car) - 0.1
    assert acceleration(truck) == pytest.approx(acceleration(shifted))


def test_the_next_lane_is_no_reason_to_brake():
    assert acceleration(world({"x": 215.0, "y": 8.0, "vx": 20.0})) == pytest.approx(acceleration(world()))


def test_it_makes_room_for_one_that_cuts_in():
    steady = {"x": 214.0, "y": 8.0, "vx": 18.0}
    assert acceleration(world({**steady, "vy": -1.2}, blocked(0.0))) < acceleration(world(steady, blocked(0.0))) - 1.0


def test_weaving_below_the_noise_is_not_a_cut_in():
    steady = {"x": 214.0, "y": 8.0, "vx": 18.0}
    assert acceleration(world({**steady, "vy": -0.3})) == pytest.approx(acceleration(world(steady)))


def test_it_overtakes_a_slow_leader_where_there_is_room():
    slow = {"x": 240.0, "y": 4.0, "vx": 10.0}
    assert action(world(slow, blocked(8.0))) == "LANE_LEFT"
    assert action(world(slow, blocked(0.0))) == "LANE_RIGHT"
    assert action(world(slow, blocked(0.0), blocked(8.0))) not in ("LANE_LEFT", "LANE_RIGHT")


def test_it_does_not_change_in_front_of_a_fast_follower():
    slow = {"x": 240.0, "y": 4.0, "vx": 10.0}
    follower = {"x": 160.0, "y": 0.0, "vx": 35.0}
    assert action(world(slow, blocked(8.0), follower)) != "LANE_LEFT"
    assert action(world(slow, blocked(8.0), {**follower, "vx": 20.0})) == "LANE_LEFT"


def test_it_stays_when_a_faster_one_comes_up_behind_it():
    slow = {"x": 240.0, "y": 4.0, "vx": 10.0}
    follower = {"x": 160.0, "y": 4.0, "vx": 35.0}
    assert action(world(slow, blocked(8.0), follower)) != "LANE_LEFT"
    assert action(world(slow, blocked(8.0), {**follower, "vx": 20.0})) == "LANE_LEFT"


def test_it_waits_before_its_first_lane_change():
    env = world({"x": 240.0, "y": 4.0, "vx": 10.0}, blocked(8.0))
    env.unwrapped.steps = 15
    assert action(env) != "LANE_LEFT"


def test_it_does_not_change_next_to_one_that_wants_the_same_lane():
    slow = {"x": 240.0, "y": 8.0, "vx": 10.0}
    other = {"x": 202.0, "y": 0.0, "vx": 20.0, "vy": 1.0}
    assert action(world(slow, other, lane=2)) != "LANE_LEFT"
    assert action(world(slow, {**other, "vy": 0.0}, lane=2)) == "LANE_LEFT"


def test_it_never_overtakes_in_a_lane_of_the_oncoming():
    env = world(name="two-way-v0")
    core = env.unwrapped
    ego = MDPVehicle(core.road, [30.0, 4.0], speed=20.0, target_speeds=SPEEDS)
    place(core, ego)
    core.road.vehicles.append(TrackVehicle(core.road, [60.0, 4.0], speed=5.0))
    assert is_oncoming(core.road.network, ("a", "b", 0), ego.position)
    assert not is_oncoming(core.road.network, ("a", "b", 1), ego.position)
    assert action(env) == "SLOWER"


def test_it_leaves_a_lane_that_ends():
    env = world(name="merge-v1")
    core = env.unwrapped
    lane = core.road.network.get_lane(("b", "c", 2))
    place(core, MDPVehicle(core.road, lane.position(5.0, 0.0), speed=20.0, target_speeds=SPEEDS))
    assert action(env) == "LANE_LEFT"


def test_it_slows_down_before_a_curve():
    env = world(name="u-turn-v1")
    core = env.unwrapped
    lane = core.road.network.get_lane(("a", "b", 0))
    accelerations = []
    for s in (lane.length - 100.0, lane.length - 20.0):
        ego = MDPVehicle(core.road, lane.position(s, 0.0), lane.heading_at(s), 16.0, target_speeds=SPEEDS)
        place(core, ego)
        ego.plan_route_to("d")
        accelerations.append(acceleration(env))
    assert accelerations[1] < -1.0 < accelerations[0]


def test_it_follows_its_route_through_the_roundabout():
    env = world(name="roundabout-v1")
    core = env.unwrapped
    place(core, core.vehicle)
    ego = core.vehicle
    path = path_ahead(core.road.network, ego.target_lane_index, ego.route, ego.position, 150.0)
    nxs = core.road.network.get_lane(("nx", "nxs", 0))
    assert min(nxs.distance(p) for p in path.points) < 0.5
    length = np.linalg.norm(np.diff(path.points, axis=0), axis=-1)
    assert length.max() < 6.0
    assert ego.route == core.vehicle.route


def test_a_forecast_collision_overrides_the_car_following_model():
    """A crossing vehicle that IDM does not see, because it is not on the path yet."""
    env = world(speed=10.0)
    core = env.unwrapped
    crossing = TrackVehicle(core.road, [225.0, 24.0], heading=-np.pi / 2, speed=8.0)
    core.road.vehicles.append(crossing)
    decision = PLANNER.decide(env)
    core.road.vehicles.remove(crossing)
    assert PLANNER.decide(env).action == "FASTER"
    assert decision.action != "FASTER"


def test_deciding_changes_nothing_and_repeats():
    env = world({"x": 230.0, "y": 4.0, "vx": 12.0}, name="roundabout-v1")
    core = env.unwrapped
    before = deepcopy({k: v for k, v in vars(core.vehicle).items() if k not in ("road", "lane")})
    random = core.np_random.bit_generator.state
    first, second = PLANNER.act(env), PLANNER.act(env)
    np.testing.assert_array_equal(PLANNER.choose(env).plan, PLANNER.choose(env).plan)
    assert first == second
    np.testing.assert_equal({k: v for k, v in vars(core.vehicle).items() if k not in ("road", "lane")}, before)
    assert core.np_random.bit_generator.state == random


@pytest.mark.parametrize("name", PLANNERS)
def test_a_plan_begins_at_the_vehicle_and_goes_forward(name):
    env = world({"x": 240.0, "y": 4.0, "vx": 10.0}, blocked(8.0), **settings(find(name)))
    plan = find(name).choose(env).plan
    assert plan.ndim == 2
    assert plan.shape[1] == 2
    np.testing.assert_allclose(plan[0], [200.0, 4.0], atol=0.3)
    assert (np.diff(plan[:, 0]) > 0).all()
    if name in ("idm", "truth"):
        assert plan[-1, 1] < 1.0  # in the left lane, where it overtakes


@pytest.mark.parametrize("name", PLANNERS)
def test_a_choice_has_the_action_of_acting(name):
    env = world({"x": 240.0, "y": 4.0, "vx": 10.0}, blocked(8.0), **settings(find(name)))
    np.testing.assert_array_equal(find(name).choose(env).action, find(name).act(env))


def following(v: float, target: float, gap: float, lead: float) -> gym.Env:
    """Behind a leader, both lanes beside blocked, with an ego that drives at v towards another target speed."""
    env = world({"x": 200.0 + gap + 4.85, "y": 4.0, "vx": lead}, blocked(0.0), blocked(8.0))
    ego = EgoVehicle(env.unwrapped.road, [200.0, 4.0], speed=v, target_speeds=SPEEDS)
    ego.speed_index = SPEEDS.index(target)
    ego.target_speed = target
    env.unwrapped.road.vehicles[0] = env.unwrapped.vehicle = ego
    return env


def test_what_is_nearly_right_is_left_alone():
    """Noise of a quarter of a metre per second in the leader's speed does not move the pedals."""
    steady = PLANNER.model.desired_gap(20.0, 20.0)
    for lead in np.linspace(19.75, 20.25, 5):
        assert action(following(20.0, 20.0, steady, lead)) == "IDLE"


def test_a_change_of_target_is_not_taken_back_at_once():
    steady = PLANNER.model.desired_gap(20.0, 20.0)
    closing = next(g for g in np.arange(steady, 0.0, -0.2) if action(following(20.0, 20.0, g, 20.0)) == "SLOWER")
    assert action(following(19.7, 17.5, closing, 20.0)) == "IDLE"


def test_an_emergency_is_braked_with_all_there_is():
    env = following(25.0, 25.0, 28.0, 0.0)
    ego, steps = env.unwrapped.vehicle, []
    for _ in range(4):
        ego.act(action(env))
        steps.append(ego.action["acceleration"])
        for _ in range(3):
            ego.act()
            ego.step(1 / 15)
    assert steps[-1] == -8.0


def test_who_leans_towards_the_path_is_given_way_as_far_as_a_change_is_likely():
    def beside(vy):
        return acceleration(world({"x": 214.0, "y": 8.0, "vx": 18.0, "vy": vy}, blocked(0.0)))

    assert beside(0.0) == beside(1.0)  # 0.2 % and less
    assert beside(0.0) > beside(-0.7) + 0.1 > beside(-1.3) + 0.5


@pytest.mark.parametrize("name", PLANNERS)
def test_every_planner_gives_valid_actions(name):
    planner = find(name)
    env = world(**settings(planner))
    action = planner.act(env)
    assert env.action_space.contains(int(action) if np.ndim(action) == 0 else action)


def test_idle_is_idle_in_continuous_spaces_too_and_idm_says_what_it_needs():
    env = world(action={"type": "ContinuousAction"})
    np.testing.assert_array_equal(find("idle").act(env), np.zeros(2))
    with pytest.raises(TypeError, match="DiscreteMetaAction"):
        find("idm").act(env)


def test_idle_takes_the_middle_of_discrete_actions_and_refuses_where_there_is_none():
    assert find("idle").act(world(action={"type": "DiscreteAction"})) == 4
    assert find("idle").act(world(action={"type": "DiscreteAction", "lateral": False, "actions_per_axis": 5})) == 2
    with pytest.raises(TypeError, match="odd number of actions_per_axis, got 4"):
        find("idle").act(world(action={"type": "DiscreteAction", "actions_per_axis": 4}))


@pytest.mark.parametrize("kind", ["ContinuousAction", "DiscreteAction", "DiscreteMetaAction"])
def test_a_scenario_takes_every_action_type_and_idle_keeps_its_speed(kind):
    env = gym.make("testbed/following-v0", tracker="rm-feldmann", planner="idle", config={"action": {"type": kind}})
    env.reset(seed=0)
    speed = float(np.hypot(*env.truth.ego.velocity))
    for _ in range(3):
        env.step(find("idle").act(env))
    assert np.hypot(*env.truth.ego.velocity) == pytest.approx(speed, abs=1.3)
    assert env.unwrapped.road.vehicles[0] is env.unwrapped.vehicle
    if kind == "DiscreteMetaAction":
        assert env.action_space.contains(find("idm").act(env))
    else:
        with pytest.raises(TypeError, match=r"the planner needs config.*DiscreteMetaAction.*use planner 'idle'"):
            find("idm").act(env)


def test_an_unknown_planner_is_answered_with_the_nearest():
    with pytest.raises(LookupError, match="did you mean 'idle'"):
        find("idl")
    assert find("truth").knows_truth
    assert not find("idm").knows_truth


@pytest.mark.parametrize(("name", "seed"), [("cut-in", 0), ("merge", 1), ("hard-brake", 0), ("roundabout", 0)])
def test_it_drives_without_a_collision_when_it_knows_the_truth(name, seed):
    env = gym.make(f"testbed/{name}-v0", tracker="truth", radar="front", config={"duration": 12.0})
    env.reset(seed=seed)
    done, info, start = False, {}, env.truth.ego.pose[:2]
    while not done:
        *_, terminated, truncated, info = env.step(PLANNER.act(env))
        done = terminated or truncated
    assert not info["crashed"]
    assert np.hypot(*(env.truth.ego.pose[:2] - start)) > 50.0


# What it stands on


def test_others_are_found_along_and_across_a_path():
    env = world()
    core = env.unwrapped
    path = path_ahead(core.road.network, ("0", "1", 1), None, core.vehicle.position, 100.0)
    others = Others(
        position=np.array([[230.0, 5.0], [180.0, 4.0]]),
        heading=np.array([np.pi / 2, 0.0]),
        velocity=np.array([[1.0, 2.0], [3.0, 0.0]]),
        size=np.array([[5.0, 2.0], [4.0, 2.0]]),
        course=np.zeros(2),
        bend=np.zeros(2),
        lean=np.zeros((2, 2)),
        lean_cov=np.zeros((2, 2, 2)),
    )
    r = relate(path, others)
    np.testing.assert_allclose(r.along, [30.0, -20.0], atol=1e-9)
    np.testing.assert_allclose(r.across, [1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(r.speed, [1.0, 3.0])
    np.testing.assert_allclose(r.drift, [2.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(r.half, [[1.0, 2.5], [2.0, 1.0]], atol=1e-9)
    np.testing.assert_array_equal(on_path(r, 2.0), [True, True])
    np.testing.assert_array_equal(on_path(r, 2.0, later=3.0), [False, True])


def test_a_forecast_stays_on_the_circle_of_its_lane():
    radius = 30.0
    others = Others(np.array([[radius, 0.0]]), np.array([np.pi / 2]), np.array([[0.0, 9.0]]), np.ones((1, 2)),
                    np.array([np.pi / 2]), np.array([1 / radius]), np.zeros((1, 2)), np.zeros((1, 2, 2)))  # fmt: skip
    times = np.linspace(0.0, 4.0, 9)
    position, heading = forecast(others, times)
    angle = 9.0 * times / radius
    np.testing.assert_allclose(position[0], radius * np.stack([np.cos(angle), np.sin(angle)], -1), atol=1e-9)
    np.testing.assert_allclose(heading[0], np.pi / 2 + angle)


@pytest.mark.parametrize(
    ("offset", "turn", "expected"),
    [([4.9, 0.0], 0.0, True), ([5.1, 0.0], 0.0, False), ([0.0, 2.1], 0.0, False), ([3.6, 0.0], np.pi / 2, False),
     ([3.4, 0.0], np.pi / 2, True), ([3.5, 2.4], np.pi / 4, True), ([4.3, 3.2], np.pi / 4, False)],
)  # fmt: skip
@pytest.mark.parametrize("world_turn", [0.0, 1.1])
def test_boxes_overlap_whatever_the_orientation_of_the_world(offset, turn, expected, world_turn):
    c, s = np.cos(world_turn), np.sin(world_turn)
    d = np.array([[c, -s], [s, c]]) @ offset
    size = np.array([5.0, 2.0])
    hit = overlap(np.zeros(2), np.array(world_turn), size, d, np.array(world_turn + turn), size)
    assert bool(hit) is expected


@pytest.mark.parametrize("name", ["roundabout-v1", "merge-v1", "u-turn-v1", "racetrack-v1"])
def test_tables_of_lanes_agree_with_the_lanes(name):
    network = gym.make(name).unwrapped.road.network
    for lane in network.lanes_list():
        s = np.linspace(0.0, lane.length, 23)
        points, heading = lane_table(lane).at(s)
        np.testing.assert_allclose(points, [lane.position(x, 0.0) for x in s], atol=0.03)
        turn = heading - np.array([lane.heading_at(x) for x in s])
        np.testing.assert_allclose(np.sin(turn / 2), 0.0, atol=0.03)


def test_beyond_its_ends_a_tabulated_lane_goes_straight_on():
    lane = CircularLane([0.0, 0.0], 20.0, 0.0, 1.0)
    (before, after), heading = lane_table(lane).at(np.array([-5.0, lane.length + 5.0]))
    np.testing.assert_allclose(before, lane.position(0.0, 0.0) - 5.0 * np.array([0.0, 1.0]), atol=1e-9)
    end = lane.position(lane.length, 0.0)
    np.testing.assert_allclose(after, end + 5.0 * np.array([np.cos(heading[1]), np.sin(heading[1])]), atol=1e-9)
    np.testing.assert_allclose(heading, [np.pi / 2, np.pi / 2 + 1.0])


def test_points_along_a_path_invert_the_relation():
    env = world(name="roundabout-v1")
    core = env.unwrapped
    ego = core.vehicle
    path = path_ahead(core.road.network, ego.target_lane_index, ego.route, ego.position, 100.0)
    arc = np.array([0.0, 31.0, 99.0])
    points, heading = along_path(path, arc, np.zeros(3))
    nothing = np.zeros((3, 2)), np.ones((3, 2)), heading, np.zeros(3), np.zeros((3, 2)), np.zeros((3, 2, 2))
    r = relate(path, Others(points, heading, *nothing))
    np.testing.assert_allclose(r.along, arc, atol=0.2)
    np.testing.assert_allclose(r.across, 0.0, atol=0.2)
