"""The way of the ego in place of a map: which way others drive, and that hardly anybody crosses a fast road."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.trackers.motion.bodies import CAR
from tests.trackers.multi.known_objects import scan_of as detections_of
from tests.trackers.multi.test_bends import scan_of
from trackers import MultiObjectTracker, RandomMatrix, SensorModel, build
from trackers.geometry import perpendicular, unit, wrap_angle
from trackers.multi.course import Course
from trackers.multi.road import LOOK_BACK, RoadMap, Way, bent

DT = 1 / 15
WIDE = SensorModel(max_range=120.0, fov=2 * np.pi, sigma_range=0.15, sigma_azimuth=0.008, sigma_rate=0.1, clutter=1.0)
angles = st.floats(-3.1, 3.1)


def platform(speed=20.0, yaw_rate=0.0, pose=(0.0, 0.0, 0.0)):
    return np.array([*pose, *speed * unit(pose[2]), yaw_rate])


@given(st.floats(-2e3, 2e3), angles, angles, st.floats(12.0, 500.0), st.floats(-8.0, 8.0), st.sampled_from([-1, 1]))
def test_others_drive_on_circles_about_the_same_centre(x, heading, angle, radius, off, side):
    """On a circle to the left or right, at any place of it, beside the ego by `off`."""
    pose = np.array([x, -x / 3, heading])
    centre = pose[:2] + side * radius * perpendicular(unit(heading))
    start = heading - side * np.pi / 2
    there = centre + (radius + off) * unit(start + side * angle)
    along = Way.of(platform(pose=pose), side / radius).direction(there[None])
    assert abs(wrap_angle(along[0] - (heading + side * angle))) < 1e-6


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.9])
def test_a_straight_way_is_the_heading_of_the_ego_everywhere(heading):
    xy = np.random.default_rng(0).normal(0, 80, (20, 2))
    way = Way.of(platform(pose=(3.0, -4.0, heading)))
    assert way.speed == pytest.approx(20.0)
    np.testing.assert_array_equal(way.direction(xy), np.full(20, heading))


def test_the_bend_is_that_of_the_way_driven_lately():
    """After s [m] at one curvature 1 - exp(-s / 150 m) of it, in steps of any length; its first scan says all of it."""
    on, circle = platform(10.0), platform(10.0, 0.1)
    assert bent(None, circle, 0.0) == pytest.approx(0.01)
    assert bent(None, on, 0.0) == 0.0
    for steps in (3, 40):
        bend = 0.0
        for _ in range(steps):
            bend = bent(bend, circle, 6.0 / steps)
        assert bend == pytest.approx(0.01 * (1 - np.exp(-60 / LOOK_BACK)))
    there_and_back = [platform(25.0, w) for w in [0.06] * 30 + [-0.06] * 30]
    bend = 0.0
    for one in there_and_back:
        bend = bent(bend, one, DT)
    assert abs(bend) < 0.25 * 0.06 / 25  # a change of lanes


@pytest.mark.parametrize("speed", [0.0, 0.9, -4.0])
def test_an_ego_that_does_not_drive_on_says_nothing_of_its_way(speed):
    assert bent(0.004, platform(speed, 0.3), DT) == 0.004
    assert bent(None, platform(speed, 0.3), DT) == 0.0


def after(tracker, scans):
    """The tracks after scans DT apart."""
    tracks = tracker.start()
    for k, scan in enumerate(scans):
        tracks, _ = tracker.step(tracks, scan, DT if k else 0.0)
    return tracks


def ahead_in_a_bend(yaw_rate, steps=3, radius=250.0, speed=20.0, way=70.0):
    """Scans of a car that drives `way` [m] ahead on a circle to the left, while the ego turns so."""
    rng, lead = np.random.default_rng(3), way / radius
    there = radius * np.array([np.sin(lead), 1 - np.cos(lead)])  # in the axes of the ego, which drives on the circle
    for k in range(steps):
        e = speed * DT * k / radius
        ego, velocity = np.array([radius * np.sin(e), radius * (1 - np.cos(e)), e]), speed * unit(e)
        scan = scan_of(rng, np.append(there, lead), CAR, speed, speed / radius)
        polar = scan.polar - [0, 0, speed] * np.cos(scan.polar[:, 1:2])
        yield scan._replace(
            polar=polar, pose=ego[None], velocity=velocity[None], platform=np.array([*ego, *velocity, yaw_rate])
        )


@pytest.mark.parametrize(("yaw_rate", "worst"), [(0.08, 4.0), (0.0, None)])
def test_without_a_map_what_is_born_far_ahead_drives_along_the_bend_of_the_ego(yaw_rate, worst):
    """On a circle of 250 m, 70 m ahead, a lane leads 16 degrees to the left; the twin's ego drives straight on."""
    tracks = after(MultiObjectTracker(RandomMatrix(), (WIDE,)), ahead_in_a_bend(yaw_rate))
    assert tracks.memory.bend == pytest.approx(yaw_rate / 20.0)
    error = np.degrees(abs(wrap_angle(tracks.estimate.pose[0, 2] - 73.0 / 250)))
    assert error < worst if worst else error > 8.0


def test_with_a_map_the_way_of_the_ego_says_nothing():
    elsewhere = RoadMap.of([([[-200.0, -90.0], [200.0, -90.0]], 4.0)])
    tracker = MultiObjectTracker(RandomMatrix(), (WIDE,), road=elsewhere)
    one, two = (after(tracker, ahead_in_a_bend(w)) for w in (0.08, 0.0))
    assert one.memory.bend is None
    np.testing.assert_array_equal(one.estimate.pose, two.estimate.pose)


def beside_with_one_wrong_rate(ego):
    """One scan of a car in the next lane ahead, at the speed of the ego, of which one range rate of five is wrong."""
    rng = np.random.default_rng(5)
    xy = np.array([38.0, 3.6]) + np.c_[rng.normal(0, 0.15, 5), np.linspace(-0.8, 0.8, 5)]
    scan = detections_of(xy, (0.15, 0.008, 0.1), rng.normal(0, 0.05, 5) + np.array([0, 0, 0, 0, 1.6]))
    return scan._replace(velocity=np.array([[ego, 0.0]]), platform=np.array([0, 0, 0, ego, 0, 0]))


@pytest.mark.parametrize(("crossed", "along"), [((3.0, 8.0), True), ((50.0, 60.0), False)])
def test_on_a_fast_road_without_a_map_a_wrong_rate_makes_no_crossing_car(crossed, along):
    """The twin takes all roads for crossed: there the car was born at more than 5 m/s across."""
    tracker = build("imm-spline", (WIDE,))
    start = tracker.initiation
    tracker = replace(tracker, initiation=replace(start, course=replace(start.course, crossed=crossed)))
    tracks = after(tracker, [beside_with_one_wrong_rate(20.0)])
    across = abs(tracks.estimate.velocity[0, 1])
    assert across < 1.0 if along else across > 5.0


def test_speeds_of_the_ego_between_which_roads_are_crossed_less_and_less():
    assert [Course().uncrossed(v) for v in (0.0, 3.0, 5.5, 8.0, 30.0)] == [0.0, 0.0, 0.5, 1.0, 1.0]
    with pytest.raises(ValueError, match="crossed"):
        Course(crossed=(8.0, 8.0))
