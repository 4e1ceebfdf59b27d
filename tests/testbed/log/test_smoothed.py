"""Smoothed tracks in the log: rows made by hand, and the page that shows them."""

import numpy as np

from testbed.log import RunLog, blueprint, paths, reader
from testbed.log.layers import smoothed_extents, smoothed_paths
from testbed.log.record import SmoothedTrack, SmoothedTracks
from tests.testbed.log import log_content, log_runs

META = log_runs.META


def straight(number, frame):
    frame = np.asarray(frame)
    pose = np.stack([10.0 * number + frame, np.zeros(len(frame)), np.full(len(frame), 0.1 * number)], -1)
    return SmoothedTrack(number, frame, pose, np.full((len(frame), 2), [4.0, 2.0]))


def two_tracks(frames=6):
    when = np.arange(frames)
    return SmoothedTracks(when, when * log_runs.DT, (straight(1, [0, 1, 4]), straight(2, [1, 2])))


def test_each_frame_has_the_boxes_of_its_tracks_and_a_frame_without_any_has_none():
    rows = smoothed_extents(two_tracks())
    assert [row["track:id"].tolist() for row in rows] == [[1], [1, 2], [2], [], [1], []]
    assert [len(row["LineStrips2D:strips"]) for row in rows] == [1, 2, 1, 0, 1, 0]
    corners = rows[1]["LineStrips2D:strips"].xy.reshape(2, 5, 2)[:, :4]
    np.testing.assert_allclose(corners.mean(1), [[11, 0], [21, 0]], atol=1e-5)


def test_paths_are_one_line_a_track():
    lines = smoothed_paths(two_tracks())["LineStrips2D:strips"]
    assert lines.counts.tolist() == [3, 2]
    np.testing.assert_allclose(lines.xy[:, 0], [10, 11, 14, 21, 22])


def test_no_track_at_all_clears_every_frame():
    rows = smoothed_extents(two_tracks()._replace(tracks=()))
    assert [len(row["LineStrips2D:strips"]) for row in rows] == [0] * 6


def test_rows_of_the_past_are_written_beside_those_of_the_run(tmp_path):
    log = RunLog(tmp_path / "run.rrd", META)
    for record in log_runs.records(6):
        log.step(*record)
    log.smoothed("htg-map", two_tracks())
    log.close({})
    assert reader.complete(tmp_path / "run.rrd")
    rows = [
        r
        for r in log_content.rows(tmp_path / "run.rrd", paths.smoothed("htg-map", "extent"))
        if r.get(paths.STEP) is not None
    ]
    assert [row[paths.STEP] for row in rows] == list(range(6))
    assert [row["track:id"] or [] for row in rows] == [[1], [1, 2], [2], [], [1], []]
    (way,) = (
        r
        for r in log_content.rows(tmp_path / "run.rrd", paths.smoothed("htg-map", "path"))
        if r.get(paths.STEP) is not None
    )
    assert (way[paths.STEP], way["track:id"]) == (0, [1, 2])


def test_one_page_shows_smoothed_tracks_and_all_other_scenes_hide_them():
    layout = blueprint.layout(META, dict.fromkeys(META.trackers, ()), (2,), log_runs.road(), full=True)
    scenes = [view for view in views(layout.root_container) if view.class_identifier == "2D"]
    hidden = f"- /{paths.SMOOTHED}/**"
    assert [str(view.name) for view in scenes if hidden not in view.contents] == ["Smoothed"]
    assert len(scenes) > 3


def views(part):
    """All views below a container."""
    if hasattr(part, "class_identifier"):
        return [part]
    return [view for child in part.contents for view in views(child)]
