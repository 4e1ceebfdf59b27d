"""The recorder: what it writes, what it leaves behind when something goes wrong."""

import json
from pathlib import Path

import gymnasium as gym
import pytest

import sensors
import testbed  # noqa: F401  (registers the ids)
import trackers
from testbed.environment.recorder import Recorder
from testbed.evaluation.tracking import Evaluator, jsonable
from testbed.files import make_directory
from testbed.log import reader
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
    assert result["objects"] == [jsonable(row) for row in own[0].object_rows()]
    assert result["phases"] == [jsonable(row) for row in own[0].phase_rows()]


def test_each_episode_has_its_files_and_nothing_is_written_before_reset(tmp_path):
    out = tmp_path / "runs"
    env = gym.make("testbed/cut-in-v0", out=str(out), **QUICK)
    assert not out.exists()
    drive(env, seed=5)
    first = f"cut-in_{DEFAULT}_front_idm_seed5"
    assert {p.name for p in out.iterdir()} == {f"{first}.rrd"}
    env.reset()
    assert {p.name for p in out.iterdir()} == {f"{first}.rrd", f"{first}.json", f"{first}-episode1.rrd"}
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


def test_results_of_an_older_run_do_not_survive_beside_a_new_log(tmp_path):
    old = tmp_path / f"cut-in_{DEFAULT}_front_idm_seed0.json"
    old.write_text("{}")
    env = gym.make("testbed/cut-in-v0", out=str(tmp_path), **QUICK)
    env.reset(seed=0)
    assert not old.exists()
    env.close()
    assert json.loads(old.read_text())["run"]["seed"] == 0


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


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_a_full_disk_is_one_sentence(tmp_path):
    (tmp_path / f"cut-in_{DEFAULT}_front_idm_seed0.rrd").symlink_to("/dev/full")
    env = gym.make("testbed/cut-in-v0", out=str(tmp_path), **QUICK)

    def episode():
        drive(env)
        env.close()

    with pytest.raises(OSError, match=r"cannot write .*No space left on device; choose another"):
        episode()


def test_results_that_cannot_be_written_are_one_sentence(tmp_path):
    env = gym.make("testbed/cut-in-v0", out=str(tmp_path), **QUICK)
    drive(env)
    (tmp_path / f"cut-in_{DEFAULT}_front_idm_seed0.json").mkdir()
    with pytest.raises(OSError, match=r"cannot write .*json: Is a directory; choose another directory"):
        env.close()
