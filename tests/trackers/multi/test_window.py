"""Births from a window of unexplained detections: one detection a scan, measured clutter, crowds, what stands."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.stats import norm

from tests.trackers.multi.known_objects import KnownObjects, scan_of, tracks_of
from trackers import MultiObjectTracker, RandomMatrix, Scan, SensorModel, prior
from trackers.geometry import dot, perpendicular, unit
from trackers.multi.cells import Linkage, components
from trackers.multi.course import Course, Lanes
from trackers.multi.initiation import Initiation
from trackers.multi.road import RoadMap
from trackers.multi.window import EMPTY, Unexplained, Window

DT = 1 / 15
FRONT = SensorModel(max_range=174.0, fov=np.deg2rad(20), sigma_range=0.25, sigma_azimuth=0.0087, clutter=3.0)
NOISE = (0.25, 0.0087, 0.1)
LANE = RoadMap.of([([[-50.0, 0.0], [250.0, 0.0]], 4.0)])


def follow(tracker, scans, tracks=None):
    """Tracks and infos after each scan, DT apart."""
    tracks, out = tracker.start() if tracks is None else tracks, []
    for scan in scans:
        tracks, info = tracker.step(tracks, scan, DT if out else 0.0)
        out.append((tracks, info))
    return out


def singles(rates, start=100.0):
    """One detection a scan, which moves at 20 m/s, with these ground range rates [m/s]."""
    return [scan_of([(start + 20.0 * k * DT, 0.3 * (-1) ** k)], NOISE, rate) for k, rate in enumerate(rates)]


def test_one_detection_a_scan_is_a_reported_track_at_the_third():
    tracker = MultiObjectTracker(RandomMatrix(), (FRONT,))
    steps = follow(tracker, singles([20.0] * 4))
    assert [len(tracks.id) for tracks, _ in steps[:3]] == [0, 0, 1]
    assert [len(tracks.reported.id) for tracks, _ in steps[:3]] == [0, 0, 1]
    assert steps[2][0].hits.tolist() == [3]
    assert len(steps[2][0].memory.unexplained.rate) == 0
    assert len(steps[3][0].id) == 1


def test_detections_with_other_speeds_each_time_are_no_vehicle():
    tracker = MultiObjectTracker(RandomMatrix(), (FRONT,))
    steps = follow(tracker, singles([20.0, 26.0, 32.0, 14.0, 8.0, 38.0]))
    assert all(len(tracks.id) == 0 for tracks, _ in steps)
    assert len(steps[-1][0].memory.unexplained.rate) == 6


def uniform(rng, M):
    """Single false alarms of the front radar."""
    r, a = 174.0 * np.sqrt(rng.random(M)), np.deg2rad(20) * (rng.random(M) - 0.5)
    return scan_of(r[:, None] * unit(a), NOISE, rng.uniform(-60, 60, M))


def both(a, b):
    """Two scans of the radar at the origin as one."""
    return a._replace(polar=np.concatenate([a.polar, b.polar]), mask=np.concatenate([a.mask, b.mask]))


THREE = scan_of([(100.0, -0.5), (100.2, 0.0), (100.0, 0.5)], NOISE, 20.0)


def test_three_detections_are_a_track_in_a_clear_scan_and_none_in_heavy_clutter():
    tracker = MultiObjectTracker(RandomMatrix(), (FRONT,))
    rng = np.random.default_rng(0)
    assert len(follow(tracker, [THREE])[-1][0].reported.id) == 1
    nothing = [uniform(rng, 3) for _ in range(30)]
    assert len(follow(tracker, [*nothing, THREE])[-1][0].reported.id) == 1
    near = lambda tracks: tracks.estimate.pose[np.abs(tracks.estimate.pose[:, 0] - 102) < 4]  # noqa: E731
    assert len(near(follow(tracker, [*nothing, both(uniform(rng, 200), THREE)])[-1][0])) == 0


def test_thirteen_vehicles_at_once_are_thirteen_cells_of_clutter_and_born_all_the_same():
    xy = [(x + dx, y) for x in (30, 45, 60, 75, 90) for y in (-4, 0, 4) for dx in (0.0, 0.4, 0.8)][: 13 * 3]
    tracker = MultiObjectTracker(RandomMatrix(), (replace(FRONT, fov=1.0),))
    assert len(follow(tracker, [scan_of(xy, NOISE, 20.0)])[-1][0].reported.id) == 13


def loose_of(rng, P, extent=20.0):
    """P detections at random, ages of three scans."""
    angle = rng.uniform(-0.3, 0.3, P)
    return Unexplained(
        rng.uniform(0, extent, (P, 2)), unit(angle), rng.normal(10, 2, P), rng.uniform(0, 0.3, P),
        rng.uniform(0, 0.3, P), np.full(P, 1e-6), rng.integers(0, 2, P), np.zeros((P, 2)),
        rng.uniform(-3, 3, P), np.zeros(P, bool), rng.choice([0.0, DT, 2 * DT], P),
    )  # fmt: skip


@given(st.integers(0, 60), st.integers(0, 2**32 - 1))
def test_cells_are_those_of_a_loop_over_all_pairs(P, seed):
    points, link = loose_of(np.random.default_rng(seed), P), Linkage()
    cell = list(range(P))
    for i in range(P):
        for j in range(i):
            e, sigma = unit(points.course[i]), (points.sigma[i] + points.sigma[j]) / 2
            d = points.xy[i] - points.xy[j]
            along, across = d @ e, e[0] * d[1] - e[1] * d[0]
            most = link.rate if points.age[i] == points.age[j] else link.rate_between
            near = (along / (link.along + sigma)) ** 2 + (across / (link.across + sigma)) ** 2 < 1
            if near and abs(points.rate[i] - points.rate[j]) < most:
                cell = [cell[j] if c == cell[i] else c for c in cell]
    got = link.label(points)
    np.testing.assert_array_equal(got[:, None] == got, np.equal.outer(cell, cell))
    assert sorted(set(got)) == list(range(len(set(cell))))


@given(st.integers(1, 200), st.floats(0.0, 2.0), st.integers(0, 2**32 - 1))
def test_components_are_numbered_in_the_order_of_their_first_points(P, density, seed):
    a, b = np.random.default_rng(seed).integers(0, P, (2, int(density * P)))
    graph = coo_array((np.ones(len(a), bool), (a, b)), (P, P))
    np.testing.assert_array_equal(components(P, a, b), connected_components(graph, directed=False)[1])


def test_a_chain_in_the_worst_order_is_one_component():
    chain = np.arange(300)
    for order in (chain, chain[::-1], np.r_[chain[::2], chain[1::2]]):
        assert not components(300, order[:-1], order[1:]).any()


def test_cells_of_a_crowd_are_the_same_up_to_its_grid():
    rng = np.random.default_rng(0)
    points = loose_of(rng, 3000, extent=400.0)._replace(course=np.zeros(3000))
    fine = Linkage(thin=1e-6)
    one, other = fine.label_crowd(points), fine.label(points)
    np.testing.assert_array_equal(one[:, None] == one, other[:, None] == other)
    same = Unexplained(*(np.repeat(leaf[:1], 4000, 0) for leaf in points))
    assert set(Linkage().label_crowd(same)) == {0}


def test_two_vehicles_abreast_are_two_cells():
    xy = np.array([(50.0 + dx, y + dy) for y in (-1.8, 1.8) for dx in (0.0, 2.0) for dy in (-0.8, 0.0, 0.8)])
    points = loose_of(np.random.default_rng(0), 12)._replace(
        xy=xy, rate=np.full(12, 10.0), course=np.zeros(12), age=np.zeros(12), var_along=np.full(12, 0.01),
        var_across=np.full(12, 0.01),
    )  # fmt: skip
    assert Linkage().label(points).tolist() == [0] * 6 + [1] * 6
    assert set(Linkage(across=3.0).label(points)) == {0}


def test_the_window_moves_detections_along_their_lanes_and_forgets_them():
    """Hand-computed: 10 m/s seen under 60 degrees to the lane is 20 m/s along it; what stands stays, for longer."""
    points = loose_of(np.random.default_rng(0), 3)._replace(
        xy=np.array([[50.0, 0.0], [60.0, 0.0], [70.0, 0.0]]),
        sight=unit(np.deg2rad([60.0, 0.0, 0.0])), rate=np.array([10.0, 0.2, 10.0]), course=np.zeros(3),
        age=np.array([0.0, 0.4, 0.4]),
    )  # fmt: skip
    later = Window().predict(points, 0.1)
    np.testing.assert_allclose(later.xy, [[52.0, 0.0], [60.0, 0.0]])
    np.testing.assert_allclose(later.age, [0.1, 0.5])
    assert len(Window().predict(points, 1.2).rate) == 0


def test_what_a_track_comes_to_explain_leaves_the_window():
    tracker = MultiObjectTracker(KnownObjects(), (FRONT,))
    steps = follow(tracker, singles([20.0] * 2))
    memory = steps[-1][0].memory
    assert len(memory.unexplained.rate) == 2
    for place, left in ((102.0, 0), (106.0, 0), (112.0, 2)):  # on a track; just behind it, at its speed; away
        tracks = tracks_of(prior([(place, 0.0, 0.0)], velocity=(20.0, 0.0)))._replace(memory=memory)
        after, _ = tracker.step(tracks, scan_of(np.zeros((0, 2)), NOISE), DT)
        assert len(after.memory.unexplained.rate) == left


@pytest.mark.parametrize("seed", range(3))
def test_a_crowd_is_an_event_and_bears_nothing_that_is_reported(seed):
    tracker, rng = MultiObjectTracker(RandomMatrix(), (FRONT,)), np.random.default_rng(seed)
    crowd = uniform(rng, 5000)
    (tracks, info), (after, _) = follow(tracker, [crowd, THREE])
    assert [e.kind for e in info.events if e.track < 0] == ["crowded"]
    assert "unexplained detections" in info.events[0].reason
    assert len(tracks.reported.id) == 0
    assert len(tracks.id) <= tracker.initiation.most_births
    assert len(tracks.memory.unexplained.rate) == 0
    here = np.abs(after.estimate.pose[:, 0] - 102) < 4
    assert after.reported.id.tolist() == after.id[here & (after.existence > 0.5)].tolist()
    assert here.any()


def test_many_detections_at_one_point_take_bounded_memory():
    """Ten thousand: all pairs of them would be a gigabyte."""
    tracker = MultiObjectTracker(RandomMatrix(), (FRONT,))
    same = scan_of(np.tile([[100.0, 0.0]], (10_000, 1)), NOISE, 20.0)
    ((tracks, info),) = follow(tracker, [same])
    assert len(tracks.id) == 1
    assert info.events[0].kind == "crowded"


@given(st.integers(0, 2**32 - 1))
def test_order_and_padding_of_detections_change_neither_window_nor_births(seed):
    rng, tracker = np.random.default_rng(seed), MultiObjectTracker(RandomMatrix(), (FRONT,))
    one, two = tracker.start(), tracker.start()
    for k in range(5):
        xy = [(60.0 + 20 * k * DT, 3.0), (100 + 20 * k * DT, 0.0)]
        scan = both(uniform(rng, 12), scan_of(xy, NOISE, 20.0))
        order = rng.permutation(14)
        polar = np.concatenate([scan.polar[order], np.full((3, 3), np.nan)])
        other = scan._replace(polar=polar, mask=np.arange(17) < 14)
        one, info = tracker.step(one, scan, DT)
        two, again = tracker.step(two, other, DT)
        assert info.events == again.events
        for a, b in zip(one.memory.unexplained, two.memory.unexplained, strict=True):
            np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(one.estimate.pose, two.estimate.pose)
    assert len(one.id) >= 2


def test_rows_leave_the_window_alone():
    tracks = follow(MultiObjectTracker(RandomMatrix(), (FRONT,)), [THREE, *singles([20.0] * 2, 50.0)])[-1][0]
    assert len(tracks.memory.unexplained.rate) == 2
    assert tracks.rows(np.zeros(1, bool)).memory is tracks.memory


# Course


def crossing(k, ego=3.0):
    """A car at (32, -45) m, 11 m/s across, seen by a wide radar of an ego at 3 m/s; scan k."""
    centre, ego_x = np.array([32.0, -45.0 + 11 * k * DT]), ego * k * DT
    rng = np.random.default_rng(k)
    body = centre + np.c_[-0.9 + rng.exponential(0.2, 12), rng.uniform(-2.2, 2.2, 12)] + rng.normal(0, 0.1, (12, 2))
    scan = Scan.from_xy(body, pose=[ego_x, 0.0, 0.0], noise=(0.1, 0.005, 0.1))
    polar = scan.polar.copy()
    polar[:, 2] = scan.sight @ np.array([-ego, 11.0])
    return scan._replace(
        polar=polar, velocity=np.array([[ego, 0.0]]), platform=np.array([ego_x, 0.0, 0.0, ego, 0.0, 0.0])
    )


WIDE = SensorModel(max_range=100.0, fov=np.deg2rad(120), sigma_range=0.1, sigma_azimuth=0.005, clutter=2.0)


def test_a_crossing_car_without_a_map_keeps_its_id_and_gets_its_velocity():
    steps = follow(MultiObjectTracker(RandomMatrix(), (WIDE,)), [crossing(k) for k in range(9)])
    assert {int(i) for tracks, _ in steps for i in tracks.reported.id} == {0}
    tracks = steps[-1][0]
    assert np.hypot(*(tracks.estimate.velocity[0] - [0.0, 11.0])) < 2


def seeming_to_stand(direction):
    """Motion of one cell 20 m ahead of an ego at 10 m/s, without a range rate, on a lane with this direction [rad]."""
    n = 3
    xy = np.array([20.0, 0.0]) + np.arange(n)[:, None] * [0.2, 0.5]
    one, zero = np.ones(n), np.zeros(n)
    cell = Unexplained(
        xy, unit(np.arctan2(xy[:, 1], xy[:, 0])), zero, one, one, one, zero.astype(int), np.zeros((n, 2)),
        direction * one, zero > 0, zero,
    )  # fmt: skip
    lanes = Lanes(np.array([direction]), np.array([1.0]), 10.0, np.zeros(1))
    return Course().of(cell, np.ones((1, n), bool), lanes, np.array([True]))


def test_what_shows_no_range_rate_stands_in_a_lane_ahead_and_may_drive_in_one_that_crosses():
    ahead, across = seeming_to_stand(0.0), seeming_to_stand(np.pi / 2)
    assert np.hypot(*ahead.velocity[0]) < 0.2
    assert np.sqrt(ahead.cov[0, 0, 0]) < 1.0
    assert np.sqrt(across.cov[0, 1, 1]) > 4.0
    assert across.heading[0] == pytest.approx(np.pi / 2, abs=0.1)


def test_a_narrow_prior_along_the_ego_would_lose_the_crossing_car():
    """The twin: with the log odds that hold on lanes the prior along the ego's heading wins, and the car is lost."""
    tracker = MultiObjectTracker(RandomMatrix(), (WIDE,))
    course = replace(tracker.initiation.course, any_log_odds=(-3.0, -30.0))
    narrow = replace(tracker, initiation=replace(tracker.initiation, course=course))
    tracks = follow(narrow, [crossing(0)])[-1][0]
    assert np.hypot(*(tracks.estimate.velocity[0] - [0.0, 11.0])) > 5


