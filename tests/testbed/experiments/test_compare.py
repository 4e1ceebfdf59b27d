"""What a comparison takes, and with which sentence it refuses the rest."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pandas as pd
import psutil
import pyarrow.parquet as pq
import pytest

from scenarios import SCENARIOS
from testbed.environment.perception import radar_of
from testbed.experiments.command import check, execute
from testbed.experiments.compare import Comparison, Settings
from testbed.experiments.engine import Engine
from testbed.experiments.episode import episode
from testbed.experiments.run import Run, expand, parse_seeds, with_faults
from testbed.experiments.store import RECORDINGS, ROWS, RUNS, Results, Store
from testbed.replay.recording import record
from testbed.replay.rescan import rescan
from tests.testbed.command_line.refused import refused
from trackers import TRACKERS

SHORT = Settings(radar="front", duration=1.0)


def comparison(out, **changes):
    return replace(Comparison(("cut-in",), ("rm-koch", "htg-map"), (0, 1), SHORT, out=str(out)), **changes)


@pytest.mark.parametrize(
    ("text", "seeds"), [("0:3", (0, 1, 2)), ("2:5", (2, 3, 4)), ("0,3,7", (0, 3, 7)), ("5", (5,)), (" 1, 2", (1, 2))]
)
def test_seeds_are_ranges_lists_or_one_number(text, seeds):
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "a", "0:2:4", "1;2", "0-3", ":", "1,", "0.5", "nan"])
def test_other_texts_are_refused_with_what_seeds_read_like(text):
    with pytest.raises(ValueError, match=f"seeds must read like 0:20, 0,3,7 or 5, got '{text}'"):
        parse_seeds(text)


@pytest.mark.parametrize("text", ["0:0", "5:2"])
def test_an_empty_range_is_refused(text):
    with pytest.raises(ValueError, match=f"seeds '{text}' are empty; the range 0:20"):
        parse_seeds(text)


def test_all_stands_for_the_whole_catalogue():
    assert expand(["all"], "scenarios") == tuple(SCENARIOS)
    assert expand(["all"], "trackers") == tuple(TRACKERS)
    assert expand(["merge", "cut-in"], "scenarios") == ("merge", "cut-in")


def test_runs_are_the_product_and_those_on_one_recording_stand_together(tmp_path):
    wanted = comparison(tmp_path, scenarios=("cut-in", "merge"))
    works = wanted.work()
    assert len(set(works)) == len({run.name for run in works}) == len(works) == 8
    assert [(run.case, run.source, run.seed) for run in works[:3]] == [
        ("cut-in", "rm-koch", 0),
        ("cut-in", "htg-map", 0),
        ("cut-in", "rm-koch", 1),
    ]
    assert works[0].name == "cut-in_rm-koch_front_seed0"
    assert works[0].recording == works[1].recording != works[2].recording
    assert works[0].recording_name == "cut-in_front_seed0"


def test_the_first_tracker_is_the_reference_unless_one_is_named(tmp_path):
    assert comparison(tmp_path).baseline == "rm-koch"
    assert comparison(tmp_path, reference="htg-map").baseline == "htg-map"


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"seeds": ()}, "seeds must name at least one of them, got none"),
        ({"trackers": ()}, "trackers must name at least one"),
        ({"seeds": (1, 2, 1)}, "seeds must differ, got 1, 2, 1; drop the repetition"),
        ({"scenarios": ("merge", "merge")}, "scenarios must differ"),
        ({"seeds": (0, -1)}, "seeds must not be negative, got -1; take 0 or more"),
        ({"reference": "rm-vmm"}, "reference 'rm-vmm' is not compared; choose one of rm-koch, htg-map, or add it"),
    ],
)
def test_a_comparison_that_cannot_be_is_refused(tmp_path, changes, sentence):
    with pytest.raises(ValueError, match=sentence):
        comparison(tmp_path, **changes)


@pytest.mark.parametrize("duration", [0.0, -1.0, float("nan"), float("inf")])
def test_a_duration_must_be_positive_and_finite(duration):
    with pytest.raises(ValueError, match=f"duration must be positive and finite, got {duration} s; leave it out"):
        Settings(duration=duration)


def test_a_loop_is_open_or_closed():
    with pytest.raises(ValueError, match="loop must be one of open, closed, got 'half'; choose one of them"):
        Settings(loop="half")


def test_how_long_runs_are_is_given_by_duration_and_maneuver():
    both = Settings(duration=60.0, after=3.0)
    runs = [Run("cut-in"), Run("cut-in", duration=1.0), Run("cut-in", duration=60.0, after=3.0)]
    assert [run.settings for run in runs] == [{}, {"duration": 1.0}, {"duration": 60.0, "after": 3.0}]
    assert replace(runs[2], scenario="highway-v0").settings == {"duration": 60.0}  # its maneuver has no end
    assert (Settings().length, SHORT.length) == ("the scenarios' own", "1 s")
    assert both.length == "to 3 s after the maneuver, 60 s at most"


@pytest.mark.parametrize("settle", [-1, float("nan"), float("inf"), "2", True])
def test_the_time_to_settle_is_a_time(settle):
    with pytest.raises(ValueError, match="settle must be a number from 0 to 3600 s, got"):
        Settings(settle=settle)


def test_a_run_cannot_end_before_the_maneuver_does():
    with pytest.raises(ValueError, match="after must be positive and finite, got -1 s; leave it out for a run that"):
        Settings(after=-1)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"scenarios": ("cut-inn",)}, "no scenario 'cut-inn'; did you mean 'cut-in'?"),
        ({"trackers": ("htg-mapp",)}, "htg-mapp.*did you mean 'htg-map'"),
        ({"settings": Settings(radar="frnt")}, "frnt.*did you mean 'front'"),
        ({"settings": Settings(planner="imd")}, "imd.*did you mean 'idm'"),
    ],
)
def test_unknown_names_are_refused_with_the_nearest(tmp_path, changes, sentence):
    with pytest.raises(LookupError, match=sentence.replace("?", r"\?")):
        check(comparison(tmp_path, **changes), Engine())


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"radar": "surround"}, "radar 'front'"),
        ({"duration": None}, "duration 1.0"),
        ({"duration": 2.0}, "duration 1.0"),
        ({"loop": "closed"}, "loop 'open'"),
        ({"planner": "truth"}, "planner 'idm'"),
    ],
)
def test_other_settings_are_refused_with_the_field_that_differs(tmp_path, changes, field):
    Store(comparison(tmp_path)).open()
    with pytest.raises(ValueError, match=f"holds runs with {field}, wanted is .*; choose another directory"):
        check(comparison(tmp_path, settings=replace(SHORT, **changes)), Engine())


def test_a_folder_takes_the_same_settings_whatever_is_compared(tmp_path):
    Store(comparison(tmp_path)).open()
    check(comparison(tmp_path, scenarios=("merge",), trackers=("rm-vmm",), seeds=(7,)), Engine())


def test_a_new_tracker_may_join_a_folder_and_a_changed_one_is_refused_by_name(tmp_path):
    Store(comparison(tmp_path, trackers=("rm-feldmann",))).open()
    both = comparison(tmp_path, trackers=("rm-feldmann", "htg-mm"))
    check(both, Engine())
    Store(both).open()
    known = Store(both).about()
    assert {"code of rm-feldmann", "code of htg-mm"} <= set(known)
    (tmp_path / "study.json").write_text(json.dumps(known | {"code of htg-mm": "older"}))
    check(comparison(tmp_path, trackers=("rm-feldmann",)), Engine())
    with pytest.raises(ValueError, match="holds runs with code of htg-mm 'older', wanted is"):
        check(both, Engine())


# Real runs

WANTED = Comparison(("xia2020-lane",), ("rm-koch", "rm-feldmann"), (0, 1), Settings("front", duration=0.5))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A comparison that was made in one process."""
    made = replace(WANTED, out=str(tmp_path_factory.mktemp("whole")))
    tally = execute(made, Engine(1))
    assert (tally.done, tally.found, tally.failed) == (4, 0, [])
    return made


