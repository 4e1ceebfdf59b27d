"""Empty ground under a track: two vehicles in file are told from a long one, and from one of which a part is hidden."""

from dataclasses import replace

import numpy as np
import pytest

from tests.trackers.multi.known_objects import KnownObjects, scan_of, tracks_of
from trackers import MultiObjectTracker, SensorModel, prior
from trackers.batch import take
from trackers.multi.ground import CELLS, NOTHING, PLACE, STEP, GroundTest, end_on, untouched
from trackers.multi.tracks import BEFORE, BEHIND
from trackers.multi.visibility import SensorArray
from trackers.scan import DepthProfile

DT = 1 / 15
SIDE = SensorModel(max_range=30.0, fov=2 * np.pi, sigma_azimuth=0.02, count_at_15m=7.0, count_falloff=0.6, clutter=1.5)
AHEAD = replace(SIDE, max_range=100.0, fov=1.0, sigma_azimuth=0.005)
NOISE = (0.15, 0.02, 0.1)
CARS, LONG = ((-5.0, -0.5), (0.5, 5.0)), ((-5.0, 5.0),)  # [m] along the lane


def side_of(rng, bodies, even=False, count=14, y=4.0):
    """Detections of the nearer sides of bodies beside a radar at the origin: even over the angle, or the length."""
    x = rng.uniform(-7.5, 7.5, 8 * count) if even else 3.1 * np.tan(rng.uniform(-1.18, 1.18, 2 * count))
    x = x[np.any([(a < x) & (x < b) for a, b in bodies], 0)][: 2 * count]
    depth = np.where(rng.random(len(x)) < 0.2, rng.uniform(0, 1.8, len(x)), rng.exponential(0.12, len(x)))
    return np.c_[x, y - 0.9 + depth] + rng.normal(0, 0.05, (len(x), 2))


def box(centre=0.0, length=10.2, y=4.0, speed=0.0, width=2.5):
    """A track as wide as a truck, so that its width does not say that it is two cars."""
    size, std = (length, width), (1.0, 0.1)
    return prior([(centre, y, 0.0)], velocity=(speed, 0.0), size=size, size_std=std, position_std=0.1)


def stepped(draw, scans, estimate, sensor, seed=0):
    """The tracks after so many scans of what draw(rng) gives, and which of them were divided and merged."""
    rng, events = np.random.default_rng(seed), []
    tracker = MultiObjectTracker(KnownObjects(), (sensor,), ground=GroundTest())
    tracks = tracks_of(estimate, existence=0.99)
    for _ in range(scans):
        tracks, info = tracker.step(tracks, scan_of(draw(rng), NOISE, 0.0), DT)
        events += info.events
    return tracks, [e for e in events if e.kind in ("divided", "merged")]


def after(bodies, scans, estimate=None, seed=0, even=False, sensor=SIDE):
    """The tracks after so many scans of bodies beside the radar, and their events."""
    return stepped(lambda rng: side_of(rng, bodies, even), scans, box() if estimate is None else estimate, sensor, seed)


@pytest.mark.parametrize("seed", range(5))
def test_two_cars_in_a_queue_held_for_one_become_two_and_stay_so(seed):
    tracks, events = after(CARS, 45, seed=seed)
    assert [(e.kind, e.track) for e in events] == [("divided", 0)]
    assert sorted(tracks.id.tolist()) == [0, 1]
    order = np.argsort(tracks.estimate.pose[:, 0])
    np.testing.assert_allclose(tracks.estimate.pose[order, 0], [-2.8, 2.8], atol=0.4)
    np.testing.assert_allclose(tracks.estimate.size[:, 0], 4.6, atol=0.6)
    assert tracks.memory.divided.tolist() == [[0, BEFORE], [1, BEHIND]]
    assert tracks.confirmed.all()