def test_on_a_lane_of_the_map_a_vehicle_is_born_along_the_lane():
    lane = RoadMap.of([([[32.0, -100.0], [32.0, 100.0]], 4.0)])
    tracks = follow(MultiObjectTracker(RandomMatrix(), (WIDE,), road=lane), [crossing(0)])[-1][0]
    assert len(tracks.id) == 1
    np.testing.assert_allclose(tracks.estimate.velocity[0], [0.0, 11.0], atol=1.5)
    np.testing.assert_allclose(tracks.estimate.pose[0, 2], np.pi / 2, atol=0.1)


def test_a_vehicle_across_the_line_of_sight_points_where_its_velocity_is_open():
    """Straight ahead, range rate near zero, off the lanes of a map: it stands across the sight, not along the way."""
    xy = np.c_[np.full(5, 60.0), np.linspace(-2, 2, 5)]
    scan = scan_of(xy, NOISE, np.full(5, 1.2))._replace(platform=np.array([0.0, 0, 0, 2, 0, 0]))
    z, _ = MultiObjectTracker(RandomMatrix(), (WIDE,)).association.prepare(
        scan, MultiObjectTracker(RandomMatrix(), (WIDE,)).sensor_array
    )
    births = Initiation().births(z, np.ones(5, bool), EMPTY, np.ones(1), 0.0, 0.0, RoadMap.of([]))
    assert abs(np.sin(births.estimate.pose[0, 2])) > 0.95
    assert births.estimate.cov[0, 3, 3] > 4**2


