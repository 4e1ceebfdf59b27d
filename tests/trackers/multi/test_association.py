"""Gates and owners on scans made by hand: a radar at the origin faces along x to boxes 4 m long and 2 m wide."""

from dataclasses import dataclass

import numpy as np
import pytest

from tests.trackers.multi.known_objects import KnownObjects, scan_of, tracks_of
from trackers import MultiObjectTracker, SensorModel, prior
from trackers.multi.association import Association
from trackers.multi.road import RoadMap
from trackers.multi.visibility import SensorArray

QUIET = SensorModel(max_range=200.0, fov=np.pi, clutter=0.01)  # whatever falls into the gates is owned


def box(x, y, heading=0.0, **known):
    """One object; its variances along and across the box are 0.25 + 0.04 + 0.04 [m^2] before the radar's noise."""
    spread = {"velocity": (20.0, 0.0), "size": (4.0, 2.0), "size_std": (0.4, 0.4), "position_std": 0.5}
    return prior([(x, y, heading)], **(spread | known))


def owners(estimate, scan, sensor=QUIET, existence=0.9):
    """Row of the track that takes each detection, -1 for none."""
    tracker = MultiObjectTracker(KnownObjects(), (sensor,))
    _, info = tracker.step(tracks_of(estimate, existence), scan, 0.0)
    return info.owner.tolist()


def test_the_position_gate_ends_at_ten_squared_deviations_outside_the_box():
    """Behind a rear end at x = 48 m the variance is 0.33 + 0.3^2 = 0.42 m^2: the gate is sqrt(10 x 0.42) = 2.05 m."""
    scan = scan_of([(46.0, 0.0), (45.9, 0.0)], noise=(0.3, 0.001, 0.1))
    assert owners(box(50, 0), scan) == [0, -1]


def test_noise_of_the_measurement_widens_the_position_gate():
    """1.9 m outside the box: the gate is sqrt(10 x 0.33) = 1.82 m, and sqrt(10 x 0.42) = 2.05 m with 0.3 m of noise."""
    assert owners(box(50, 0), scan_of([(46.1, 0.0)], noise=(0.0, 0.0, 0.1))) == [-1]
    assert owners(box(50, 0), scan_of([(46.1, 0.0)], noise=(0.3, 0.0, 0.1))) == [0]
    assert owners(box(50, -2.9), scan_of([(50.0, 0.0)], noise=(0.0, 0.0, 0.1))) == [-1]
    assert owners(box(50, -2.9), scan_of([(50.0, 0.0)], noise=(0.0, 0.3 / 50, 0.1))) == [0]


@pytest.mark.parametrize("heading", [0.0, np.pi / 2, np.pi])
def test_range_noise_counts_along_the_line_of_sight_and_azimuth_noise_across(heading):
    """Noise 0.1 m along, 1 m across (0.02 rad at 50 m): gates of sqrt(10 x 0.34) = 1.84 m and sqrt(10 x 1.33) = 3.65 m.

    Both detections lie straight ahead on y = 0; a square box, so that its heading does not move its sides.
    """
    noise, size = (0.1, 0.02, 0.1), (2.0, 2.0)
    assert owners(box(51 + 1.7, 0, heading, size=size), scan_of([(50.0, 0.0)], noise)) == [0]
    assert owners(box(51 + 2.0, 0, heading, size=size), scan_of([(50.0, 0.0)], noise)) == [-1]
    assert owners(box(50, 1 + 3.5, heading, size=size), scan_of([(50.0, 0.0)], noise)) == [0]
    assert owners(box(50, 1 + 3.8, heading, size=size), scan_of([(50.0, 0.0)], noise)) == [-1]


def test_the_rate_gate_ends_at_twelve_squared_deviations():
    """Speed 20 +- 1 m/s and a model error of 0.5 m/s: the gate is sqrt(12 x 1.25) = 3.87 m/s either way."""
    rates = np.array([20 - 3.95, 20 - 3.80, 20.0, 20 + 3.80, 20 + 3.95])
    scan = scan_of(np.tile([48.2, 0.0], (5, 1)), noise=(0.1, 0.0, 0.0), rate=rates)
    assert owners(box(50, 0, yaw_rate_std=1e-3), scan) == [-1, 0, 0, 0, -1]


def test_a_left_turn_slows_the_left_side_of_a_car_that_drives_away():
    """A point 0.9 m left of the centre of a body that turns left with 3 rad/s moves 2.7 m/s backwards.

    So it recedes with 20 - 2.7 m/s from a radar straight behind it, and the right side with 20 + 2.7 m/s; the gate is
    sqrt(12 (0.1^2 + 0.09^2 + 0.5^2)) = 1.8 m/s.
    """
    turning = {"yaw_rate": 3.0, "velocity_std": 0.1, "yaw_rate_std": 0.1}
    scan = scan_of([(48.2, 0.0), (48.2, 0.0)], noise=(0.1, 0.0, 0.0), rate=[17.3, 22.7])
    assert owners(box(50, -0.9, **turning), scan) == [0, -1]  # its left side faces the radar
    assert owners(box(50, 0.9, **turning), scan) == [-1, 0]


