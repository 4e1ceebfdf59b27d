import gc
import json
import os
import signal
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from sensors.origin import KINDS
from testbed.log import RunLog, paths, reader
from testbed.log.writer import in_focus
from tests.testbed.log import log_content, log_runs

TRACKERS = log_runs.META.trackers


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # rerun drops a bad column with a warning only
        return log_runs.write(tmp_path_factory.mktemp("log") / "run.rrd", steps=45)


def expected_paths(objects, metrics):
    numbers = {paths.EGO_ACTION, paths.EGO_SPEED, *paths.RISK, paths.EVENTS, paths.CONFIG, paths.SUMMARY, paths.LEGEND}
    numbers |= {paths.MOMENTS, paths.OBJECTS}
    numbers |= {paths.metric(metric, name) for metric in metrics for name in TRACKERS}
    return numbers | {paths.of_object(i, leaf) for i in range(objects) for leaf in (*TRACKERS, paths.SEEN)}


def metric_names():
    first = next(log_runs.records(1))
    return tuple(first.scores[TRACKERS[0]].mean)


def test_every_path_is_written_and_nothing_else(log):
    expected = expected_paths(5, metric_names()) | set(log_content.scene_layers(TRACKERS))
    assert reader.entity_paths(log) == expected


def test_level_metrics_writes_numbers_and_events_only(tmp_path):
    path = log_runs.write(tmp_path / "m.rrd", steps=20, level="metrics")
    assert reader.entity_paths(path) == expected_paths(5, metric_names())


def test_metrics_come_back_as_they_went_in(log):
    gwd = reader.scalars(log, "metrics/gwd/**")
    records = list(log_runs.records(45))
    for name in TRACKERS:
        steps, values = gwd[paths.metric("gwd", name)]
        assert np.array_equal(steps, np.arange(45))
        assert np.array_equal(values, [r.scores[name].mean["gwd"] for r in records])


def test_errors_of_an_object_end_with_a_gap_when_its_track_is_lost(log):
    path = paths.of_object(2, "htg-map")
    steps, values = reader.scalars(log, path, "metrics:gwd")[path]
    _, ids = reader.scalars(log, path, "metrics:track_id")[path]
    assert steps.tolist() == [*range(21), *range(40, 45)]
    assert np.flatnonzero(np.isnan(values)).tolist() == [20]
    assert ids[20] == -1
    assert set(np.delete(ids, 20)) == {102}


def test_detections_of_all_kinds_carry_their_columns_and_padding_is_left_out(log):
    components = log_content.components(log)
    wanted = {"Points2D:positions", "radar:doppler", "radar:object_color", "radar:object_id", "radar:sensor"}
    wanted |= {f"radar:{word}_{name}" for word in ("owner", "owner_color") for name in TRACKERS}
    drawn = 0
    for kind in KINDS:
        assert wanted <= components[paths.detections(kind)]
        drawn += instances(log, paths.detections(kind), "Points2D:positions")
    assert drawn == sum(int(record.frame.scan.mask.sum()) for record in log_runs.records(45))


def instances(path, entity, component):
    batches = [batch for _, batch in reader.batches(path, f"/{entity}") if component in batch.schema.names]
    rows = [batch for batch in batches if paths.STEP in batch.schema.names]
    return sum(len(batch[component].flatten()) for batch in rows)


def test_actions_are_written_when_they_change(log):
    batches = [b for _, b in reader.batches(log, f"/{paths.EGO_ACTION}") if paths.STEP in b.schema.names]
    rows = [row for batch in batches for row in batch.to_pylist()]
    assert [(row["step"], row["StateChange:state"]) for row in rows] == [(0, ["IDLE"]), (33, ["FASTER"])]


def test_events_have_levels_that_tell_lost_tracks_from_noise(log):
    events = {(e.step, e.text): e.level for e in reader.events(log)}
    assert events[20, "htg-map: track 102 died, no detection for 1 s"] == "INFO"
    assert events[20, "htg-map: track 150 born, 3 detections no track explains"] == "DEBUG"
    assert events[20, "htg-map: scan implausible, 2 detections left out"] == "WARN"
    assert events[30, "veh_01 starts a lane change"] == "INFO"


def test_properties_say_what_was_run_and_what_came_out(log):
    properties = reader.properties(log)
    assert properties["run"]["scenario"] == "made-by-hand"
    assert properties["run"]["seed"] == 0
    assert properties["run"]["trackers"] == "rm-feldmann htg-map"
    assert properties["summary"]["htg_map_gwd"] == 0.24
    assert properties["summary"]["collision"] is False


