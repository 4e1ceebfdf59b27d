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
from trackers.estimate import prior
from trackers.geometry import rotation, unit, wrap_angle
from trackers.multi.course import Course
from trackers.multi.road import RoadMap
from trackers.multi.way import ACROSS, HEADING, WINDING, Way
from trackers.multi.window import EMPTY

DT = 1 / 15
WIDE = SensorModel(max_range=120.0, fov=2 * np.pi, sigma_range=0.15, sigma_azimuth=0.008, sigma_rate=0.1, clutter=1.0)
angles = st.floats(-3.1, 3.1)


def platform(speed=20.0, yaw_rate=0.0, pose=(0.0, 0.0, 0.0)):
    return np.array([*pose, *speed * unit(pose[2]), yaw_rate])


def estimates(pose, speed=20.0, std=0.03):
    """Vehicles at poses (N, 3) that drive where they head."""
    pose = np.reshape(pose, (-1, 3)).astype(float)
    return prior(pose, velocity=speed * unit(pose[:, 2]), heading_std=std)


NOBODY = estimates([])


def on_circle(s, radius, off=0.0):
    """Poses (N, 3) s (N,) [m] along a circle to the left, from the origin eastwards, `off` to the left of it."""
    angle = np.asarray(s) / radius
    centre = np.array([0.0, radius])
    return np.c_[centre + (radius - off) * unit(angle - np.pi / 2), angle]


def driven(poses, others=NOBODY, speed=20.0):
    """The way of an ego that drove through these poses (K, 3)."""
    way = Way.of(platform(speed, pose=poses[0]))
    for pose in poses:
        way = way.followed(platform(speed, pose=pose), others)
    return way


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.9])
def test_a_straight_way_is_the_heading_of_the_ego_everywhere(heading):
    xy = np.random.default_rng(0).normal(0, 80, (20, 2))
    one = platform(pose=(3.0, -4.0, heading))
    way = Way.of(one)
    assert way.speed == pytest.approx(20.0)
    np.testing.assert_array_equal(way.direction(xy), np.full(20, heading))
    np.testing.assert_allclose(way.followed(one, NOBODY).direction(xy), heading, atol=1e-12)


@given(st.floats(60.0, 2000.0), st.floats(-8.0, 8.0), st.floats(0.0, 0.8), st.booleans())
def test_where_others_drive_on_a_circle_the_road_leads_as_they_do(radius, off, share, oncoming):
    """Between them too, beside the ego by `off`, in the other direction, and behind, where the ego drove."""
    lead = min(120.0, radius)
    others = on_circle(lead * np.linspace(0.2, 1, 5), radius, off)
    others[:, 2] += np.pi * oncoming
    way = driven(on_circle(np.arange(-200.0, 1.0, 2.0), radius), estimates(others))
    there = on_circle(np.array([share * lead, -share * lead]), radius, off)
    assert np.abs(wrap_angle(way.direction(there[:, :2]) - there[:, 2])).max() < 0.03 + 2 / radius
    np.testing.assert_allclose(way.curvature(there), 1 / radius, rtol=0.4, atol=1e-3)
    back = there + np.array([0, 0, np.pi])
    np.testing.assert_allclose(way.curvature(back), -way.curvature(there), atol=1e-12)
    np.testing.assert_array_equal(way.curvature(there + np.array([0, 0, np.pi / 2])), 0.0)  # across


def walked(s):
    """Of a curvature that walks in steps of 1 m, at s (N,) whole m at 20 m/s: the covariance of the directions, that of
    the curvatures with them, and the variance of the curvatures."""
    reach = int(np.abs(s).max()) + 1
    fine = np.arange(-reach, reach)  # a step of the curvature at each, in its middle, outwards
    middle = fine + 0.5
    curve, turn = np.zeros((len(s), 2 * reach)), np.zeros((len(s), 2 * reach))
    for row, to in enumerate(s):
        same = (middle * to > 0) & (np.abs(middle) < np.abs(to))
        curve[row] = same
        turn[row] = same * np.sign(to) * (np.abs(to) - np.abs(middle))
    at, var = np.asarray(s, float), (ACROSS / 20.0**2) ** 2
    K = HEADING**2 + var * (np.outer(at, at) + turn @ turn.T / WINDING)
    return K, var * (at + curve @ turn.T / WINDING), var * (1 + np.abs(at) / WINDING)


