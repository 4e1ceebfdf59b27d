"""Vehicles: sizes, gaps, steering, courses, and constants that nobody else can change."""

import copy
import warnings

import gymnasium as gym
import highway_env  # noqa: F401 - registers the ids
import numpy as np
import pytest
from highway_env.road.lane import CircularLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import MDPVehicle
from highway_env.vehicle.dynamics import BicycleVehicle
from highway_env.vehicle.kinematics import Vehicle
from highway_env.vehicle.objects import Obstacle

from scenarios.bodies import contour_of, motion, parts, rear_extent, resize
from scenarios.constants import ProtectedConstants
from scenarios.courses import CourseTable
from scenarios.roads import CachedRoad
from scenarios.vehicles import CourseVehicle, EgoVehicle, SizedIDM

DT = 0.05


def straight(lanes=3, connected=False):
    net = RoadNetwork.straight_road_network(lanes, length=2000)
    return CachedRoad(net, np_random=np.random.default_rng(0), neighbour_vehicles_connected_lanes=connected)


def run(road, seconds, dt=DT):
    for _ in range(round(seconds / dt)):
        road.act()
        road.step(dt)


def turning_table(duration=8.0, speed=10.0, rate=0.25, hz=100, start=0.0):
    """A course on a circle, exact in every column."""
    t = np.arange(round(duration * hz) + 1) / hz
    h, radius = rate * t + 0.3, speed / rate
    one = np.ones_like(t)
    rows = [start + t, radius * np.sin(h), -radius * np.cos(h), h, speed * np.cos(h), speed * np.sin(h), rate * one]
    return np.stack(rows, -1)


def make_intersection():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return gym.make("intersection-v2").unwrapped


# Sizes


def test_resize_takes_the_diagonal_along():
    vehicle = resize(Vehicle(straight(), [0.0, 0.0]), 12.0, 2.5)
    assert (vehicle.LENGTH, vehicle.WIDTH, vehicle.diagonal) == (12.0, 2.5, np.hypot(12.0, 2.5))
    assert Vehicle.LENGTH == 5.0


def test_a_size_that_is_not_positive_is_refused():
    with pytest.raises(ValueError, match=r"positive, got 0 and 2\.0"):
        SizedIDM(straight(), [0.0, 0.0], length=0, width=2.0)


def test_long_vehicles_that_overlap_end_to_end_collide():
    road = straight()
    a, b = (SizedIDM(road, [x, 0.0], contour="bus") for x in (0.0, 11.5))
    a.handle_collisions(b, DT)
    assert a.crashed
    assert b.crashed


def test_a_stale_diagonal_would_miss_that_collision():
    road = straight()
    a, b = (Vehicle(road, [x, 0.0]) for x in (0.0, 11.5))
    a.LENGTH = b.LENGTH = 12.0
    a.handle_collisions(b, DT)
    assert not a.crashed


@pytest.mark.parametrize("cls", [SizedIDM, EgoVehicle])
def test_create_from_keeps_size_contour_and_state(cls):
    road = straight()
    old = cls(road, [10.0, 4.0], 0.1, 20.0, target_speed=24.0, length=9.0, width=2.4, contour="truck")
    new = cls.create_from(old)
    assert (new.LENGTH, new.WIDTH, new.diagonal, new.contour) == (9.0, 2.4, old.diagonal, "truck")
    assert new.speed == old.speed
    assert new.target_speed == old.target_speed
    assert new.position is not old.position
    np.testing.assert_array_equal(new.position, old.position)


def test_create_from_keeps_the_habits_of_one_driver():
    old = SizedIDM(straight(), [10.0, 4.0], 0.0, 20.0, enable_lane_change=False)
    old.TIME_WANTED = 1.1
    new = SizedIDM.create_from(old)
    assert new.TIME_WANTED == 1.1
    assert not new.enable_lane_change


def test_traffic_can_be_made_from_a_stock_vehicle():
    stock = IDMVehicle(straight(), [10.0, 4.0], 0.0, 20.0)
    new = SizedIDM.create_from(stock)
    assert (new.LENGTH, new.contour, new.DISTANCE_WANTED) == (5.0, "car", 5.0)


def test_unknown_contours_are_guessed_from_type_and_length():
    road = straight()
    assert contour_of(Vehicle(road, [0.0, 0.0])) == "car"
    assert contour_of(resize(Vehicle(road, [0.0, 0.0]), 9.0, 2.5)) == "truck"
    assert contour_of(Obstacle(road, [0.0, 0.0])) == "box"


# Gaps


