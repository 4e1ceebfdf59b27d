"""What a planner may see, and what it must not."""

from copy import deepcopy

import gymnasium as gym
import numpy as np
import pytest
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import MDPVehicle
from highway_env.vehicle.objects import Landmark, Obstacle

from scenarios.articulated import ArticulatedIDM
from testbed.environment.belief import BeliefView, RoadSwap, belief_road, is_map, mirror_road
from testbed.environment.perception import advance
from testbed.planners.track_vehicle import MAX_SIZE, TrackVehicle, plausible
from trackers.estimate import prior
from trackers.geometry import box_corners, unit


def straight_road() -> Road:
    return Road(RoadNetwork.straight_road_network(3, length=500.0), np_random=np.random.default_rng(0))


def world_with_ego(x: float = 100.0) -> tuple[Road, MDPVehicle]:
    road = straight_road()
    ego = MDPVehicle(road, [x, 4.0], speed=20.0)
    road.vehicles = [ego, IDMVehicle(road, [x + 30.0, 4.0], speed=15.0)]
    return road, ego


def posterior(estimate, ids=None):
    road, ego = world_with_ego()
    ids = np.arange(len(estimate.pose)) if ids is None else ids
    return belief_road(road, [ego], ids, estimate, np.random.default_rng(0)), ego


def test_a_track_shows_its_estimate_until_it_is_stepped():
    estimate = prior([[120.0, 4.0, 0.1]], velocity=[[10.0, 2.0]], size=[[8.0, 2.5]])
    road, _ = posterior(estimate)
    track = road.vehicles[1]
    np.testing.assert_array_equal(track.velocity, [10.0, 2.0])
    assert (track.LENGTH, track.WIDTH, track.diagonal) == (8.0, 2.5, np.hypot(8.0, 2.5))
    assert track.speed == pytest.approx(estimate.speed[0])
    track.act()
    track.step(0.1)
    np.testing.assert_allclose(track.velocity, track.speed * unit(track.heading))


def test_a_changed_velocity_does_not_reach_into_the_track():
    road, _ = posterior(prior([[120.0, 4.0, 0.0]], velocity=[[10.0, 0.0]]))
    road.vehicles[1].velocity[:] = 99.0
    np.testing.assert_array_equal(road.vehicles[1].velocity, [10.0, 0.0])


def test_tracks_come_after_the_ego_nearest_first():
    estimate = prior([[170.0, 4.0, 0.0], [110.0, 0.0, 0.0], [60.0, 8.0, 0.0]])
    road, ego = posterior(estimate, ids=np.array([7, 8, 9]))
    assert road.vehicles[0] is ego
    assert [v.track_id for v in road.vehicles[1:]] == [8, 9, 7]


@pytest.mark.parametrize(
    ("pose", "velocity", "size"),
    [
        ([np.nan, 0.0, 0.0], [1.0, 0.0], [4.0, 2.0]),
        ([120.0, 0.0, np.inf], [1.0, 0.0], [4.0, 2.0]),
        ([120.0, 0.0, 0.0], [np.nan, 0.0], [4.0, 2.0]),
        ([120.0, 0.0, 0.0], [500.0, 0.0], [4.0, 2.0]),
        ([120.0, 0.0, 0.0], [1.0, 0.0], [np.nan, 2.0]),
        ([9000.0, 0.0, 0.0], [1.0, 0.0], [4.0, 2.0]),
        ([101.0, 4.2, 0.0], [1.0, 0.0], [4.0, 2.0]),  # within the ego
    ],
)
def test_an_absurd_estimate_never_reaches_the_planner(pose, velocity, size):
    good = ([130.0, 4.0, 0.0], [1.0, 0.0], [4.0, 2.0])
    both = [np.stack(pair) for pair in zip((pose, velocity, size), good, strict=True)]
    estimate = prior(both[0], velocity=both[1], size=both[2])
    road, ego = posterior(estimate)
    np.testing.assert_array_equal(plausible(estimate, [ego]), [False, True])
    assert [v.track_id for v in road.vehicles[1:]] == [1]


def test_a_track_carries_the_uncertainty_across_its_heading():
    estimate = prior([[120.0, 4.0, np.pi / 2]], velocity=[[0.0, 10.0]])
    cov = np.diag([1.5, 1.0, 0.3**2, 2.0**2])
    cov[0, 2] = cov[2, 0] = 0.2
    road, _ = posterior(estimate._replace(cov=cov[None]))
    np.testing.assert_allclose(road.vehicles[1].across_cov, [[1.5, 0.2], [0.2, 0.09]])  # x is across a heading along y


def test_an_absurd_size_is_clipped_and_the_vehicle_stays():
    road, _ = posterior(prior([[150.0, 4.0, 0.0]], size=[[400.0, 90.0]]))
    assert tuple(MAX_SIZE) == (road.vehicles[1].LENGTH, road.vehicles[1].WIDTH)


def test_no_track_is_an_empty_road_with_the_ego():
    road, ego = posterior(prior(np.zeros((0, 3))))
    assert road.vehicles == [ego]


