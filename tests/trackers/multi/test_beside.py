"""Long tracks far away: two vehicles in neighbouring lanes are told from one that is seen from behind and aside."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import booleans, floats

from tests.trackers.multi.known_objects import KnownObjects, scan_of, tracks_of
from trackers import MultiObjectTracker, SensorModel, prior
from trackers.multi.association import Association
from trackers.multi.beside import NOTHING, BesideTest, Taken, likeliest, owners
from trackers.multi.ground import GroundTest
from trackers.multi.initiation import Initiation
from trackers.multi.visibility import SensorArray

DT = 1 / 15
FRONT = SensorModel(
    max_range=220.0, fov=0.4, sigma_azimuth=0.008, count_at_15m=7.0, count_falloff=0.6, clutter=1.5
)  # 1.1 m across at 140 m
NOISE = (0.2, 0.008, 0.1)
IN_FILE_NEVER = GroundTest(surer=1e9)
SPEED = 20.0  # [m/s] along x, of all vehicles


class MovingObjects(KnownObjects):
    """The same, but they move."""

    def predict(self, state, dt):
        pose = state.pose.copy()
        pose[..., :2] += dt * state.velocity
        return state._replace(pose=pose)


def truck(rng, count):
    """A rear of 2.5 m at 103 m, and sometimes the right side, of a truck in the lane at 4 m."""
    rear = np.c_[np.full(count, 103.0), 4.0 + rng.uniform(-1.25, 1.25, count)]
    side = np.c_[rng.uniform(103.0, 115.0, count), np.full(count, 2.75)]
    return np.where(rng.random((count, 1)) < 0.3, side, rear)


def car(rng, count):
    """A rear of 1.8 m at 112 m in the lane at 0 m."""
    return np.c_[np.full(count, 112.0), rng.uniform(-0.9, 0.9, count)]


def van(rng, count):
    """A rear of 1.9 m at 103 m in the lane at 4 m."""
    return np.c_[np.full(count, 103.0), 4.0 + rng.uniform(-0.95, 0.95, count)]


def seen(rng, bodies, further, noise=NOISE):
    """Detections of the bodies, three each, with noise; all of it further away by so much [m]."""
    xy = np.concatenate([body(rng, 3) for body in bodies])
    xy[:, 0] += further
    r, a = np.hypot(*xy.T), np.arctan2(xy[:, 1], xy[:, 0]) + rng.normal(0, noise[1], len(xy))
    r = r + rng.normal(0, noise[0], len(xy))
    return np.c_[r * np.cos(a), r * np.sin(a)]


def after(bodies, scans, seed=0, further=0.0, y=2.0, ground=IN_FILE_NEVER, noise=NOISE):
    """The tracks after so many scans of the bodies, or as soon as one is divided, the divisions, and how far all is.

    One track of 13 m has all of it at first.
    """
    rng, events = np.random.default_rng(seed), []
    tracker = MultiObjectTracker(MovingObjects(), (FRONT,), ground=ground)
    one = prior(
        [(109.5 + further, y, 0.0)], velocity=(SPEED, 0.0), size=(13.0, 2.6), size_std=(1.0, 0.1), position_std=0.3
    )
    tracks = tracks_of(one, existence=0.99)
    for _ in range(scans):
        further += SPEED * DT
        tracks, info = tracker.step(tracks, scan_of(seen(rng, bodies, further, noise), noise), DT)
        found = [e for e in info.events if e.kind == "divided"]
        assert not found or not len(tracks.memory.taken.id)  # what was taken is forgotten, each begins anew
        events += found
        if found:
            break
    return tracks, events, further


@pytest.mark.parametrize("seed", range(5))
def test_a_truck_and_a_car_of_the_next_lane_become_two_tracks(seed):
    tracks, events, further = after((truck, car), 45, seed)
    assert [(e.track, e.reason.split(" of lanes ")[0]) for e in events] == [(0, "detections")]
    assert events[0].reason.endswith("m apart; the front part is track 1")
    assert tracks.id.tolist() == [0, 1]
    assert tracks.confirmed.all()
    np.testing.assert_allclose(tracks.estimate.pose[:, 1], [4.0, 0.0], atol=1.2)
    near = tracks.estimate.pose[:, 0] - tracks.estimate.size[:, 0] / 2 - further
    np.testing.assert_allclose(near, [103.0, 112.0], atol=2.0)  # about the cut they are mixed


@pytest.mark.parametrize("seed", range(5))
def test_a_truck_seen_from_behind_and_aside_stays_one(seed):
    _, events, _ = after((truck, truck), 75, seed, y=4.0)
    assert events == []


def bus(rng, count):
    """The left edge of a rear at 103 m, and the front half of the right side, of a bus in the lane at 4 m."""
    edge = np.c_[np.full(count, 103.0), rng.uniform(4.75, 5.25, count)]
    side = np.c_[rng.uniform(109.0, 114.0, count), np.full(count, 2.75)]
    return np.where(rng.random((count, 1)) < 0.5, side, edge)


@pytest.mark.parametrize("seed", range(5))
def test_nearer_by_too_two_of_neighbouring_lanes_become_two_tracks(seed):
    """A new track, whose length is not known yet, took both, 8 to 61 m ahead: less than 0.5 m of noise across.

    The negative twin takes only more noise.
    """
    assert [e.kind for e in after((van, car), 33, seed, further=-95.0)[1]] == ["divided"]
    noisier = replace(IN_FILE_NEVER, lanes=BesideTest(noisy=0.5))
    assert after((van, car), 33, seed, further=-95.0, ground=noisier)[1] == []


@pytest.mark.parametrize("seed", range(5))
def test_an_edge_of_a_rear_and_a_side_lie_no_lane_apart(seed):
    """2.25 m; the negative twin has lanes so narrow."""
    assert after((bus, bus), 30, seed, further=-73.0, y=4.0)[1] == []
    narrow = replace(IN_FILE_NEVER, lanes=BesideTest(lanes=(1.8, 6.0)))
    assert after((bus, bus), 30, seed, further=-73.0, y=4.0, ground=narrow)[1] != []


def test_where_detections_are_sharp_nothing_is_taken_from_the_next_lane():
    """With less than 0.2 m of noise a step across is a turned or a bent body."""
    sharp = (0.2, 0.002, 0.1)
    tracks, events, further = after((truck, car), 30, further=-90.0, noise=sharp)
    assert further < -45
    assert events == []
    assert len(tracks.memory.taken.id) == 0


def test_without_the_test_they_stay_one():
    """The negative twin: with the same scans."""
    never = replace(IN_FILE_NEVER, lanes=BesideTest(surer=1e9, likelier=1e9))
    assert after((truck, car), 45, ground=never)[1] == []


def lanes_of(each, speed=20.0, course=0.0, curvature=0.0):
    """Each so many detections of two lanes 4 m apart, in turn over two seconds; all turned by a course [rad].

    The lanes have a curvature [1/m].
    """
    age = np.repeat(np.linspace(2.0, 0.0, each), 2)
    ahead = np.tile([False, True], each)
    xy = np.c_[np.where(ahead, 9.0, 0.0) - speed * age, np.where(ahead, 4.0, 0.0)] + [120.0, 0.0]
    xy[:, 1] += curvature * (speed * age) ** 2 / 2
    turn = np.array([[np.cos(course), np.sin(course)], [-np.sin(course), np.cos(course)]])
    P = 2 * each
    return Taken(np.full(P, 7), xy @ turn, np.full(P, 0.64), np.zeros((P, 2)), age, np.arange(P)), ahead


def test_the_step_is_that_of_means_by_hand():
    """Twelve detections a lane, of variance 0.64 + 0.36, weigh 6: 2.5 / sqrt(2 / 6); both groups move along x.

    The velocity of the track does not.
    """
    taken, ahead = lanes_of(12)
    sure = (4.0 - 1.5) / np.sqrt(2 / 6)
    velocity = np.array([[18.0, 8.0]])
    speed, id = np.hypot(18.0, 8.0), np.array([7])
    assert BesideTest(surer=sure + 0.01, far=9.0).pairs(taken, id, velocity) == []
    (pair,) = BesideTest(surer=sure - 0.01, far=9.0).pairs(taken, id, velocity)
    assert pair.track == 0
    assert pair.across == pytest.approx(4.0)
    np.testing.assert_allclose(pair.velocity, [speed, 0.0], atol=1e-9)
    for part, own in zip(pair.parts, (~ahead, ahead), strict=True):
        np.testing.assert_array_equal(part.row, taken.row[own])
        np.testing.assert_allclose(part.xy[:, 0], taken.xy[own, 0] + taken.age[own] * speed)
    for options in ({"lanes": (4.5, 6.0)}, {"fast": 25.0}, {"least": 13}, {"wide": 3.0}):
        assert BesideTest(**options).pairs(taken, id, velocity) == []
    np.testing.assert_array_equal(owners(pair.parts, 30), [*ahead, *[-1] * 6])
    earlier = taken._replace(row=np.where(ahead, -1, taken.row))
    np.testing.assert_array_equal(owners((earlier,), 24), np.where(ahead, -1, 0))
    assert BesideTest().pairs(earlier, id, velocity) == []  # one of them has none in this scan


@given(course=floats(-3.1, 3.1))
def test_the_step_is_the_same_in_every_direction(course):
    taken, ahead = lanes_of(15, course=course)
    velocity = 20.0 * np.array([[np.cos(course), np.sin(course)]])
    (pair,) = BesideTest().pairs(taken, np.array([7]), velocity)
    np.testing.assert_array_equal(pair.parts[1].row, taken.row[ahead])
    assert pair.across == pytest.approx(4.0, abs=1e-6)


@given(course=floats(-3.1, 3.1), left=booleans())
def test_in_a_bend_the_lanes_are_told_apart_by_the_curvature_of_the_road(course, left):
    """A radius of 250 m, 1.6 m/s^2 across; the twin does not know of it, and takes it for one vehicle that turns."""
    curvature = 0.004 if left else -0.004
    straight, bent = (lanes_of(15, course=course, curvature=c)[0] for c in (0.0, curvature))
    ask = np.array([7]), 20.0 * np.array([[np.cos(course), np.sin(course)]])
    (pair,) = BesideTest().pairs(bent, *ask, np.array([curvature]))
    (same,) = BesideTest().pairs(straight, *ask)
    assert pair.across == pytest.approx(same.across)
    np.testing.assert_allclose(pair.parts[0].xy, same.parts[0].xy, atol=1e-6)
    assert BesideTest().pairs(bent, *ask) == []


def test_a_vehicle_that_turns_is_one():
    """Its rear was seen, then its front: moved straight ahead they are in two lanes, 4 m/s^2 across for 3 s."""
    age = np.linspace(3.0, 0.0, 60)
    x, y = 18.0 * -age + np.where(age > 1.0, -2.0, 2.0), 2.0 * age**2
    taken = Taken(np.full(60, 7), np.c_[x + 120.0, y], np.full(60, 0.3), np.zeros((60, 2)), age, np.arange(60))
    ask = taken, np.array([7]), np.array([[18.0, 0.0]])
    assert BesideTest().pairs(*ask) == []
    assert len(BesideTest(curved=20.0).pairs(*ask)) == 1  # the negative twin


def abreast(rng, count):
    """A rear of 1.9 m at 103 m in the lane at 0 m, beside that of the truck."""
    return np.c_[np.full(count, 103.0), rng.uniform(-0.95, 0.95, count)]


@pytest.mark.parametrize("seed", range(5))
def test_two_abreast_far_away_become_two_tracks(seed):
    """No place along the lanes is between them. The negative twin takes only noise that there is none of."""
    tracks, events, _ = after((van, abreast), 45, seed)
    assert [e.kind for e in events] == ["divided"]
    np.testing.assert_allclose(np.sort(tracks.estimate.pose[:, 1]), [0.0, 4.0], atol=1.2)
    assert after((van, abreast), 45, seed, ground=replace(IN_FILE_NEVER, lanes=BesideTest(far=9.0)))[1] == []


def crowds(each, curvature=0.0):
    """Each so many detections of variance 0.64 in lanes at -2 and 2 m, in turn over three seconds, none ahead.

    The lanes have a curvature [1/m].
    """
    age = np.repeat(np.linspace(3.0, 0.0, each), 2)
    left = np.tile([False, True], each)
    along = np.arange(2 * each) // 2 % 3
    xy = np.c_[along - 20.0 * age, np.where(left, 2.0, -2.0) + curvature * (20.0 * age) ** 2 / 2] + [120.0, 0.0]
    return Taken(np.full(2 * each, 7), xy, np.full(2 * each, 0.64), np.zeros((2 * each, 2)), age, np.arange(2 * each))


ASK = np.array([7]), np.array([[20.0, 0.0]])


def test_how_much_likelier_two_abreast_are_by_hand():
    """40 detections 2 m from the middle, of variance 0.64 and of the body, a tenth of them from anywhere in 12 m."""

    def log_density(off, var, share=1.0):
        return np.log(0.9 * share * sum(np.exp(-0.5 * d**2 / var) for d in off) / np.sqrt(2 * np.pi * var) + 0.1 / 12)

    one, two = log_density((2.0,), 0.64 + 1.44), log_density((0.0, 4.0), 0.64 + 0.36, 0.5)
    more = 0.5 * 40 * (two - one)
    (pair,) = BesideTest(likelier=more - 0.01).pairs(crowds(20), *ASK)
    assert abs(pair.across) == pytest.approx(4.0, abs=0.01)
    assert {tuple(part.row.tolist()) for part in pair.parts} == {tuple(range(0, 40, 2)), tuple(range(1, 40, 2))}
    for options in ({"likelier": more + 0.01}, {"far": 0.81}, {"fast": 21.0}, {"crowd": 21}):
        assert BesideTest(**options).pairs(crowds(20), *ASK) == []


def test_the_likelihood_of_many_detections_is_the_sum_of_logarithms():
    """Of as many as three seconds can have, all of them stray: their product is no float."""
    p = np.random.default_rng(0).uniform(0.1 / 12, 0.5, (400, 3))
    p[:, 1], p[:, 2] = 0.1 / 12, 0.4
    value, column = likeliest(p)
    assert column == 2
    assert value == pytest.approx(400 * np.log(0.4))
    assert likeliest(p[:, 1:2])[0] == pytest.approx(400 * np.log(0.1 / 12))


def test_lanes_between_which_no_distance_is_tried_are_refused():
    (pair,) = BesideTest(lanes=(5.8, 6.3)).pairs(crowds(20), *ASK)
    assert abs(pair.across) == 6.0
    with pytest.raises(ValueError, match="lanes must be two distances"):
        BesideTest(lanes=(5.8, 6.2))


def test_a_vehicle_that_changes_lanes_is_one():
    """4 m in 3 s, and the lane of two seconds before it; the negative twin is in both all the time."""
    two = crowds(30)
    one = two.xy.copy()
    one[:, 1] = np.where(np.arange(60) < 20, 0.0, 2.0 - 2.0 * np.cos(np.pi * (3.0 - two.age) / 3.0))
    assert BesideTest().pairs(two._replace(xy=one), *ASK) == []
    assert len(BesideTest().pairs(two, *ASK)) == 1


def test_of_two_one_behind_the_other_nothing_is_said_of_two_abreast():
    """Left and 5 m ahead; detections lie within 2 m along, as in the negative twin."""
    assert len(BesideTest(surer=1e9).pairs(crowds(20), *ASK)) == 1
    two = crowds(20)
    two.xy[1::2, 0] += 5.0
    assert BesideTest(surer=1e9).pairs(two, *ASK) == []
    assert len(BesideTest(surer=1e9, level=0.51).pairs(two, *ASK)) == 1


def test_in_a_sharp_bend_nothing_is_said_of_two_abreast():
    """1.9 and 2.1 m/s^2 across."""
    assert len(BesideTest().pairs(crowds(20, 1.9 / 400), *ASK, np.array([1.9 / 400]))) == 1
    assert BesideTest().pairs(crowds(20, 2.1 / 400), *ASK, np.array([2.1 / 400])) == []


def test_what_was_taken_is_forgotten_with_time_and_with_its_track():
    test, id = BesideTest(memory=0.25), np.array([4, 9])
    scan = scan_of([(140.0, 0.0), (150.0, 1.0), (20.0, 0.0)], NOISE)
    z, _ = Association().prepare(scan, SensorArray.of((FRONT,)))
    owner = np.argsort(np.argsort(z.xy[:, 0])) - 1  # of the one at 20 m none, of those at 140 and 150 m rows 0 and 1
    both, none = np.arange(2), np.full(3, -1)
    taken = test.observe(NOTHING, both, id, z, owner, 0.1)
    assert taken.id.tolist() == [4, 9]
    assert (taken.row >= 0).all()
    assert test.observe(NOTHING, both[:1], id, z, owner, 0.1).id.tolist() == [4]  # 9 is not long
    later = test.observe(taken, both, id, z, none, 0.1)
    np.testing.assert_array_equal(later.xy, taken.xy)
    assert later.row.tolist() == [-1, -1]
    np.testing.assert_allclose(later.age, 0.1)
    assert test.observe(taken, both[:1], id, z, none, 0.1).id.tolist() == [4]  # 9 is not long any more
    assert len(test.observe(later, both, id, z, none, 0.2).id) == 0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_part_begins_where_its_detections_do(side):
    """A truck of which the near end and much of the side were seen, ahead of the sensor and behind it."""
    x = side * np.concatenate([np.full(20, 100.0), np.linspace(100.0, 111.0, 20)])
    none = np.zeros((40, 2))
    taken = Taken(np.zeros(40, int), np.c_[x, np.full(40, 3.0)], np.ones(40), none, np.zeros(40), np.arange(40))
    whole = prior([(side * 104.0, 1.0, 0.1)], velocity=(20.0, 0.0), size=(13.0, 2.6), position_std=0.3)
    own = Initiation().parted(whole, [taken])
    assert own.size.tolist() == [[12.0, 2.5]]
    np.testing.assert_allclose(own.pose, [[side * 106.0, 3.0, 0.0]], atol=1e-9)
    np.testing.assert_array_equal(own.velocity, whole.velocity)
    assert np.linalg.eigvalsh(own.cov).min() > 0