@pytest.mark.parametrize("even", [False, True])
def test_one_long_vehicle_stays_one_however_its_detections_spread_along_it(even):
    """In ten seconds of each of eight drives; log odds of 3 come up by chance in about one of thirty."""
    ends = [after(LONG, 150, seed=seed, even=even) for seed in range(8)]
    assert sum(len(events) for _, events in ends) <= 1
    assert sum(tracks.id.tolist() == [0] for tracks, _ in ends) >= 7


def test_a_stretch_without_detections_is_no_gap_where_these_are_patchy():
    patchy = replace(SIDE, profile=DepthProfile(patchy=True))
    tracks, events = after(CARS, 45, sensor=patchy)
    assert events == []
    assert tracks.id.tolist() == [0]


def test_three_in_file_become_three():
    three = ((-7.0, -2.9), (-2.0, 2.0), (2.9, 7.0))
    tracks, events = after(three, 90, box(length=14.2))
    assert [e.kind for e in events] == ["divided", "divided"]
    np.testing.assert_allclose(np.sort(tracks.estimate.pose[:, 0]), [-5, 0, 5], atol=0.5)
    rear, middle, front = tracks.id[np.argsort(tracks.estimate.pose[:, 0])]
    ends = [(rear, BEFORE), (middle, BEHIND), (middle, BEFORE), (front, BEHIND)]
    assert set(map(tuple, tracks.memory.divided)) == set(ends)


@pytest.mark.parametrize(("tracked", "divided"), [(True, 0), (False, 1)])
def test_a_part_that_another_vehicle_hides_is_not_empty_ground(tracked, divided):
    """A handcart in between, whose own returns keep its track; without that track the part would look empty."""
    e = prior([(0.0, 4.0, 0.0), (0.0, 1.6, np.pi / 2)], size=[(10.2, 2.5), (1.2, 1.1)], position_std=0.1)
    tracker, rng = MultiObjectTracker(KnownObjects(), (SIDE,), ground=GroundTest()), np.random.default_rng(0)
    tracks, events = tracks_of(take(e, np.arange(1 + tracked)), existence=0.99), []
    for _ in range(60):
        cart = np.c_[rng.uniform(-0.5, 0.5, 5), np.full(5, 1.05)]
        scan = scan_of(np.concatenate([side_of(rng, ((-5.0, -1.8), (1.8, 5.0))), cart]), NOISE, 0.0)
        tracks, info = tracker.step(tracks, scan, DT)
        events += [e for e in info.events if e.kind == "divided"]
    assert len(events) == divided


def test_a_part_out_of_the_field_of_view_is_not_empty_ground():
    views = tuple(replace(SIDE, mount=(0.0, 0.0, a), fov=np.deg2rad(60)) for a in np.deg2rad([45.0, 135.0]))
    tracker = MultiObjectTracker(KnownObjects(), views, ground=GroundTest())
    rng, tracks = np.random.default_rng(0), tracks_of(box(), existence=0.99)
    for _ in range(90):
        xy = side_of(rng, ((-5.0, -0.9), (0.9, 5.0)))  # nothing within 15 degrees of abeam
        scan = scan_of(xy, NOISE, 0.0)
        tracks, info = tracker.step(tracks, scan._replace(sensor=(xy[:, 0] < 0).astype(int)), DT)
        assert not [e for e in info.events if e.kind == "divided"]


@pytest.mark.parametrize("aside", [0.0, 0.3, 0.6, 0.9])
def test_detections_are_expected_up_to_the_edge_of_a_view_and_no_further(aside):
    """Of a side 3.1 m beside a radar that looks 60 degrees to both sides, wherever the cells of the track lie."""
    sensor = replace(SIDE, mount=(0.0, 0.0, np.pi / 2), fov=np.deg2rad(120))
    tracker = MultiObjectTracker(KnownObjects(), (sensor,), ground=GroundTest())
    tracks = tracks_of(box(aside, length=13.0, width=1.8), existence=0.99)
    xy = np.stack([np.linspace(-5.0, 5.0, 9), np.full(9, 3.15)], -1)
    tracks, _ = tracker.step(tracks, scan_of(xy, NOISE, 0.0), DT)
    ground, edge = tracks.memory.ground, 3.1 * np.tan(np.deg2rad(60))
    x = ground.origin[0, 0] + PLACE
    assert (np.abs(x[ground.expected[0] > 0]) < edge).all()
    assert (np.abs(x[ground.expected[0] == 0]) > edge - STEP).all()


