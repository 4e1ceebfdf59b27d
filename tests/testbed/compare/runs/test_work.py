"""A comparison as a whole: it repeats, goes on after damage, and a failing run stops nothing."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from scenarios.highway import ScenarioEnv
from testbed.compare.runs import tasks as runs
from testbed.compare.runs.config import SETTINGS, Comparison, Settings, Task, with_faults
from testbed.compare.runs.results import RUNS, collect, write_runs
from testbed.compare.runs.tasks import RECORDINGS, ROWS, RecordingTask, recording_path, rows_path
from testbed.compare.runs.work import execute
from testbed.environment.wrapper import TrackedEnv
from testbed.evaluation.metric import COSTS
from testbed.experiments.engine import Engine
from testbed.experiments.rows import check_part
from testbed.experiments.run import DONE, FAILED, FOUND
from testbed.planners import find as find_planner
from testbed.replay import recording
from testbed.replay.rescan import replay

WANTED = Comparison(("xia2020-lane",), ("rm-koch", "rm-feldmann"), (0, 1), Settings("front", duration=0.5))
DAMAGED, SWAPPED = WANTED.tasks[:2]


def rows_of(out, comparison=WANTED):
    """Task -> table of its rows."""
    return {task: pq.read_table(rows_path(task, Path(out))) for task in comparison.tasks}


def assert_same_results(a, b):
    """Rows to the bit, and the table of runs but for wall times."""
    one, two = rows_of(a), rows_of(b)
    assert all(one[task].equals(two[task], check_metadata=True) for task in WANTED.tasks)
    frames = [pd.read_parquet(Path(out) / RUNS).drop(columns=list(COSTS)) for out in (a, b)]
    pd.testing.assert_frame_equal(*frames, check_exact=True)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of an uninterrupted comparison in one process."""
    out = tmp_path_factory.mktemp("whole")
    report = execute(replace(WANTED, out=str(out)), Engine(1))
    write_runs(collect(replace(WANTED, out=str(out))))
    assert (report.done, report.found, report.failed, report.exit_status) == (4, 0, [], 0)
    return out


@pytest.fixture
def copied(whole, tmp_path):
    """A copy of it to be damaged."""
    return replace(WANTED, out=str(shutil.copytree(whole, tmp_path / "copy")))


def again(comparison, **engine):
    report = execute(comparison, Engine(**engine))
    write_runs(collect(comparison))
    return report


def test_a_comparison_leaves_its_settings_recordings_rows_and_one_table(whole):
    assert {p.name for p in whole.iterdir()} == {SETTINGS, RECORDINGS, ROWS, RUNS}
    assert {p.name for p in (whole / ROWS).iterdir()} == {f"{task.name}.parquet" for task in WANTED.tasks}
    assert {p.name for p in (whole / RECORDINGS).iterdir()} == {f"xia2020-lane_seed{s}.npz" for s in (0, 1)}


def test_runs_on_one_recording_see_the_same_objects_at_the_same_times(whole):
    for seed in WANTED.seeds:
        seen = []
        for tracker in WANTED.trackers:
            frame = rows_of(whole)[Task("xia2020-lane", tracker, seed)].to_pandas()
            counted = frame[frame["status"].isin(["pair", "missed"])]
            seen.append(counted[["time", "object", "range", "visible", "expected"]].to_numpy(float))
        assert np.array_equal(*seen)


def test_what_is_there_is_found_and_not_made_again(copied):
    before = {p: p.stat().st_mtime_ns for p in Path(copied.out).rglob("*.*") if p.name != RUNS}
    report = again(copied)
    assert (report.done, report.found) == (0, 4)
    assert before == {p: p.stat().st_mtime_ns for p in Path(copied.out).rglob("*.*") if p.name != RUNS}


def test_other_seeds_and_trackers_join_the_folder(copied):
    report = again(replace(copied, trackers=("rm-koch", "rm-vmm"), seeds=(1, 2)))
    assert (report.done, report.found) == (3, 1)


def truncate(path, _):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def flip(path, _):
    data = bytearray(path.read_bytes())
    for k in range(len(data) // 2, len(data) // 2 + 64):
        data[k] ^= 255
    path.write_bytes(data)


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        (truncate, "is damaged"),
        (flip, "is damaged"),
        (lambda path, other: path.write_bytes(b""), "is damaged"),
        (lambda path, other: shutil.copy(other, path), "holds the run"),
    ],
    ids=["truncated", "flipped", "empty", "another run"],
)
def test_a_corrupt_part_is_named_and_made_again(copied, whole, damage, told):
    out = Path(copied.out)
    damage(rows_path(DAMAGED, out), rows_path(SWAPPED, out))
    report = again(copied)
    assert (report.done, report.found) == (1, 3)
    (redone,) = report.redone
    assert redone.name == DAMAGED.name
    assert redone.note.startswith(f"{rows_path(DAMAGED, out)} {told}")
    assert_same_results(whole, out)


