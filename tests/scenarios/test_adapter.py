"""The adapter: Scenes that agree with the motion of the simulation."""

import warnings
from types import SimpleNamespace

import gymnasium as gym
import highway_env  # noqa: F401 - registers the ids
import numpy as np
import pytest
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.controller import MDPVehicle
from highway_env.vehicle.objects import Landmark, Obstacle

from scenarios.adapter import SceneReader, bounding_box
from scenarios.articulated import ArticulatedIDM
from scenarios.bodies import RigidPart, parts
from scenarios.contours import CONTOURS, find
from scenarios.vehicles import EgoVehicle, SizedIDM
from trackers.geometry import to_frame, wrap_angle


def make(name, **config):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        env = gym.make(name, config=config or None).unwrapped
    env.reset(seed=3)
    return env


def small_world(*vehicles, objects=(), frequency=20, walls=None):
    """What the reader reads of an environment: an ego at the origin and the vehicles given by (class, kwargs)."""
    road = Road(RoadNetwork.straight_road_network(3, length=1000), np_random=np.random.default_rng(0))
    ego = EgoVehicle(road, [0.0, 8.0], 0.0, 20.0)
    road.vehicles = [ego] + [cls(road, *args, **kwargs) for cls, args, kwargs in vehicles]
    road.objects = [cls(road, *args) for cls, args in objects]
    env = SimpleNamespace(road=road, vehicle=ego, steps=0, config={"simulation_frequency": frequency})
    if walls is not None:
        env.walls = walls
    return env


def advance(env):
    env.road.step(1 / env.config["simulation_frequency"])
    env.steps += 1


@pytest.mark.parametrize(
    "name",
    ["highway-v0", "merge-v1", "roundabout-v1", "exit-v1", "u-turn-v1", "two-way-v0", "racetrack-v1", "parking-v0"],
)
def test_any_stock_environment_can_be_read(name):
    env = make(name)
    reader = SceneReader()
    first = reader.read(env)
    env.step(env.action_space.sample())
    scene = reader.read(env)
    n = len(scene.objects.id)
    assert n == len(first.objects.id) == len(env.road.vehicles) - 1 + sum(o.solid for o in env.road.objects)
    assert scene.objects.pose.shape == (n, 3)
    assert scene.bodies.owner.tolist() == list(range(n))
    assert scene.time == pytest.approx(env.steps / env.config["simulation_frequency"])
    assert scene.dt == 1 / env.config["simulation_frequency"]
    assert scene.walls.shape == (0, 2, 2)


def test_time_comes_from_frames_not_from_policy_steps():
    env = make("highway-v0", simulation_frequency=20, policy_frequency=3, vehicles_count=3)
    for _ in range(6):
        env.step(1)
    assert env.time == pytest.approx(2.0)
    assert SceneReader().read(env).time == 36 / 20


def test_a_lane_change_is_read_as_it_moves_and_stock_velocity_is_not():
    """Read between the decisions and the move of each frame, when the steering of the frame is known."""
    env = small_world((MDPVehicle, ([30.0, 0.0], 0.0, 25.0), {"target_speed": 25.0}))
    reader, other = SceneReader(), env.road.vehicles[1]
    other.target_lane_index = ("0", "1", 1)
    errors, stock = [], []
    for _ in range(60):
        env.road.act()
        scene, naive = reader.read(env), other.velocity
        advance(env)
        after = reader.read(env)
        moved = (after.objects.pose[0] - scene.objects.pose[0]) / scene.dt
        truth = [*scene.objects.velocity[0], scene.objects.yaw_rate[0]]
        errors.append(np.abs(moved - truth).max())
        stock.append(np.linalg.norm(moved[:2] - naive))
    # explicit Euler is exact here; rounding: 1e-14 * 100 m / 0.05 s
    assert max(errors) < 1e-10
    assert max(stock) > 1.0


