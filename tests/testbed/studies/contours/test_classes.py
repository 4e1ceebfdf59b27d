"""What tracks say about classes, held against the truth."""

import numpy as np
import pytest

from testbed.compare.runs.recording import record
from testbed.compare.runs.replay import replay
from testbed.studies.contours.classes import (
    ClassProbe,
    Story,
    at_age,
    calibration,
    confusion_table,
    delay_table,
    right_since,
)
from testbed.studies.contours.drive import Passing, drive, shape_iou
from testbed.studies.contours.page import drive_table, page

CLASSES = ("car", "bus")


def story(kind, *p_of_bus):
    p = np.array(p_of_bus)
    return Story(kind, 0.5 * np.arange(1, len(p) + 1), np.stack([1 - p, p], -1))


def test_right_since_is_the_age_after_the_last_error():
    assert right_since(story("bus", 0.1, 0.8, 0.4, 0.7, 0.9), CLASSES) == 2.0
    assert right_since(story("car", 0.1, 0.2), CLASSES) == 0.5
    assert right_since(story("bus", 0.9, 0.3), CLASSES) == np.inf


def test_tables_count_tracks_at_their_age():
    stories = [story("bus", 0.1, 0.8, 0.8, 0.95), story("bus", 0.1, 0.2), story("car", 0.05, 0.3)]
    assert at_age(stories, 1.0)[:, 1].tolist() == [0.8, 0.2, 0.3]
    assert at_age(stories, 2.0)[:, 1].tolist() == [0.95]
    bus = delay_table(stories, CLASSES).splitlines()[3]
    assert bus == "| bus | 2 | 0% of 2 | 50% of 2 | 100% of 1 | – | – | never | 50% |"
    assert confusion_table(stories, CLASSES).splitlines()[3] == "| bus | 50 | 50 | 0.57 |"
    share, right = calibration(stories, CLASSES)
    assert share == pytest.approx(2 / 8)
    assert right == 1.0


def test_a_tracker_without_classes_is_refused():
    with pytest.raises(ValueError, match="rm-feldmann does not tell classes"):
        ClassProbe("rm-feldmann")


def test_tracks_of_a_drive_tell_stories_about_the_vehicles_they_follow():
    probe = ClassProbe("pmht-spline-adaptive")
    replay(record("cut-in", 0, "surround", 2.0), [probe.tracker], [probe])
    assert len(probe.stories) >= 3
    for one in probe.stories:
        assert one.kind in probe.classes
        assert (np.diff(one.age) > 0).all()
        np.testing.assert_allclose(one.probability.sum(-1), 1.0)


@pytest.fixture(scope="module")
def seen():
    return drive(Passing("car", duration=3.0, ahead=6.0), "pmht-spline-adaptive")


def test_a_car_that_is_passed_has_a_contour_that_is_nearly_its_own(seen):
    assert np.isfinite(seen.iou[-10:]).all()
    assert seen.iou[-10:].min() > 0.6
    assert np.abs(seen.position_error[-10:]).max() < 1.5
    assert any("car" in words for _, words in seen.events)
    assert shape_iou(seen.truth[0], seen.truth) == pytest.approx(1.0)


def test_the_page_has_every_table(seen):
    drives = {("car", "pmht-spline-adaptive"): [seen]}
    assert drive_table(drives).count("\n") == 2
    probe = ClassProbe("pmht-spline-adaptive")
    p = np.tile(np.eye(len(probe.classes))[0], (40, 1))
    stories = [Story("car", np.arange(40) / 15, p)]
    counts = {"seeds": 1, "scenarios": 1, "class_seeds": 1, "length": 2.0}
    text = page("python -m testbed.studies.contours.page", drives, stories, probe, counts, "\nmine\n")
    assert text.endswith("\nmine\n")
    assert "100% of these are right" in text
