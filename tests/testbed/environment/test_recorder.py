"""The recorder: what it writes, what it leaves behind when something goes wrong."""

import json
import os
from contextlib import suppress
from pathlib import Path

import gymnasium as gym
import pytest

import sensors
import testbed  # noqa: F401  (registers the ids)
import trackers
from testbed.environment.recorder import Recorder
from testbed.evaluation.tracking import Evaluator, jsonable
from testbed.files import ROOM, LostFileWarning, make_directory
from testbed.log import paths, reader
from testbed.log.record import RunMeta, run_id
from trackers import DEFAULT, MultiObjectTracker

QUICK = {"config": {"duration": 1.0}, "radar": "front"}


def drive(env, steps=2, seed=0):
    env.reset(seed=seed)
    for _ in range(steps):
        env.step(1)


def test_names_of_files_hold_the_settings_and_no_slash():
    assert run_id("a/b", ("x", "y"), "front", "idm", 3) == "a-b_x+y_front_idm_seed3"


def test_the_json_holds_the_metrics_of_the_evaluator(tmp_path):
    env = gym.make("testbed/cut-in-v0", tracker="rm-feldmann", out=str(tmp_path), log="off", **QUICK)
    own: list[Evaluator] = []

    def judge(frame):
        if frame.step == 0:
            own.append(Evaluator("rm-feldmann", env.recorder.phases))
        own[0].step(frame.time, frame.scene, frame.origin, frame.outputs["rm-feldmann"][0])

    env.attach(judge)
    drive(env)
    path = env.recorder.json_path
    env.close()
    result = json.loads(path.read_text())
    assert result["trackers"]["rm-feldmann"]["pairs"] > 0
    assert result["trackers"]["rm-feldmann"] == jsonable(own[0].summary())
    severity = [row.pop("severity") for row in result["objects"]]
    assert result["objects"] == [jsonable(row) for row in own[0].object_rows()]
    assert sum(m["severity"] for m in result["moments"] if m["object"] is not None) <= sum(severity) + 0.01
    assert result["phases"] == [jsonable(row) for row in own[0].phase_rows()]


def test_each_episode_has_its_files_and_nothing_is_written_before_reset(tmp_path):
    out = tmp_path / "runs"
    env = gym.make("testbed/cut-in-v0", out=str(out), **QUICK)
    assert not out.exists()
    drive(env, seed=5)
    first = f"cut-in_{DEFAULT}_front_idm_seed5_1s"
    (log,) = out.iterdir()
    assert log.match(f"{first}.unfinished-*.rrd")
    env.reset()
    assert {p.name for p in out.iterdir()} > {f"{first}.rrd", f"{first}.json"}
    assert [p.name for p in out.glob(f"{first}-episode1.*")] == [env.recorder.log.file.name]
    env.close()
    assert {p.name for p in out.glob("*.json")} == {f"{first}.json", f"{first}-episode1.json"}
    for log in out.glob("*.rrd"):
        assert reader.complete(log)


def test_closing_again_changes_nothing(tmp_path):
    env = gym.make("testbed/cut-in-v0", out=str(tmp_path), log="off", **QUICK)
    drive(env)
    recorder = env.recorder
    result = recorder.close(interrupted=True)
    before = recorder.json_path.read_bytes()
    env.close()
    assert recorder.close() is result
    assert result["interrupted"]
    assert recorder.json_path.read_bytes() == before


def test_an_interrupted_log_says_so(tmp_path):
    env = gym.make("testbed/cut-in-v0", out=str(tmp_path), **QUICK)
    drive(env)
    log = env.recorder.log.path
    env.recorder.close(interrupted=True)
    env.close()
    assert reader.events(log)[-1][2:] == ("WARN", "the run was interrupted")


class BlindAfter:
    """A tracker that drops all tracks after so many scans and finds none again."""

    def __init__(self, scans):
        self.inner = MultiObjectTracker(trackers.find("rm-feldmann"), sensors.find("ideal").models)
        self.left = scans

    def start(self):
        return self.inner.start()

    def step(self, tracks, scan, dt):
        self.left -= 1
        tracks, info = self.inner.step(tracks, scan, dt)
        return (tracks if self.left >= 0 else self.inner.start()), info