def test_after_a_frame_the_motion_is_right_up_to_the_change_of_steering():
    env = small_world((SizedIDM, ([30.0, 0.0], 0.0, 25.0), {"target_speed": 25.0, "enable_lane_change": False}))
    reader, other = SceneReader(), env.road.vehicles[1]
    other.target_lane_index = ("0", "1", 1)
    env.road.act()
    advance(env)
    error = []
    for _ in range(80):
        scene = reader.read(env)
        env.road.act()
        advance(env)
        moved = (reader.read(env).objects.pose[0] - scene.objects.pose[0]) / scene.dt
        error.append(np.linalg.norm(moved[:2] - scene.objects.velocity[0]))
    # d(beta)/dt * dt * v = (0.13 rad/s / 0.6 s * 2.35 m / 25 m/s) * 0.05 s * 25 m/s = 0.026 m/s
    assert max(error) < 0.05


def test_the_ego_is_read_like_any_vehicle():
    env = small_world()
    env.vehicle.target_lane_index = ("0", "1", 1)
    reader, turning = SceneReader(), []
    for _ in range(20):
        env.road.act()
        scene = reader.read(env)
        advance(env)
        after = reader.read(env)
        np.testing.assert_allclose((after.ego.pose - scene.ego.pose)[:2] / 0.05, scene.ego.velocity, atol=1e-10)
        assert (after.ego.pose - scene.ego.pose)[2] / 0.05 == pytest.approx(scene.ego.yaw_rate, abs=1e-10)
        turning.append(abs(scene.ego.yaw_rate))
    assert max(turning) > 0.1
    assert len(scene.objects.id) == 0
    np.testing.assert_array_equal(scene.ego.platform[:3], scene.ego.pose)


@pytest.mark.parametrize("name", [n for n in CONTOURS if n != "trailer"])
def test_the_box_that_collides_is_the_bounding_box_of_the_contour(name):
    env = small_world((SizedIDM, ([30.0, 4.0], 0.8, 5.0), {"contour": name, "length": 6.6, "width": 2.2}))
    scene = SceneReader().read(env)
    vehicle, outline = env.road.vehicles[1], scene.bodies.outline[0]
    pose = np.array([*vehicle.position, vehicle.heading])
    box, drawn = to_frame(pose, vehicle.polygon()), to_frame(pose, outline)
    np.testing.assert_allclose([drawn.min(0), drawn.max(0)], [box.min(0), box.max(0)], atol=1e-12)
    np.testing.assert_array_equal(scene.objects.size[0], [6.6, 2.2])


def test_headings_are_wrapped():
    env = small_world((SizedIDM, ([30.0, 4.0], 3 * np.pi + 0.1, 5.0), {}))
    scene = SceneReader().read(env)
    assert scene.objects.pose[0, 2] == pytest.approx(-np.pi + 0.1)
    assert scene.bodies.pose[0, 2] == scene.objects.pose[0, 2]


def test_ids_are_stable_when_vehicles_leave_and_never_given_twice():
    env = small_world(*[(SizedIDM, ([20.0 * k, 4.0],), {}) for k in range(1, 5)])
    reader = SceneReader()
    assert reader.read(env).objects.id.tolist() == [1, 2, 3, 4]
    del env.road.vehicles[2]
    assert reader.read(env).objects.id.tolist() == [1, 3, 4]
    seen = {1, 2, 3, 4}
    for _ in range(50):  # each newcomer is dropped at once: its address is free for the next
        env.road.vehicles[1:] = [SizedIDM(env.road, [50.0, 4.0])]
        (new,) = reader.read(env).objects.id.tolist()
        assert new not in seen
        seen.add(new)
    reader.reset()
    assert reader.read(env).objects.id.tolist() == [1]


def test_ids_do_not_depend_on_the_order_of_later_frames():
    env = small_world(*[(SizedIDM, ([20.0 * k, 4.0],), {}) for k in range(1, 4)])
    reader = SceneReader()
    reader.read(env)
    env.road.vehicles.reverse()
    scene = reader.read(env)
    assert scene.objects.id.tolist() == [3, 2, 1]
    assert scene.objects.pose[0, 0] == 60.0


def test_solid_obstacles_are_objects_at_rest_and_landmarks_are_not():
    objects = ((Landmark, ([70.0, 0.0],)), (Obstacle, ([60.0, 0.0], 0.2, 9.0)))
    scene = SceneReader().read(small_world((SizedIDM, ([30.0, 4.0],), {}), objects=objects))
    assert scene.objects.kind == ("car", "obstacle")
    assert scene.objects.velocity[1].tolist() == [0.0, 0.0]
    np.testing.assert_array_equal(scene.objects.size[1], [2.0, 2.0])
    assert len(scene.bodies.outline[1]) == 4