def test_the_road_is_that_of_a_curvature_that_walks_at_random():
    """Direction, how sure it is, and curvature, less what may be none, are those of a walk in steps of 1 m."""
    seen, asked = np.array([-130, -60, -7, 25, 60, 110]), np.array([-200, -90, -20, 10, 40, 100, 160])
    off = np.array([-0.5, -0.25, -0.03, 0.1, 0.27, 0.55])
    K, slope, free = walked(np.append(seen, asked))
    n, var = len(seen), np.array([0.01, 0.01, 0.01, 0.02, 0.03, 0.04]) ** 2
    known = np.linalg.inv(K[:n, :n] + np.diag(var))
    gain = K[n:, :n] @ known
    way = Way(np.array([[0.0, 0.0, 0.3]]), 20.0, seen.astype(float), known @ off, known)
    xy = asked[:, None] * unit(0.3)
    np.testing.assert_allclose(way.direction(xy) - 0.3, gain @ off, atol=2e-4)
    expected = np.sqrt(np.diag(K)[n:] - (gain * K[n:, :n]).sum(1))
    np.testing.assert_allclose(way.direction_std(xy), expected, rtol=1e-2)
    c, unknown = slope[n:, :n] @ known @ off, free[n:] - ((slope[n:, :n] @ known) * slope[n:, :n]).sum(1)
    assert (c**2 > 2 * unknown).sum() > 3
    pose = np.c_[xy, way.direction(xy)]
    np.testing.assert_allclose(way.curvature(pose), c * np.maximum(1 - unknown / c**2, 0), atol=3e-5)


@given(angles, st.floats(-1e3, 1e3), st.sampled_from([-1, 1]))
def test_turning_shifting_and_mirroring_the_world_does_so_with_the_road(angle, shift, side):
    rng = np.random.default_rng(7)
    poses, others = on_circle(np.arange(-91.3, 0.1, 3.3), 150.0), on_circle([20.0, 50.0, 90.0], 120.0, 4.0)
    ask = np.c_[rng.normal(0, 60, (9, 2)), np.full(9, 0.2)]

    def moved(pose):
        xy, heading = pose[:, :2] * [1, side], side * pose[:, 2]
        return np.c_[xy @ rotation(angle).T + [shift, -shift / 3], wrap_angle(heading + angle)]

    one, two = driven(poses, estimates(others)), driven(moved(poses), estimates(moved(others)))
    turned = two.direction(moved(ask)[:, :2]) - angle
    np.testing.assert_allclose(wrap_angle(turned - side * one.direction(ask[:, :2])), 0, atol=1e-6)
    np.testing.assert_allclose(two.direction_std(moved(ask)[:, :2]), one.direction_std(ask[:, :2]), atol=1e-6)
    np.testing.assert_allclose(two.curvature(moved(ask)), side * one.curvature(ask), atol=1e-8)


@pytest.mark.parametrize(
    ("turn", "speed", "says"), [(0.1, 20.0, True), (0.1 - np.pi, 20.0, True), (1.4, 20.0, False), (0.1, 3.0, False)]
)
def test_who_crosses_or_hardly_moves_says_nothing_of_the_road(turn, speed, says):
    straight = np.c_[np.arange(-200.0, 1.0, 5.0), np.zeros((41, 2))]
    way = driven(straight, estimates([[45.0, 3.0, turn]], speed))
    assert (abs(way.direction(np.array([[45.0, 3.0]]))[0]) > 0.02) == says


def test_the_farther_from_all_that_drives_the_less_is_known_of_the_road():
    straight = np.c_[np.arange(-200.0, 1.0, 5.0), np.zeros((41, 2))]
    xy = np.c_[[-150.0, 0.0, 60.0, 120.0], np.zeros(4)]
    alone, led = driven(straight), driven(straight, estimates([[100.0, 0.0, 0.0], [120.0, 3.5, 0.0]]))
    assert (alone.direction_std(xy)[:2] < 0.02).all()
    assert alone.direction_std(xy)[3] > 2 * alone.direction_std(xy)[2] > 0.1
    assert (led.direction_std(xy) < 0.1).all()