def ground_with(gap, density, length=10.0):
    """Ground of a track of that length at the origin, with `density` detections a cell but in the gap (2,) [m]."""
    inside = np.abs(PLACE) < length / 2
    seen = np.where(inside & ~((gap[0] < PLACE) & (gap[1] > PLACE)), density, 0.0)
    ground = untouched(np.zeros(1, int), np.zeros((1, 2)))
    return ground._replace(seen=seen[None], expected=np.where(inside, density, 0.0)[None], hits=seen[None])


def log_odds(gap, speed, length=10.0, density=1.5, width=2.5, **rule):
    ground, test = ground_with(gap, density, length), GroundTest(gaps=(round(np.ptp(gap) / STEP),), **rule)
    return test.split(ground, box(0, length, 0.0, speed, width)).ratio[0]


def test_the_log_odds_are_those_of_sums_by_hand():
    """Evidence, densities of the lengths and of the gap: two cars of 4.5 m against one vehicle of 10 m."""
    x, rule = STEP * np.arange(CELLS), GroundTest()
    classes, mean = rule.fleet.classes, rule.closest + rule.headway * 20.0
    std = [np.hypot(c.length[1], rule.length_std) for c in classes]
    wider = [max(c.width[0] - 2.5, 0.0) / np.sqrt(c.width[1] ** 2 + rule.width_std**2 + 0.1**2) for c in classes]
    share = np.array([c.share for c in classes]) * np.exp(-0.5 * np.array(wider) ** 2)
    length = sum(
        p * np.exp(-0.5 * ((x - c.length[0]) / s) ** 2) / s / np.sqrt(2 * np.pi)
        for c, s, p in zip(classes, std, share / share.sum(), strict=True)
    )
    length = (1 - rule.fleet.floor) * length + rule.fleet.floor / x[-1]
    gap = np.exp(-x / mean) / mean
    file, last = length.copy(), length
    for _ in range(3):  # one more vehicle behind a gap
        last = np.convolve(np.convolve(last, gap), length)[:CELLS] * STEP**2
        file += last
    evidence = (rule.thin - rule.stray) * 4 * 1.5  # four cells, nothing seen
    expected = evidence + 2 * np.log(file[18]) + np.log(gap[4]) - np.log(length[40])
    assert log_odds((-0.5, 0.5), 20.0) == pytest.approx(expected, rel=1e-6)


def test_what_is_seen_end_on_is_compared_with_what_both_parts_show_of_their_insides():
    """16 m, the 8 m in the middle are empty: 3 m of each part count, with 1 and 2 detections a cell, not the faces."""
    test, half = GroundTest(gaps=(32,)), 8.0
    shown = np.where(PLACE < 0, 1.0, 2.0) * ((np.abs(PLACE) > 4.0) & (np.abs(PLACE) < half))
    shown += 50.0 * ((np.abs(PLACE) > half - 1.0) & (np.abs(PLACE) < half))
    ground = untouched(np.zeros(1, int), np.zeros((1, 2)))._replace(hits=shown[None])
    estimate = box(0, 16.0, 0.0, 25.0)
    prior = test.split(ground, estimate).ratio[0]
    evidence = test.split(ground._replace(end_on=shown[None]), estimate).ratio[0] - prior
    assert evidence == pytest.approx((test.thin - test.stray) * 1.0 * 32)
    stray = np.where(np.abs(PLACE) < 1.0, 0.25, shown)[None]
    less = test.split(ground._replace(end_on=stray), estimate).ratio[0] - prior
    assert less == pytest.approx(evidence - 2.0 * np.log(test.thin / test.stray))