def assert_same_rows(a, b):
    for run in a.work():
        assert Store(a).table(run).equals(Store(b).table(run), check_metadata=True)


def test_runs_on_one_recording_see_the_same_objects_at_the_same_times(whole):
    for seed in whole.seeds:
        seen = []
        for tracker in whole.trackers:
            frame = Store(whole).table(whole.run("xia2020-lane", tracker, seed)).to_pandas()
            counted = frame[frame["status"].isin(["pair", "missed"])]
            seen.append(counted[["time", "object", "range", "visible", "expected"]].to_numpy(float))
        assert np.array_equal(*seen)


def test_two_processes_give_the_rows_of_one_and_a_corrupt_recording_is_made_again(whole, tmp_path):
    two = replace(WANTED, out=str(tmp_path / "two"))
    assert execute(two, Engine(2)).done == 4
    assert_same_rows(whole, two)
    first, path = two.work()[0], Store(two).recording_path(two.work()[0])
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert execute(two, Engine()).found == 4  # nobody needs it
    Store(two).path(first).unlink()
    assert execute(two, Engine()).done == 1
    assert_same_rows(whole, two)


def test_a_run_in_closed_loop_repeats_and_scores_the_drive(tmp_path):
    settings = Settings("front", "closed", duration=0.5)
    made = [Comparison(("xia2020-lane",), ("rm-koch",), (1,), settings, out=str(tmp_path / name)) for name in "ab"]
    assert [execute(one, Engine()).done for one in made] == [1, 1]
    assert_same_rows(*made)
    assert Results.read(made[0]).runs["progress"].notna().all()