@pytest.mark.parametrize("lead", ["car", "truck", "bus"])
@pytest.mark.parametrize("follow", ["motorcycle", "car", "bus"])
def test_a_follower_stops_five_metres_behind_the_bumper(lead, follow):
    road = straight(1)
    leader = SizedIDM(road, [120.0, 0.0], 0.0, 0.0, target_speed=0.0, contour=lead)
    follower = SizedIDM(road, [0.0, 0.0], 0.0, 15.0, target_speed=20.0, contour=follow)
    road.vehicles = [follower, leader]
    run(road, 60)
    gap = leader.position[0] - follower.position[0] - (leader.LENGTH + follower.LENGTH) / 2
    # the model creeps towards 5 m: after 60 s some centimetres are left
    assert 5.0 <= gap < 5.2
    assert not follower.crashed


def test_the_stock_driver_hits_a_long_leader():
    road = straight(1)
    leader = SizedIDM(road, [120.0, 0.0], 0.0, 0.0, target_speed=0.0, length=16.5, width=2.5)
    follower = resize(IDMVehicle(road, [0.0, 0.0], 0.0, 15.0, target_speed=20.0), 4.7, 1.9)
    road.vehicles = [follower, leader]
    run(road, 60)
    assert follower.crashed


def test_a_faster_leader_is_no_reason_to_brake():
    road = straight(1)
    slow = SizedIDM(road, [0.0, 0.0], 0.0, 20.0, target_speed=20.0)
    fast = Vehicle(road, [40.0, 0.0], 0.0, 80.0)
    assert slow.acceleration(slow, fast) == pytest.approx(slow.acceleration(slow) - 3.0 * (5.0 / (40 - 4.85)) ** 2)


def test_nobody_drives_backwards_to_restore_a_gap():
    road = straight(1)
    leader = SizedIDM(road, [10.0, 0.0], 0.0, 0.0, target_speed=0.0)
    follower = SizedIDM(road, [2.0, 0.0], 0.0, 3.0, target_speed=20.0)
    road.vehicles = [follower, leader]
    speeds = []
    for _ in range(100):
        run(road, DT)
        speeds.append(follower.speed)
    assert min(speeds) == 0.0


def test_nobody_changes_into_a_lane_beside_a_long_vehicle():
    """A car behind a slow leader; beside it a bus whose centre is 7 m ahead, as fast as can be wished."""
    road = straight(2)
    car = SizedIDM(road, [50.0, 0.0], 0.0, 20.0, target_speed=28.0)
    slow = SizedIDM(road, [80.0, 0.0], 0.0, 15.0, target_speed=15.0)
    bus = SizedIDM(road, [57.0, 4.0], 0.0, 28.0, target_speed=28.0, contour="bus")
    road.vehicles = [car, slow, bus]
    assert not car.mobil(("0", "1", 1))
    road.vehicles = [car, slow]
    assert car.mobil(("0", "1", 1))


def test_a_driver_told_to_stay_in_lane_stays():
    lanes = {}
    for enabled in (True, False):
        road = straight(2)
        car = SizedIDM(road, [50.0, 0.0], 0.0, 25.0, target_speed=28.0, enable_lane_change=enabled)
        road.vehicles = [car, SizedIDM(road, [90.0, 0.0], 0.0, 10.0, target_speed=10.0, enable_lane_change=False)]
        run(road, 6)
        lanes[enabled] = car.target_lane_index[2]
    assert lanes == {True: 1, False: 0}


# Steering


def lane_change(vehicle, road):
    """Peak yaw rate [rad/s] and lateral acceleration [m/s^2], and the time to 90 % of 4 m [s]."""
    road.vehicles = [vehicle]
    vehicle.target_lane_index = ("0", "1", 1)
    rate, lateral, done = 0.0, 0.0, None
    for frame in range(200):
        run(road, DT)
        v, omega = motion(vehicle)
        rate, lateral = max(rate, abs(omega)), max(lateral, abs(omega) * np.hypot(*v))
        done = frame * DT if done is None and vehicle.position[1] > 3.6 else done
    return rate, lateral, done


def test_lane_changes_are_those_of_a_human_driver():
    road = straight()
    ego = EgoVehicle(road, [0.0, 0.0], 0.0, 25.0, target_speed=25.0)
    rate, lateral, seconds = lane_change(ego, road)
    assert rate < 0.15
    assert lateral < 4.0
    assert 3.0 < seconds < 5.0


def test_stock_lane_changes_are_violent():
    road = straight()
    rate, lateral, seconds = lane_change(MDPVehicle(road, [0.0, 0.0], 0.0, 25.0, target_speed=25.0), road)
    assert rate > 1.0
    assert lateral > 10.0
    assert seconds < 1.5