@pytest.mark.parametrize("ahead", [False, True])
@pytest.mark.parametrize(("face", "due", "evidence"), [(1.0, 0.0, True), (5.0, 0.0, False), (1.0, 1.0, False)])
def test_of_a_vehicle_whose_side_is_in_no_view_the_face_at_the_gap_is_enough(ahead, face, due, evidence):
    """12 m, of which the side of one half and a gap of 2 m beside it are in view; of the other half a face is hit.

    A bus whose far face is hit has none at the gap, and what should show its side there and does not may be bent.
    """
    x, test = PLACE if ahead else -PLACE, GroundTest(gaps=(8,))
    side, gap, rest = (x > -6) & (x < -1), (x > -1) & (x < 1), (x > 1) & (x < 6)
    hits = 20.0 * ((face < x) & (x < face + STEP)) + 0.2 * rest
    ground = untouched(np.zeros(1, int), np.zeros((1, 2)))._replace(hits=(side + hits)[None])
    estimate = box(0, 12.0, 0.0, 10.0)
    seen = ground._replace(seen=1.0 * side[None], expected=1.0 * (side | gap)[None] + due * rest)
    ratio = [test.split(each, estimate).ratio[0] for each in (ground, seen)]
    assert np.diff(ratio) == pytest.approx((test.thin - test.stray) * 8 if evidence else 0.0)


@pytest.mark.parametrize("inside", [0.0, 1.0])
def test_a_face_says_nothing_of_the_inside(inside):
    """Of the rear part only the face is seen, and 1 m: how many detections its inside would give is not known."""
    shown = np.where((np.abs(PLACE + 7.5) < 0.5 + inside) | (np.abs(PLACE - 2.0) < 6.0), 3.0, 0.0)
    ground = untouched(np.zeros(1, int), np.zeros((1, 2)))._replace(hits=shown[None])
    test, estimate = GroundTest(gaps=(round((3.0 - inside) / STEP),)), box(0, 16.0, 0.0, 25.0)
    with_end = test.split(ground._replace(end_on=shown[None]), estimate).ratio
    np.testing.assert_array_equal(with_end, test.split(ground, estimate).ratio)


def test_end_on_a_face_looks_wider_than_a_side():
    """10 m by 2.5 m at a distance of 40 m: from 10 m aside both look alike."""
    poses = np.array([[-40.0, y, 0.0] for y in (0.0, 9.0, -11.0)] + [[0.0, 20.0, 0.0]])
    np.testing.assert_array_equal(end_on(box(0.0, 10.0, 0.0), poses), [[True, True, False, False]])


def ahead(bodies, scans, sensor=AHEAD, seed=0):
    """Tracks after so many scans of bodies in the lane of the radar, of rears and insides, and kinds of events."""
    low, high = np.array(bodies).T

    def draw(rng):
        n = rng.poisson(0.25 * (high - low))
        x = np.concatenate([rng.uniform(*b, k) for b, k in zip(bodies, n, strict=True)] + [np.repeat(low, 2)])
        return np.c_[x, rng.uniform(-0.9, 0.9, len(x))] + rng.normal(0, 0.05, (len(x), 2))

    estimate = box((low[0] + high[-1]) / 2, high[-1] - low[0] + 0.2, 0.0)
    tracks, events = stepped(draw, scans, estimate, sensor, seed)
    return tracks, [e.kind for e in events]


@pytest.mark.parametrize("seed", range(3))
def test_two_in_file_that_are_seen_from_behind_become_two(seed):
    tracks, events = ahead(((30.0, 34.5), (40.0, 44.5)), 30, seed=seed)
    assert events == ["divided"]
    np.testing.assert_allclose(np.sort(tracks.estimate.pose[:, 0]), [32.25, 42.25], atol=0.8)


