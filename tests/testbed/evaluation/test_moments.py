"""Worst moments of runs made by hand: each kind, each reason, and the order by severity."""

from typing import NamedTuple

import numpy as np
import pytest

from sensors.origin import CLUTTER, CONTOUR, MIRROR, Origin
from sensors.scene import boxes_scene
from testbed.evaluation.moments import MISSING, NEAR, WHATS, Moment, all_moments, moment_row, severity_of
from testbed.evaluation.reasons import CAUSES
from testbed.evaluation.snapshots import Snapshots, hiding
from testbed.evaluation.tracking import Evaluator
from testbed.frame import Frame
from trackers.estimate import prior
from trackers.multi.tracks import Event, StepInfo, Tracks
from trackers.scan import Scan

DT, CAR = 0.1, (4.6, 1.8)
NAME = "case"


class Body(NamedTuple):
    """An object at one scan; `hits` are detections along its body as shares of half its length."""

    x: float = 30.0
    y: float = 0.0
    vx: float = 0.0
    vy: float = 0.0
    size: tuple[float, float] = CAR
    visible: float = 1.0
    expected: float = 9.0
    hits: tuple[float, ...] = (-1, -1, -1, 0, 0, 0, 1, 1, 1)
    owner: int = 7  # track of its detections


class Track(NamedTuple):
    """A reported track."""

    id: int = 7
    x: float = 30.0
    y: float = 0.0
    heading: float = 0.0
    vx: float = 0.0
    size: tuple[float, float] = CAR


def frame_of(k, bodies, tracks, loose=(), events=()):
    """loose: kind and owner of detections of no object."""
    pose = np.array([[b.x, b.y, 0.0] for b in bodies])
    velocity = np.array([[b.vx, b.vy] for b in bodies])
    scene = boxes_scene(pose, np.array([b.size for b in bodies]), velocity, time=k * DT, dt=DT)
    objects = scene.objects._replace(id=np.arange(1, len(bodies) + 1))
    scene = scene._replace(objects=objects)
    xy = [[b.x + h * b.size[0] / 2, b.y] for b in bodies for h in b.hits] + [[60.0, 9.0]] * len(loose)
    source = [n for n, b in enumerate(bodies) for _ in b.hits] + [-1] * len(loose)
    kind = [CONTOUR for b in bodies for _ in b.hits] + [kind for kind, _ in loose]
    owner = [b.owner for b in bodies for _ in b.hits] + [track for _, track in loose]
    of = np.array(source, int)
    visible, expected = np.array([b.visible for b in bodies]), np.array([b.expected for b in bodies])
    origin = Origin(of, of, of, np.array(kind, int), expected, visible)
    scan = Scan.from_xy(np.array(xy, float).reshape(-1, 2))
    T = len(tracks)
    estimate = prior(
        np.array([[t.x, t.y, t.heading] for t in tracks]).reshape(-1, 3),
        np.array([[t.vx, 0.0] for t in tracks]).reshape(-1, 2),
        size=np.array([t.size for t in tracks]).reshape(-1, 2),
    )
    ids = np.array([t.id for t in tracks], int)
    held = Tracks(ids, np.full(T, 0.9), np.full(T, 9), np.ones(T), np.ones(T, bool), None, estimate, 99)
    zero = np.zeros(T)
    info = StepInfo(np.array(owner, int), ids, zero, zero > 0, zero.astype(int), zero, zero, tuple(events))
    return Frame(k, scene, scan, origin, {NAME: (held, info)}, "IDLE", np.zeros((0, 2)))


def play(steps):
    """Moments of a run; every step is the arguments of `frame_of` after the first."""
    evaluator, snapshots = Evaluator(NAME), Snapshots()
    for k, step in enumerate(steps):
        frame = frame_of(k, *step)
        tracks, info = frame.outputs[NAME]
        evaluator.step(frame.time, frame.scene, frame.origin, tracks, info.owner)
        snapshots(frame)
    return all_moments({NAME: evaluator}, snapshots)


def only(found) -> Moment:
    assert len(found) == 1, found
    assert found[0].what in WHATS
    assert found[0].cause in CAUSES
    return found[0]


GOOD = ([Body()], [Track()])
LOOSE = Body(owner=-1)


def gap(body, scans, *rest, tracks=(), before=GOOD, after=GOOD):
    """Ten good scans, some without a track on object 1, ten good ones."""
    return [before] * 10 + [([body, *rest], list(tracks))] * scans + [after] * 10


def test_nothing_is_said_of_a_good_run_or_of_none():
    assert play([GOOD] * 20) == []
    assert play([]) == []


def test_harm_is_price_by_time_by_nearness():
    found = only(play(gap(LOOSE, 5)))
    assert found.severity == pytest.approx(MISSING * 0.5 * NEAR / (NEAR + 30.0))
    assert (found.start, found.end) == pytest.approx((1.0, 1.5))
    wrong = only(play([([Body()], [Track(y=1.5)])] * 11))
    assert wrong.severity == pytest.approx(1.5**2 * 1.0 / 2)