def test_an_object_is_logged_as_lost_one_second_after_its_last_track(tmp_path):
    """15 scans a second: scans 0 to 9 have tracks, scan 10 is the first without, and 15 scans later they are lost."""
    frames = {"simulation_frequency": 15, "policy_frequency": 5, "duration": 2.0}
    env = gym.make("testbed/following-v0", tracker=BlindAfter(10), radar="ideal", config=frames, out=str(tmp_path))
    env.reset(seed=0)
    for _ in range(9):
        env.step(1)
    log = env.recorder.log.path
    env.close()
    lost = [event.step for event in reader.events(log) if " lost, was track " in event.text]
    assert len(lost) > 1
    assert min(lost) == 10 + 15


NAME = f"cut-in_{DEFAULT}_front_idm_seed0_1s"


def older_run(folder):
    """Files of an older run of the same name."""
    files = [folder / f"{NAME}.json", folder / f"{NAME}.rrd"]
    for file in files:
        file.write_text("old")
    return files


def test_files_of_an_older_run_stay_until_those_of_the_new_one_are_complete(tmp_path):
    results, log = older_run(tmp_path)
    env = gym.make("testbed/cut-in-v0", out=str(tmp_path), **QUICK)
    drive(env)
    assert (results.read_text(), log.read_text()) == ("old", "old")
    env.close()
    assert json.loads(results.read_text())["run"]["seed"] == 0
    assert reader.complete(log)
    assert sorted(tmp_path.iterdir()) == [results, log]


def test_a_name_has_the_duration_where_it_is_not_the_scenarios_own(tmp_path):
    settings = {"radar": "front", "log": "off", "out": str(tmp_path)}
    for config in ({}, {"duration": 20.0}, {"duration": 1}, {"duration": 1.25}):
        env = gym.make("testbed/cut-in-v0", config=config, **settings)
        env.reset(seed=0)
        env.close()
    assert {path.stem.partition("seed0")[2] for path in tmp_path.iterdir()} == {"", "_1s", "_1.25s"}


@pytest.mark.parametrize("kept", ["off", "metrics", "full"])
def test_levels_of_the_log(tmp_path, kept):
    env = gym.make("testbed/cut-in-v0", out=str(tmp_path), log=kept, **QUICK)
    drive(env)
    env.close()
    assert len(list(tmp_path.glob("*.json"))) == 1
    logs = list(tmp_path.glob("*.rrd"))
    assert len(logs) == (kept != "off")
    for log in logs:
        drawn = any(entity.startswith("world/") for entity in reader.entity_paths(log))
        assert drawn == (kept == "full")


def test_an_unknown_level_is_one_sentence(tmp_path):
    with pytest.raises(ValueError, match="log must be one of off, metrics, full, got 'loud'"):
        gym.make("testbed/cut-in-v0", out=str(tmp_path), log="loud", **QUICK)


def test_the_object_in_focus_reaches_the_log(tmp_path):
    """A log refuses a focus that is not in the scene, so the error shows that the focus reached it."""
    env = gym.make("testbed/cut-in-v0", **QUICK)
    meta = RunMeta("a", "cut-in", 0, "front", (DEFAULT,), "idm", {}, {})
    env.attach(Recorder(meta, tmp_path, focus=999))
    with pytest.raises(ValueError, match=r"focus must be an object of the first scene, .* got 999"):
        env.reset(seed=0)


@pytest.mark.parametrize("below", [False, True])
def test_a_file_in_the_way_is_one_sentence(tmp_path, below):
    there = tmp_path / "file"
    there.touch()
    with pytest.raises(OSError, match=r"out: cannot write to .*; choose another directory"):
        make_directory(there / "sub" if below else there)


def test_checking_a_directory_leaves_nothing_in_it(tmp_path):
    make_directory(tmp_path / "a" / "b")
    assert list((tmp_path / "a" / "b").iterdir()) == []


def nameless_files(folder):
    """Size [bytes] of each open file in a folder that has no name."""
    sizes = []
    for number in os.listdir("/proc/self/fd"):
        with suppress(OSError):
            if Path(os.readlink(f"/proc/self/fd/{number}")).parent == folder:
                found = os.stat(f"/proc/self/fd/{number}")
                sizes += [found.st_size] if found.st_nlink == 0 else []
    return sizes


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="this system does not list open files")
def test_room_for_the_results_is_kept_until_they_are_written(tmp_path):
    env = gym.make("testbed/cut-in-v0", out=str(tmp_path), log="off", **QUICK)
    env.reset(seed=0)
    recorder = env.recorder
    assert nameless_files(tmp_path) == [ROOM]
    recorder.close()
    assert nameless_files(tmp_path) == []
    env.close()