@pytest.mark.parametrize(("contour", "radius", "speed"), [("car", 15.0, 8.0), ("bus", 30.0, 8.0), ("car", 200.0, 25.0)])
def test_soft_steering_keeps_the_lane_in_a_curve(contour, radius, speed):
    def error(cls, **kwargs):
        net = RoadNetwork()
        net.add_lane("a", "b", CircularLane([0, 0], radius, -3.1, 3.1, speed_limit=30))
        road = Road(net)
        lane = net.get_lane(("a", "b", 0))
        v = cls(road, lane.position(0, 0), lane.heading_at(0), speed, target_speed=speed, contour=contour, **kwargs)
        road.vehicles = [v]
        run(road, 4.0 * radius / speed)
        return abs(lane.local_coordinates(v.position)[1])

    class StockPursuit(SizedIDM):
        TAU_PURSUIT = IDMVehicle.TAU_PURSUIT

    assert error(SizedIDM) < 0.25
    assert error(StockPursuit) > 2 * error(SizedIDM)


def test_the_ego_accelerates_and_brakes_within_its_limits():
    road = straight()
    ego = EgoVehicle(road, [0.0, 0.0], 0.0, 10.0, target_speed=40.0, target_speeds=[0, 20, 40])
    ego.act("IDLE")
    assert ego.action["acceleration"] == 4.0
    ego.speed = 40.0
    ego.target_speed = 0.0
    ego.act("IDLE")
    assert ego.action["acceleration"] == -8.0


def accelerations(ego, presses, frames=3, dt=1 / 15):
    """Acceleration right after each press of a meta-action, the presses being some frames apart."""
    given = []
    for action in presses:
        ego.act(action)
        given.append(ego.action["acceleration"])
        for _ in range(frames):
            ego.step(dt)
            ego.act()
    return np.array(given)


def cruising(speed, step=2.5):
    return EgoVehicle(straight(), [0.0, 0.0], 0.0, speed, target_speeds=np.arange(0.0, 40.1, step))


@pytest.mark.parametrize("step", [2.0, 2.5])
def test_one_press_is_gentle_and_repeated_ones_are_an_emergency_stop(step):
    brake = accelerations(cruising(25.0, step), ["SLOWER"] * 8)
    assert -4.0 < brake[0] < -1.0
    assert (np.diff(brake[:3]) < 0).all()
    assert brake.min() == brake[-1] == -8.0
    drive = accelerations(cruising(20.0, step), ["FASTER"] * 8)
    assert 1.0 < drive[0] < 3.5
    assert drive.max() == 4.0


def test_stock_braking_never_gets_harder_than_that_of_the_step_below_the_present_speed():
    ego = MDPVehicle(straight(), [0.0, 0.0], 0.0, 25.0, target_speeds=np.arange(0.0, 40.1, 2.5))
    assert accelerations(ego, ["SLOWER"] * 8).min() > -6.3


def test_a_press_moves_the_target_by_a_step_but_braking_begins_at_the_present_speed():
    ego = cruising(25.0)
    accelerations(ego, ["FASTER", "FASTER"])
    assert ego.target_speed == 30.0
    assert 25.0 < ego.speed < 27.5
    assert ego.target_after("SLOWER") == 25.0
    assert ego.target_after("FASTER") == 30.0  # more would not be faster: the limit is 4 m/s^2
    assert ego.target_after("IDLE") == ego.target_after("LANE_LEFT") == 30.0


@pytest.mark.parametrize("action", ["FASTER", "SLOWER", "IDLE"])
@pytest.mark.parametrize("speed", [0.0, 0.3, 12.4, 25.0, 39.9])
@pytest.mark.parametrize("target", [0, 4, 9, 16])
def test_the_announced_target_is_the_one_that_is_set_and_pressing_never_goes_the_other_way(action, speed, target):
    ego = cruising(speed)
    ego.speed_index = target
    ego.target_speed = before = ego.index_to_speed(target)
    announced = ego.target_after(action)
    ego.act(action)
    assert ego.target_speed == announced
    assert np.sign(announced - before) in (0, {"FASTER": 1, "SLOWER": -1, "IDLE": 0}[action])


def test_the_ego_stops_and_stays():
    ego = cruising(15.0)
    accelerations(ego, ["SLOWER"] * 40)
    assert 0 <= ego.speed < 0.01
    assert ego.target_speed == 0.0


# Motion