def test_arrays_may_change_after_the_step(tmp_path):
    kept = log_runs.write(tmp_path / "kept.rrd", steps=10)
    with RunLog(tmp_path / "spoilt.rrd", log_runs.META) as log:
        log.static(log_runs.road(), log_runs.SENSORS)
        for record in log_runs.records(10):
            log.step(*record)
            frame = record.frame
            for array in (frame.scan.polar, frame.scene.objects.pose, frame.scene.ego.pose, frame.plan):
                array[...] = -1.0
            for tracks, _ in frame.outputs.values():
                tracks.estimate.pose[...] = -1.0
            for score in record.scores.values():
                score.mean["gwd"] = -1.0
        log.close(log_runs.SUMMARY)
    assert log_content.digests(tmp_path / "spoilt.rrd") == log_content.digests(kept)


@pytest.mark.filterwarnings("error")
def test_closing_twice_writes_once(tmp_path):
    log = RunLog(tmp_path / "a.rrd", log_runs.META)
    for record in log_runs.records(3):
        log.step(*record)
    log.close({"steps": 3})
    log.close({"steps": 99})
    assert reader.properties(tmp_path / "a.rrd")["summary"] == {"steps": 3}
    with pytest.raises(ValueError, match="is closed"):
        log.step(*next(log_runs.records(1)))
    del log
    gc.collect()  # does not close it once more


def test_an_exception_leaves_a_complete_log_that_names_it(tmp_path):
    path = tmp_path / "a.rrd"

    def interrupted():
        with RunLog(path, log_runs.META) as log:
            for record in log_runs.records(8):
                log.step(*record)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert reader.complete(path)
    assert reader.steps(path).tolist() == list(range(8))
    last = reader.events(path)[-1]
    assert (last.step, last.level, last.text) == (7, "ERROR", "the run ended with KeyboardInterrupt")


def test_a_run_that_fails_before_its_first_step_leaves_no_file(tmp_path):
    with pytest.raises(RuntimeError, match="before"), RunLog(tmp_path / "a.rrd", log_runs.META):
        raise RuntimeError("before")
    assert not (tmp_path / "a.rrd").exists()