def test_a_detection_that_is_probably_clutter_stays_without_an_owner():
    """Two boxes with one detection in each middle: density 1 / (4 x 2) = 0.125 / m^2, half a detection expected.

    2000 false alarms on a half disc of 100 m have a density of 0.1273 / m^2, so a detection is q x 0.491 times as
    likely from the box: probabilities 0.31 for existence 0.93 and 0.27 for 0.75, on both sides of 0.3.
    """
    blind = SensorModel(max_range=100.0, fov=np.pi, clutter=2000.0, count_at_15m=0.01)
    known = {"position_std": 0.01, "size_std": 0.01}
    two = prior([(50, 0, 0), (50, 20, 0)], size=(4.0, 2.0), **known)
    scan = scan_of([(50.0, 0.0), (50.0, 20.0)], noise=(0.01, 0.0002, 0.1))
    assert owners(two, scan, blind, existence=[0.93, 0.75]) == [0, -1]
    assert owners(two, scan, blind, existence=[0.75, 0.93]) == [-1, 1]


def test_of_two_tracks_the_likelier_takes_the_whole_detection():
    """A detection 0.5 m behind one box and 1.5 m before another goes to the nearer one, and to nobody twice."""
    two = prior([(50, 0, 0), (44, 0, 0)], size=(4.0, 2.0), position_std=0.5)
    assert owners(two, scan_of([(47.5, 0.0)], noise=(0.1, 0.001, 0.1))) == [0]
    assert owners(two, scan_of([(46.5, 0.0)], noise=(0.1, 0.001, 0.1))) == [1]


@pytest.mark.parametrize(("others", "owner"), [(0, 0), (20, 0), (2000, -1)])
def test_a_burst_of_clutter_raises_its_intensity_and_a_few_new_vehicles_do_not(others, owner):
    """A detection 1.4 m behind the box of an unsure track: with 2000 false alarms in place of 5 it is one of them."""
    rng = np.random.default_rng(0)
    xy = np.c_[rng.uniform(60.0, 200.0, others), rng.uniform(-100.0, 100.0, others)]
    scan = scan_of([(46.6, 0.0), *xy], (0.1, 0.001, 0.1), np.r_[20.0, rng.uniform(-60, 60, others)])
    assert owners(box(50, 0), scan, SensorModel(max_range=250.0, fov=np.pi, clutter=5.0), 0.002)[0] == owner


@pytest.mark.parametrize(("rate", "spread", "owner"), [(20.0, 12.0, 0), (np.nan, 140.0, 0), (20.0, 140.0, -1)])
def test_what_lies_close_together_counts_once_and_what_has_no_range_rate_never(rate, spread, owner):
    """400 detections of a lorry that comes into view, or a wall seen without range rates, are no burst of clutter."""
    there = np.c_[
        np.linspace(60.0, 60.0 + spread, 400), np.tile([8.0, 40.0], 200) if spread > 100 else np.full(400, 8.0)
    ]
    scan = scan_of([(46.6, 0.0), *there], (0.1, 0.001, 0.1), np.r_[20.0, np.full(400, rate)])
    assert owners(box(50, 0), scan, SensorModel(max_range=250.0, fov=np.pi, clutter=1.0), 0.0005)[0] == owner


@pytest.mark.parametrize(
    ("at", "sigma_azimuth", "deep"),
    [
        ((50.0, 1.3), 0.002, True),  # 0.7 m inside the edge, 0.1 m of noise across the lane
        ((50.0, 1.3), 0.012, False),  # 0.6 m of noise
        ((50.0, 1.2), 0.012, True),
        ((50.0, 0.7), 0.1, True),  # 1.3 m inside, 5 m of noise: more than 1.2 m is never asked for
        ((1.3, 50.0), 0.01, False),  # beside the radar: off the lane
    ],
)
def test_the_noisier_what_stands_the_deeper_in_a_lane_it_must_lie_for_a_birth(at, sigma_azimuth, deep):
    road = RoadMap.of([([(-100.0, 0.0), (100.0, 0.0)], 4.0)])
    scan, sheets = scan_of([at], (0.1, sigma_azimuth, 0.1), 0.0), SensorArray.of((QUIET,))
    z, _ = Association(static_inside=(0.5, 1.2)).prepare(scan, sheets, road)
    plain, _ = Association().prepare(scan, sheets, road)
    assert z.in_lane.tolist() == [deep]
    assert plain.in_lane.tolist() == [at[0] > 40]
    assert z.clutter.tolist() == plain.clutter.tolist()


