"""Silence of a radar ahead about the length of a truck beside, whose front no radar has in view; by many rays."""

import numpy as np
import pytest

from tests.trackers.multi.known_objects import KnownObjects, scan_of, tracks_of
from trackers import MultiObjectTracker, SensorModel, prior
from trackers.batch import take
from trackers.multi.association import Association
from trackers.multi.silence import LENGTHS, SHORTEST, Silence
from trackers.multi.visibility import SensorArray, ray_box

BESIDE = SensorModel(mount=(1.9, 0.8, np.pi / 3), max_range=30.0, fov=np.pi / 2)
AHEAD = SensorModel(mount=(2.3, 0.0, 0.0), max_range=150.0, fov=np.radians(20.0))
SENSORS = (BESIDE, AHEAD)
NOISE = (0.15, 0.01, 0.1)
REAR, MOST = 2.0, 19.5  # [m] where the truck begins, and its greatest length
BEGINS = 2.3 + 2.75 / np.tan(np.radians(10.0)) - REAR  # [m] length from which on the radar ahead would see it


def truck(length, std=2.0):
    """A track in the next lane with its rear in its place."""
    return prior([(REAR + length / 2, 4.0, 0.0)], size=[(length, 2.5)], size_std=(std, 0.1), position_std=0.1)


def said(estimate=None, longest=None, more=(), out=(0.0, 0.0), occluder=(), silence=None):
    """What silence says of the first track, of which the radar beside has detections; `more` are (xy, sensor)."""
    estimate = truck(8.0) if estimate is None else estimate
    longest = truck(MOST) if longest is None else longest
    xy = [(3.0 + k, 2.75) for k in range(4)] + [place for place, _ in more]
    sensor = np.array([0] * 4 + [s for _, s in more])
    array = SensorArray.of(SENSORS)
    z, order = Association().prepare(scan_of(xy, NOISE)._replace(sensor=sensor), array)
    owner = np.array([0] * 4 + [-1] * len(more))[order]
    hides = np.isin(np.arange(len(estimate.pose)), occluder)
    return (silence or Silence()).quiet(
        np.array([0]), longest, estimate, hides, z, owner, np.array(out), array, rate_factor=0.8
    )


def foretold(length, rays=20_000):
    """Detections that the radar ahead should have of a truck so long, by many rays over all of its field of view."""
    azimuth = np.radians(10.0) * (2 * (np.arange(rays) + 0.5) / rays - 1)
    ray = np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
    pose, size = np.array([[REAR + length / 2, 4.0, 0.0]]), np.array([[length, 2.5]])
    d = ray_box(np.array([[2.3, 0.0]]), ray[None], pose, size)[0, :, 0]
    d = d[d < AHEAD.max_range]
    return 0.8 * AHEAD.expected_count(d.min(), d.sum() * np.radians(20.0) / rays) if len(d) else 0.0


def test_lengths_that_would_reach_into_the_view_ahead_are_as_improbable_as_no_detections_of_them():
    quiet = said()
    assert quiet.rows.tolist() == [0]
    np.testing.assert_allclose(quiet.length[0], np.linspace(SHORTEST, MOST, LENGTHS))
    Gam = np.array([foretold(length) for length in quiet.length[0]])
    assert (Gam > 0).tolist() == (quiet.length[0] > BEGINS).tolist()
    expected = 0.5 * np.log(np.maximum((1 + Gam / 2) ** -2.0, 0.1))
    np.testing.assert_allclose(quiet.log_p[0], expected, atol=0.1)
    assert quiet.log_p[0, -1] < -0.5


def test_the_near_end_stays_where_it_is_whatever_the_length():
    """Of a truck behind, whose near end is its front: the same by symmetry, with the radars turned round."""
    ahead = said()
    back = [SensorModel(**{**vars(s), "mount": (-s.mount[0], -s.mount[1], s.mount[2] + np.pi)}) for s in SENSORS]
    array, turn = SensorArray.of(tuple(back)), np.array([-1.0, -1.0, 1.0])
    z, _ = Association().prepare(
        scan_of([(-3.0 - k, -2.75) for k in range(4)], NOISE)._replace(sensor=np.zeros(4, int)), array
    )
    estimate, longest = (e._replace(pose=e.pose * turn) for e in (truck(8.0), truck(MOST)))
    behind = Silence().quiet(
        np.array([0]), longest, estimate, np.zeros(1, bool), z, np.zeros(4, int), np.zeros(2), array, 0.8
    )
    np.testing.assert_allclose(behind.log_p, ahead.log_p, atol=1e-9)


