"""Articulated trucks: a trailer that follows, collides and is kept clear of."""

import copy

import numpy as np
import pytest
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.kinematics import Vehicle

from scenarios.articulated import KINGPIN, OVERHANG, ArticulatedCourse, ArticulatedIDM
from scenarios.bodies import parts, reach, rear_extent
from scenarios.contours import find
from scenarios.vehicles import SizedIDM
from trackers.geometry import to_world, unit

DT = 0.05


def straight(lanes=3):
    return Road(RoadNetwork.straight_road_network(lanes, length=2000), np_random=np.random.default_rng(0))


def circle(radius=15.0, speed=5.0, turns=1.0):
    """A course straight for 20 m and then round a circle; exact in every column."""
    t = np.arange(round((20 + 2 * np.pi * turns * radius) / speed * 100)) / 100
    s = speed * t - 20
    h = np.maximum(s, 0) / radius
    x, y = np.where(s < 0, s, radius * np.sin(h)), np.where(s < 0, 0, radius * (1 - np.cos(h)))
    return np.stack([t, x, y, h, speed * np.cos(h), speed * np.sin(h), np.where(s < 0, 0.0, speed / radius)], -1)


def test_the_whole_truck_is_16_and_a_half_metres_long_by_default():
    truck = ArticulatedIDM(straight(), [0.0, 0.0])
    xy = np.concatenate([find(p.contour).place(p.pose, p.size) for p in truck.parts()])
    np.testing.assert_allclose(np.ptp(xy, axis=0), [16.5, 2.55], atol=1e-12)
    assert truck.LENGTH / 2 + rear_extent(truck) == pytest.approx(16.5)


def test_both_bodies_share_the_kingpin_at_any_hitch():
    truck = ArticulatedIDM(straight(), [10.0, 20.0], 0.7, hitch=0.4)
    unit_part, trailer = truck.parts()
    length = trailer.size[0]
    a = to_world(unit_part.pose, np.array([[KINGPIN, 0.0]]))
    b = to_world(trailer.pose, np.array([[length / 2 - OVERHANG, 0.0]]))
    np.testing.assert_allclose(a, b, atol=1e-12)
    assert truck.hitch == pytest.approx(0.4)


def test_the_cab_clears_the_swinging_trailer():
    cab = find("tractor-unit").points
    wide = cab[np.abs(cab[:, 1]) > 0.495]  # the drive wheels are lower than the trailer, the cab is not
    cab_rear = 6.0 * wide[:, 0].min() - KINGPIN  # [m] ahead of the kingpin
    assert np.hypot(OVERHANG, 2.55 / 2) < cab_rear


def test_steady_turn_has_the_hitch_of_the_geometry():
    """On a circle the trailer axle runs on its own circle, its radius R_axle^2 = R_kingpin^2 - D^2."""
    radius = 15.0
    truck = ArticulatedCourse(straight(), circle(radius, turns=2.0))
    for _ in range(round(30 / 0.01)):
        truck.step(0.01)
    kingpin = np.hypot(radius, KINGPIN)
    expected = -(np.arcsin(7.7 / kingpin) + np.arctan2(-KINGPIN, radius))
    # explicit Euler with the motion at the start of each 0.01 s frame: rate * dt = 0.0033 rad at most
    assert truck.hitch == pytest.approx(expected, abs=3.3e-3)
    assert np.degrees(abs(truck.hitch)) > 20


def test_the_trailer_axle_does_not_slip_sideways():
    truck = ArticulatedCourse(straight(), circle())
    for _ in range(140):
        truck.step(DT)
        trailer = truck.parts()[1]
        heading = trailer.pose[2]
        lever = (13.6 / 2 - OVERHANG - 7.7) * unit(heading)
        axle = trailer.velocity + trailer.yaw_rate * np.array([-lever[1], lever[0]])
        assert abs(np.cross([*unit(heading), 0.0], [*axle, 0.0])[2]) < 1e-12
    assert abs(truck.hitch) > 0.2


@pytest.mark.parametrize(("length", "overall", "axle"), [(11.1, 14.0, 6.096), (15.85, 18.75, 9.144)])
def test_a_longer_trailer_makes_a_longer_truck_with_its_axle_further_back(length, overall, axle):
    truck = ArticulatedIDM(straight(), [0.0, 0.0], trailer=(length, 2.5))
    xy = np.concatenate([find(p.contour).place(p.pose, p.size) for p in truck.parts()])
    assert np.ptp(xy[:, 0]) == pytest.approx(overall)
    assert truck.axle == pytest.approx(axle, abs=1e-3)  # 7.7 / 12 of the way from the kingpin to the end
    assert ArticulatedIDM.create_from(truck).trailer_size.tolist() == [length, 2.5]


@pytest.mark.parametrize("size", [(1.6, 2.5), (12.0, 0.0)])
def test_a_trailer_that_does_not_reach_behind_its_kingpin_is_refused(size):
    with pytest.raises(ValueError, match="trailer must be longer"):
        ArticulatedIDM(straight(), [0.0, 0.0], trailer=size)


