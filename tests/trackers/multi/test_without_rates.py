"""Detections without range rate, as of a lidar: tracks are born of them, and what has a rate is treated as before."""

from dataclasses import replace

import numpy as np
import pytest

from trackers import DEFAULT, Scan, SensorModel, build
from trackers.estimate import prior
from trackers.multi.association import Association
from trackers.multi.leftovers import Suppression
from trackers.multi.road import RoadMap
from trackers.multi.visibility import SensorArray

RNG = np.random.default_rng(3)
SHEET = SensorModel(mount=(0.0, 0.0, 0.0), max_range=100.0, fov=2.0, clutter=0.1)
LANE = RoadMap.of([([(-50.0, 0.0), (400.0, 0.0)], 4.0)])
NOWHERE = RoadMap.of([])
EGO, OTHER = 20.0, 25.0  # [m/s]


def scan(time, at=(30.0, 0.0), speed=OTHER, rate=np.nan):
    """Points on the rear of a car, seen by an ego that is ahead of where it began."""
    y = np.linspace(-0.8, 0.8, 8)
    xy = np.stack([np.full(8, at[0] + speed * time), at[1] + y], -1) + RNG.normal(0, 0.03, (8, 2))
    pose = np.array([[EGO * time, 0.0, 0.0]])
    made = Scan.from_xy(xy, pose=pose, noise=(0.05, 0.002, 0.1))
    made.polar[:, 2] = rate
    platform = np.array([EGO * time, 0.0, 0.0, EGO, 0.0, 0.0])
    return made._replace(velocity=np.array([[EGO, 0.0]]), platform=platform, delivered=np.array([True]))


def on(road, name="rm-koch"):
    return replace(build(name, (SHEET,)), road=road)


def track(scans, road=None, name="rm-koch", dt=0.1):
    tracker = on(road, name)
    tracks = tracker.start()
    for k, one in enumerate(scans):
        tracks, _ = tracker.step(tracks, one, dt if k else 0.0)
    return tracks


def test_a_vehicle_on_a_lane_is_born_with_the_lane_and_the_speed_of_the_ego():
    born = track([scan(0.0)], LANE)
    assert len(born.id) == 1
    assert born.estimate.pose[0, 2] == pytest.approx(0.0, abs=0.05)
    assert born.estimate.velocity[0] == pytest.approx([EGO, 0.0], abs=2.0)


@pytest.mark.parametrize("name", [DEFAULT, "rm-koch", "dra"])
def test_trackers_find_the_speed_from_the_places(name):
    known = track([scan(t) for t in np.arange(12) * 0.1], LANE, name).reported
    assert len(known.id) == 1
    assert known.estimate.velocity[0, 0] == pytest.approx(OTHER, abs=1.5)


def test_nothing_is_born_beside_the_lanes_of_a_map_but_anywhere_without_one():
    beside = [scan(0.1 * k, at=(30.0, 12.0)) for k in range(3)]
    assert len(track(beside, LANE).id) == 0
    assert len(track(beside, NOWHERE).id) == len(track(beside).id) == 1


def test_without_a_rate_nothing_is_remembered_for_later_scans():
    far = scan(0.0, at=(60.0, 0.0))
    alone = far._replace(mask=np.arange(8) < 1)
    assert len(track([alone], LANE).memory.unexplained.rate) == 0
    rated = scan(0.0, at=(60.0, 0.0), rate=OTHER - EGO)
    assert len(track([rated._replace(mask=alone.mask)], LANE).memory.unexplained.rate) == 1


@pytest.mark.parametrize(("rate", "free"), [(np.nan, False), (0.0, False), (9.0, True)])
def test_what_lies_just_beyond_the_end_of_a_track_bears_no_other_unless_its_rate_differs(rate, free):
    box = prior(np.array([[30.0, 0.0, 0.0]]), velocity=np.array([[EGO, 0.0]]), size=(4.0, 1.8))
    one = scan(0.0, at=(34.0, 0.0), rate=rate)  # 2 m beyond the front
    point = one._replace(mask=np.arange(8) == 4)
    z, _ = Association().prepare(point, SensorArray.of((SHEET,)))
    assert Suppression().candidates(z, np.array([-1]), box, np.array([0.9])).tolist() == [free]