def test_the_nearer_and_the_longer_is_worse():
    far, near = Body(x=90.0, owner=-1), Body(x=10.0, y=4.0, owner=-1)
    on = [Track(7, 90.0), Track(8, 10.0, 4.0)]
    steps = [([far, near], on)] * 5 + [([far, near], [])] * 4 + [([far, near], on)] * 5
    assert [m.object for m in play(steps)] == [2, 1]
    steps = [([far, near], on)] * 5 + [([far, near], [])] * 2 + [([far, near], on[1:])] * 20 + [([far, near], on)]
    found = play(steps)
    assert [m.object for m in found] == [1, 2]
    assert severity_of(found, NAME, 1) == pytest.approx(found[0].severity, abs=1e-3)


def test_late_births_losses_gaps_and_objects_that_never_had_a_track():
    late = only(play([([LOOSE], [])] * 8 + [GOOD] * 5))
    assert (late.what, late.text) == ("late birth", "no track for 0.8 s, then track 7")
    lost = only(play(gap(LOOSE, 12, after=([Body()], [Track(9)]))))
    assert (lost.what, lost.text) == ("lost", "without a track for 1.2 s, was track 7, then track 9")
    short = only(play(gap(LOOSE, 3)))
    assert (short.what, short.track) == ("gap", 7)
    assert lost.severity > MISSING * 1.2 / 2  # the switch has its price too
    assert only(play([([LOOSE], [])] * 9)).what == "never tracked"


def test_a_switch_at_once_names_the_second_track():
    both = ([Body()], [Track(), Track(9, y=0.6)])
    found = [m for m in play([GOOD] * 9 + [both] + [([Body(owner=9)], [Track(9)])] * 9) if m.what == "switch"]
    assert (found[0].text, found[0].cause) == ("track 7 became track 9", "fragment")
    died = (*GOOD, (), [Event("died", 7, "existence below one tenth")])
    found = only(play([GOOD] * 9 + [died] + [([Body(owner=9)], [Track(9)])] * 9))
    assert (found.what, found.why) == ("switch", "track 7 ended: existence below one tenth")


@pytest.mark.parametrize(
    ("track", "what", "text"),
    [
        (Track(y=-1.6), "position", "1.6 m off"),
        (Track(size=(8.6, 1.8)), "size", "8.6 m long instead of 4.6 m"),
        (Track(size=(4.6, 4.4)), "size", "4.4 m wide instead of 1.8 m"),
        (Track(heading=np.pi), "heading", "heading off by 180 deg"),
        (Track(vx=3.0), "velocity", "velocity off by 3.0 m/s"),
        (Track(x=31.5, size=(7.6, 1.8)), "position", "1.5 m off, 7.6 m long instead of 4.6 m"),
    ],
)
def test_a_wrong_track_is_called_by_its_largest_error(track, what, text):
    found = only(play([([Body()], [track])] * 40))
    assert (found.what, found.text) == (what, text)


def test_wrong_periods_with_little_between_are_one_and_the_worst_scan_is_named():
    wrong, worse = ([Body()], [Track(y=1.5)]), ([Body()], [Track(y=2.0)])
    found = only(play([wrong] * 5 + [GOOD] * 3 + [wrong, worse, wrong] + [GOOD] * 9))
    assert (found.start, found.time, found.text) == (0.0, pytest.approx(0.9), "2.0 m off")
    assert len(play([wrong] * 5 + [GOOD] * 8 + [wrong] * 5)) == 2


TRUCK = Body(x=15.0, size=(8.0, 2.5), owner=8)
ON_TRUCK = Track(8, 15.0, size=(8.0, 2.5))
HIDDEN = Body(visible=0.1, hits=(), owner=-1)
NEXT = Body(y=4.0, owner=8)


@pytest.mark.parametrize(
    ("body", "rest", "tracks", "cause", "why"),
    [
        (HIDDEN, [TRUCK], [ON_TRUCK], "hidden", "hidden by veh_02, 10 % visible"),
        (HIDDEN._replace(visible=0.0, expected=0.0), [], [], "out of view", "out of the field of view"),
        (
            Body(owner=8), [NEXT], [Track(8, y=4.0)],
            "merged", "merged with veh_02, whose track has 54 of its 54 detections",
        ),
        (LOOSE, [], [Track(5, 31.5, size=(18.0, 3.0))], "too wrong", "track 5 lies on it, too wrong in size or place"),
        (Body(owner=5), [], [Track(5, 35.0, size=(18.0, 3.0))], "too wrong", "track 5 has 54 of its 54 detections"),
        (
            Body(owner=5), [Body(40.0, owner=5)], [Track(5, 35.0, size=(18.0, 3.0))],
            "merged", "merged with veh_02: track 5 has detections of both, and is too wrong for either",
        ),
        (LOOSE._replace(hits=(0.0,)), [], [], "few detections", "1.0 detections a scan"),
        (LOOSE, [], [], "unknown", "in view, 9 detections a scan"),
    ],
)  # fmt: skip
def test_why_an_object_has_no_track(body, rest, tracks, cause, why):
    good = ([Body(), *rest], [Track(), *[t for t in tracks if t.id == 8]])
    found = [m for m in play(gap(body, 6, *rest, tracks=tracks, before=good, after=good)) if m.what == "gap"]
    assert only(found).cause == cause
    assert found[0].why.startswith(why)