def cell_of(xy, rate):
    """Detections (P, 2) [m] of one scan of a radar at the origin, with range rates (P,) [m/s], as one cell."""
    xy, n = np.asarray(xy, float), len(rate)
    one, zero = np.ones(n), np.zeros(n)
    return Unexplained(
        xy, unit(np.arctan2(xy[:, 1], xy[:, 0])), np.asarray(rate, float), one, one, one, zero.astype(int),
        np.zeros((n, 2)), zero, zero > 0, zero,
    )  # fmt: skip


def velocity_of(cell, along, speed, mapped=False):
    """Velocity (2,) [m/s] of one cell about an ego that drives so fast along x, which it is so sure to drive along."""
    lanes = Lanes(np.zeros(1), np.array([along]), speed, np.zeros(1), mapped=mapped)
    return Course().of(cell, np.ones((1, len(cell.rate)), bool), lanes, np.array([False])).velocity[0]


def likeliest(cell, along, speed):
    """The same by search over all velocities: odds, prior and likelihood of each, hypothesis by hypothesis."""
    c, grid = Course(), np.arange(-40.0, 40.0, 0.1)
    v = np.stack(np.meshgrid(grid, grid, indexing="ij"), -1)
    middle, across = cell.xy.mean(0), perpendicular(cell.sight)
    lever = dot(cell.xy - middle, across)
    log_p = norm.logpdf(cell.rate, v @ cell.sight.T, np.hypot(c.sigma_rate, c.turn_std * lever)).sum(-1)
    normal = lambda mean, std: norm.logpdf(v, mean, std).sum(-1)  # noqa: E731
    odds = c.any_log_odds[1] + (c.any_log_odds[0] - c.any_log_odds[1]) * along
    hypotheses = [normal([s * speed, 0.0], c.lane_std) for s in (1, -1)] + [normal([0.0, 0.0], c.any_std) + odds]
    best = np.max(hypotheses, 0) + log_p
    return v.reshape(-1, 2)[best.argmax()]