@pytest.mark.parametrize(
    "case",
    [
        {"more": [((19.0, 3.0), 1)]},  # the radar ahead has a detection there, be it of whatever
        {"out": (0.0, 0.9)},  # or delivers nothing
        {"longest": truck(BEGINS - 0.3)},  # or would see nothing of the greatest length
    ],
)
def test_nothing_is_said_where_nothing_follows(case):
    assert said(**case) is None


def test_a_detection_of_something_far_from_it_hinders_nothing():
    np.testing.assert_array_equal(said(more=[((40.0, 0.0), 1)]).log_p, said().log_p)


def test_what_others_hide_says_nothing():
    both = prior(
        [(REAR + 4.0, 4.0, 0.0), (12.0, 1.8, 0.0)], size=[(8.0, 2.5), (4.5, 1.8)], size_std=(2.0, 0.1), position_std=0.1
    )
    assert (said(both).log_p == said().log_p).all()
    assert (said(both, occluder=[1]).log_p == 0).all()


def asked(estimate, some=None, out=(0.0, 0.0), owner=(0, 0)):
    """The tracks of which silence may say something, where the radar beside has detections that `owner` own."""
    array = SensorArray.of(SENSORS)
    z, _ = Association().prepare(scan_of([(3.0, 2.75), (4.0, 2.75)], NOISE)._replace(sensor=np.zeros(2, int)), array)
    some = np.ones(len(estimate.pose), bool) if some is None else some
    return Silence().asked(estimate, some, z, np.array(owner), np.array(out), array).tolist()


def test_only_tracks_with_detections_and_an_unsure_length_are_asked_for():
    place = np.tile([REAR + 4.0, 4.0, 0.0], (3, 1))
    e = prior(place, size=(8.0, 2.5), size_std=[(0.4, 0.1), (0.6, 0.1), (0.6, 0.1)])
    assert asked(e, np.array([True, True, False])) == [1]


def test_tracks_that_no_silent_radar_might_see_are_not_asked_for():
    assert asked(truck(8.0)) == [0]
    assert asked(truck(8.0), out=(0.0, 0.9)) == []
    behind = truck(8.0)._replace(pose=np.array([[-30.0, 4.0, 0.0]]))
    assert asked(behind) == []
    assert asked(behind, owner=(-1, -1)) == []  # its front might reach to -10 m, where no view begins


@pytest.mark.parametrize("seed", range(5))
def test_all_of_which_silence_says_something_are_asked_for(seed):
    rng = np.random.default_rng(seed)
    pose = np.c_[rng.uniform(-40, 170, 200), rng.uniform(-30, 30, 200), rng.uniform(-np.pi, np.pi, 200)]
    found = 0
    for one in pose:
        estimate = prior([one], size=[(8.0, 2.5)], size_std=(2.0, 0.1))
        c = one[:2] + (MOST - 8.0) / 2 * np.array([np.cos(one[2]), np.sin(one[2])])
        longest = prior([(*c, one[2])], size=[(MOST, 2.5)])
        if said(estimate, longest) is not None:
            found += 1
            assert asked(estimate) == [0]
    assert found > 10


class Hearing(KnownObjects):
    """Known objects that may be as long as `MOST`, and keep what they hear."""

    def __init__(self):
        object.__setattr__(self, "heard", [])

    def reach(self, state):
        return take(truck(MOST), np.zeros(len(state.pose), int))

    def quiet(self, state, rows, length, log_p):
        self.heard.append((rows, length, log_p))
        return state


@pytest.mark.parametrize(
    ("silence", "delivered", "heard"), [(Silence(), None, 1), (Silence(), [True, False], 0), (None, None, 0)]
)
def test_the_filter_hears_it_before_its_update(silence, delivered, heard):
    filter = Hearing()
    tracker = MultiObjectTracker(filter, SENSORS, silence=silence)
    xy = [(3.0 + k, 2.75) for k in range(4)]
    scan = scan_of(xy, NOISE, 0.0)._replace(
        sensor=np.zeros(4, int), delivered=None if delivered is None else np.array(delivered)
    )
    tracker.step(tracks_of(truck(8.0)), scan, 0.1)
    assert len(filter.heard) == heard
    for rows, _, log_p in filter.heard:
        assert rows.tolist() == [0]
        assert (log_p[0, -2:] < 0).all()


def test_a_louder_scan_says_more_of_the_same():
    one, two = (said(silence=Silence(weight=w)).log_p for w in (0.5, 1.0))
    np.testing.assert_allclose(two, 2 * one)


@pytest.mark.parametrize("wrong", [{"dispersion": 0.0}, {"least": -0.1}, {"weight": np.nan}])
def test_wrong_parameters_are_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Silence(**wrong)
