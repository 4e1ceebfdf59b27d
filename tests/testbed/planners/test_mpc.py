"""Model predictive control on hand-made roads: gaps, what uncertainty does to them, steering."""

import gymnasium as gym
import numpy as np
import pytest
from highway_env.vehicle.kinematics import Vehicle

from testbed.experiments.probe import BLIND, driven
from testbed.experiments.run import Run
from testbed.frame import TRUTH
from testbed.planners.mpc import Obstacles, merging, on_belief_road, steering_angle
from testbed.planners.prediction import LanePath, Others, path_ahead
from testbed.planners.registry import find, settings
from tests.testbed.planners.roads import world

MPC = find("mpc")


def continuous(*others: dict, **more):
    return world(*others, **{**settings(MPC), **more})


def acceleration(env: gym.Env, planner=MPC) -> float:
    return planner.decide(env).acceleration


def drive(env: gym.Env, decisions: int) -> list[float]:
    """The ego's speeds [m/s] after each decision."""
    speeds = []
    for _ in range(decisions):
        env.step(MPC.act(env))
        speeds.append(float(env.unwrapped.vehicle.speed))
    return speeds


def test_an_empty_road_is_driven_at_the_same_speed():
    assert abs(acceleration(continuous(speed=23.0))) < 0.5


def test_it_stops_behind_what_stands_in_its_lane():
    env = continuous()
    env.unwrapped.road.vehicles.append(Vehicle(env.unwrapped.road, [260.0, 4.0]))
    speeds = drive(env, 80)
    gap = 260.0 - env.unwrapped.vehicle.position[0] - 5.0  # both are 5 m long
    assert not env.unwrapped.vehicle.crashed
    assert speeds[-1] < 0.5
    assert gap > 0.5


def test_what_is_beside_the_lane_is_no_reason_to_brake_but_what_drifts_in_is():
    beside = {"x": 212.0, "y": 8.0, "vx": 18.0}
    assert acceleration(continuous(beside)) == pytest.approx(acceleration(continuous()), abs=0.6)
    assert acceleration(continuous({**beside, "vy": -1.5})) < acceleration(continuous(beside)) - 1.0


def test_the_action_is_the_acceleration_as_a_share_of_its_range():
    env = continuous({"x": 225.0, "y": 4.0, "vx": 5.0})
    low, high = settings(MPC)["action"]["acceleration_range"]
    action = MPC.act(env)
    assert action.shape == (2,)
    assert low + (action[0] + 1) / 2 * (high - low) == pytest.approx(acceleration(env), abs=1e-5)
    alone = continuous({"x": 225.0, "y": 4.0, "vx": 5.0}, action={**settings(MPC)["action"], "lateral": False})
    np.testing.assert_allclose(MPC.act(alone), action[:1])


def test_it_says_which_actions_it_needs():
    with pytest.raises(TypeError, match=r"ContinuousAction, got .*DiscreteMetaAction"):
        MPC.act(world())


def obstacle(cov: np.ndarray, edges: tuple[float, float] = (0.0, 0.0), existence: float = 1.0) -> Obstacles:
    """One leader 30 m ahead in the ego's lane, as fast; standard deviations [m] of its front and rear."""
    others = Others(np.array([[230.0, 4.0]]), np.zeros(1), np.array([[20.0, 0.0]]), np.array([[4.0, 2.0]]), np.zeros(1),
                    np.zeros(1), np.zeros((1, 2)), np.zeros((1, 2, 2)))  # fmt: skip
    return Obstacles(others, np.array([existence]), cov[None], np.array([edges]))


def test_the_near_bumper_is_as_uncertain_as_its_place_and_the_speed_together():
    """PLAN.3 by hand: var = 2 + 2 t 0.5 + t^2 4, so 2 at once and 20 after 2 s; nothing of y and the front."""
    cov = np.diag([1.0, 99.0, 4.0, 99.0])
    cov[0, 2] = cov[2, 0] = 0.5
    edges = 9.0, np.sqrt(2.0)
    np.testing.assert_allclose(obstacle(cov, edges).edge_std(np.array([0.0, 2.0]), 0.0), np.sqrt([[2.0, 20.0]]))
    turned = obstacle(np.diag([99.0, 1.0, 99.0, 4.0]), edges)
    turned = turned._replace(others=turned.others._replace(course=np.full(1, np.pi / 2)))
    np.testing.assert_allclose(turned.edge_std(np.array([2.0]), 0.0), np.sqrt([[18.0]]))
    np.testing.assert_allclose(obstacle(0 * cov, edges).edge_std(np.array([0.0]), np.pi), [[9.0]])  # it comes towards


