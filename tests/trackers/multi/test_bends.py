"""Vehicles on lanes that bend: they turn as their lane does while nobody sees them, and from birth on."""

from dataclasses import replace

import numpy as np
import pytest

from tests.trackers.motion.bodies import CAR, seen_body
from trackers import SensorModel, build
from trackers.geometry import unit
from trackers.multi.beside import BesideTest
from trackers.multi.road import RoadMap

WIDE = SensorModel(max_range=120.0, fov=2 * np.pi, sigma_range=0.15, sigma_azimuth=0.008, sigma_rate=0.1, clutter=1.0)
STRAIGHT = RoadMap.of([([[-200.0, -90.0], [200.0, -90.0]], 4.0)])  # elsewhere
DT = 0.1


def circle(radius, centre):
    """The map of a lane round a centre, counterclockwise."""
    angle = np.linspace(0.0, 2 * np.pi, round(2 * np.pi * radius / 4) + 1)
    return RoadMap.of([(centre + radius * unit(angle), 4.0)])


def scan_of(rng, pose, size, speed, yaw_rate):
    """Ten detections of a body at pose (3,) of a size (2,) [m]."""
    heading = np.array(pose[2])
    scan = seen_body(
        rng, pose[:2], heading, speed * unit(heading), np.array(yaw_rate), 10, noise=0.15, rate_noise=0.1, size=size
    )
    return scan._replace(delivered=np.array([True]))


def tracker_on(road, **parameters):
    return replace(build("imm-spline", (WIDE,)), road=road, **parameters)


def place_after_an_outage(known, radius=60.0, speed=12.0, silent=20):
    """Distance [m] from a car after 3 s in view and an outage of 2 s, in which its lane bends, and its NEES."""
    angle = np.linspace(-np.pi / 2, 0.0, 30)
    bend = [0.0, radius] + radius * unit(angle)
    line = np.concatenate([np.c_[np.linspace(-80.0, -4.0, 20), np.zeros(20)], bend]) + np.array([40.0, 12.0])
    rng, tracker = np.random.default_rng(1), tracker_on(RoadMap.of([(line, 4.0)]) if known else STRAIGHT)
    s, tracks = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T))), tracker.start()
    for k in range(30 + silent):
        at = [[np.interp(40.0 + speed * DT * k + d, s, x) for x in line.T] for d in (-0.5, 0.0, 0.5)]
        pose = np.append(at[1], np.arctan2(at[2][1] - at[0][1], at[2][0] - at[0][0]))
        scan = scan_of(rng, pose, CAR, speed, 0.0)
        if k >= 30:
            scan = scan._replace(mask=np.zeros(10, bool), delivered=np.array([False]))
        tracks, _ = tracker.step(tracks, scan, DT if k else 0.0)
    assert tracks.id.tolist() == [0]
    d = tracks.estimate.pose[0, :2] - pose[:2]
    return np.hypot(*d), d @ np.linalg.solve(tracks.estimate.cov[0, :2, :2], d)


def test_a_car_that_nobody_sees_follows_the_bend_of_its_lane():
    (known, nees), (unknown, _) = place_after_an_outage(True), place_after_an_outage(False)
    assert known < 1.5
    assert unknown > 2 * known
    assert nees < 9.0


def speed_at_birth(road, seeds=30, radius=25.0, speed=7.0):
    """Speed (seeds,) [m/s] and yaw rate of trucks on a circle that are seen from the side, after their first scan."""
    found = []
    for seed in range(seeds):
        rng, tracker = np.random.default_rng(seed), tracker_on(road)
        angle = np.pi + 0.4
        pose = np.append([50.0, 20.0] + radius * unit(angle), angle + np.pi / 2)
        scan = scan_of(rng, pose, np.array([10.8, 2.5]), speed, speed / radius)
        tracks, _ = tracker.step(tracker.start(), scan, 0.0)
        tracks, _ = tracker.step(tracks, scan_of(rng, pose, np.array([10.8, 2.5]), speed, speed / radius), DT)
        found += [(np.hypot(*e.velocity[0]), e.yaw_rate[0]) for e in [tracks.estimate] if len(e.velocity)]
    assert len(found) > 0.9 * seeds
    return np.array(found).T


def test_what_is_born_in_a_bend_turns_with_it():
    """The range rates of a turning truck differ along it, which is no speed across the line of sight."""
    with_map, without = (speed_at_birth(road) for road in (circle(25.0, np.array([50.0, 20.0])), STRAIGHT))
    wrong = [np.sqrt(np.mean((speed - 7.0) ** 2)) for speed, _ in (with_map, without)]
    assert wrong[0] < 1.3 < 3.0 < wrong[1]
    assert with_map[1].mean() == pytest.approx(7.0 / 25.0, abs=0.06)


@pytest.mark.parametrize("road", [None, STRAIGHT])
def test_without_bends_nothing_is_asked_of_the_filter(road):
    tracker = tracker_on(road)
    assert tracker._bends is None
    tracks, _ = tracker.step(
        tracker.start(), scan_of(np.random.default_rng(0), np.array([30.0, 5, 0]), np.array([4.6, 1.9]), 9, 0), 0.0
    )
    assert (tracks.state.motion.curvature == 0).all()


def test_a_filter_without_motion_modes_knows_no_bends():
    assert replace(build("rm-feldmann", (WIDE,)), road=circle(60.0, np.zeros(2)))._bends is None


def test_whether_a_long_track_is_two_beside_each_other_is_asked_with_the_bend_of_its_lane():
    asked = []

    class Asked(BesideTest):
        def pairs(self, *of):
            asked.append(np.broadcast_to(of[3], len(of[1])))
            return []

    rng, tracker = np.random.default_rng(0), tracker_on(circle(100.0, np.zeros(2)))
    tracker = replace(tracker, ground=replace(tracker.ground, lanes=Asked(noisy=0.0)))
    tracks, truck = tracker.start(), np.array([10.8, 2.5])
    for k in range(15):
        angle = 0.15 * DT * k
        pose = np.append(100.0 * unit(angle), angle + np.pi / 2)
        tracks, _ = tracker.step(tracks, scan_of(rng, pose, truck, 15.0, 0.15), DT if k else 0.0)
    np.testing.assert_allclose(asked[-1], [0.01], rtol=0.05)