def test_stock_vehicles_are_cars():
    env = make("highway-v0", vehicles_count=4)
    assert SceneReader().read(env).objects.kind == ("car",) * 4


def test_crashed_vehicles_are_marked():
    env = small_world(*[(SizedIDM, ([30.0 * k, 4.0],), {}) for k in (1, 2)])
    env.road.vehicles[2].crashed = True
    assert SceneReader().read(env).objects.crashed.tolist() == [False, True]


def test_walls_are_passed_on_and_checked():
    walls = np.array([[[0.0, -2.0], [500.0, -2.0]]])
    np.testing.assert_array_equal(SceneReader().read(small_world(walls=walls)).walls, walls)
    with pytest.raises(ValueError, match=r"env.walls must be \(W, 2, 2\)"):
        SceneReader().read(small_world(walls=walls[0]))


def test_an_articulated_ego_is_refused():
    env = small_world((ArticulatedIDM, ([30.0, 4.0],), {}))
    env.vehicle = env.road.vehicles[1]
    with pytest.raises(ValueError, match="one rigid body"):
        SceneReader().read(env)


def test_an_articulated_truck_is_one_object_with_two_bodies():
    env = small_world(
        (SizedIDM, ([90.0, 0.0],), {}),
        (ArticulatedIDM, ([60.0, 4.0], 0.3), {"hitch": -0.2}),
        (SizedIDM, ([30.0, 0.0],), {}),
    )
    scene = SceneReader().read(env)
    assert scene.objects.kind == ("car", "articulated", "car")
    assert scene.bodies.owner.tolist() == [0, 1, 1, 2]
    assert scene.objects.pose[1, 2] == pytest.approx(0.1)
    xy = to_frame(scene.objects.pose[1], np.concatenate(scene.bodies.outline[1:3]))
    np.testing.assert_allclose(
        [xy.min(0), xy.max(0)], [-scene.objects.size[1] / 2, scene.objects.size[1] / 2], atol=1e-9
    )


@pytest.mark.parametrize("hitch", [-0.6, -0.15, 0.0, 0.02, 0.4])
@pytest.mark.parametrize("steering", [-0.1, 0.0, 0.2])
def test_the_box_of_an_articulated_truck_moves_as_it_says(hitch, steering):
    env = small_world((ArticulatedIDM, ([60.0, 4.0], 0.3, 12.0), {"hitch": hitch}))
    truck, dt = env.road.vehicles[1], 1e-5
    truck.action = {"steering": steering, "acceleration": 0.0}
    before = SceneReader().read(env).objects
    truck.step(dt)
    after = SceneReader().read(env).objects
    # first order: dt / 2 times accelerations of the vertices, below 100 m/s^2
    np.testing.assert_allclose((after.pose[0, :2] - before.pose[0, :2]) / dt, before.velocity[0], atol=1e-3)
    turned = wrap_angle(after.pose[0, 2] - before.pose[0, 2]) / dt
    assert turned == pytest.approx(before.yaw_rate[0], abs=1e-4)


def test_the_velocity_of_the_trailer_is_not_that_of_the_box():
    """The negative twin: with a moving hitch the centre of the box wanders within the trailer."""
    truck = small_world((ArticulatedIDM, ([60.0, 4.0], 0.3, 12.0), {"hitch": -0.6})).road.vehicles[1]
    truck.action = {"steering": 0.2, "acceleration": 0.0}
    box = bounding_box(parts(truck))
    assert np.linalg.norm(box.velocity - truck.parts()[1].velocity) > 0.5


def test_the_bounding_box_of_one_body_is_its_box():
    part = RigidPart("car", np.array([1.0, 2.0, 0.5]), np.array([3.0, 4.0]), 0.2, find("car").size)
    box = bounding_box([part])
    np.testing.assert_allclose(box.pose, part.pose, atol=1e-12)
    np.testing.assert_allclose(box.velocity, part.velocity, atol=1e-12)
    np.testing.assert_allclose(box.size, part.size, atol=1e-12)
