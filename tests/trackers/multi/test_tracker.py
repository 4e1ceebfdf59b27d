"""The multi-object tracker: laws, bad scans, and what it must do in a small world."""

import warnings
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbed.check.draws import arrays
from tests.trackers.multi.known_objects import KnownObjects, scan_of, tracks_of
from tests.trackers.rear_sides import RADAR, Road, drive
from trackers import MultiObjectTracker, RandomMatrix, Scan, find, prior
from trackers.batch import take
from trackers.filter import Note
from trackers.geometry import box_corners, to_frame, to_world, unit
from trackers.multi.association import shares
from trackers.multi.cells import Linkage
from trackers.multi.exclusion import GRID, Exclusion
from trackers.multi.existence import Existence
from trackers.multi.tracker import events_of
from trackers.multi.tracks import NO_TRACK, Tracks
from trackers.multi.visibility import SensorArray, angular_spans, predict_visibility, ray_box
from trackers.multi.window import EMPTY

CARS = [(30, 0, 0, 25.0), (50, 4, 0, 28.0), (60, -4, 0, 22.0)]


def assert_same(a, b):
    for x, y in zip(arrays(a), arrays(b), strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-9, atol=1e-12)


def test_three_cars_are_three_tracks_within_three_scans(tracker):
    tracks, infos = drive(tracker, Road(CARS), 0.2)
    assert len(tracks.reported.id) == 3
    assert sum(e.kind == "confirmed" for i in infos for e in i.events) == 3


def test_ids_stay_for_ten_seconds_and_clutter_bears_nothing(tracker):
    road, seen = Road(CARS), []
    tracks, _ = drive(tracker, road, 10, lambda road, scan, tracks, info: seen.append(set(tracks.reported.id.tolist())))
    assert set.union(*seen) == {0, 1, 2}
    order = np.argsort(tracks.estimate.pose[:, 1])
    np.testing.assert_allclose(tracks.estimate.pose[order, 1], [-4, 0, 4], atol=0.5)
    np.testing.assert_allclose(tracks.estimate.velocity[order, 0], [22, 25, 28], atol=0.3)


@pytest.mark.parametrize("seed", range(5))
def test_an_empty_road_with_clutter_stays_empty(tracker, seed):
    reported = []
    drive(tracker, Road([], clutter=20, seed=seed), 10, lambda *a: reported.append(len(a[2].reported.id)))
    assert sum(reported) == 0


@given(seed=st.integers(0, 2**32 - 1))
def test_order_padding_and_splitting_of_detections_change_nothing(seed):
    tracker, rng = MultiObjectTracker(RandomMatrix(), (RADAR,)), np.random.default_rng(seed)

    def scrambled(scan):
        M = len(scan.mask)
        full = scan._replace(pose=np.repeat(scan.pose, M, 0), velocity=np.repeat(scan.velocity, M, 0))
        keep = rng.permutation(M)
        polar = np.concatenate([full.polar[keep], np.full((4, 3), np.nan)])
        mask = np.concatenate([full.mask[keep], np.zeros(4, bool)])
        pose = np.concatenate([full.pose[keep], np.full((4, 3), np.nan)])
        velocity = np.concatenate([full.velocity[keep], np.full((4, 2), np.nan)])
        return full._replace(polar=polar, mask=mask, pose=pose, velocity=velocity)

    road, one, two = Road(CARS, seed=seed), tracker.start(), tracker.start()
    for k in range(6):
        scan = road.scan()
        one, info = tracker.step(one, scan, road.dt if k else 0.0)
        two, other = tracker.step(two, scrambled(scan), road.dt if k else 0.0)
        assert_same(one, two)
        assert info.events == other.events
        road.advance()


def test_an_empty_scan_costs_visible_tracks_existence_and_hidden_ones_none(tracker):
    road = Road([(30, 0, 0, 25.0), (60, 0.2, 0, 25.0)])
    tracks, _ = drive(tracker, road, 1.0)
    tracks = tracks._replace(existence=np.full(len(tracks.id), 0.9))
    nothing = road.scan()._replace(
        mask=np.zeros(len(road.scan().mask), bool), polar=np.zeros((len(road.scan().mask), 3))
    )
    nothing = Scan(np.zeros((0, 3)), np.zeros(0, bool), nothing.pose, nothing.velocity, platform=nothing.platform)
    after, info = tracker.step(tracks, nothing, road.dt)
    near, far = np.argsort(after.estimate.pose[:, 0])
    assert after.existence[near] < 0.7
    assert after.existence[far] > 0.88
    assert info.expected[near] > 1
    assert info.expected[far] == 0
    predicted = tracker._predict(tracks, road.dt)
    assert_same(after.estimate, predicted.estimate)