def test_motion_is_the_next_frame_of_the_bicycle_and_stock_velocity_is_not():
    road = straight()
    v = MDPVehicle(road, [0.0, 0.0], 0.0, 25.0, target_speed=25.0)
    road.vehicles = [v]
    v.target_lane_index = ("0", "1", 1)
    errors, stock = [], []
    for _ in range(60):
        road.act()
        velocity, rate = motion(v)
        before, heading, naive = v.position.copy(), v.heading, v.velocity
        road.step(DT)
        moved = (v.position - before) / DT
        errors.append(np.abs([*(moved - velocity), (v.heading - heading) / DT - rate]).max())
        stock.append(np.linalg.norm(moved - naive))
    # explicit Euler: the difference is the derivative, up to 1e-16 * 100 m / 0.05 s of rounding
    assert max(errors) < 1e-11
    assert max(stock) > 1.0


def test_motion_of_the_dynamic_bicycle_includes_its_lateral_speed():
    v = BicycleVehicle(straight(), [0.0, 0.0], 0.4, 12.0)
    for _ in range(100):
        v.act({"acceleration": 0.0, "steering": 0.3})
        v.step(1e-3)
    before, heading = v.position.copy(), v.heading
    velocity, rate = motion(v)
    v.step(1e-3)
    # first order in dt = 1e-3 s: dt / 2 times the accelerations, below 40 m/s^2 and 100 rad/s^2
    np.testing.assert_allclose((v.position - before) / 1e-3, velocity, atol=2e-2)
    assert (v.heading - heading) / 1e-3 == pytest.approx(rate, abs=5e-2)
    assert abs(v.lateral_speed) > 0.1


def test_crashed_vehicles_roll_straight_and_obstacles_rest():
    road = straight()
    v = Vehicle(road, [0.0, 0.0], 0.3, 5.0)
    v.action = {"steering": 0.5, "acceleration": 0.0}
    v.crashed = True
    velocity, rate = motion(v)
    np.testing.assert_allclose(velocity, 5 * np.array([np.cos(0.3), np.sin(0.3)]))
    assert rate == 0.0
    velocity, rate = motion(Obstacle(road, [0.0, 0.0]))
    assert (*velocity, rate) == (0.0, 0.0, 0.0)


def test_a_plain_vehicle_is_one_part():
    v = SizedIDM(straight(), [3.0, 4.0], 0.1, 5.0, contour="van")
    (part,) = parts(v)
    assert part.contour == "van"
    np.testing.assert_array_equal(part.size, [5.5, 2.0])
    assert rear_extent(v) == 2.75


# Courses


@pytest.mark.parametrize("frequency", [15, 20, 100])
def test_a_course_is_followed_without_error_or_drift(frequency):
    table = turning_table(20.0)
    v = CourseVehicle(straight(), table)
    for _ in range(18 * frequency):
        v.step(1 / frequency)
    h, radius = 0.25 * 18 + 0.3, 40.0
    assert v.time == 18.0
    # cubic between rows 10 ms apart: error h^4 / 384 of the fourth derivative 10 * 0.25^3 m/s^4, below 1e-11 m
    np.testing.assert_allclose(v.position, [radius * np.sin(h), -radius * np.cos(h)], atol=1e-9)
    np.testing.assert_allclose(v.velocity, 10 * np.array([np.cos(h), np.sin(h)]), atol=1e-7)
    assert v.yaw_rate == pytest.approx(0.25, abs=1e-9)


def test_course_velocity_is_the_derivative_of_its_position():
    table = CourseTable(turning_table(2.0, hz=10))
    e = 1e-6
    for t in (0.013, 0.55, 1.234, 1.99):
        difference = (table.at(t + e)[0] - table.at(t - e)[0]) / (2 * e)
        np.testing.assert_allclose(difference, table.at(t)[1], atol=1e-7)  # rounding 1e-16 * 40 m / 1e-6 s


def test_after_its_end_a_course_goes_straight_on():
    table = turning_table(1.0)
    v = CourseVehicle(straight(), table)
    for _ in range(60):
        v.step(DT)
    last = table[-1]
    np.testing.assert_allclose(v.position, last[1:3] + 2.0 * last[4:6], atol=1e-9)
    assert v.yaw_rate == 0.0
    assert v.heading == pytest.approx(last[3])


def test_a_table_may_start_at_any_time_and_wrap_its_heading():
    table = turning_table(20.0, start=7.0)
    table[:, 3] = (table[:, 3] + np.pi) % (2 * np.pi) - np.pi
    v = CourseVehicle(straight(), table)
    for _ in range(300):
        v.step(DT)
        assert v.yaw_rate == pytest.approx(0.25, abs=1e-9)
    assert v.time == 22.0


