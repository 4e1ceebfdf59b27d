"""Two drives side by side: where they part, and what one of them does too late or for nothing."""

import numpy as np
import pytest

from testbed.evaluation.driving import DriveCurves
from testbed.experiments.drives import Curves
from testbed.experiments.pairs import events, parting


def curves(braking, actions=None):
    """A drive at 10 Hz that brakes like this [m/s^2] at each frame."""
    n = len(braking)
    fields = {name: np.zeros(n) for name in DriveCurves._fields}
    fields |= {"time": 0.1 * np.arange(n), "acceleration": -np.asarray(braking, float)}
    words = actions or ["IDLE"] * n
    return Curves(DriveCurves(**fields), np.zeros((n, 3)), np.zeros(n), words, [f"cause {k}" for k in range(n)])


def drive(decisions):
    """What is kept of a drive that decides every 0.2 s."""
    times = [0.2 * k for k in range(len(decisions))]
    return {"decisions": [list(np.ravel(d)) for d in decisions], "times": times}


def brake(start, stop, hard=5.0, n=120):
    """Braking from one frame to another."""
    return np.where((np.arange(n) >= start) & (np.arange(n) < stop), hard, 0.0)


def test_drives_part_at_the_first_decision_that_differs_and_the_cause_is_that_of_its_frame():
    own, other = curves([0] * 8, ["-", *"AABBBBB"]), curves([0] * 8, ["-", *"AAAAAAA"])
    found = parting(own, other, drive([1, 4, 4, 1]), drive([1, 1, 1, 1]))
    assert found is not None
    assert (found.time, found.action, found.other, found.cause) == (pytest.approx(0.2), "B", "A", "cause 2")
    assert str(found) == "at 0.2 s B instead of A; cause 2"


def test_continuous_actions_part_beyond_a_small_difference():
    own, other = curves([0] * 8), curves([0] * 8)
    assert parting(own, other, drive([[0.1, 0.0], [0.14, 0.0]]), drive([[0.1, 0.0], [0.1, 0.0]])) is None
    assert parting(own, other, drive([[0.1, 0.0], [0.2, 0.0]]), drive([[0.1, 0.0], [0.1, 0.0]])) is not None


def test_braking_that_the_other_drive_has_not_is_for_nothing():
    assert events(curves(brake(40, 50)), curves(brake(0, 0))) == [(pytest.approx(4.0), "brakes for nothing, 5.0 m/s^2")]


def test_braking_later_than_the_other_drive_is_late():
    assert events(curves(brake(44, 60)), curves(brake(40, 60))) == [(pytest.approx(4.4), "brakes 0.4 s late")]
    assert events(curves(brake(40, 60)), curves(brake(40, 60))) == []
    assert events(curves(brake(36, 60)), curves(brake(40, 60))) == []


def test_braking_that_is_missing_is_said():
    assert events(curves(brake(0, 0)), curves(brake(40, 50))) == [
        (pytest.approx(4.0), "does not brake where the other drive does")
    ]