def test_a_car_hidden_for_two_seconds_keeps_its_track(tracker):
    """Behind a nearer one: no detection, and none expected."""
    road = Road([(30, 0, 0, 25.0), (70, 0.1, 0, 25.0)], hidden={1: (2.0, 4.0)})
    tracks, _ = drive(tracker, road, 6.0)
    assert sorted(tracks.reported.id.tolist()) == [0, 1]


def test_a_visible_track_without_detections_dies(tracker):
    road = Road([(30, 0, 0, 25.0)], hidden={0: (1.0, 99.0)})
    tracks, infos = drive(tracker, road, 2.5)
    assert len(tracks.id) == 0
    assert any(e.kind == "died" for i in infos for e in i.events)


def test_owners_are_ids_at_the_places_of_the_scan(tracker):
    def check(road, scan, tracks, info):
        assert info.owner.shape == scan.mask.shape
        for i, n in zip(info.track, info.detections, strict=True):
            assert (info.owner == i).sum() == n

    drive(tracker, Road(CARS), 1.0, check)


def empty(platform):
    return Scan(np.zeros((0, 3)), np.zeros(0, bool), np.zeros((1, 3)), np.zeros((1, 2)), platform=platform)


def test_no_scan_ever_corrupts_a_state(tracker):
    """Nothing, ten thousand false alarms, all at one point, no range rate, time standing still."""
    road, rng = Road(CARS), np.random.default_rng(0)
    tracks, _ = drive(tracker, road, 1.0)
    base = road.scan()

    def crowd(polar):
        return base._replace(polar=polar, mask=np.ones(len(polar), bool))

    burst = rng.uniform([1, -0.5, -60], [174, 0.5, 60], (10_000, 3))
    no_rate = np.where(np.arange(3) == 2, np.nan, base.polar)
    scans = [empty(road.ego), crowd(burst), crowd(np.tile(base.polar[:1], (3000, 1))), crowd(no_rate), base]
    for scan in scans:
        for dt in (0.0, road.dt, 2.0):
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", "a scan has too many unexplained")
                after, _ = tracker.step(tracks, scan, dt)
            assert all(np.isfinite(a).all() for a in arrays(after))
            assert np.linalg.eigvalsh(after.estimate.cov).min(initial=1) > 0
            assert ((after.existence >= 0) & (after.existence < 1)).all()


def test_implausible_detections_are_counted_and_the_rest_is_tracked_as_if_they_were_padding(tracker):
    road = Road(CARS)
    tracks, _ = drive(tracker, road, 1.0)
    scan = road.scan()
    wrong, masked = scan.polar.copy(), scan.mask.copy()
    wrong[:2, 0], masked[:2] = 1e9, False
    got, info = tracker.step(tracks, scan._replace(polar=wrong), road.dt)
    want, quiet = tracker.step(tracks, scan._replace(mask=masked), road.dt)
    assert (info.implausible, quiet.implausible) == (2, 0)
    assert [e.kind for e in info.events] == ["implausible", *(e.kind for e in quiet.events)]
    assert info.events[0].track == NO_TRACK
    for a, b in zip(arrays(got), arrays(want), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"mask": np.ones((2, 3), bool), "polar": np.ones((2, 3, 3))},
            r"scan\.polar has leading axes \(2,\)",
        ),
        ({"polar": np.full((3, 3), np.nan)}, r"scan\.polar is not finite for 3 detections"),
        ({"sensor": np.array([7])}, "scan.sensor must index the tracker's 1 sensors"),
        ({"platform": np.zeros(3)}, r"scan\.platform must be \(\.\.\., 6\)"),
        ({"platform": np.full(6, np.inf)}, "ego motion is missing"),
    ],
)
def test_impossible_scans_get_one_clear_error(tracker, change, message):
    scan = Scan.from_xy(np.ones((3, 2)) * 10)._replace(platform=np.zeros(6))
    tracker.step(tracker.start(), scan, 0.1)
    with pytest.raises(ValueError, match=message):
        tracker.step(tracker.start(), scan._replace(**change), 0.1)