def test_a_course_is_not_pushed_and_not_controlled():
    road = straight()
    v = CourseVehicle(road, turning_table())
    free = CourseVehicle(road, turning_table())
    v.impact, v.crashed = np.array([1.0, 1.0]), True
    v.act("LANE_LEFT")
    v.step(DT)
    free.step(DT)
    np.testing.assert_array_equal(v.position, free.position)
    assert v.impact is None


def test_prediction_of_a_course_is_its_future():
    road = straight()
    v = CourseVehicle(road, turning_table())
    positions, headings = v.predict_trajectory_constant_speed(np.array([0.5, 1.0]))
    assert v.time == 0.0
    for p, h in zip(positions, headings, strict=True):
        for _ in range(10):
            v.step(DT)
        np.testing.assert_allclose(v.position, p, atol=1e-12)
        assert v.heading == pytest.approx(h, abs=1e-12)


def test_copies_of_a_course_go_their_own_way_on_a_shared_table():
    v = CourseVehicle(straight(), turning_table())
    v.step(DT)
    for twin in (CourseVehicle.create_from(v), copy.deepcopy(v)):
        assert twin.table is v.table
        before = v.position.copy()
        twin.step(DT)
        np.testing.assert_array_equal(v.position, before)
        assert twin.time == pytest.approx(2 * DT)
    with pytest.raises(TypeError, match="table of its own"):
        CourseVehicle.create_from(SizedIDM(straight(), [0.0, 0.0]))


def test_the_history_of_a_course_can_be_recorded():
    road = Road(RoadNetwork.straight_road_network(2), record_history=True)
    v = CourseVehicle(road, turning_table())
    road.vehicles = [v]
    run(road, 3 * DT)
    assert [h.time for h in v.history] == pytest.approx([3 * DT, 2 * DT, DT])


@pytest.mark.parametrize(
    ("table", "reason"),
    [
        (np.zeros((5, 4)), r"got \(5, 4\)"),
        (turning_table()[:1], r"got \(1, 7\)"),
        (turning_table()[::-1], "increase in t"),
        (np.full((3, 7), np.nan), "finite"),
    ],
)
def test_a_table_that_cannot_be_followed_is_refused(table, reason):
    with pytest.raises(ValueError, match=reason):
        CourseTable(table)


# Constants


def trajectory(cls):
    road = straight()
    road.vehicles = [
        cls(road, [12.0 * k, 4.0 * (k % 3)], 0.0, 20.0 + k % 4, target_speed=22.0 + k % 5) for k in range(12)
    ]
    run(road, 5)
    return np.array([v.position for v in road.vehicles])


def test_an_intersection_does_not_change_our_traffic():
    before = trajectory(SizedIDM)
    with ProtectedConstants():
        make_intersection()
        during = trajectory(SizedIDM)
        assert IDMVehicle.DISTANCE_WANTED == 7
    np.testing.assert_array_equal(before, during)


def test_an_intersection_would_change_the_stock_traffic():
    before = trajectory(IDMVehicle)
    with ProtectedConstants():
        make_intersection()
        during = trajectory(IDMVehicle)
    assert np.abs(before - during).max() > 0.1
    np.testing.assert_array_equal(trajectory(IDMVehicle), before)


def test_constants_are_restored_after_an_error():
    outside = IDMVehicle.DISTANCE_WANTED

    def spoil():
        with ProtectedConstants():
            IDMVehicle.DISTANCE_WANTED, IDMVehicle.NOVEL = 1.0, 2.0
            raise RuntimeError

    with pytest.raises(RuntimeError):
        spoil()
    assert outside == IDMVehicle.DISTANCE_WANTED
    assert not hasattr(IDMVehicle, "NOVEL")


def test_a_fence_gives_its_environment_its_own_constants_back():
    outside = IDMVehicle.DISTANCE_WANTED
    fence = ProtectedConstants()
    with fence:
        make_intersection()
    assert outside == IDMVehicle.DISTANCE_WANTED
    with fence:
        assert IDMVehicle.DISTANCE_WANTED == 7
        with fence:
            assert IDMVehicle.DISTANCE_WANTED == 7
        assert IDMVehicle.DISTANCE_WANTED == 7
    assert outside == IDMVehicle.DISTANCE_WANTED


def test_the_peak_acceleration_of_a_circle_is_speed_times_yaw_rate():
    t = np.arange(0, 5, 0.01)
    w, v = 0.2, 10.0
    rows = np.stack(
        [t, v / w * np.sin(w * t), v / w * (1 - np.cos(w * t)), w * t, v * np.cos(w * t), v * np.sin(w * t), w + 0 * t],
        -1,
    )
    assert CourseTable(rows).peak_acceleration == pytest.approx(v * w, rel=1e-4)
