"""Class probabilities of tracks against the truth, and contours learned in passing."""

import numpy as np
import pytest

from studies.contours.classes import (
    ClassHistory,
    ClassProbe,
    at_age,
    calibration,
    confusion_table,
    delay_table,
    right_since,
)
from studies.contours.page import passing_table, render
from studies.contours.passing import Passing, follow, shape_iou
from testbed.replay.recording import record
from testbed.replay.rescan import replay

CLASSES = ("car", "bus")


def history(kind, *p_of_bus):
    p = np.array(p_of_bus)
    return ClassHistory(kind, 0.5 * np.arange(1, len(p) + 1), np.stack([1 - p, p], -1))


def test_right_since_is_the_age_after_the_last_error():
    assert right_since(history("bus", 0.1, 0.8, 0.4, 0.7, 0.9), CLASSES) == 2.0
    assert right_since(history("car", 0.1, 0.2), CLASSES) == 0.5
    assert right_since(history("bus", 0.9, 0.3), CLASSES) == np.inf


def test_tables_count_tracks_at_their_age():
    histories = [history("bus", 0.1, 0.8, 0.8, 0.95), history("bus", 0.1, 0.2), history("car", 0.05, 0.3)]
    assert at_age(histories, 1.0)[:, 1].tolist() == [0.8, 0.2, 0.3]
    assert at_age(histories, 2.0)[:, 1].tolist() == [0.95]
    bus = delay_table(histories, CLASSES).splitlines()[3]
    assert bus == "| bus | 2 | 0% of 2 | 50% of 2 | 100% of 1 | – | – | never | 50% |"
    assert confusion_table(histories, CLASSES).splitlines()[3] == "| bus | 50 | 50 | 0.57 |"
    share, right = calibration(histories, CLASSES)
    assert share == pytest.approx(2 / 8)
    assert right == 1.0


def test_a_tracker_without_classes_is_refused():
    with pytest.raises(ValueError, match="rm-feldmann has no classes"):
        ClassProbe("rm-feldmann")


def test_tracks_of_a_run_have_class_histories_of_the_vehicles_they_follow():
    probe = ClassProbe("pmht-spline-adaptive")
    replay(record("cut-in", 0, "surround", 2.0), [probe.tracker], [probe])
    assert len(probe.histories) >= 3
    for one in probe.histories:
        assert one.kind in probe.classes
        assert (np.diff(one.age) > 0).all()
        np.testing.assert_allclose(one.probability.sum(-1), 1.0)


@pytest.fixture(scope="module")
def passed():
    return follow(Passing("car", duration=3.0, ahead=6.0), "pmht-spline-adaptive")


def test_a_car_that_is_passed_has_a_contour_that_is_nearly_its_own(passed):
    assert np.isfinite(passed.iou[-10:]).all()
    assert passed.iou[-10:].min() > 0.6
    assert np.abs(passed.position_error[-10:]).max() < 1.5
    assert any("car" in words for _, words in passed.events)
    assert shape_iou(passed.truth[0], passed.truth) == pytest.approx(1.0)


def test_the_page_has_every_table(passed):
    runs = {("car", "pmht-spline-adaptive"): [passed]}
    assert passing_table(runs).count("\n") == 2
    probe = ClassProbe("pmht-spline-adaptive")
    p = np.tile(np.eye(len(probe.classes))[0], (40, 1))
    histories = [ClassHistory("car", np.arange(40) / 15, p)]
    counts = {"seeds": 1, "scenarios": 1, "class_seeds": 1, "length": 2.0}
    text = render(runs, histories, probe.classes, counts)
    assert passing_table(runs) in text
    assert "100% of these are right" in text