@pytest.mark.parametrize("dt", [-0.1, np.nan, np.inf])
def test_impossible_time_steps_get_one_clear_error(tracker, dt):
    with pytest.raises(ValueError, match="dt must be finite, >= 0"):
        tracker.step(tracker.start(), empty(np.zeros(6)), dt)


def test_a_tracker_that_would_prune_its_births_cannot_be_built():
    with pytest.raises(ValueError, match="births are removed in silence"):
        MultiObjectTracker(RandomMatrix(), (RADAR,), prune_below=0.05)
    with pytest.raises(ValueError, match="sensors must name at least one"):
        MultiObjectTracker(RandomMatrix(), ())


def test_pieces_of_one_vehicle_become_one_and_neighbours_do_not():
    pose = np.array([[20.0, 0, 0], [26, 0.3, 0], [20, 3.5, 0]])
    e = prior(pose, velocity=(20.0, 0.0), size=(5.0, 2.0))
    verdict = Exclusion().apply(e, np.array([3.0, 2.0, 1.0]))
    assert verdict.keep.tolist() == [True, False, True]
    assert verdict.into.tolist() == [-1, 0, -1]
    np.testing.assert_allclose(verdict.estimate.size[0], [11, 2])
    np.testing.assert_allclose(verdict.estimate.pose[0], [23, 0, 0], atol=1e-9)
    assert e.size[0, 0] == 5


def test_in_a_queue_two_metres_apart_vehicles_stay_two():
    e = prior(np.array([[20.0, 0, 0], [27, 0, 0]]), size=(5.0, 2.0))
    assert Exclusion().apply(e, np.ones(2)).keep.all()
    moving = e._replace(velocity=np.full((2, 2), [25.0, 0]))
    assert not Exclusion().apply(moving, np.ones(2)).keep.all()


def test_at_speed_nothing_drives_a_fifth_of_a_second_behind_another():
    for gap, stay in ((6.5, 1), (8.5, 2)):
        e = prior(np.array([[20.0, 0, 0], [25 + gap, 0, 0]]), velocity=(25.0, 0.0), size=(5.0, 2.0))
        assert Exclusion().apply(e, np.ones(2)).keep.sum() == stay


def test_a_track_that_is_hidden_is_reported_while_its_lane_is_known():
    """Standard deviations of 1 m along and 0.5 m across are those of a lane, turned by a right angle they are not."""
    e = prior(np.array([[20.0, 0, 0], [40, 0, np.pi / 2]]), position_std=1.0)
    e.cov[:, 1, 1] = 0.25
    tracks = tracks_of(e)._replace(noise=np.full(2, 0.1))
    assert tracks.reported.id.tolist() == [0, 1]
    assert tracks._replace(hidden=np.array([0.3, 0.3])).reported.id.tolist() == [0]
    assert tracks._replace(hidden=np.array([0.2, 0.2])).reported.id.tolist() == [0, 1]
    assert tracks._replace(hidden=np.array([0.3, 0.3]), noise=np.full(2, 0.3)).reported.id.tolist() == [0, 1]


def test_the_noise_of_a_track_is_the_least_across_the_line_of_sight_of_its_last_detections():
    """0.01 rad at 20 and 60 m; without a detection the noise of the last one stays."""
    e = prior(np.array([[20.0, 0, 0], [60, 0, 0]]), position_std=0.1)
    tracks = tracks_of(e, 0.99)._replace(hidden=np.zeros(2), noise=np.array([np.inf, np.inf]))
    tracker = MultiObjectTracker(KnownObjects(), (RADAR,))
    both, one = (scan_of(np.array(xy), (0.1, 0.01, 0.1)) for xy in ([[20.0, 0], [60, 0]], [[20.0, 0]]))
    for scan in (both, one):
        tracks, _ = tracker.step(tracks, scan, 0.1)
        assert tracks.noise == pytest.approx([0.2**2, 0.6**2], rel=1e-6)


@pytest.mark.parametrize(("truck", "works", "hidden"), [(True, True, 0.3), (False, True, 0.0), (True, False, 0.0)])
def test_a_track_counts_as_hidden_behind_another_and_not_in_plain_view_or_without_radar(truck, works, hidden):
    """Both are without detections for three scans, the second one behind a truck or not."""
    e = prior(np.array([[20.0, 0, np.pi / 2], [50, 0, 0]]), size=[[12.0, 2.5], [4.5, 1.9]], position_std=0.1)
    tracker = MultiObjectTracker(KnownObjects(), (RADAR,), occlude_above=0.1 if truck else 1.0)
    tracks = tracks_of(e, 0.9999)._replace(hidden=np.zeros(2), noise=np.zeros(2))
    scan = scan_of(np.zeros((0, 2)), (0.1, 0.01, 0.1))._replace(delivered=np.array([works]))
    for _ in range(3):
        tracks, _ = tracker.step(tracks, scan, 0.1)
    assert tracks.hidden[tracks.id == 1] == pytest.approx(hidden)