JAM = cell_of([(35.1, -4.3), (35.4, -4.8), (36.3, -5.2)], [4.7, 4.5, 5.6])  # of two cars of a queue, as in stop-and-go
NEAR = np.array([(10.0, -6.0), (10.0, -4.0), (10.0, -2.0)])
CROSSING = cell_of(NEAR, unit(np.arctan2(NEAR[:, 1], NEAR[:, 0])) @ [0.0, 12.0])  # at 12 m/s


@pytest.mark.parametrize(
    ("cell", "along", "speed"),
    [(JAM, 0.0, 2.3), (JAM, 1.0, 20.0), (CROSSING, 0.0, 2.0)],
    ids=["queue", "fast-road", "crossing"],
)
def test_a_cell_has_the_likeliest_velocity(cell, along, speed):
    np.testing.assert_allclose(velocity_of(cell, along, speed), likeliest(cell, along, speed), atol=0.1)


def test_two_cars_of_a_queue_in_one_cell_without_a_map_do_not_cross_the_road():
    """The twin is off the lanes of a map: by the likeliest hypothesis, whatever its velocity, they cross it."""
    assert abs(velocity_of(JAM, 0.0, 2.3)[1]) < 2
    assert abs(velocity_of(JAM, 0.0, 2.3, mapped=True)[1]) > 10


