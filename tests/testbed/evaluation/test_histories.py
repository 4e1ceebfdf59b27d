"""Histories of single objects, counted by hand; one scan a second unless said otherwise."""

import numpy as np
import pytest

from testbed.evaluation import histories
from testbed.evaluation.histories import History, birth_delay, losses, never_tracked, switches


def history(track, counted=None, plain=None, covered=None, dt=1.0):
    """From one character a scan: '.' for no track, a digit for its id; flags as strings of 0 and 1."""

    def flags(text, default):
        return np.array([c == "1" for c in text], bool) if text else np.full(len(track), default)

    ids = np.array([-1 if c == "." else int(c) for c in track])
    return History(dt * np.arange(len(track)), flags(counted, True), flags(plain, True), flags(covered, False), ids)


def test_a_spell_lasts_until_the_first_scan_after_it():
    time = np.array([0.0, 0.5, 1.0, 2.0, 4.0])
    where = np.array([True, False, False, True, True])
    assert histories.periods(time, where).tolist() == [[0.0, 0.5], [2.0, 4.0]]
    assert histories.longest(time, where) == 2.0
    assert histories.longest(time, np.zeros(5, bool)) == 0.0


@pytest.mark.parametrize(
    ("track", "counted", "times"),
    [
        ("1111", None, []),
        ("..11", None, []),
        ("1.1.", None, []),
        ("1..2", None, [3.0]),
        ("1212", None, [1.0, 2.0, 3.0]),
        ("1221", "1001", []),  # tracks at scans at which it was not counted are ignored
        ("1222", "1001", [3.0]),
    ],
)
def test_a_switch_is_an_id_that_differs_from_the_last(track, counted, times):
    assert switches(history(track, counted)).tolist() == times


@pytest.mark.parametrize(
    ("track", "counted", "dt", "times"),
    [
        ("1111", None, 0.5, []),
        ("....", None, 0.5, []),  # never tracked is not lost
        ("1.11", None, 0.5, []),
        ("1..1", None, 0.5, [1.5]),  # without a track from 0.5 to 1.5 s
        ("1.....1", None, 0.5, [1.5]),  # one loss, however long
        ("1..1..1", None, 0.5, [1.5, 3.0]),
        ("1..1", "1101", 0.5, []),  # hidden in between
        ("1...........2", None, 0.1, [1.1]),
    ],
)
def test_lost_is_one_second_without_a_track_after_having_had_one(track, counted, dt, times):
    np.testing.assert_allclose(losses(history(track, counted, dt=dt)), times)


def test_birth_delay_runs_from_first_counted_to_first_assigned():
    assert birth_delay(history("....11", "011111")) == 3.0
    assert birth_delay(history("111111", "001111")) == 0.0  # tracked before anyone asked
    assert np.isnan(birth_delay(history("......")))
    assert np.isnan(histories.first_counted(history("..", "00")))


def test_never_needs_two_counted_seconds():
    assert never_tracked(history("....", "1101"))
    assert not never_tracked(history("..", "11"))  # the first scan stands for one second, the last for none
    assert not never_tracked(history("...1", "1111"))
    assert never_tracked(history("...1", "1110"))  # held only where it was not counted


def test_gaps_count_plain_view_without_a_track():
    seen = history("1...1..", plain="1110111", covered="0110000")
    assert histories.plain_view_gap(seen) == 2.0
    assert histories.uncovered_gap(seen) == 1.0
    assert histories.plain_view_gap(history("1111")) == 0.0