@pytest.mark.parametrize(("std", "hidden"), [(0.1, 0.0), (3.0, 0.3)])
def test_a_track_of_which_no_sensor_is_sure_counts_as_hidden(std, hidden):
    """At the edge of the view, 30 degrees and 50 m from the radar, a box 3.9 m wide may be outside of it by 3 m."""
    e = prior([(2.3 + 50 * np.cos(np.pi / 6), 25.0, 0.0)], size=(4.5, 1.9), position_std=std)
    tracker = MultiObjectTracker(KnownObjects(), (RADAR,), edge_sigmas=1.0)
    tracks = tracks_of(e, 0.9999)._replace(hidden=np.zeros(1), noise=np.zeros(1))
    scan = scan_of(np.zeros((0, 2)), (0.1, 0.01, 0.1))._replace(delivered=np.array([True]))
    for _ in range(3):
        tracks, _ = tracker.step(tracks, scan, 0.1)
    assert tracks.hidden == pytest.approx([hidden])


def test_a_duplicate_inside_a_box_goes():
    e = prior(np.array([[20.0, 0, 0], [20.5, 0.2, 0.1]]), velocity=(20.0, 0.0))
    verdict = Exclusion().apply(e, np.array([1.0, 2.0]))
    assert verdict.keep.tolist() == [False, True]
    assert not verdict.joined.any()


@given(st.integers(0, 8), st.integers(0, 2**32 - 1))
def test_overlapping_pairs_are_those_of_a_loop_over_all_pairs(n, seed):
    rng = np.random.default_rng(seed)
    pose = np.c_[rng.uniform(0, 8, (n, 2)), rng.uniform(-3, 3, n)]
    e = prior(pose, velocity=rng.uniform(0, 6, (n, 2)), size=rng.uniform(1, 6, (n, 2)))
    rule = Exclusion()
    expected = np.zeros((n, n), bool)
    for a in range(n):
        for b in set(range(n)) - {a}:
            there = [to_frame(e.pose[j], to_world(e.pose[i], GRID * e.size[i])) for i, j in ((a, b), (b, a))]
            share = max((np.abs(p) < e.size[j] / 2).all(-1).mean() for p, j in zip(there, (b, a), strict=True))
            alike = np.linalg.norm(e.velocity[a] - e.velocity[b]) < rule.overlap_speed
            expected[a, b] = share > rule.overlap_sure or (share > rule.overlap and alike)
    np.testing.assert_array_equal(rule.overlapping(e), expected)


def test_rays_enter_boxes_where_the_corners_say():
    pose, size = np.array([[10.0, 0, 0], [0.0, 20, np.pi / 2], [-1, 0, 0]]), np.array([[4.0, 2], [6, 2], [4, 4]])
    origin, direction = np.zeros((1, 2)), unit(np.array([[0.0, np.pi / 2, np.pi]]))
    d = ray_box(origin, direction, pose, size)[0]
    np.testing.assert_allclose(d, [[8, np.inf, 0], [np.inf, 17, 0], [np.inf, np.inf, 0]])


def test_rays_agree_with_the_edges_of_the_box():
    """The slab method against a loop over corners: first crossing of any edge."""
    rng = np.random.default_rng(3)
    pose, size = np.c_[rng.normal(0, 20, (40, 2)), rng.uniform(-3, 3, 40)], rng.uniform(1, 8, (40, 2))
    bearing = rng.uniform(-3, 3, 25)
    got = ray_box(np.zeros((1, 2)), unit(bearing)[None], pose, size)[0]
    corners = box_corners(pose, size)
    for k, u in enumerate(unit(bearing)):
        for t, ring in enumerate(corners):
            hits = []
            for a, b in zip(ring, np.roll(ring, -1, 0), strict=True):
                r, s = np.linalg.solve(np.stack([u, a - b], -1), a)
                if 0 <= s <= 1 and r > 0:
                    hits.append(r)
            inside = len(hits) == 1  # the ray leaves a box that it never entered
            expected = 0.0 if inside else min(hits, default=np.inf)
            np.testing.assert_allclose(got[k, t], expected, atol=1e-9)