def test_faults_are_a_dimension_and_all_share_the_healthy_recording(tmp_path):
    fault = "front:outage:0.8:2"
    cases = with_faults(["cut-in"], ["front:outage:.8:2"])
    assert cases == ("cut-in", f"cut-in+{fault}")
    settings = Settings("front", duration=1.5)
    made = replace(WANTED, settings=settings, scenarios=cases, trackers=("rm-koch",), seeds=(0,), out=str(tmp_path))
    assert execute(made, Engine(1)).done == 2
    assert [path.name for path in (tmp_path / RECORDINGS).iterdir()] == ["cut-in_front_seed0.npz"]
    plain, faulty = (Store(made).table(run).to_pandas() for run in made.work())
    assert set(faulty["scenario"]) == {cases[1]}
    assert faulty["detections"].sum() < plain["detections"].sum()
    early = plain["time"] < 0.8
    columns = ["time", "status", "object", "detections", "gospa2"]
    pd.testing.assert_frame_equal(plain.loc[early, columns], faulty.loc[faulty["time"] < 0.8, columns])


def test_a_replay_has_the_faults_that_the_live_run_had():
    faults = ("drop:0.5", "burst:0.2:20")
    live, again = [], []
    recorded = record("xia2020-lane", 3, "front", 0.5)
    episode(Run("xia2020-lane", 3, "truth", "truth", "front", faults, duration=0.5), [live.append])
    episode(Run("xia2020-lane", 3, "truth", radar="front", faults=faults, loop="open"), [again.append], recorded)
    assert len(live) == len(again) > 5
    for one, other in zip(live, again, strict=True):
        np.testing.assert_array_equal(one.scan.polar, other.scan.polar)
        np.testing.assert_array_equal(one.scan.delivered, other.scan.delivered)
    assert 0 < sum(frame.scan.delivered.all() for frame in again) < len(again)


def test_another_radar_scans_the_recorded_scenes(tmp_path):
    run = Run("xia2020-lane", 3, "rm-koch", radar="surround", loop="open", recorded_with="front", duration=0.3)
    recorded, seen = record("xia2020-lane", 3, "front", 0.3), []
    episode(run, [seen.append], recorded)
    assert run.recording.radar == "front"
    assert [frame.scene.time for frame in seen] == [frame.scene.time for frame in recorded.frames]
    by_hand, rng = [], np.random.default_rng([3, 1])
    rescan(recorded, radar_of("surround"), rng, ("rm-koch",), [by_hand.append])
    for one, other in zip(seen, by_hand, strict=True):
        np.testing.assert_array_equal(one.scan.polar, other.scan.polar)


@pytest.mark.parametrize(
    ("case", "word"),
    [("xia2020-lane+rear:drop:0.1", "no 'rear'"), ("xia2020-lane+drop:.1", "is written"), ("xia2020-lane+x", "KIND")],
)
def test_faults_that_a_rig_cannot_have_are_refused_before_the_runs(tmp_path, case, word):
    with pytest.raises(ValueError, match=word):
        execute(replace(WANTED, scenarios=(case,), out=str(tmp_path)), Engine(1))


PLAIN = {**os.environ, "COLUMNS": "200", "NO_COLOR": "1", "TERM": "dumb"}
LONG = replace(WANTED, seeds=tuple(range(6)))
ASKED = ["compare", "xia2020-lane", "--radar", "front", "--duration", "0.5", "--seeds", "0:6"]
PAIR = ["--tracker", "rm-koch", "--tracker", "rm-feldmann"]