@pytest.mark.parametrize("seed", range(3))
def test_one_long_vehicle_that_is_seen_from_behind_stays_one(seed):
    tracks, events = ahead(((30.0, 44.5),), 150, seed=seed)
    assert events == []
    assert tracks.id.tolist() == [0]


def test_the_face_of_a_vehicle_does_not_foretell_what_its_side_shows():
    """A truck 4 m aside: many detections of its rear, few along the side, some of its front wheels."""

    def rear_and_side(rng):
        n, wheels = rng.poisson([1.0, 1.0])
        rear = np.c_[30.0 + rng.exponential(0.1, 10), rng.uniform(2.8, 5.2, 10)]
        x = np.r_[rng.uniform(31.0, 42.0, n), rng.uniform(40.0, 41.0, wheels)]
        side = np.c_[x, 2.8 + rng.exponential(0.1, n + wheels)]
        return np.concatenate([rear, side]) + rng.normal(0, 0.05, (10 + n + wheels, 2))

    truck = box(36.0, length=12.0)
    ends = [stepped(rear_and_side, 60, truck, AHEAD, seed) for seed in range(8)]
    assert [events for _, events in ends] == [[]] * 8


def test_patchy_sensors_say_nothing_of_what_they_see_end_on():
    tracks, events = ahead(((30.0, 34.5), (40.0, 44.5)), 30, replace(AHEAD, profile=DepthProfile(patchy=True)))
    assert events == []
    assert tracks.id.tolist() == [0]


def test_the_same_empty_ground_divides_two_cars_and_not_a_cab_from_its_load():
    cars, truck = log_odds((-0.5, 0.5), 20.0, density=4.0), log_odds((-2.5, -1.5), 20.0, density=4.0)
    assert cars > GroundTest().surer > truck


def test_the_faster_two_drive_the_more_must_be_seen_of_the_gap_between_them():
    slow, fast = log_odds((-0.5, 0.5), 2.0), log_odds((-0.5, 0.5), 25.0)
    assert slow > fast + 1
    assert log_odds((-0.5, 0.5), 25.0, headway=0.0) > slow


def test_a_length_that_no_vehicle_has_is_two_sooner():
    """Of 19 m there is hardly any; the gap is that of two lengths that are common."""
    assert log_odds((-5.0, -4.0), 20.0, 19.0) > log_odds((-3.0, -2.0), 20.0, 15.5)


def divided_at(gap, stray, fov, length=12.0):
    """The parts of a track with detections up to 1 m ahead, and `stray` 5 m ahead, beside a radar that looks so far."""
    ground, estimate = ground_with(gap, 1.5, length), box(0, length, 4.0, 0.0, 1.8)
    hits = np.where(PLACE < 1.0, ground.seen, 0.0)
    hits[0, PLACE == 4.875] = stray
    test = GroundTest(gaps=(round(np.ptp(gap) / STEP),))
    ground = ground._replace(hits=hits)
    split = test.split(ground, estimate)
    assert split.where.all()
    sensors = SensorArray.of((replace(SIDE, mount=(0.0, 0.0, np.pi / 2), fov=fov),))
    return test.pieces(ground, split, estimate, sensors, np.zeros(6))


def test_a_part_whose_end_was_never_hit_may_be_shorter():
    """From the gap to the front, -2 to 6 m, with the last of many detections 1 m ahead: 4.5 m of it are bare."""
    rear, front = divided_at((-3.0, -2.0), 0.0, 2 * np.pi)
    np.testing.assert_allclose([rear.pose[0, 0], rear.size[0, 0], rear.size_std[0, 0]], [-4.5, 3.0, 0.3])
    np.testing.assert_allclose([front.pose[0, 0], front.size[0, 0]], [2.0 - 4.5 / 4, 8.0 - 4.5 / 2])
    assert front.size_std[0, 0] == pytest.approx(np.hypot(0.1 * 5.75, 4.5 / 2))