def test_a_box_behind_a_confirmed_one_is_not_expected():
    e = prior(np.array([[20.0, 0, 0], [40, 0, 0], [40, 9, 0]]))
    sensors, platform = SensorArray.of((RADAR,)), np.zeros(6)
    free = predict_visibility(e, np.zeros(3, bool), sensors, platform)
    behind = predict_visibility(e, np.array([True, False, False]), sensors, platform)
    assert (free.expected > 0).all()
    assert behind.expected[0, 1] == 0
    assert behind.in_view[1]
    np.testing.assert_array_equal(behind.expected[0, [0, 2]], free.expected[0, [0, 2]])


def test_a_duplicate_is_not_protected_by_its_twin():
    e = prior(np.array([[20.0, 0, 0], [20.3, 0, 0]]))
    view = predict_visibility(e, np.ones(2, bool), SensorArray.of((RADAR,)), np.zeros(6))
    assert (view.expected > 0).all()


def test_outside_every_field_of_view_nothing_is_expected():
    e = prior(np.array([[-20.0, 0, 0], [400.0, 0, 0]]))
    view = predict_visibility(e, np.zeros(2, bool), SensorArray.of((RADAR,)), np.zeros(6))
    assert not view.in_view.any()
    assert (view.expected == 0).all()


def test_a_box_is_complete_but_for_what_an_edge_cuts_off_and_others_hide():
    edge = 20.0 * np.tan(RADAR.fov / 2)
    e = prior(np.array([[20.0, 0, 0], [20.0 + 2.3, edge, 0], [60.0, 0.9, 0], [-20.0, 0, 0]]))
    view = predict_visibility(e, np.array([True, False, False, False]), SensorArray.of((RADAR,)), np.zeros(6))
    assert view.complete[0] == 1
    assert 0.2 < view.complete[1] < 0.8
    assert view.complete[2] < 0.75
    assert view.complete[3] == 0


def test_what_is_expected_of_a_box_that_may_be_out_of_view_is_not_certain():
    """(MOT.59): half a box beyond the edge of the view, its place known to 0.5 m; one in the middle of the view."""
    edge = 20.0 * np.tan(RADAR.fov / 2)
    e = prior(np.array([[20.0 + 2.3, edge, 0], [20.0, 0.0, 0.0]]), position_std=0.5)
    sensors, idle = SensorArray.of((RADAR,)), np.zeros(2, bool)
    views = [predict_visibility(e, idle, sensors, np.zeros(6), edge_sigmas=k) for k in (0.0, 1.0, 9.0)]
    low, _, _ = angular_spans(e, np.array([RADAR.mount]))
    half, std = RADAR.fov / 2, 0.5 / np.hypot(*(e.pose[0, :2] - RADAR.mount[:2]))
    share = np.sqrt((half - std - low[0, 0]) / (half - low[0, 0]))
    np.testing.assert_allclose([view.certain[0, 0] for view in views], [1.0, share, 0.0])
    assert [view.certain[0, 1] for view in views] == [1.0, 1.0, 1.0]
    assert len({view.expected[0, 0] for view in views}) == 1
    around = SensorArray.of((replace(RADAR, fov=2 * np.pi),))  # has no edge
    behind = prior(np.array([[-20.0, 0.5, 0.0]]), position_std=0.5)
    assert predict_visibility(behind, idle[:1], around, np.zeros(6), edge_sigmas=3.0).certain[0, 0] == 1.0


@pytest.mark.parametrize(("edge_sigmas", "lives"), [(0.0, False), (1.0, True)])
def test_a_track_at_the_edge_of_the_view_does_not_die_of_silence(edge_sigmas, lives):
    """A corner of its box is in view by 0.1 degrees; its place is known to 0.4 m."""
    y = 20.0 * np.tan(RADAR.fov / 2 - np.deg2rad(0.1)) + 0.95
    tracker = MultiObjectTracker(KnownObjects(), (replace(RADAR, mount=(0.0, 0.0, 0.0)),), edge_sigmas=edge_sigmas)
    box = prior([[20.0 - 2.3, y, 0.0]], size=(4.6, 1.9), position_std=0.4)
    tracks = tracks_of(box, existence=0.95)
    for _ in range(10):
        tracks, _ = tracker.step(
            tracks, scan_of(np.zeros((0, 2)), (0.1, 0.01, 0.1), 0.0)._replace(delivered=np.ones(1, bool)), 0.1
        )
    assert (len(tracks.id) == 1 and tracks.existence[0] > 0.5) == lives


