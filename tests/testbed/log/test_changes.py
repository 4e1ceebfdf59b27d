"""Contours that a tracker has learned, in the log: drawn where the track was, removed after a second, and an event."""

import numpy as np
import pytest

from testbed.log import RunLog, paths, reader
from testbed.log.layers import change_rows, tracker_rows
from testbed.log.modes import mode_names
from tests.testbed.log import log_content, log_runs
from trackers import SensorModel, build
from trackers.geometry import to_frame
from trackers.multi.tracks import Event, Memory

RING = np.array([[2.0, 1.0], [-2.0, 1.0], [-2.0, -1.0], [2.0, -1.0]])
PAIR = np.stack([RING, 0.8 * RING])
NAME = log_runs.META.trackers[1]
BEFORE, AFTER = (paths.tracker(NAME, layer) for layer in paths.CHANGE_LAYERS)


def with_change(record, track):
    tracks, info = record.frame.outputs[NAME]
    event = Event("adapted", track, "contour learned from 200 new detections", PAIR)
    outputs = record.frame.outputs | {NAME: (tracks, info._replace(events=(*info.events, event)))}
    return record._replace(frame=record.frame._replace(outputs=outputs))


def rows(path, entity):
    return [row for row in log_content.rows(path, entity) if row.get(paths.STEP) is not None]


def write(path, at, steps=45, track=101, level="full"):
    with RunLog(path, log_runs.META, level=level) as log:
        log.static(log_runs.road(), log_runs.SENSORS)
        records = list(log_runs.records(steps))
        for k, record in enumerate(records):
            log.step(*(with_change(record, track) if k in at else record))
    return records


def test_both_contours_are_drawn_at_the_pose_of_the_track_and_go_after_a_second(tmp_path):
    path = tmp_path / "run.rrd"
    records = write(path, (10,))
    tracks, _ = records[10].frame.outputs[NAME]
    pose = tracks.estimate.pose[tracks.id == 101][0]
    for entity, ring in ((BEFORE, PAIR[0]), (AFTER, PAIR[1])):
        first, last = rows(path, entity)
        assert (first[paths.STEP], first["track:id"]) == (10, [101])
        (strip,) = first["LineStrips2D:strips"]
        np.testing.assert_allclose(to_frame(pose, np.array(strip)[:4]), ring, atol=1e-3)
        assert last[paths.STEP] == 25
        assert not last["LineStrips2D:strips"]
    logged = [event for event in reader.events(path) if "adapted" in event.text]
    assert [(event.step, event.level) for event in logged] == [(10, "INFO")]


def test_without_a_change_nothing_is_written_for_it(tmp_path):
    write(tmp_path / "run.rrd", ())
    assert not {BEFORE, AFTER} & reader.entity_paths(tmp_path / "run.rrd")


def test_a_change_of_a_track_that_is_gone_and_the_level_metrics_draw_nothing(tmp_path):
    records = write(tmp_path / "gone.rrd", (10,), steps=12, track=999)
    assert BEFORE not in reader.entity_paths(tmp_path / "gone.rrd")
    assert change_rows(NAME, *records[10].frame.outputs[NAME]) == {}
    write(tmp_path / "numbers.rrd", (10,), steps=12, level="metrics")
    assert BEFORE not in reader.entity_paths(tmp_path / "numbers.rrd")
    assert any("adapted" in event.text for event in reader.events(tmp_path / "numbers.rrd"))


def test_the_class_of_a_track_stands_behind_its_id_where_it_is_likely():
    tracks, info = next(log_runs.records(1)).frame.outputs[NAME]
    p = np.tile([0.5, 0.5], (len(tracks.id), 1))
    p[0] = [0.2, 0.8]
    known = tracks._replace(estimate=tracks.estimate._replace(class_probability=p))
    named = known._replace(memory=Memory(classes=("car", "bus")))
    labels = tracker_rows(NAME, named, info)[paths.tracker(NAME, "center")]["Points2D:labels"]
    shown = tracks.reported.id.tolist()
    assert labels == [f"{i} bus" if i == tracks.id[0] else str(i) for i in shown]
    assert tracker_rows(NAME, known, info)[paths.tracker(NAME, "center")]["Points2D:labels"] == [str(i) for i in shown]


def test_models_of_contours_are_no_motion_models():
    assert mode_names("pmht-spline") == ()
    assert mode_names("edra-imm") == ("cv", "ca", "ct")


@pytest.mark.parametrize(
    ("tracker", "known"),
    [("pmht-spline-adaptive", "tractor"), ("pmht-spline", None), ("pmht-spline:size=ends", "bus"),
     ("pmht-spline-adaptive:motion=on", "tractor")],
)  # fmt: skip
def test_the_classes_of_a_tracker_have_names(tracker, known):
    names = build(tracker, (SensorModel(),)).start().memory.classes
    assert names is None if known is None else known in names