def test_a_single_detection_far_out_does_not_make_an_end():
    _, with_stray = divided_at((-3.0, -2.0), 0.6, 2 * np.pi)
    _, without = divided_at((-3.0, -2.0), 0.0, 2 * np.pi)
    np.testing.assert_array_equal(with_stray.size, without.size)
    _, seen = divided_at((-3.0, -2.0), 3.0, 2 * np.pi)
    assert seen.size[0, 0] > without.size[0, 0] + 1


@pytest.mark.parametrize(("fov", "more"), [(2 * np.pi, 0.0), (2 * np.arctan(6.9 / 4.0), 2.0)])
def test_a_part_whose_end_lies_where_no_sensor_looks_may_have_any_length(fov, more):
    rear, _ = divided_at((-3.0, -2.0), 0.0, fov)
    assert rear.size_std[0, 0] == pytest.approx(np.hypot(0.3, more))
    assert rear.size[0, 0] == pytest.approx(3.0)


@pytest.mark.parametrize(("width", "divided"), [(1.8, 2), (2.5, 1)])
def test_what_is_long_and_as_narrow_as_a_car_is_two_where_the_ground_is_not_seen(width, divided):
    """Both ends are seen, the ground between them is in no field of view."""
    views = tuple(replace(SIDE, mount=(0.0, 0.0, a), fov=np.deg2rad(60)) for a in np.deg2rad([20.0, 160.0]))
    tracker = MultiObjectTracker(KnownObjects(), views, ground=GroundTest())
    rng, tracks = np.random.default_rng(0), tracks_of(box(length=12.4, width=width), existence=0.99)
    for _ in range(20):
        xy = side_of(rng, ((-6.2, -3.8), (3.8, 6.2)))
        scan = scan_of(xy, NOISE, 0.0)
        tracks, _ = tracker.step(tracks, scan._replace(sensor=(xy[:, 0] < 0).astype(int)), DT)
    assert len(tracks.id) == divided


def test_a_track_as_narrow_as_a_car_that_shows_no_gap_is_one():
    assert (
        log_odds((-1.5, 1.5), 25.0, 12.0, width=1.8) > GroundTest().surer > log_odds((0.0, 3.0), 25.0, 7.5, width=1.8)
    )
    full = ground_with((0.0, 0.0), 1.5, 12.0)
    assert GroundTest().split(full, box(0, 12.0, 0.0, 25.0, 1.8)).ratio[0] < GroundTest().surer