def ahead_of(planner, obstacles):
    env = continuous()
    ego = env.unwrapped.vehicle
    path = path_ahead(env.unwrapped.road.network, ego.lane_index, None, ego.position, 150.0)
    return ego, planner.ahead(ego, path, obstacles)


def test_caution_keeps_the_quantile_of_the_near_bumper_free():
    unsure = obstacle(np.zeros((4, 4)), (0.0, 2.0), existence=0.3)
    (ego, plain), (_, cautious) = (ahead_of(find(name), unsure) for name in ("mpc", "mpc-cautious"))
    np.testing.assert_allclose(cautious.margin - plain.margin, 1.28 * 2.0)
    np.testing.assert_allclose(plain.rear[0, :2], [32.0, 36.0])  # 30 - 2 + 20 t
    speed, arc = np.full((1, 20), 25.0), 25.0 * np.arange(0.2, 4.1, 0.2)[None]
    certain = plain._replace(weight=np.ones(1))
    np.testing.assert_allclose(MPC.risk(ego, plain, speed, arc), 0.3 * MPC.risk(ego, certain, speed, arc))
    assert MPC.risk(ego, plain, speed, arc).max() > 0
    # by hand after 0.2 s, both at 25 m/s: a gap of 32 - 5 - 2.5 m, 2 + 2.56 + 22.5 + (25^2 - 20^2) / 6 wanted
    missing = 2 + 2.56 + 22.5 + 37.5 - 24.5
    np.testing.assert_allclose(MPC.risk(ego, cautious, speed, arc)[0, 0], 0.3 * 0.02 * missing**2)


def test_the_controls_of_caution_keep_margins_of_one_mean_that_know_no_covariance():
    unsure, sure = obstacle(np.zeros((4, 4)), (0.0, 2.0)), obstacle(np.zeros((4, 4)))
    kept = {}
    for name in ("constant", "curve"):
        planner = find(f"mpc-cautious:margin={name}")
        assert planner.above == find("mpc-cautious").above
        (_, plain), (_, one), (_, other) = ahead_of(MPC, sure), ahead_of(planner, sure), ahead_of(planner, unsure)
        np.testing.assert_array_equal(one.margin, other.margin)
        kept[name] = (one.margin - plain.margin)[0]
    assert np.ptp(kept["constant"]) < 1e-9 < np.ptp(kept["curve"])
    assert kept["constant"].mean() == pytest.approx(kept["curve"].mean())
    with pytest.raises(ValueError, match="margin"):
        find("mpc:margin=wide")


@pytest.fixture(scope="module")
def tracked():
    env = gym.make("testbed/hard-brake-v0", tracker="rm-feldmann", config=settings(MPC), warm_up=1.0)
    env.reset(seed=3)
    yield env
    env.close()


def test_with_perfect_tracks_caution_changes_nothing():
    env = gym.make("testbed/hard-brake-v0", tracker="truth", config={**settings(MPC), "duration": 8.0})
    env.reset(seed=1)
    done, hardest = False, 0.0
    while not done:
        sure, cautious = (find(name).decide(env) for name in ("mpc", "mpc-cautious"))
        assert sure.acceleration == cautious.acceleration
        hardest = min(hardest, sure.acceleration)
        *_, crashed, over, _ = env.step(MPC.act(env))
        done = crashed or over
    assert hardest <= -1.0
    assert not env.unwrapped.vehicle.crashed