def test_range_rates_that_turn_over_a_near_cell_tell_that_it_crosses():
    """Those of its two ends differ by 4 m/s, which no turn explains."""
    np.testing.assert_allclose(velocity_of(CROSSING, 0.0, 2.0), [0.0, 12.0], atol=1.0)


# What stands


def standing(k, xy=(120.0, 0.0), share=2):
    """A vehicle that stands ahead and gives one detection in every other scan; the ego drives at 10 m/s."""
    ego = 10.0 * k * DT
    some = [] if k % share else [(xy[0] - ego, xy[1] + 0.8 * np.sin(7 * k))]
    scan = scan_of(np.reshape(some, (-1, 2)), NOISE, -10.0)
    scan.polar[:, 2] = -10.0 * scan.sight[:, 0]
    return scan._replace(
        pose=np.array([[ego, 0.0, 0.0]]), velocity=np.array([[10.0, 0.0]]), platform=np.array([ego, 0, 0, 10, 0, 0.0])
    )


@pytest.mark.parametrize(("road", "y", "found"), [(LANE, 0.0, True), (None, 0.0, False), (LANE, 6.0, False)])
def test_a_far_standing_vehicle_is_found_over_time_on_lanes_only(road, y, found):
    tracker = MultiObjectTracker(RandomMatrix(), (FRONT,), road=road)
    steps = follow(tracker, [standing(k, (120.0, y)) for k in range(25)])
    assert (len(steps[-1][0].reported.id) == 1) is found
    assert all(len(tracks.id) == 0 for tracks, _ in steps[:9])


def test_what_moves_across_the_sight_is_not_born_standing():
    """8 m/s along a crossing lane: the range rate is nearly 0, the place is not."""
    lane = RoadMap.of([([[120.0, -60.0], [120.0, 60.0]], 4.0)])
    tracker = MultiObjectTracker(RandomMatrix(), (FRONT,), road=lane)
    scans = [scan_of([(120.0, -6.0 + 8 * k * DT)], NOISE, 0.0) for k in range(22)]
    assert all(len(tracks.id) == 0 for tracks, _ in follow(tracker, scans))


@pytest.mark.parametrize(("road", "existence"), [(LANE, [0.05]), (None, [])])
def test_three_standing_detections_of_one_scan_are_born_unsure_on_lanes_only(road, existence):
    tracker = MultiObjectTracker(KnownObjects(), (FRONT,), road=road)
    scan = scan_of([(60.0, -0.5), (60.3, 0.0), (60.0, 0.5)], NOISE, 0.0)
    np.testing.assert_allclose(follow(tracker, [scan])[-1][0].existence, existence)
