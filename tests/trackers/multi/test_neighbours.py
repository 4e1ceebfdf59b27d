"""The room up to the next vehicle in file bounds a length; by hand, and what the tracker does with it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from tests.trackers.rear_sides import RADAR, Road, drive
from trackers import build, prior
from trackers.batch import take
from trackers.multi.neighbours import InFile, Neighbours
from trackers.multi.silence import LENGTHS, SHORTEST, Quiet, Silence

FRONT, ROOM = -12.0, 7.0  # [m] end in view of the track in question, and from there to the next one behind
MOST = 19.0  # [m] its greatest length


def said(next_=(FRONT - ROOM, -4.0, 0.0, 0.3), std=3.0, length=6.0, age=5.0, empty=(False, False), away=-1.0, more=()):
    """What the room says of the length of the first track.

    next_: end that faces it, y, heading, and standard deviation of the length of the next one, which is 4.5 m long;
    empty: ground behind and before the next one; away: -1 where the far end is behind; more: others, as next_.
    """
    others = [next_, *more]
    pose = [(FRONT + away * length / 2, -4.0, 0.0), *[(x + away * 2.25, y, h) for x, y, h, _ in others]]
    estimate = prior(pose, size=[(length, 1.9), *[(4.5, 1.8)] * len(others)], position_std=0.1)
    stds = np.array([std, *[one[3] for one in others]])
    estimate = estimate._replace(size_std=np.stack([stds, np.full(len(stds), 0.1)], -1))
    longest = take(estimate, np.array([0]))
    far = longest.pose + np.array([[away * (MOST - length) / 2, 0.0, 0.0]])
    longest = longest._replace(pose=far, size=np.array([[MOST, 1.9]]))
    divided = np.zeros((len(pose), 2), bool)
    divided[1] = empty
    who = Neighbours()
    asked = who.asked(estimate, np.ones(len(pose), bool), np.full(len(pose), age), divided)
    if 0 not in asked.rows:
        return None
    mine = InFile(*(a[asked.rows == 0] for a in asked))
    return who.bound(mine, longest, estimate)


@pytest.mark.parametrize("away", [-1.0, 1.0])
def test_lengths_beyond_the_room_are_improbable(away):
    """(MOT.65), (MOT.66) by hand."""
    quiet = said((FRONT + away * ROOM, -4.0, 0.0, 0.4), away=away)
    assert quiet.rows.tolist() == [0]
    length = np.linspace(SHORTEST, MOST, LENGTHS)
    np.testing.assert_allclose(quiet.length[0], length)
    np.testing.assert_allclose(
        quiet.log_p[0], 0.5 * np.log(np.maximum(norm.cdf((ROOM - length) / 0.4), 0.1)), atol=1e-15
    )
    assert quiet.log_p[0, 0] == pytest.approx(0.0, abs=1e-6)
    assert quiet.log_p[0, -1] == pytest.approx(0.5 * np.log(0.1))


def test_the_nearest_of_several_counts():
    further = (FRONT - ROOM - 8.0, -4.0, 0.0, 0.2)
    np.testing.assert_array_equal(said(more=[further]).log_p, said().log_p)
    np.testing.assert_array_equal(said(further, more=[(FRONT - ROOM, -4.0, 0.0, 0.3)]).log_p, said().log_p)
    in_view = (FRONT + 9.0, -4.0, 0.0, 0.2)  # at the other end
    np.testing.assert_array_equal(said(more=[in_view]).log_p, said().log_p)


@pytest.mark.parametrize(
    "changed",
    [
        {"next_": (FRONT - ROOM, -0.5, 0.0, 0.3)},  # in the next lane
        {"next_": (FRONT - ROOM, -4.0, 1.0, 0.3)},  # across
        {"next_": (FRONT - ROOM, -4.0, 0.0, 0.6)},  # of unknown length itself
        {"next_": (FRONT - 30.0, -4.0, 0.0, 0.3)},  # far off
        {"next_": (FRONT + 9.0, -4.0, 0.0, 0.3)},  # at the end in view
        {"next_": (FRONT - 3.0, -4.0, 0.0, 0.3)},  # where no car fits in between: one of the boxes is wrong
        {"age": 1.0},  # just born: two pieces of one vehicle, perhaps
        {"length": 4.5, "std": 1.0},  # it ends before
    ],
    ids=lambda changed: "-".join(changed),
)
def test_who_is_no_neighbour_or_not_known_says_nothing(changed):
    assert said() is not None
    assert said(**changed) is None


def test_over_ground_that_was_seen_to_be_empty_the_young_count_too():
    """Ground before the next one, which is behind: there it was divided from what is ahead of it."""
    assert said(age=0.1) is None
    assert said(age=0.1, empty=(True, False)) is None
    np.testing.assert_array_equal(said(age=0.1, empty=(False, True)).log_p, said().log_p)


@given(room=st.floats(3.6, 8.5), std=st.floats(0.0, 0.5))
def test_no_length_within_the_room_is_punished_more_than_a_longer_one(room, std):
    quiet = said((FRONT - room, -4.0, 0.0, std))
    assert (np.diff(quiet.log_p[0]) <= 1e-12).all()
    assert (quiet.log_p <= 0).all()
    inside = quiet.length[0] < room - 4 * 0.5
    np.testing.assert_allclose(quiet.log_p[0, inside], 0.0, atol=1e-3)


class Bounding(Neighbours):
    """The same for all tracks, whoever is about them."""

    def asked(self, estimate, some, age, divided):
        rows = np.flatnonzero(some)
        return InFile(rows, np.full((len(rows), len(some)), 5.0))

    def bound(self, asked, longest, estimate):
        R = len(asked.rows)
        return Quiet(asked.rows, np.tile([1.5, 3.0, 3.5, 19.5], (R, 1)), np.tile([0.0, 0.0, -5.0, -5.0], (R, 1)))


@pytest.mark.parametrize("silence", [Silence(), None], ids=["silence", "none"])
def test_the_tracker_tells_the_filter_what_neighbours_say(silence):
    def length(neighbours):
        tracker = replace(build("imm-spline", (RADAR,)), neighbours=neighbours, silence=silence)
        tracks, _ = drive(tracker, Road([(30.0, 0.0, 0.0, 25.0)], clutter=0), 1.0)
        return tracks.reported.estimate.size[0, 0]

    assert length(Bounding()) < 3.3
    assert length(None) > 3.8
    assert length(Neighbours()) == length(None)  # there is no other one


def test_parameters_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="least"):
        Neighbours(least=0.0)
    assert replace(Neighbours(), settled=0.0).settled == 0.0