def test_caution_sees_tentative_tracks_that_are_not_on_the_road(tracked):
    all_tracks = tracked.current_tracks
    on_road, seen = on_belief_road(tracked, 150.0), find("mpc-cautious").obstacles(tracked)
    near = np.hypot(*(all_tracks.estimate.pose[:, :2] - tracked.unwrapped.vehicle.position).T) < 150.0
    assert len(seen.existence) >= (near & (all_tracks.existence > 0.1)).sum()
    assert set(np.round(on_road.others.position[:, 0], 6)) <= set(np.round(seen.others.position[:, 0], 6))


@pytest.mark.parametrize(("y", "heading", "side"), [(5.0, 0.0, -1), (3.0, 0.0, 1), (4.0, 0.1, -1)])
def test_it_steers_back_to_the_centre_of_the_lane(y, heading, side):
    env = continuous()
    ego = env.unwrapped.vehicle
    ego.position, ego.heading = np.array([200.0, y]), heading
    path = path_ahead(env.unwrapped.road.network, ("0", "1", 1), None, ego.position, 100.0)
    assert np.sign(steering_angle(path, ego)) == side


def test_a_lateral_error_fades_without_overshoot():
    env = continuous()
    env.unwrapped.vehicle.position[1] = 4.8
    offsets = []
    for _ in range(40):
        env.step(MPC.act(env))
        offsets.append(env.unwrapped.vehicle.position[1] - 4.0)
    assert abs(offsets[-1]) < 0.05
    assert min(offsets) > -0.1


@pytest.mark.parametrize("name", ["s-curve", "roundabout", "merge"])
def test_it_follows_bent_roads_and_routes(name):
    env = gym.make(f"testbed/{name}-v0", tracker="truth", config={**settings(MPC), "duration": 8.0})
    env.reset(seed=0)
    done, offsets = False, []
    while not done:
        *_, crashed, over, _ = env.step(MPC.act(env))
        ego = env.unwrapped.vehicle
        offsets.append(abs(ego.lane.local_coordinates(ego.position)[1]))
        done = crashed or over
    assert not crashed
    assert max(offsets) < 0.6


def straight(points):
    arc = 2.0 * np.arange(len(points))
    return LanePath(points, np.zeros(len(arc)), arc, np.zeros(len(arc)), np.full(len(arc), np.inf), 0.0)


def test_a_lane_that_ends_is_left_in_time():
    """The lane ends after 40 m, the next one lies 4 m to the right: half of that is done half of 20 m before."""
    x = 2.0 * np.arange(31)
    path = straight(np.stack([x, np.where(x > 40.0, -4.0, 0.0)], -1))
    moved = merging(path, 20.0)
    y = dict(zip(x, moved.points[:, 1], strict=True))
    assert [y[20.0], y[30.0], y[40.0], y[60.0]] == pytest.approx([0.0, -2.0, -4.0, -4.0])
    assert np.diff(moved.points[:, 1]).min() > -0.7  # no step is left
    assert moved.heading[[5, 30]] == pytest.approx([0.0, 0.0])
    assert moved.heading.min() == pytest.approx(np.arctan(-1.5 * 4.0 / 20.0), abs=0.01)
    np.testing.assert_array_equal(moved.arc, path.arc)


def test_a_path_without_end_of_a_lane_stays_as_it_is():
    x = 2.0 * np.arange(31)
    path = straight(np.stack([x, np.where(x > 40.0, 0.9, 0.0)], -1))
    assert merging(path, 20.0) is path


@pytest.mark.parametrize("seed", [910, 911])
def test_it_merges_on_the_road_and_crashes_if_it_sees_nothing(seed):
    truth, blind = (driven(Run("probe-merge", seed, source, "mpc", warm_up=1.0)) for source in (TRUTH, BLIND))
    assert truth["off_road"] == truth["collisions"] == 0
    assert blind["collisions"] > 0


def test_pedals_never_drive_backwards():
    env = gym.make("testbed/following-v0", tracker="truth", config={**settings(MPC), "duration": 8.0})
    env.reset(seed=0)
    done, speeds = False, []
    while not done:
        *_, crashed, over, _ = env.step(np.array([-1.0, 0.0]))
        speeds.append(env.unwrapped.vehicle.speed)
        done = crashed or over
    assert min(speeds) == 0.0 == speeds[-1]