def test_the_cells_follow_a_box_that_grew_at_one_end():
    """The centre moves by 6 m when a track takes in what lies behind it; what was seen of it stays where it was."""
    test, id = GroundTest(), np.array([3])
    ground = test.predict(NOTHING, id, box(0.0, 8.0, 0.0), 0.0)
    ground.seen[0, CELLS // 2 + 8] = 5.0  # 2.1 m ahead of the old centre
    ground = test.predict(ground, id, box(-6.0, 20.0, 0.0), 0.0)
    seen = np.flatnonzero(ground.seen[0])
    np.testing.assert_allclose(ground.origin[0, 0] + PLACE[seen], [2.125])
    np.testing.assert_allclose(ground.seen.sum(), 5.0)


def test_the_ground_moves_and_the_tracks_stay_where_they_were():
    test, long = GroundTest(), prior([[30.0, 0.0, 0.0]], velocity=(10.0, 0.0), size=(12.0, 2.0))
    ground = test.predict(NOTHING, np.array([3]), long, 0.0)
    ground = test.predict(ground, np.array([3]), long, 0.1)
    np.testing.assert_allclose(ground.origin, [[31.0, 0.0]])
    np.testing.assert_array_equal(long.pose[0, :2], [30.0, 0.0])


def test_a_part_may_also_be_shorter_at_the_gap():
    """The front part begins at the gap, at -2 m, and its detections 3 m ahead: 5 m less `slack` of it are bare."""
    ground, estimate = ground_with((-3.0, -2.0), 1.5, 12.0), box(0, 12.0, 4.0, 0.0, 1.8)
    hits = np.where((PLACE > -3.0) & (PLACE < 3.0), 0.0, ground.seen)
    test = GroundTest(gaps=(4,), strays=0.0)
    sensors = SensorArray.of((replace(SIDE, mount=(0.0, 0.0, np.pi / 2)),))
    split = test.split(ground, estimate)
    rear, front = test.pieces(ground._replace(hits=hits), split, estimate, sensors, np.zeros(6))
    np.testing.assert_allclose([rear.size[0, 0], front.size[0, 0]], [3.0, 8.0 - 4.5 / 2])
    np.testing.assert_allclose(front.pose[0, 0], 2.0 + 4.5 / 4)


def cut_of(at=(20.0, 0.0), near=0.0, hidden=False, fov=2 * np.pi, count=1.0, rule=None):
    """Whether a box from -8 to 8 m is cut, and its rest: detections from -6 to 0 m, and `near` of them 7 m ahead.

    The radar lies `at` (2,) [m] and looks back along the axis.
    """
    hits = np.where((PLACE > -6.0) & (PLACE < 0.0), count, 0.0)
    hits[PLACE == 6.875] = near
    ground = untouched(np.zeros(1, int), np.zeros((1, 2)))._replace(hits=hits[None])
    view = SensorArray.of((replace(SIDE, mount=(0.0, 0.0, np.pi), max_range=60.0, fov=fov),))
    platform = np.array([*at, 0.0, 0.0, 0.0, 0.0])
    where, rest = (rule or GroundTest()).cut(ground, box(0.0, 16.0, 0.0), np.array([not hidden]), view, platform)
    return where[0], rest


def test_the_end_that_faces_the_radar_is_cut_where_it_was_never_hit():
    """7.5 m of it, slack taken off; the far end, of which 1.5 m are bare, may be there and out of sight."""
    cut, rest = cut_of(rule=GroundTest(strays=0.0))
    assert cut
    assert cut_of()[0]
    np.testing.assert_allclose(rest.size[0, 0], 16.0 - 7.5 - 1.5 / 2)
    np.testing.assert_allclose(rest.pose[0, 0], (-8.0 + 0.5) / 2 + 1.5 / 4)
    assert not cut_of((-20.0, 0.0))[0]  # from behind 1.5 m are bare, which the size layer corrects


@pytest.mark.parametrize(
    "how",
    [
        {"near": 2.0},  # it was hit
        {"near": 20.0, "count": 10.0},  # hit often, and a little short: the size layer corrects it
        {"hidden": True},
        {"fov": np.deg2rad(20.0), "at": (30.0, 20.0)},  # out of view
        {"at": (12.0, 6.0)},  # beside it an end is seen at a grazing angle
        {"count": 0.1},  # 2.4 detections
    ],
)
def test_an_end_that_may_be_there_is_not_cut(how):
    assert not cut_of(**how)[0]


@pytest.mark.parametrize(("age", "cut"), [(0.3, 0), (3.0, 1)])
def test_a_track_that_begins_with_empty_ground_starts_again_without_it_once_it_is_settled(age, cut):
    """A car and empty road before it, up to where one that drove away was once part of the track."""
    tracker = MultiObjectTracker(KnownObjects(), (replace(SIDE, max_range=60.0),), ground=GroundTest())
    tracks = tracks_of(box(-20.0, length=16.0), existence=0.99)._replace(age=np.array([age]))
    rng, events = np.random.default_rng(0), []
    for _ in range(8):
        xy = np.c_[rng.uniform(-27.0, -22.0, 12), 4.0 + rng.uniform(-0.9, 0.9, 12)]
        tracks, info = tracker.step(tracks, scan_of(xy, NOISE, 0.0), DT)
        events += [e for e in info.events if e.kind == "cut"]
    assert len(events) == cut
    assert tracks.id.tolist() == [0]
    assert (tracks.estimate.size[0, 0] < 10.0) == bool(cut)
