"""What detections from one side leave out of a body: cabs ahead of loads, and ends that are round."""

from dataclasses import replace

import numpy as np
import pytest

from tests.trackers.size.bodies import DT, NEAR, ROUNDED, WHOLE, behind_rear, beside, rear_start, scan_of, seen, sized
from trackers import find, prior
from trackers.scan import DepthProfile
from trackers.size.evidence import evidence
from trackers.size.fleet import Fleet
from trackers.size.grid import LENGTH
from trackers.size.hits import Boxes, hits_of

CAR, TRUCK = (4.4, 1.8), (9.0, 2.5)


def counted(xy, anchor=-1.0, profile=None, size=TRUCK, pose=(NEAR + 4.5, 0.0, 0.0)):
    """The detections (2, D) along a box from behind, of a scan (M, 2) from the origin."""
    f = sized().size
    if profile is not None:
        f = replace(f, sensors=(replace(f.sensors[0], profile=profile),))
    scan, rows = scan_of(np.asarray(xy, float)), np.zeros(len(xy), int)
    box = Boxes(np.array([pose]), np.array([size]), np.array([[anchor, -1.0]]))
    hits = hits_of(scan, (np.arange(len(xy)),), rows, box.pose, f.profiles, f.sigma)
    said = evidence(f.grids, hits, box, rows[:1], np.ones(1, bool), 0.015, 6, 0.3, f.offset_share, None)
    return said.behind[0]


def test_detections_from_behind_are_counted_by_their_depth():
    """(ENDS.45): half a detection each by (ENDS.9); on the axis only the rear is in view, beside it less counts."""
    n = counted([(NEAR + 3.1, 0.0), (NEAR + 8.9, 0.1)])
    expected = np.zeros(LENGTH.depths)
    expected[[13, 36]] = 0.5  # the cells up to 3.25 and 9 m
    np.testing.assert_allclose(n, [expected, 0 * expected], atol=1e-3)
    aslant = counted([(NEAR + 3.1, 3.0)], pose=(NEAR + 4.5, 3.0, 0.0))
    sine = 3.0 / np.hypot(NEAR + 3.1, 3.0)
    assert aslant[0].sum() == 0
    np.testing.assert_allclose(aslant[1, 13], 0.5 * (1 - sine / np.sin(np.radians(10.0))), rtol=1e-6)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"xy": [(NEAR + 0.15, 0.0)]}, "of the face"),
        ({"anchor": 1.0, "pose": (NEAR + 4.5, 0.0, np.pi)}, "of the front"),
        ({"xy": [(NEAR + 3.1, 6.0)], "pose": (NEAR + 4.5, 6.0, 0.0)}, "12 degrees off the axis"),
        ({"profile": DepthProfile(inside_depth=1.3)}, "the inside does not show evenly"),
    ],
)
def test_what_says_nothing_of_a_load_is_not_counted(change, why):
    n = counted(**{"xy": [(NEAR + 3.1, 0.0)]} | change)
    assert n.sum() < 0.1, why


def rounded_front(rng):
    """A car of 4.4 m from behind, of which the last 0.26 m have no detection."""
    return behind_rear(rng, 6, 4.4, 1.8, upto=NEAR + 4.4 - 0.26)


def errors(fleet, draw, start, size, runs=6):
    """Mean error of the length, and of the place along the body, of so many runs [m]."""
    found = []
    for seed in range(runs):
        f, state = seen(draw, 45, start, size, seed, sized(find("pmht-spline"), fleet=fleet))
        e = f.estimate(state)
        found.append((e.size[0] - 4.4, e.pose[0] - e.size[0] / 2 - NEAR))
    return np.mean(found, 0)


def test_a_car_from_behind_reaches_beyond_its_detections():
    """(ENDS.48); without it the car is too short, and its rear is where it is either way."""
    length, rear = errors(ROUNDED, rounded_front, rear_start(CAR[0]), CAR)
    short, same = errors(WHOLE, rounded_front, rear_start(CAR[0]), CAR)
    assert abs(length) < 0.12
    assert short < length - 0.12
    assert rear == pytest.approx(same, abs=0.02)


@pytest.mark.parametrize("scans", [1, 45])
def test_only_a_length_that_detections_made_known_grows(scans):
    """That of one scan is still the fleet's, which knows the whole body."""
    more = [
        f.estimate(state).size[0]
        for f, state in (seen(rounded_front, scans, rear_start(4.4), CAR, 0, sized(fleet=a)) for a in (ROUNDED, WHOLE))
    ]
    assert (more[0] - more[1] > 0.1) == (scans == 45)


def test_a_side_shows_where_both_ends_are():
    draw = lambda rng: beside(rng, 8, 4.4, 1.8)  # noqa: E731
    one, other = (
        f.estimate(state)
        for f, state in (seen(draw, 30, (0.0, 10.9, 0.0), CAR, 0, sized(fleet=a)) for a in (ROUNDED, WHOLE))
    )
    np.testing.assert_allclose(one.size, other.size, atol=1e-3)


def test_the_end_that_faces_away_is_less_certain_and_the_near_one_is_not():
    f, state = seen(rounded_front, 45, rear_start(4.4), CAR, 0, sized(fleet=ROUNDED))
    plain = replace(f.size, fleet=WHOLE).estimate(state.size, f.estimate(state))
    e = f.size.estimate(state.size, f.estimate(state))
    assert e.edges[0] > plain.edges[0]
    assert e.edges[1] == pytest.approx(plain.edges[1])


def test_what_was_seen_from_behind_is_forgotten_when_a_body_turns_out_to_face_the_other_way():
    f = sized(fleet=Fleet())
    state = f.init(prior(rear_start(9.0), size=TRUCK, velocity=(-12.0, 0.0), velocity_std=0.1))
    rng = np.random.default_rng(0)
    for _ in range(5):
        state = f.update(f.predict(state, DT), scan_of(behind_rear(rng, 6, 9.0, 2.5)))[0]
    before = state.size.behind.sum()
    box = f.estimate(state)
    turned = box._replace(pose=box.pose + np.array([0.0, 0.0, np.pi]))
    after, _ = f.size.corrected(state.size, box.pose, turned, scan_of(behind_rear(rng, 3, 9.0, 2.5)), None)
    assert before > 1.0
    assert after.behind.sum() < 0.1