def test_a_corrupt_recording_is_made_again_where_it_is_needed(copied, whole):
    out = Path(copied.out)
    path = recording_path(RecordingTask(DAMAGED.scenario, DAMAGED.seed), out)
    truncate(path, None)
    assert again(copied).found == 4  # nobody needs it
    rows_path(DAMAGED, out).unlink()
    assert again(copied).done == 1
    assert_same_results(whole, out)


def test_a_folder_of_other_settings_is_refused_before_anything_is_made(copied):
    with pytest.raises(ValueError, match=r"holds runs with duration 0\.5, wanted is 1\.0"):
        execute(replace(copied, settings=Settings("front", duration=1.0)), Engine(1))


def test_two_processes_give_the_rows_of_one(whole, tmp_path):
    comparison = replace(WANTED, out=str(tmp_path / "two"))
    assert again(comparison, jobs=2).done == 4
    assert_same_results(whole, comparison.out)


def test_a_run_that_cannot_be_written_is_one_sentence_and_stops_nothing(copied):
    out = Path(copied.out)
    rows_path(DAMAGED, out).unlink()
    rows_path(DAMAGED, out).mkdir()  # nothing can be written in its place
    report = again(copied)
    (failed,) = report.failed
    assert failed.name == DAMAGED.name
    assert failed.name.endswith(f"seed{DAMAGED.seed}")
    assert re.fullmatch(r"cannot .*parquet.*", failed.note)
    assert report.found == 3
    assert collect(copied).missing == [DAMAGED]


def test_a_run_in_closed_loop_repeats_and_scores_the_drive(tmp_path):
    task, settings = Task("xia2020-lane", "rm-koch", 1), Settings("front", "closed", duration=0.5)
    outs = [tmp_path / name for name in ("a", "b")]
    for out in outs:
        (out / ROWS).mkdir(parents=True)
        assert runs.run(task, settings, out).status == DONE
        assert runs.run(task, settings, out).status == FOUND
        check_part(rows_path(task, out), task)
    tables = [pq.read_table(rows_path(task, out)) for out in outs]
    assert tables[0].equals(tables[1])
    comparison = Comparison((task.scenario,), (task.tracker,), (task.seed,), settings, out=str(outs[0]))
    assert collect(comparison).runs["progress"].notna().all()


def test_a_run_of_an_unknown_tracker_fails_alone(tmp_path):
    (tmp_path / ROWS).mkdir()
    (tmp_path / RECORDINGS).mkdir()
    outcome = runs.run(Task("xia2020-lane", "none", 0), WANTED.settings, tmp_path)
    assert outcome.status == FAILED
    assert "Traceback" in outcome.note
    assert "LookupError" in outcome.note


def test_faults_are_a_dimension_and_all_share_the_healthy_recording(tmp_path):
    fault = "front:outage:0.8:2"
    cases = with_faults(["cut-in"], ["front:outage:.8:2"])
    assert cases == ("cut-in", f"cut-in+{fault}")
    settings = Settings("front", duration=1.5)
    comparison = replace(
        WANTED, settings=settings, scenarios=cases, trackers=("rm-koch",), seeds=(0,), out=str(tmp_path)
    )
    report = execute(comparison, Engine(1))
    assert (report.done, report.failed) == (2, [])
    assert [path.name for path in (tmp_path / RECORDINGS).iterdir()] == ["cut-in_seed0.npz"]
    plain, faulty = (table.to_pandas() for table in rows_of(tmp_path, comparison).values())
    assert set(faulty["scenario"]) == {cases[1]}
    assert faulty["detections"].sum() < plain["detections"].sum()
    early = plain["time"] < 0.8
    columns = ["time", "status", "object", "detections", "gospa2"]
    pd.testing.assert_frame_equal(plain.loc[early, columns], faulty.loc[faulty["time"] < 0.8, columns])
    assert execute(comparison, Engine(1)).found == 2


def test_a_replay_has_the_faults_that_the_live_run_had():
    faults = ("drop:0.5", "burst:0.2:20")
    live = []
    env = TrackedEnv(ScenarioEnv(scenario="xia2020-lane"), "truth", "front", planner="truth", faults=faults)
    env.attach(live.append)
    env.reset(seed=3)
    planner = find_planner("truth")
    for _ in range(2):
        env.step(planner.choose(env).action)
    recorded = recording.record("xia2020-lane", 3, "front", 0.5)
    again = []
    replay(recorded, ("truth",), [again.append], faults)
    pairs = list(zip(live, again, strict=False))
    assert len(pairs) > 5
    for one, other in pairs:
        np.testing.assert_array_equal(one.scan.polar, other.scan.polar)
        np.testing.assert_array_equal(one.scan.delivered, other.scan.delivered)
    assert 0 < sum(frame.scan.delivered.all() for frame in again) < len(again)


@pytest.mark.parametrize(
    ("case", "word"),
    [("xia2020-lane+rear:drop:0.1", "no 'rear'"), ("xia2020-lane+drop:.1", "is written"), ("xia2020-lane+x", "KIND")],
)
def test_faults_that_a_rig_cannot_have_are_refused_before_the_runs(tmp_path, case, word):
    with pytest.raises(ValueError, match=word):
        execute(replace(WANTED, scenarios=(case,), out=str(tmp_path)), Engine(1))