def refused_here(out, *args):
    """The sentence with which `testbed compare` is refused that writes to a folder."""
    return refused("compare", "xia2020-lane", "--out", out, *args)


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["merg"], "no scenario 'merg'; did you mean 'merge'?"),
        (["--tracker", "htg-mapp"], "did you mean 'htg-map'?"),
        (["--radar", "frnt"], "did you mean 'front'?"),
        (["--planner", "imd"], "did you mean 'idm'?"),
        (["--seeds", "0:0"], "seeds '0:0' are empty"),
        (["--seeds", "many"], "seeds must read like 0:20, 0,3,7 or 5, got 'many'"),
        (["--tracker", "rm-koch", "--reference", "rm-vmm"], "reference 'rm-vmm' is not compared"),
        (["--duration", "nan"], "duration must be positive and finite, got nan s"),
        (["--loop", "half"], "loop must be one of open, closed"),
        (["--jobs", "0"], "jobs must be 1 or more, or -1 for all cores, got 0"),
        (["xia2020-lane"], "scenarios must differ"),
    ],
)
def test_wrong_input_is_one_sentence(tmp_path, args, sentence):
    assert sentence in refused_here(tmp_path, *args)


def test_an_out_that_cannot_be_is_one_sentence(tmp_path):
    (tmp_path / "file").touch()
    assert "out: cannot write to" in refused_here(tmp_path / "file")


def test_a_folder_of_an_older_version_is_one_sentence(tmp_path):
    (tmp_path / "comparison.json").write_text('{"radar": "front"}')
    assert "holds other files than those of `testbed compare`, or runs of an older" in refused_here(tmp_path)


def test_tables_are_printed_where_they_cannot_be_written(tmp_path, command):
    (tmp_path / RUNS).mkdir()
    done = command(*ASKED[:-1], "0", "--tracker", "rm-koch", "--out", tmp_path)
    assert done.status == 2
    assert "GOSPA [m]" in done.out
    assert done.err.splitlines()[-1].startswith(f"testbed: cannot write {tmp_path / RUNS}: it is a directory;")


def test_a_closed_loop_shows_the_drives_and_keeps_them_with_their_units(tmp_path, command):
    asked = ["compare", "xia2020-lane", "--radar", "front", "--duration", "0.5", "--seeds", "0", "--loop", "closed"]
    done = command(*asked, "--tracker", "rm-koch", "--out", tmp_path)
    assert done.status == 0, done.err
    assert "the drives with 95 % intervals" in done.out
    assert "progress [m]" in done.out
    stored = pq.read_schema(tmp_path / RUNS)
    assert {name: stored.field(name).metadata[b"unit"] for name in ("progress", "tit")} == {
        "progress": b"m",
        "tit": b"s^2",
    }
    assert "The drives" in (tmp_path / "report.html").read_text()


def started(out):
    """A comparison on two processes that has made its first runs."""
    command = [sys.executable, "-m", "testbed", *ASKED, *PAIR, "--jobs", "2", "--out", str(out)]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=PLAIN, start_new_session=True
    )
    deadline = time.monotonic() + 300
    while not list((out / ROWS).glob("*.parquet")) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    return process


def test_the_workers_of_a_comparison_that_was_killed_end(tmp_path):
    process = started(tmp_path)
    workers = psutil.Process(process.pid).children(recursive=True)
    assert len(workers) >= 2
    process.kill()
    process.wait()
    _, alive = psutil.wait_procs(workers, timeout=30)
    for worker in alive:
        worker.kill()
    assert alive == []


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory):
    """Folder, exit status and output of a comparison that got Ctrl-C after its first runs."""
    out = tmp_path_factory.mktemp("interrupted")
    process = started(out)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers too
    output, errors = process.communicate(timeout=300)
    return out, process.returncode, output, errors


def test_an_interrupted_comparison_says_so_and_leaves_whole_files(interrupted):
    out, status, output, errors = interrupted
    assert status == 130, errors
    assert "interrupted: tables of the runs made so far; the same command makes the rest" in output
    assert "Traceback" not in output + errors
    made = [run for run in LONG.work() if Store(LONG, out).path(run).exists()]
    assert 0 < len(made) < 12
    for run in made:
        Store(LONG, out).verify(run)


def test_it_goes_on_and_ends_with_the_rows_of_an_uninterrupted_one(interrupted, whole):
    resumed = replace(LONG, out=str(interrupted[0]))
    tally = execute(resumed, Engine(1))
    assert tally.found > 0
    assert tally.done == 12 - tally.found
    assert_same_rows(whole, resumed)