def test_the_near_end_is_hidden_where_another_box_stands_before_it():
    """A truck in the next lane, a car close behind it that hides its rear, not its side, and one far behind it."""
    truck = np.array([40.0, 4.0, 0.0])
    cars = [np.array([truck[0] - 6 - 2.3 - gap, 4.0, 0.0]) for gap in (3.0, 30.0)]
    size, sensors = [[12.0, 2.5], [4.6, 1.86]], SensorArray.of((RADAR,))
    for car, hidden in zip(cars, (True, False), strict=True):
        e = prior(np.array([truck, car]), size=size)
        view = predict_visibility(e, np.array([False, True]), sensors, np.zeros(6))
        np.testing.assert_array_equal(view.end_hidden, [hidden, False])
        assert view.share[0, 0] > 0
        assert not predict_visibility(e, np.zeros(2, bool), sensors, np.zeros(6)).end_hidden.any()
    beside = prior(np.array([[20.0, 0.0, np.pi / 2], [15.0, 0.0, np.pi / 2]]), size=[[12.0, 2.5], [3.0, 1.0]])
    view = predict_visibility(beside, np.array([False, True]), sensors, np.zeros(6))
    assert view.share[0, 0] < 1
    assert not view.end_hidden.any()  # no end is turned to the sensor


def test_existence_by_hand():
    ex = Existence()
    np.testing.assert_allclose(np.exp(ex.log_ratio(np.zeros(2), np.array([0.0, 1.0]), np.zeros(2))), [1, 1.5**-2])
    assert ex.log_ratio(np.zeros(1), np.array([50.0]), np.zeros(1)) == np.log(0.2)
    np.testing.assert_allclose(ex.log_ratio(np.ones(1), np.array([2.0]), np.array([3.0])), [2.4])
    np.testing.assert_allclose(ex.update(np.array([0.5]), np.log([4.0])), [0.8])
    visible, in_view, hidden = np.array([[1, 0, 0, 0], [1, 1, 1, 0], [0, 1, 0, 1]], bool)
    alive = ex.survive(np.ones(4), visible, in_view, hidden, 1.5)
    np.testing.assert_allclose(alive, np.exp([-1.5 / 60, -1.5 / 4, -1.5 / 8, -1]))


def test_what_lies_just_ahead_of_a_box_and_moves_like_it_starts_no_track(tracker):
    """A car is tracked; then a scan has returns up to 2.5 m ahead of it, as a longer vehicle would give them."""
    road = Road([(30, 0, 0, 25.0)], clutter=0)
    tracks, _ = drive(tracker, road, 1)
    front = tracks.estimate.pose[0, 0] + tracks.estimate.size[0, 0] / 2
    pose, velocity = RADAR.poses(road.ego), RADAR.velocity(road.ego)
    for faster, free in ((0.0, False), (5.0, True)):
        xy = np.stack([front + np.array([1.0, 2.5]), np.full(2, tracks.estimate.pose[0, 1])], -1)
        scan = Scan.from_xy(xy, pose=pose)
        polar = scan.polar.copy()
        polar[:, 2] = (scan.sight * (tracks.estimate.velocity[0] - velocity)).sum(-1) + faster
        full = Scan(polar, scan.mask, pose[None], velocity[None], np.array([[0.15, 0.01, 0.1]]), platform=road.ego)
        z, _ = tracker.association.prepare(full, tracker.sensor_array)
        got = tracker.suppression.candidates(z, np.full(len(xy), -1), tracks.estimate, tracks.existence)
        np.testing.assert_array_equal(got, [free and ahead > tracker.suppression.along for ahead in (1.0, 2.5)])


def test_shares_hold_every_owned_detection_once_and_never_too_many():
    owner = np.array([2, -1, 0, 2, 2, 0, -1])
    np.testing.assert_array_equal(shares(owner, 3, 40), [[2, 5, -1], [-1, -1, -1], [0, 3, 4]])
    np.testing.assert_array_equal(shares(owner, 3, 2), [[2, 5], [-1, -1], [0, 4]])
    np.testing.assert_array_equal(shares(np.zeros(0, int), 2, 40), [[-1], [-1]])


