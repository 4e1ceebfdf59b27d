"""Two runs beside each other: where they part, and what differs there."""

import json

import pytest

from testbed.command_line.differences import NOTHING, compare_results
from testbed.log import RunLog
from testbed.log.difference import compare_logs, pairs_of
from tests.testbed.log import log_runs


def written(path, change=lambda record: record, steps=20, meta=log_runs.META):
    with RunLog(path, meta) as log:
        log.static(log_runs.road(), log_runs.SENSORS)
        for record in log_runs.records(steps):
            log.step(*change(record))
    return path


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return written(tmp_path_factory.mktemp("difference") / "a.rrd")


def moved(record):
    """From step 7 on the first detection lies 0.5 m farther, from step 9 on the ego brakes."""
    frame = record.frame
    if frame.step >= 7:
        polar = frame.scan.polar.copy()
        polar[0, 0] += 0.5
        frame = frame._replace(scan=frame.scan._replace(polar=polar))
    if frame.step >= 9:
        frame = frame._replace(action="SLOWER")
    return record._replace(frame=frame)


def without_a_track(record):
    frame = record.frame
    if frame.step == 5:
        tracks, info = frame.outputs["htg-map"]
        outputs = {**frame.outputs, "htg-map": (tracks.rows(tracks.id != 103), info)}
        frame = frame._replace(outputs=outputs)
    return record._replace(frame=frame)


def test_equal_runs_have_no_difference(log, tmp_path):
    found = compare_logs(log, written(tmp_path / "b.rrd"))
    assert (found.settings, found.partings, found.steps) == ([], [], 20)


def test_the_first_step_and_every_layer_that_parts_are_named(log, tmp_path):
    found = compare_logs(log, written(tmp_path / "b.rrd", moved))
    assert {p.what.partition(",")[0] for p in found.partings} == {"detections", "action"}
    assert [p.step for p in found.partings] == sorted(p.step for p in found.partings)
    assert found.partings[0].difference == "up to 0.5 m apart"
    assert found.partings[0].time == pytest.approx(7 * log_runs.DT)
    (action,) = (p for p in found.partings if p.what == "action")
    assert (action.step, action.difference) == (9, "IDLE / SLOWER")


def test_a_missing_track_and_a_longer_run_are_said(log, tmp_path):
    found = compare_logs(log, written(tmp_path / "b.rrd", without_a_track, steps=25))
    assert [(p.what, p.step) for p in found.partings][:2] == [("ids of htg-map", 5), ("tracks of htg-map", 5)]
    assert found.partings[0].difference == "5 / 4"
    assert (found.partings[-1].what, found.partings[-1].difference) == ("length of the run", "20 steps / 25 steps")


def test_settings_that_differ_are_listed(log, tmp_path):
    found = compare_logs(log, written(tmp_path / "b.rrd", meta=log_runs.META._replace(seed=4)))
    assert found.settings == [("seed", "0", "4")]
    assert found.partings == []


RESULTS = {
    "run": {"id": "a", "versions": {"numpy": "2"}},
    "objects": [{"tracker": "x", "object": 3, "gwd": 1.0}, {"tracker": "x", "object": 5, "gwd": 2.0}],
    "timing": {"wall": 3.0},
}


def test_results_are_compared_by_what_their_rows_are_about():
    other = json.loads(json.dumps(RESULTS))
    other["objects"] = [{"tracker": "x", "object": 5, "gwd": 2.5}]
    other["timing"]["wall"] = 9.0
    found = compare_results(RESULTS, other)
    assert ("objects.x.5.gwd", 2.0, 2.5) in found
    assert ("objects.x.3", "3 values", NOTHING) in found
    assert found[-1][0] == "objects.x.5.gwd"  # the smallest
    assert len(found) == 2


def test_what_only_one_of_two_results_has_is_one_row():
    rm, spline = {"gospa": 2.0, "gwd": 1.0}, {"gospa": 1.0, "gwd": None}
    first, second = ({"run": {"id": "a"}, "trackers": t} for t in ({"rm": rm, "spline": spline}, {"spline": spline}))
    assert compare_results(first, second) == [("trackers.rm", "2 values", NOTHING)]
    assert compare_results(second, first) == [("trackers.rm", NOTHING, "2 values")]
    first["trackers"] = {"rm": rm}
    assert [row[0] for row in compare_results(first, second)] == ["trackers.rm", "trackers.spline"]
    assert compare_results({"run": {}, "seed": 3}, {"run": {}}) == [("seed", 3, NOTHING)]


def test_the_command_ends_with_one_where_runs_differ(command, log, tmp_path):
    other = written(tmp_path / "b.rrd", moved)
    assert command("diff", log, log).status == 0
    done = command("diff", log, other)
    assert done.status == 1
    assert "the runs part at step 7, 0.47 s: detections" in done.out
    for name, content in (("a.json", RESULTS), ("b.json", RESULTS | {"drive": {"progress": 3.25}})):
        (tmp_path / name).write_text(json.dumps(content))
    done = command("diff", tmp_path / "a.json", tmp_path / "b.json")
    assert (done.status, "drive.progress" in done.out) == (1, True)
    for wrong, said in ((tmp_path / "a.json", "two logs"), (tmp_path / "none.rrd", "there is no log")):
        done = command("diff", log, wrong)
        assert (done.status, said in done.err) == (2, True)


def test_two_trackers_are_compared_with_each_other():
    assert pairs_of(["a", "b"], ["b", "c"]) == [("b", "b"), ("a", "c")]
    assert pairs_of(["a"], ["b", "c"]) == [("a", "b")]


def test_logs_of_other_trackers_part_where_their_tracks_do(log, tmp_path):
    names = log_runs.META.trackers
    other = {name: f"{name}-2" for name in names}

    def renamed(record):
        frame = record.frame
        outputs = {other[name]: out for name, out in frame.outputs.items()}
        if frame.step >= 5:
            outputs = {name: (tracks.rows(tracks.id != 103), info) for name, (tracks, info) in outputs.items()}
        scores = {other[name]: score for name, score in record.scores.items()}
        return record._replace(frame=frame._replace(outputs=outputs), scores=scores)

    meta = log_runs.META._replace(trackers=tuple(other.values()))
    found = compare_logs(log, written(tmp_path / "b.rrd", renamed, meta=meta))
    (first, *_) = [p for p in found.partings if "tracks of" in p.what]
    assert (first.what, first.step) == (f"tracks of {names[0]} / {names[0]}-2", 5)
    assert not any("nothing" in p.difference for p in found.partings)