def test_before_it_has_driven_the_ego_is_taken_to_have_turned_as_it_does():
    radius = 200.0
    way = Way.of(platform()).followed(platform(20.0, 20.0 / radius), NOBODY)
    np.testing.assert_allclose(way.driven, on_circle(np.arange(-190.0, 1.0, 10.0), radius), atol=1e-9)
    ahead = on_circle([0.0, 30.0, 60.0], radius)
    np.testing.assert_allclose(way.direction(ahead[:, :2]), ahead[:, 2], atol=0.015)


@pytest.mark.parametrize("speed", [0.0, 0.9, -4.0])
def test_the_yaw_rate_of_an_ego_that_does_not_drive_on_says_nothing_of_its_way(speed):
    way = Way.of(platform()).followed(platform(speed, 0.3), NOBODY)
    np.testing.assert_array_equal(way.driven[:, 2], 0.0)


def test_of_the_way_of_the_ego_a_pose_each_ten_metres_is_kept_and_two_hundred_metres_of_them():
    way = driven(np.c_[np.arange(0.0, 500.0, 1.0), np.zeros((500, 2))])
    assert way.driven[-1, 0] == 499.0
    np.testing.assert_allclose(np.diff(way.driven[:, 0])[:-1], 10.0)
    assert 180 < np.ptp(way.driven[:, 0]) < 200
    stands = way
    for _ in range(30):
        stands = stands.followed(platform(0.0, pose=(499.0, 0.0, 0.0)), NOBODY)
    np.testing.assert_array_equal(stands.driven, way.driven)


def test_an_ego_that_is_elsewhere_at_once_has_driven_nothing():
    there = platform(20.0, 0.1, pose=(5e5, -2e5, 1.0))
    way = driven(np.c_[np.arange(0.0, 300.0, 1.0), np.zeros((300, 2))]).followed(there, NOBODY)
    np.testing.assert_array_equal(way.driven, Way.of(there).followed(there, NOBODY).driven)


def test_a_change_of_lanes_of_the_ego_bends_the_road_a_little_and_only_for_a_while():
    """Its heading is off by 0.075 rad at most, the road up to 60 m ahead then by 0.2 rad, and by 0.02 from 100 m on."""
    s = np.arange(-200.0, 201.0, 2.0)
    y = 3.6 / (1 + np.exp(-s / 12.0))
    poses, worst, way = np.c_[s, y, np.arctan2(np.gradient(y, s), 1.0)], [], None
    for pose in poses:
        now = platform(pose=pose)
        way = (way or Way.of(now)).followed(now, NOBODY)
        worst.append(np.abs(way.direction(pose[:2] + np.c_[[20.0, 60.0], np.zeros(2)])).max())
    assert 0.05 < max(worst) < 0.2
    assert max(np.array(worst)[s > 100]) < 0.02


@pytest.mark.parametrize(("speed", "least", "most"), [(20.0, 1.0, 2.0), (6.0, 0.0, 0.8)])
def test_an_ego_that_turns_slowly_leaves_its_road_rather_than_follows_it(speed, least, most):
    """Half way round a corner of 20 m: by so much [rad] the road is expected to go on turning in the next 30 m."""
    straight = np.c_[np.arange(-200.0, 0.0, 2.0), np.zeros((100, 2))]
    way = driven(np.concatenate([straight, on_circle(np.arange(0.0, 16.0, 2.0), 20.0)]), speed=speed)
    x, y, heading = way.driven[-1]
    assert least < way.direction(np.array([[x, y]]) + 30 * unit(heading))[0] - heading < most


def after(tracker, scans):
    """The tracks after scans DT apart."""
    tracks = tracker.start()
    for k, scan in enumerate(scans):
        tracks, _ = tracker.step(tracks, scan, DT if k else 0.0)
    return tracks