def test_an_estimate_is_advanced_at_constant_velocity_with_its_contour():
    estimate = prior([[0.0, 0.0, 0.0]], velocity=[[10.0, 1.0]], yaw_rate=[0.5])
    estimate = estimate._replace(contour=box_corners(estimate.pose, estimate.size))
    later = advance(estimate, 0.2)
    np.testing.assert_allclose(later.pose, [[2.0, 0.2, 0.1]])
    np.testing.assert_allclose(later.contour, box_corners(later.pose, later.size), atol=1e-12)
    np.testing.assert_array_equal(advance(estimate, 0.0).contour, estimate.contour)


def test_predictions_keep_gaps_from_bumper_to_bumper():
    road = straight_road()
    car, truck = (TrackVehicle(road, [50.0, 4.0], size=(length, 2.0)) for length in (4.0, 16.0))
    ahead = TrackVehicle(road, [90.0, 4.0], size=(6.0, 2.0))
    assert truck.desired_gap(truck, ahead) - car.desired_gap(car, ahead) == pytest.approx(6.0)
    assert car.desired_gap(car, ahead) == pytest.approx(TrackVehicle.DISTANCE_WANTED + 5.0)


def test_predictions_do_not_depend_on_what_was_written_into_the_stock_class(monkeypatch):
    before = TrackVehicle.DISTANCE_WANTED, TrackVehicle.COMFORT_ACC_MAX, TrackVehicle.COMFORT_ACC_MIN
    for name in ("DISTANCE_WANTED", "COMFORT_ACC_MAX", "COMFORT_ACC_MIN"):
        monkeypatch.setattr(IDMVehicle, name, 99.0)
    assert before == (TrackVehicle.DISTANCE_WANTED, TrackVehicle.COMFORT_ACC_MAX, TrackVehicle.COMFORT_ACC_MIN)


def test_a_new_vehicle_from_a_track_keeps_its_size():
    track = TrackVehicle(straight_road(), [50.0, 4.0], size=(12.0, 2.5))
    twin = TrackVehicle.create_from(track)
    assert (twin.LENGTH, twin.WIDTH, twin.diagonal) == (12.0, 2.5, track.diagonal)


def test_the_map_has_landmarks_and_lane_ends_but_not_what_stands_in_the_lane():
    road = gym.make("merge-v1").unwrapped.road
    (end_of_ramp,) = road.objects
    broken_down = Obstacle(road, [100.0, 4.0])
    assert is_map(road, end_of_ramp)
    assert is_map(road, Landmark(road, [100.0, 4.0]))
    assert is_map(road, Obstacle(road, [100.0, -30.0]))
    assert not is_map(road, broken_down)
    road.objects.append(broken_down)
    ego = road.vehicles[0]
    belief = belief_road(road, [ego], np.zeros(0, int), prior(np.zeros((0, 3))), np.random.default_rng(0))
    assert belief.objects == [end_of_ramp]


def test_a_mirror_shows_an_articulated_truck_with_its_trailer():
    road, ego = world_with_ego()
    truck = ArticulatedIDM(road, [200.0, 0.0], 0.0, 15.0)
    road.vehicles.append(truck)
    twin = mirror_road(road, [ego], np.random.default_rng(0)).vehicles[2]
    assert twin.LENGTH > truck.LENGTH + 5.0
    assert twin.position[0] < truck.position[0]


def test_a_mirror_keeps_the_order_of_the_true_list():
    road, ego = world_with_ego()
    road.vehicles.reverse()
    mirror = mirror_road(road, [ego], np.random.default_rng(0))
    assert mirror.vehicles[1] is ego
    np.testing.assert_array_equal(mirror.vehicles[0].position, road.vehicles[0].position)


def test_a_view_has_its_own_road_and_everything_else_from_the_environment():
    env = gym.make("highway-fast-v0").unwrapped
    road = straight_road()
    view = BeliefView(env, lambda: road)
    assert view.road is road
    assert view.vehicle is env.vehicle
    assert view.config is env.config
    with pytest.raises(AttributeError):
        view.__array_interface__  # noqa: B018
    with pytest.raises(AttributeError):
        view.no_such_thing  # noqa: B018


def test_a_copied_view_is_the_copied_environment():
    env = gym.make("highway-fast-v0").unwrapped
    env.observation_type.env = BeliefView(env, straight_road)
    twin = deepcopy(env)
    assert twin.observation_type.env is twin
    assert twin is not env


def test_while_the_truth_is_hidden_stray_references_copy_the_belief():
    env = gym.make("highway-fast-v0").unwrapped
    truth, belief = env.road, straight_road()
    env.keepsake = truth
    swap = RoadSwap(env)
    swap.hide(belief)
    assert env.road is belief
    assert env.vehicle.road is belief
    twin = deepcopy(env)
    assert twin.keepsake is twin.road
    assert twin.road.vehicles == []
    swap.show()
    assert env.road is truth
    assert env.vehicle.road is truth
    assert len(deepcopy(env).road.vehicles) == len(truth.vehicles)


def test_a_road_that_was_replaced_meanwhile_is_kept():
    env = gym.make("highway-fast-v0").unwrapped
    swap = RoadSwap(env)
    swap.hide(straight_road())
    env.reset(seed=1)
    fresh = env.road
    swap.show()
    assert env.road is fresh
    assert not swap.hidden
