"""A vehicle that was lost gets its id back where it should be by now, and nobody else does."""

from dataclasses import replace

import numpy as np
import pytest

from tests.trackers.multi.known_objects import KnownObjects, scan_of, tracks_of
from tests.trackers.rear_sides import Road, drive
from trackers import MultiObjectTracker, SensorModel, find, prior
from trackers.batch import take
from trackers.multi.reidentification import LostTracks, Reidentification
from trackers.multi.road import RoadMap

RULE = Reidentification()


def gone_of(pose, velocity, size=(4.6, 1.86), age=0.0):
    """Remembered tracks 70, 71, ..."""
    estimate = prior(np.atleast_2d(pose), velocity=velocity, size=size, position_std=0.3, velocity_std=0.5)
    D = len(estimate.pose)
    return LostTracks(70 + np.arange(D), np.full(D, 30), np.full(D, age), estimate, np.arange(float(D)))


def reported_ids(tracker, road, seconds):
    seen, events = [], []

    def note(road, scan, tracks, info):
        seen.append(tracks.reported.id.tolist())
        events.extend(info.events)

    drive(tracker, road, seconds, note)
    return seen, events


@pytest.mark.parametrize("name", ["rm-feldmann", "edra-imm", "pmht-spline-adaptive"])
def test_a_car_that_comes_back_after_three_seconds_has_its_id_and_size(tracker, name):
    road = Road([(30, 0, 0, 25.0), (45, 4, 0, 27.0)], hidden={0: (1.5, 4.5)})
    seen, events = reported_ids(replace(tracker, filter=find(name)), road, 6.0)
    assert sorted(seen[20]) == [0, 1]
    assert seen[60] == [1]
    assert sorted(seen[-1]) == [0, 1]
    assert [e.track for e in events if e.kind == "returned"] == [0]
    assert sum(e.kind == "confirmed" for e in events) == 2


def test_a_car_that_comes_back_later_than_remembered_is_another(tracker):
    forgetful = replace(tracker, reidentification=replace(RULE, span=1.0))
    seen, events = reported_ids(forgetful, Road([(30, 0, 0, 25.0)], hidden={0: (1.5, 4.5)}), 6.0)
    assert seen[-1] == [1]
    assert not [e for e in events if e.kind == "returned"]


@pytest.mark.parametrize(
    ("pose", "velocity", "length", "row"),
    [
        ((101.0, 0.3, 0.0), (24.0, 0.0), 1.0, 0),
        ((101.0, 8.0, 0.0), (24.0, 0.0), 1.0, -1),
        ((101.0, 0.3, 0.0), (10.0, 0.0), 1.0, -1),
        ((101.0, 0.3, 0.0), (24.0, 0.0), 9.0, -1),
    ],
    ids=["there", "two-lanes-off", "too-slow", "too-long"],
)
def test_place_speed_and_length_decide(pose, velocity, length, row):
    gone = gone_of([(100.0, 0.0, 0.0)], (25.0, 0.0), age=1.0)
    born = prior([pose], velocity=velocity, position_std=0.9, velocity_std=0.7)
    assert RULE.match(gone, born, np.array([length])).tolist() == [row]


@pytest.mark.parametrize(("least", "hidden", "ids"), [(0.6, 1.0, [0]), (0.6, 0.5, [0, 1]), (np.inf, 1.0, [0, 1])])
def test_a_vehicle_that_appears_beside_its_hidden_track_is_that_track(least, hidden, ids):
    """Three metres aside, beyond the gate of a track that claims 0.3 m; in plain view it would be another vehicle."""
    e = prior([(60.0, 0.0, 0.0)], velocity=(25.0, 0.0), position_std=0.3, velocity_std=0.5)
    tracker = MultiObjectTracker(KnownObjects(), (SensorModel(max_range=200.0, fov=np.pi),))
    tracker = replace(tracker, reidentification=Reidentification(hidden=least))
    tracks = tracks_of(e, 0.6)._replace(hidden=np.array([hidden]), noise=np.zeros(1))
    seen = [(57.8, 2.2), (57.9, 2.6), (57.8, 3.0), (57.9, 3.4), (57.8, 3.8)]
    tracks, info = tracker.step(tracks, scan_of(seen, (0.1, 0.001, 0.1), 25.0), 0.0)
    assert sorted(tracks.id.tolist()) == ids
    assert [event.kind for event in info.events if event.kind in ("born", "returned")] == [
        "returned" if ids == [0] else "born"
    ]
    assert tracks.estimate.pose[-1, 1] == pytest.approx(3.0, abs=0.2)


def test_of_two_that_it_could_be_it_is_neither():
    born = prior([(101.0, 0.0, 0.0)], velocity=(25.0, 0.0), position_std=0.9)
    one = gone_of([(100.0, 0.0, 0.0)], (25.0, 0.0), age=1.0)
    two = gone_of([(100.0, 0.0, 0.0), (102.0, 0.0, 0.0)], (25.0, 0.0), age=1.0)
    assert RULE.match(one, born, np.ones(1)).tolist() == [0]
    assert RULE.match(two, born, np.ones(1)).tolist() == [-1]
    both = take(born, np.array([0, 0]))
    assert RULE.match(one, both, np.ones(2)).tolist() == [-1, -1]
    assert RULE.match(take(one, np.zeros(1) > 1), born, np.ones(1)).tolist() == [-1]


def test_a_lost_vehicle_turns_as_its_lane_does_and_grows_uncertain():
    """On a circle of 100 m: after 3 s at 20 m/s 60 m along the lane, not straight ahead."""
    angle = np.linspace(-0.5, 2.0, 200)
    circle = RoadMap.of([(100.0 * np.c_[np.sin(angle), 1 - np.cos(angle)], 4.0)])
    for road, place in ((circle, 100.0 * np.array([np.sin(0.6), 1 - np.cos(0.6)])), (None, [60.0, 0.0])):
        gone = gone_of([(0.0, 0.0, 0.0)], (20.0, 0.0))
        for _ in range(45):
            gone = RULE.predict(gone, 1 / 15, road)
        np.testing.assert_allclose(gone.estimate.pose[0, :2], place, atol=1.0)
    np.testing.assert_allclose(gone.age, 3.0)
    std = np.sqrt(np.diag(gone.estimate.cov[0]))
    np.testing.assert_allclose(std[2] ** 2, 0.5**2 + 3 * 1.5**2)
    assert std[0] > 3 > std[1]
    assert len(RULE.predict(gone, 5.1, None).id) == 0


def test_only_tracks_that_were_seen_often_are_remembered_and_only_so_many():
    died = gone_of([(float(x), 0.0, 0.0) for x in range(4)], (25.0, 0.0))._replace(hits=np.array([3, 8, 9, 30]))
    assert RULE.remember(None, died).id.tolist() == [71, 72, 73]
    few = replace(RULE, most=2)
    assert few.remember(few.remember(None, died), died._replace(id=died.id + 10)).id.tolist() == [82, 83]