def test_a_track_that_the_tracker_gave_up_says_why():
    died = ([LOOSE], [], (), [Event("died", 7, "no detection for 1 s")])
    found = only(play([GOOD] * 9 + [died] * 2 + [GOOD] * 9))
    assert (found.cause, found.why) == ("track ended", "track 7 ended: no detection for 1 s")


@pytest.mark.parametrize(
    ("body", "rest", "track", "cause", "why"),
    [
        (Body(visible=0.2), [TRUCK], Track(y=1.5), "hidden", "hidden by veh_02, 20 % visible"),
        (Body(), [NEXT._replace(owner=7)], Track(y=1.5), "merged", "merged with veh_02: "),
        (Body(hits=(-1, -1, -1)), [], Track(size=(8.0, 1.8)), "one end seen", "the radar has hit one end only"),
        (Body(hits=(0.0,)), [], Track(vx=3.0), "few detections", "1.0 detections a scan"),
        (Body(), [], Track(size=(8.0, 1.8)), "unknown", "in view, 9 detections a scan"),
    ],
)
def test_why_a_track_is_wrong(body, rest, track, cause, why):
    on = [ON_TRUCK] if TRUCK in rest else []
    found = [m for m in play([([body, *rest], [track, *on])] * 30) if m.object == 1]
    assert only(found).cause == cause
    assert found[0].why.startswith(why)


def test_a_new_track_and_a_maneuver_are_reasons():
    late = play([([Body()], [Track(vx=3.0)])] * 9 + [GOOD] * 30)
    assert (only(late).cause, late[0].why) == ("new track", "the track has it for 0.8 s only")
    braking = [([Body(vx=30.0 - 0.4 * k)], [Track(vx=30.0)]) for k in range(25)]
    found = only(play([([Body(vx=30.0)], [Track(vx=30.0)])] * 10 + braking))
    assert (found.cause, found.why) == ("maneuver", "it brakes with 4.0 m/s^2")


@pytest.mark.parametrize(
    ("loose", "bodies", "tracks", "what", "why"),
    [
        ([(MIRROR, 5)] * 3, [Body()], [Track()], "ghost", "its detections are mirror images and double bounces"),
        ([(CLUTTER, 5)] * 3, [Body()], [Track()], "false track", "its detections are clutter and standing returns"),
        ([], [Body()], [Track()], "false track", "it has no detections"),
        ([], [Body(owner=5)], [Track()], "false track", "a second track of veh_01"),
    ],
)
def test_why_a_track_is_on_no_vehicle(loose, bodies, tracks, what, why):
    step = (bodies, [*tracks, Track(5, 60.0, 9.0)], loose)
    found = only(play([GOOD] * 5 + [step] * 8 + [GOOD] * 5))
    assert (found.what, found.object, found.track, found.why) == (what, None, 5, why)
    assert found.text == "track 5 is on no vehicle for 0.8 s"


def test_a_track_that_is_false_when_it_is_born_says_so():
    found = only(play([GOOD] * 3 + [([Body()], [Track(), Track(5, 60.0, 9.0)])] + [GOOD] * 3))
    assert (found.what, found.cause) == ("false track", "new track")


def test_a_track_too_far_off_its_vehicle_is_told_once():
    step = ([Body(owner=5)], [Track(5, 36.0)])
    found = only(play([GOOD] * 5 + [step] * 8 + [GOOD] * 5))
    assert (found.what, found.object) == ("gap", 1)


def test_the_nearer_box_hides_the_farther_one_and_not_the_other_way_round():
    snapshots = Snapshots()
    snapshots(frame_of(0, [Body(), TRUCK, Body(x=20.0, y=30.0)], []))
    (frame,) = snapshots.frames
    assert hiding(frame, 1) == (2, pytest.approx(1.0))
    assert hiding(frame, 2)[1] == 0.0
    assert hiding(frame, 3) == (-1, 0.0)


def test_a_row_of_the_list_is_json():
    row = moment_row(only(play(gap(LOOSE, 5))))
    assert {type(value) for value in row.values()} <= {str, int, float, type(None)}
    assert row["time"] == 1.0