def test_the_noise_across_a_lane_is_what_counts():
    """A lane that is crossed 50 m ahead: along the line of sight the radar is sharp."""
    road = RoadMap.of([([(50.0, -100.0), (50.0, 100.0)], 4.0)])
    scan = scan_of([(48.7, 0.0)], (0.1, 0.02, 0.1), 0.0)
    z, _ = Association(static_inside=(0.5, 1.2)).prepare(scan, SensorArray.of((QUIET,)), road)
    assert z.in_lane.tolist() == [True]


def test_what_no_sensor_should_have_seen_for_a_while_hardly_shows_a_detection():
    """Behind others for 0.1 s a track expects exp(-0.1 / 0.25) of half a detection, for 3 s a fiftieth of it.

    What sensors expect to see of it counts whatever its past.
    """
    tracker = MultiObjectTracker(KnownObjects(), (QUIET,))
    z, _ = tracker.association.prepare(scan_of([(48.2, 0.0)], noise=(0.1, 0.001, 0.1)), tracker.sensor_array)
    rule, known = Association(fades=0.25), box(50, 0)

    def gain(expected, hidden):
        hidden = None if hidden is None else np.array([hidden])
        return rule.claim(None, None, known, np.array([0.9]), np.array([[expected]]), z, None, hidden).gain.item()

    assert gain(0.0, None) == gain(0.0, 0.0) == gain(0.5, 3.0)
    assert gain(0.0, 0.1) / gain(0.0, 0.0) == pytest.approx(np.exp(-0.4))
    assert gain(0.0, 3.0) / gain(0.0, 0.0) == pytest.approx(0.02)
    assert gain(2.0, 3.0) == gain(2.0, 0.0) == pytest.approx(4 * gain(0.0, 0.0))


def test_a_hidden_track_leaves_a_lone_detection_beside_it_to_the_false_alarms():
    """Three metres aside of where it should be by now, after two seconds behind a truck and in the first moment."""
    e = prior(np.array([[20.0, 0, np.pi / 2], [50, 0, 0]]), size=[[12.0, 2.5], [4.5, 1.9]], position_std=[0.1, 1.0])
    radar, scan = SensorModel(max_range=200.0, fov=np.pi, clutter=5.0), scan_of([(50.0, 3.0)], (0.1, 0.01, 0.1))
    for hidden, owner in ((2.0, -1), (0.0, 1)):
        tracker = MultiObjectTracker(KnownObjects(), (radar,), association=Association(fades=0.25))
        tracks = tracks_of(e, [0.99, 0.6])._replace(hidden=np.array([0.0, hidden]), noise=np.zeros(2))
        assert tracker.step(tracks, scan, 0.0)[1].owner.tolist() == [owner]


@dataclass(frozen=True)
class PerhapsTrucks(KnownObjects):
    """The same of unknown length: gates reach 20 m further, at either end."""

    def reach(self, state):
        return state._replace(size=state.size + np.array([40.0, 0.0]))


@pytest.mark.parametrize(
    ("places", "age", "owner"),
    [
        ([44.5], 1.1, [0]),
        ([44.4], 1.1, [-1]),
        ([44.4], 0.9, [0]),
        ([44.4, 44.4], 1.1, [0, 0]),
        ([44.4, 50.0], 1.1, [0, 0]),
    ],
)
def test_a_single_detection_far_outside_its_box_is_none_of_a_track_that_is_not_new(places, age, owner):
    """The rear is at 48 m, the gate sqrt(10 x 0.42) = 2.05 m, and 1.5 m are granted: it ends at 44.45 m.

    Without its detection the track is one that was missed: no hit, no update, and it exists less surely.
    """
    tracker = MultiObjectTracker(PerhapsTrucks(), (QUIET,))
    tracks = tracks_of(box(50, 0))._replace(age=np.array([age]))
    scan = scan_of([(x, 0.0) for x in places], (0.3, 0.001, 0.1))
    new, info = tracker.step(tracks, scan, 0.0)
    assert info.owner.tolist() == owner
    assert info.detections.tolist() == [owner.count(0)]
    assert new.hits.tolist() == [9 + (0 in owner)]
    missed = tracker.step(tracks, scan_of([(10.0, 9.0)], (0.3, 0.001, 0.1)), 0.0)[1]
    assert (info.log_ratio == missed.log_ratio).tolist() == [0 not in owner]
    takes_all = MultiObjectTracker(PerhapsTrucks(), (QUIET,), association=Association(settled=np.inf))
    assert takes_all.step(tracks, scan, 0.0)[1].owner.tolist() == [0] * len(places)