def ahead_in_a_bend(yaw_rate, steps=3, radius=250.0, speed=20.0, way=70.0, seed=3):
    """Scans of a car that drives `way` [m] ahead on a circle to the left, while the ego turns so."""
    rng, lead = np.random.default_rng(seed), way / radius
    there = radius * np.array([np.sin(lead), 1 - np.cos(lead)])  # in the axes of the ego, which drives on the circle
    for k in range(steps):
        e = speed * DT * k / radius
        ego, velocity = np.array([radius * np.sin(e), radius * (1 - np.cos(e)), e]), speed * unit(e)
        scan = scan_of(rng, np.append(there, lead), CAR, speed, speed / radius)
        polar = scan.polar - [0, 0, speed] * np.cos(scan.polar[:, 1:2])
        yield scan._replace(
            polar=polar, pose=ego[None], velocity=velocity[None], platform=np.array([*ego, *velocity, yaw_rate])
        )


@pytest.mark.parametrize(("yaw_rate", "most", "sure"), [(0.08, 3.5, 2.0), (0.0, None, None)])
def test_without_a_map_what_is_born_far_ahead_drives_along_the_bend_of_the_ego(yaw_rate, most, sure):
    """On a circle of 250 m, 70 m ahead, a lane leads 16 degrees to the left; the twin's ego drives straight on."""
    tracks = [after(build("imm-spline", (WIDE,)), ahead_in_a_bend(yaw_rate, seed=k)).estimate for k in range(12)]
    error = wrap_angle(np.array([one.pose[0, 2] for one in tracks]) - (70 + 40 * DT) / 250)
    std, rms = np.array([one.heading_std[0] for one in tracks]), np.degrees(np.sqrt((error**2).mean()))
    assert rms < most if most else rms > 8.0
    assert sure is None or ((error / std) ** 2).mean() < sure


def test_without_a_map_a_track_is_expected_to_turn_as_the_way_of_the_ego_bends():
    """The twin has a map, of another road."""
    elsewhere = RoadMap.of([([[-200.0, -90.0], [200.0, -90.0]], 4.0)])
    scans = list(ahead_in_a_bend(0.08, steps=12, way=40.0))
    tracks, twin = (after(replace(build("imm-spline", (WIDE,)), road=road), scans) for road in (None, elsewhere))
    assert 0.002 < tracks.state.motion.curvature[0] < 0.0045
    assert twin.state.motion.curvature[0] == 0.0


def test_the_less_is_known_of_the_road_the_less_of_the_speed_across_of_what_is_born():
    """A car 70 m ahead of an ego that has driven straight on; beside that three others do so, or nobody."""
    xy = np.array([70.0, 0.0]) + np.random.default_rng(2).normal(0, 0.4, (6, 2))
    scan = detections_of(xy, (0.15, 0.008, 0.1), np.zeros(6))._replace(velocity=np.array([[20.0, 0.0]]))
    tracker, way = build("imm-spline", (WIDE,)), Way.of(platform())
    z, _ = tracker.association.prepare(scan._replace(platform=platform()), tracker.sensor_array)
    across = []
    for others in (NOBODY, estimates([[60.0, 4.0, 0.0], [80.0, 4.0, 0.0], [70.0, -4.0, 0.0]])):
        known = way.followed(platform(), others)
        births = tracker.initiation.births(z, np.ones(6, bool), EMPTY, np.ones(1), 0.0, 0.0, way=known)
        expected = np.hypot(1.0, 20.0 * known.direction_std(births.mean)[0])
        across.append(np.sqrt(births.estimate.cov[0, 3, 3]))
        assert across[-1] == pytest.approx(expected, rel=0.1)
    assert across[0] > 1.3 * across[1]


def test_with_a_map_the_way_of_the_ego_says_nothing():
    elsewhere = RoadMap.of([([[-200.0, -90.0], [200.0, -90.0]], 4.0)])
    tracker = MultiObjectTracker(RandomMatrix(), (WIDE,), road=elsewhere)
    one, two = (after(tracker, ahead_in_a_bend(w)) for w in (0.08, 0.0))
    assert one.memory.way is None
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