def test_a_disk_without_room_for_the_beginning_of_the_log_is_one_sentence(tmp_path, limit_files):
    env = gym.make("testbed/cut-in-v0", **QUICK)
    env.attach(Recorder(RunMeta("a", "cut-in", 0, "front", (DEFAULT,), "idm", {}, {}), tmp_path))
    refused = pytest.raises(OSError, match=r"^cannot write the log .*a\.rrd: File too large; choose another directory$")
    with limit_files(1000), refused:
        env.reset(seed=0)
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_ends_the_log_with_a_warning_and_the_run_goes_on(tmp_path, limit_files):
    env = gym.make("testbed/cut-in-v0", out=str(tmp_path), **QUICK)
    env.reset(seed=0)
    recorder = env.recorder

    def go_on():
        for _ in range(5):
            env.step(1)

    with limit_files(recorder.log.file.stat().st_size + 1000):
        sentence = r"^cannot write the log .*: File too large; it ends at 0\.0 s$"
        with pytest.warns(LostFileWarning, match=sentence) as told:
            go_on()
        env.close()
    assert recorder.lost == [str(told[0].message)]
    assert json.loads((tmp_path / f"{NAME}.json").read_text())["drive"]["elapsed"] == pytest.approx(1.0)
    assert not reader.complete(tmp_path / f"{NAME}.rrd")


def test_results_that_cannot_be_written_are_one_sentence_and_older_ones_stay(tmp_path, limit_files):
    results, log = older_run(tmp_path)
    env = gym.make("testbed/cut-in-v0", out=str(tmp_path), log="metrics", **QUICK)
    drive(env)
    recorder = env.recorder
    with (
        limit_files(1000),
        pytest.warns(LostFileWarning, match="cannot write the log"),
        pytest.raises(OSError, match=r"^cannot write .*json: File too large; choose another directory$"),
    ):
        env.close()
    assert (results.read_text(), log.read_text()) == ("old", "old")
    assert len(recorder.lost) == 1
    assert sorted(tmp_path.iterdir()) == sorted([results, log, recorder.log.file])


@pytest.mark.parametrize("suffix", ["json", "rrd"])
@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("kept")])
def test_what_is_no_file_of_ours_is_refused_before_the_run(tmp_path, suffix, make):
    make(tmp_path / f"{NAME}.{suffix}")
    env = gym.make("testbed/cut-in-v0", out=str(tmp_path), **QUICK)
    with pytest.raises(OSError, match=rf"^cannot write .*{suffix}: it is a .*; choose another file$"):
        env.reset(seed=0)
    assert [path.name for path in tmp_path.iterdir()] == [f"{NAME}.{suffix}"]


def test_the_log_has_the_risk_ahead_and_says_once_when_hard_braking_is_needed(tmp_path):
    env = gym.make("testbed/probe-brake-v0", tracker="truth", out=str(tmp_path), log="metrics", radar="front")
    frames = []
    env.attach(lambda frame: frames.append(frame.step))
    env.reset(seed=0)
    needed = [env.step(1)[-1]["drive"]["drac"] for _ in range(27)]  # 5.4 s at constant speed, not yet at the leader
    env.close()
    (log,) = tmp_path.glob("*.rrd")
    steps, drac = reader.scalars(log, paths.EGO_DRAC)[paths.EGO_DRAC]
    assert steps.tolist() == frames
    assert drac[3::3].tolist() == needed
    assert [event.level for event in reader.events(log) if "braking with" in event.text] == ["WARN"]
    assert needed[-1] > 8.0


def test_faults_are_events_of_the_log_and_part_of_names_and_results(tmp_path):
    faults = ["front:outage:0.3:0.6", "drop:0.2:0.5:9"]
    env = gym.make("testbed/cut-in-v0", tracker="rm-koch", out=str(tmp_path), log="metrics", faults=faults, **QUICK)
    drive(env, 5)
    path = env.recorder.json_path
    env.close()
    assert path.name == "cut-in_rm-koch_front_idm_seed0_1s_front~outage~0.3~0.6+drop~0.2~0.5~9.json"
    assert json.loads(path.read_text())["run"]["config"]["faults"] == faults
    found = [(round(e.time, 1), e.level, e.text) for e in reader.events(path.with_suffix(".rrd")) if "fault" in e.text]
    assert found == [
        (0.3, "WARN", "fault front:outage:0.3:0.6 begins"),
        (0.5, "WARN", "fault drop:0.2:0.5:9 begins"),
        (0.6, "INFO", "fault front:outage:0.3:0.6 ends"),
    ]