def test_velocity_of_a_crossing_car_is_not_forced_into_the_lane():
    """Across the line of travel 12 m ahead, 60 degrees wide: only the loose prior explains the range rates."""
    velocity = np.array([0.0, 9.0])
    xy = np.stack([np.full(15, 12.0), np.linspace(-6, -1.5, 15)], -1)
    scan = Scan.from_xy(xy)
    polar = scan.polar.copy()
    polar[:, 2] = (scan.sight * velocity).sum(-1)
    tracker = MultiObjectTracker(RandomMatrix(), (RADAR,))
    z, _ = tracker.association.prepare(scan._replace(polar=polar), tracker.sensor_array)
    wide = replace(tracker.initiation, linkage=Linkage(across=2.0))
    births = wide.births(z, np.ones(15, bool), EMPTY, np.ones(1), 0.0, 0.0)
    assert np.abs(births.estimate.velocity[0] - velocity).max() < 2.0
    heading = births.estimate.pose[0, 2]
    assert abs(heading - np.pi / 2) < 0.25


def test_an_oncoming_car_is_born_facing_the_ego(tracker):
    tracks, _ = drive(tracker, Road([(80, -4, np.pi, 25.0)]), 1.0)
    assert len(tracks.reported.id) == 1
    assert abs(abs(tracks.estimate.pose[0, 2]) - np.pi) < 0.1
    assert tracks.estimate.velocity[0, 0] < -23


def test_rows_keep_counting_ids(tracker):
    tracks, _ = drive(tracker, Road(CARS), 0.5)
    some = tracks.rows(np.array([0]))
    assert some.next_id == tracks.next_id
    assert_same(some.estimate, take(tracks.estimate, np.array([0])))


def test_motion_modes_of_the_filter_reach_the_reader_of_a_step(tracker):
    mixing = replace(tracker, filter=find("edra-imm"))
    _, infos = drive(mixing, Road(CARS), 1)
    assert infos[-1].mode.shape == (3, 3)
    np.testing.assert_allclose(infos[-1].mode.sum(1), 1)
    _, infos = drive(tracker, Road(CARS), 0.2)
    assert infos[-1].mode is None  # a filter with one motion model has none to tell


def test_a_note_of_the_filter_becomes_an_event(tracker):
    """A share of the scan below 1 counts as lost here, or none does."""
    for lost_below, tracks in ((1.0, {0, 1, 2}), (0.0, set())):
        _, infos = drive(replace(tracker, filter=find("pmht-spline", lost_below=lost_below)), Road(CARS), 0.5)
        assert {e.track for i in infos for e in i.events if e.kind == "lost"} == tracks


def test_a_note_goes_to_the_tracks_it_is_about_each_with_its_own_contours():
    contours = np.arange(3 * 2 * 4 * 2.0).reshape(3, 2, 4, 2)
    events = events_of(Note("adapted", "enough seen", np.array([True, False, True]), contours), np.array([7, 8, 9]))
    assert [(e.kind, e.track, e.reason) for e in events] == [
        ("adapted", 7, "enough seen"),
        ("adapted", 9, "enough seen"),
    ]
    np.testing.assert_array_equal(events[1].contours, contours[2])
    assert events_of(Note("lost", "nothing fits", np.array([True])), np.array([4]))[0].contours is None


@dataclass(frozen=True)
class Marked(RandomMatrix):
    """A filter that marks the states it started again: the extent gets more degrees of freedom."""

    def restart(self, state, estimate):
        fresh = self.init(estimate)
        return fresh._replace(nu=np.full_like(fresh.nu, 777.0))


def test_a_filter_that_knows_more_than_an_estimate_is_restarted_and_not_born_again(tracker):
    """Two halves of one vehicle merge to one that starts again."""
    marked = replace(tracker, filter=Marked())
    halves = prior([(30, 0, 0), (33, 0, 0)], velocity=(25.0, 0.0), size=(3.0, 1.8))
    sure = np.full(2, 0.99)
    tracks = Tracks(np.arange(2), sure, np.full(2, 9), sure, sure > 0, marked.filter.init(halves), halves, 2)
    merged, info = marked.step(tracks, empty(np.array([0.0, 0, 0, 25, 0, 0])), 0.0)
    assert [e.kind for e in info.events] == ["merged"]
    assert merged.state.nu.tolist() == [777.0]