KILLED = """
import os, signal, sys, time
sys.path.insert(0, sys.argv[2])
from tests.testbed.log import log_runs
from testbed.log import RunLog
log = RunLog(sys.argv[1], log_runs.META, every=10)
for record in log_runs.records(37):
    log.step(*record)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL on this system")
def test_a_killed_run_is_readable_up_to_its_last_block(tmp_path):
    path = tmp_path / "killed.rrd"
    folder = str(Path(__file__).parents[3])
    killed = subprocess.run([sys.executable, "-c", KILLED, str(path), folder], timeout=60, check=False)
    assert killed.returncode == -signal.SIGKILL
    (left,) = tmp_path.iterdir()
    assert left.match("killed.unfinished-*.rrd")
    assert len(reader.steps(left)) >= 37 - 10
    assert not reader.complete(left)


def begun(path, steps, **options):
    """A log that is open after some steps."""
    log = RunLog(path, log_runs.META, **options)
    log.static(log_runs.road(), log_runs.SENSORS)
    for record in log_runs.records(steps):
        log.step(*record)
    return log


@pytest.fixture(scope="module")
def size(tmp_path_factory):
    """Bytes of an open log after 30 steps: two blocks."""
    log = begun(tmp_path_factory.mktemp("open") / "a.rrd", 30)
    found = log.file.stat().st_size
    log.close()
    return found


def test_a_full_disk_stops_the_log_at_its_last_block(tmp_path, limit_files, size, capfd):
    path = tmp_path / "a.rrd"
    log = begun(path, 29)
    refused = []
    with limit_files(size + 1000):
        for record in list(log_runs.records(61))[29:]:
            try:
                log.step(*record)
            except OSError as error:
                refused.append((record.frame.step, str(error)))
        log.event("INFO", "nobody reads this")
        log.close(log_runs.SUMMARY)
    assert refused == [(44, f"cannot write the log {path}: File too large; it ends at 1.9 s")]
    assert list(tmp_path.iterdir()) == [path]
    assert reader.steps(path).tolist() == list(range(30))
    assert not reader.complete(path)
    assert capfd.readouterr() == ("", "")


def test_a_disk_that_is_full_at_the_end_of_the_log_is_one_sentence(tmp_path, limit_files, size):
    path = tmp_path / "a.rrd"
    log = begun(path, 30)
    refused = pytest.raises(OSError, match=r"^cannot write the log .*a\.rrd: File too large; it ends at 1\.9 s$")
    with limit_files(size + 1000):
        with refused:
            log.close(log_runs.SUMMARY)
        log.close()
    assert reader.steps(path).tolist() == list(range(30))


def test_a_disk_without_room_for_the_beginning_is_one_sentence(tmp_path, limit_files):
    refused = pytest.raises(OSError, match=r"^cannot write the log .*: File too large; choose another directory$")
    with limit_files(10_000), refused:
        begun(tmp_path / "a.rrd", 1)
    assert list(tmp_path.iterdir()) == []


def test_a_log_that_was_damaged_on_the_disk_does_not_pass_for_whole(tmp_path):
    log = begun(tmp_path / "a.rrd", 20)
    with open(log.file, "r+b") as file:
        file.write(b"nonsense")
    with pytest.raises(OSError, match=r"^the log .*a\.rrd does not read back; delete it and run again$"):
        log.close()


def test_a_log_whose_name_is_taken_is_one_sentence(tmp_path):
    log = begun(tmp_path / "a.rrd", 20)
    (tmp_path / "a.rrd").mkdir()
    with pytest.raises(OSError, match=r"^cannot write the log .*a\.rrd: Is a directory; it is a\.unfinished-.*\.rrd"):
        log.close()
    assert log.file.match("a.unfinished-*.rrd")
    assert reader.complete(log.file)


def test_two_logs_of_one_name_are_both_whole_and_the_last_one_stays(tmp_path):
    path = tmp_path / "a.rrd"
    first, second = begun(path, 20), begun(path, 3)
    assert len(set(tmp_path.iterdir())) == 2
    first.close()
    assert reader.complete(path)
    assert len(reader.steps(path)) == 20
    second.close()
    assert reader.complete(path)
    assert len(reader.steps(path)) == 3
    assert list(tmp_path.iterdir()) == [path]


def test_an_older_log_stays_until_the_new_one_is_closed(tmp_path):
    path = log_runs.write(tmp_path / "a.rrd", steps=3)
    log = begun(path, 20)
    assert len(reader.steps(path)) == 3
    log.close(replace=False)
    assert len(reader.steps(path)) == 3
    assert reader.complete(log.file)
    assert len(reader.steps(log.file)) == 20


def test_a_log_that_nobody_closes_is_closed_when_it_goes(tmp_path):
    log = begun(tmp_path / "a.rrd", 20)
    del log
    gc.collect()
    assert reader.complete(tmp_path / "a.rrd")
    assert len(reader.steps(tmp_path / "a.rrd")) == 15


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("kept")])
def test_a_log_replaces_neither_a_pipe_nor_a_link(tmp_path, make):
    make(tmp_path / "a.rrd")
    with pytest.raises(OSError, match=r"^cannot write .*a\.rrd: it is a .*; choose another file$"):
        begun(tmp_path / "a.rrd", 1)
    assert [path.name for path in tmp_path.iterdir()] == ["a.rrd"]


def test_directories_are_made_and_old_files_replaced(tmp_path):
    path = tmp_path / "deep" / "er" / "a.rrd"
    log_runs.write(path, steps=12)
    log_runs.write(path, steps=3)
    assert len(reader.steps(path)) == 3


def test_a_path_that_cannot_be_written_is_one_sentence(tmp_path):
    (tmp_path / "file").write_text("in the way")
    log = RunLog(tmp_path / "file" / "a.rrd", log_runs.META)
    with pytest.raises(OSError, match=r"cannot write .*a\.rrd: Not a directory; choose another directory"):
        log.step(*next(log_runs.records(1)))


def test_nothing_is_opened_before_the_first_step(tmp_path):
    log = RunLog(tmp_path / "a.rrd", log_runs.META)
    log.static(log_runs.road(), log_runs.SENSORS)
    assert not (tmp_path / "a.rrd").exists()


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda r: r._replace(frame=r.frame._replace(step=0)), "frame.step must grow, got 0 after 0"),
        (lambda r: r._replace(scores={}), "scores must have the trackers of the run"),
        (lambda r: r._replace(events=(("LOUD", "x"),)), "event level must be one of"),
    ],
)
def test_bad_records_are_refused(tmp_path, spoil, message):
    log = RunLog(tmp_path / "a.rrd", log_runs.META)
    first, second = log_runs.records(2)
    log.step(*first)
    with pytest.raises(ValueError, match=message):
        log.step(*spoil(second))
    log.close()


def test_bad_options_are_refused(tmp_path):
    with pytest.raises(ValueError, match="level must be"):
        RunLog(tmp_path / "a.rrd", log_runs.META, level="off")
    with pytest.raises(ValueError, match="every must be"):
        RunLog(tmp_path / "a.rrd", log_runs.META, every=0)
    with pytest.raises(ValueError, match="cannot be part of a log path"):
        RunLog(tmp_path / "a.rrd", log_runs.META._replace(trackers=("__tracker",)))
    with pytest.raises(ValueError, match="have one name in a log"):
        RunLog(tmp_path / "a.rrd", log_runs.META._replace(trackers=("a:b", "a=b")))
    log = RunLog(tmp_path / "a.rrd", log_runs.META)
    with pytest.raises(TypeError, match=r"summary\['htg-map.gwd'\] must be a number or a text, got NoneType"):
        log.close({"htg-map": {"gwd": None}})


def test_a_focus_that_is_not_there_is_refused(tmp_path):
    log = RunLog(tmp_path / "a.rrd", log_runs.META, focus=77)
    with pytest.raises(ValueError, match=r"focus must be an object of the first scene, \[0, 1, 2, 3, 4\], got 77"):
        log.step(*next(log_runs.records(1)))


def test_empty_frames_are_logged(tmp_path):
    path = tmp_path / "empty.rrd"
    log_runs.write(path, steps=5, objects=0, clutter=0)
    assert len(reader.steps(path)) == 5
    assert instances(path, paths.TRUTH_CONTOUR, "LineStrips2D:strips") == 0
    each = log_runs.write(tmp_path / "each.rrd", steps=5, objects=0, clutter=0, every=1)
    assert log_content.digests(each) == log_content.digests(path)


def test_the_log_module_does_not_import_rerun():
    code = "import sys, testbed.log, testbed.log.review; sys.exit('rerun' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], env=os.environ, check=False).returncode == 0


MOMENT = {
    "time": 1.0, "start": 0.8, "end": 1.3, "tracker": "htg-map", "object": 4, "kind": "car", "track": 104,
    "what": "lost", "text": "without a track", "cause": "hidden", "why": "hidden by veh_01", "severity": 12.5,
}  # fmt: skip


def focus_pages(path):
    """Names of the pages of single objects in the layout that the log shows last, in no order."""
    from rerun.chunk import RrdReader

    log, found = RrdReader(path), {}
    for store in log.blueprints():
        batches = [chunk.to_record_batch() for chunk in log.stream(store=store).to_chunks()]
        column = "ContainerBlueprint:display_name"
        names = [name for b in batches if column in b.schema.names for name in b[column].to_pylist()]
        found[len(found)] = {name[0] for name in names if name and name[0].startswith(("veh_", "Motion"))}
    return sorted(map(sorted, found.values()), key=len)


def ended(path, asked=None):
    with RunLog(path, log_runs.META, focus=2) as log:
        for record in log_runs.records(2):
            log.step(*record)
        if asked is not None:
            log.focus_on(asked)
        log.tables([MOMENT | {"object": None}, MOMENT, MOMENT | {"object": 3}, MOMENT], [])
    return path


def test_the_objects_of_the_worst_moments_have_pages_and_so_has_one_that_was_asked_for(tmp_path):
    assert focus_pages(ended(tmp_path / "a.rrd")) == [["veh_02"], ["veh_03", "veh_04"]]
    assert focus_pages(ended(tmp_path / "b.rrd", asked=1)) == [["veh_02"], ["veh_01", "veh_03", "veh_04"]]
    unknown = ended(tmp_path / "c.rrd", asked=77)
    assert focus_pages(unknown) == [["veh_02"], ["veh_03", "veh_04"]]
    warned = [e.text for e in reader.events(unknown) if e.level == "WARN"]
    assert warned == ["there was no veh_77 to focus on; vehicles: 0, 1, 2, 3, 4"]


def test_the_object_asked_for_comes_first_then_the_worst_each_once():
    moments = [{"object": key} for key in (4, None, 4, 3, 9, 8)]
    assert in_focus(None, moments) == (4, 3, 9)
    assert in_focus(3, moments) == (3, 4, 9)
    assert in_focus(None, []) == ()


def test_pages_of_moments_objects_and_colours_are_in_the_log(tmp_path):
    path = ended(tmp_path / "a.rrd")
    pages = {
        page: [row["TextDocument:text"][0] for row in log_content.rows(path, page) if row.get("TextDocument:text")][-1]
        for page in (paths.MOMENTS, paths.LEGEND, paths.SUMMARY)
    }
    assert "**1.0 s, veh_04 car**: lost: without a track. *hidden by veh_01*" in pages[paths.MOMENTS]
    for word in ("| green |", "| pink |", "| grey |", "| brown |", "| orange |", "htg-map"):
        assert word in pages[paths.LEGEND]
    assert json.loads(reader.properties(path)["tables"]["moments"])[1] == MOMENT