@pytest.mark.parametrize("kind", ["idm", "course"])
def test_motion_of_both_bodies_is_the_derivative_of_their_poses(kind):
    road, dt = straight(), 1e-4
    if kind == "idm":
        truck = ArticulatedIDM(road, [0.0, 0.0], 0.0, 20.0, hitch=0.2)
        truck.target_lane_index = ("0", "1", 1)
    else:
        truck = ArticulatedCourse(road, circle(), hitch=0.2)
        for _ in range(90):
            truck.step(DT)
    road.vehicles = [truck]
    truck.act()
    before = truck.parts()
    truck.step(dt)
    for p, q in zip(before, truck.parts(), strict=True):
        # first order: dt / 2 times accelerations below 20 m/s^2
        np.testing.assert_allclose((q.pose[:2] - p.pose[:2]) / dt, p.velocity, atol=1e-3)
        assert (q.pose[2] - p.pose[2]) / dt == pytest.approx(p.yaw_rate, abs=1e-4)


def test_the_trailer_straightens_after_a_turn():
    truck = ArticulatedIDM(straight(), [0.0, 0.0], 0.0, 10.0, target_speed=10.0, hitch=0.5)
    truck.road.vehicles = [truck]
    for _ in range(100):
        truck.road.act()
        truck.road.step(DT)
    # decays as exp(-v t / D) = exp(-6.5)
    assert abs(truck.hitch) < 1e-3


def test_contact_with_the_trailer_alone_is_a_collision_whoever_comes_first():
    for first in (0, 1):
        road = straight()
        truck = ArticulatedIDM(road, [100.0, 4.0], 0.0, 0.0)
        car = SizedIDM(road, [90.0, 4.0], 0.0, 0.0)
        assert not Vehicle._is_colliding(car, truck, DT)[0], "the tractor unit is out of reach"
        road.vehicles = [car, truck] if first == 0 else [truck, car]
        road.step(DT)
        assert car.crashed
        assert truck.crashed


def test_a_car_beside_the_trailer_does_not_collide():
    road = straight()
    truck = ArticulatedIDM(road, [100.0, 4.0], 0.0, 0.0)
    car = SizedIDM(road, [90.0, 8.0], 0.0, 0.0)
    road.vehicles = [car, truck]
    road.step(DT)
    assert not car.crashed


def test_reach_holds_both_bodies_at_any_hitch():
    for hitch in np.linspace(-3, 3, 25):
        truck = ArticulatedIDM(straight(), [5.0, 0.0], 0.3, hitch=float(hitch))
        xy = np.concatenate([find("box").place(p.pose, p.size) for p in truck.parts()])
        assert np.linalg.norm(xy - truck.position, axis=1).max() <= reach(truck) + 1e-9


def test_a_follower_stops_five_metres_behind_the_trailer():
    road = straight(1)
    truck = ArticulatedIDM(road, [150.0, 0.0], 0.0, 0.0, target_speed=0.0)
    car = SizedIDM(road, [0.0, 0.0], 0.0, 15.0, target_speed=20.0)
    road.vehicles = [car, truck]
    for _ in range(1200):
        road.act()
        road.step(DT)
    assert 5.0 <= truck.position[0] - 13.5 - car.position[0] - car.LENGTH / 2 < 5.2


def test_nobody_changes_into_a_lane_beside_the_trailer():
    road = straight(2)
    car = SizedIDM(road, [50.0, 0.0], 0.0, 20.0, target_speed=28.0)
    slow = SizedIDM(road, [80.0, 0.0], 0.0, 15.0, target_speed=15.0)
    truck = ArticulatedIDM(road, [61.0, 4.0], 0.0, 28.0, target_speed=28.0)
    road.vehicles = [car, slow, truck]
    assert not car.mobil(("0", "1", 1))


def test_the_hitch_stays_small_in_a_lane_change():
    road = straight()
    truck = ArticulatedIDM(road, [0.0, 0.0], 0.0, 22.0, target_speed=22.0)
    road.vehicles = [truck]
    truck.target_lane_index = ("0", "1", 1)
    peak = 0.0
    for _ in range(200):
        road.act()
        road.step(DT)
        peak = max(peak, abs(truck.hitch))
    assert truck.position[1] == pytest.approx(4.0, abs=0.2)
    assert np.radians(0.5) < peak < np.radians(5)


def test_copies_carry_their_trailer():
    road = straight()
    idm = ArticulatedIDM(road, [0.0, 0.0], 0.2, 10.0, hitch=0.3, target_speed=12.0)
    course = ArticulatedCourse(road, circle(), hitch=0.3)
    for truck in (idm, course):
        for twin in (type(truck).create_from(truck), copy.deepcopy(truck)):
            for a, b in zip(parts(truck), parts(twin), strict=True):
                np.testing.assert_allclose(a.pose, b.pose, atol=1e-12)


def test_a_size_for_two_bodies_is_refused():
    with pytest.raises(ValueError, match="leave out contour, length"):
        ArticulatedIDM(straight(), [0.0, 0.0], length=16.5, contour="truck")
