"""Faults of a user's tracker, planner or policy in runs: one sentence, and what was measured until then is kept."""

import json
import sys
from copy import deepcopy

import gymnasium as gym
import numpy as np
import pytest
from typer.testing import CliRunner

import trackers
from testbed.cli import app
from testbed.environment.validation import WrongTracks, check_output
from testbed.experiments.episode import episode
from testbed.experiments.run import FAILED, Outcome, Run, outcome_of
from testbed.experiments.single import RunConfig, run
from testbed.planners.learned import save_policy
from testbed.replay.recording import record
from tests.testbed.environment.test_wrapper import OneTrack
from trackers.scan import SensorModel

MINE = '''
"""Trackers and planners with one fault each."""
import numpy as np
from tests.testbed.environment.test_wrapper import OneTrack

class Whole(OneTrack):
    """Reports a car 12 m ahead."""
    def __init__(self):
        super().__init__([12.0, 0.0, 0.0], [3.0, 0.0])

class Late(Whole):
    """Diverges after ten scans."""
    def step(self, tracks, scan, dt):
        new, info = super().step(tracks, scan, dt)
        pose = new.estimate.pose * (np.nan if len(self.dts) > 10 else 1.0)
        return new._replace(estimate=new.estimate._replace(pose=pose)), info

class Degrees(Whole):
    """Takes the heading for degrees."""
    def step(self, tracks, scan, dt):
        new, info = super().step(tracks, scan, dt)
        return new._replace(estimate=new.estimate._replace(pose=new.estimate.pose + [0.0, 0.0, 90.0])), info

class SameIds(Whole):
    """Two tracks of one id."""
    def step(self, tracks, scan, dt):
        new, info = super().step(tracks, scan, dt)
        both = new.rows(np.array([0, 0]))
        return both, info

def wild(env):
    """Steers by an array."""
    return np.array([1, 2]) if env.unwrapped.steps > 5 else 1
'''


@pytest.fixture
def user(tmp_path, monkeypatch):
    (tmp_path / "my_faults.py").write_text(MINE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    yield tmp_path
    sys.modules.pop("my_faults", None)


def call(*arguments):
    return CliRunner().invoke(app, arguments, env={"COLUMNS": "200"})


def test_tracks_that_become_nan_end_the_run_in_one_sentence_and_leave_its_files(user):
    done = call("run", "cut-in", "--tracker", "my_faults:Late", "--duration", "2", "--log", "metrics")
    assert done.exit_code == 2
    sentences = [line for line in done.stderr.splitlines() if line.startswith("testbed: ")]
    assert sentences == [
        "testbed: tracker my_faults:Late, step 10 (0.67 s): x of track 1 is nan; it must be finite; "
        "the run ends at 0.67 s"
    ]
    assert "Traceback" not in done.output
    (found,) = (user / "runs").glob("*.json")
    kept = json.loads(found.read_text())
    assert kept["interrupted"]
    assert kept["trackers"]["my_faults:Late"]["gospa"] > 0
    assert len(list((user / "runs").glob("*.rrd"))) == 1
    assert not list((user / "runs").glob("*unfinished*"))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--planner", "my_faults:wild"), "action array([1, 2]) is not in the action space Discrete(5)"),
        (("--planner", "learned:p.npz"), "needs an observation of 25 numbers and 3 discrete actions, got 70"),
        (("--planner", "learned:p.npz", "--config", "c.json"), "25 numbers and 3 discrete actions, got 70"),
        (("--tracker", "my_faults:Degrees"), "heading of track 1 is 90; it must be in rad and within a turn"),
        (("--tracker", "my_faults:SameIds"), "id 1 stands for 2 of 2 tracks; each needs an id of its own"),
    ],
    ids=["action", "policy", "policy with a config", "degrees", "ids"],
)
def test_what_does_not_fit_is_one_sentence_and_exit_status_2(user, options, words):
    save_policy("p.npz", [(np.zeros((3, 25)), np.zeros(3))], activation="relu")
    (user / "c.json").write_text('{"duration": 5}')
    tracker = () if "--tracker" in options else ("--tracker", "my_faults:Whole")
    done = call("run", "cut-in", "--duration", "1", "--log", "off", *tracker, *options)
    assert done.exit_code == 2
    assert words in done.stderr
    assert done.stderr.count("testbed: ") == 1
    assert "Traceback" not in done.output


def test_a_tracker_without_faults_runs_to_the_end(user):
    result = run(RunConfig("cut-in", ("my_faults:Whole",), duration=1.0, log="off", out="runs"))
    assert (result.exit_status, result.lost, result.interrupted) == (0, (), False)


def test_a_replay_keeps_what_was_tracked_until_then(user):
    assert call("record", "lone-leader", "--duration", "2", "--out", "drive").exit_code == 0
    done = call("replay", "drive", "--tracker", "my_faults:Late", "--log", "off")
    assert done.exit_code == 2
    assert "x of track 1 is nan; it must be finite; the replay ends after 10 of" in done.stderr
    assert "Traceback" not in done.output
    assert len(list((user / "runs").glob("*.json"))) == 1


@pytest.mark.parametrize("loop", ["open", "closed"])
def test_a_run_of_a_comparison_fails_with_the_sentence_alone(user, loop):
    """So the tables of a comparison have no row of such a tracker, and no verdict."""
    made = Run("lone-leader", source="my_faults:SameIds", duration=0.4, loop=loop)
    drive = record("lone-leader", 0, "surround", 0.4) if loop == "open" else None
    found = outcome_of("it", lambda: episode(made, [], drive) and "")
    sentence = "step 0 (0.00 s): id 1 stands for 2 of 2 tracks; each needs an id of its own"
    assert found == Outcome("it", FAILED, f"tracker my_faults:SameIds, {sentence}")


def test_what_a_step_returns_fits_the_scan_and_may_be_known_exactly():
    step = trackers.build("rm-koch", (SensorModel(),))
    scan = trackers.Scan.from_xy(np.array([[10.0, 0.0], [10.0, 0.5], [10.5, 0.2]]))
    tracks = step.start()
    for k in range(5):
        output = step.step(tracks, scan, 0.1 * bool(k))
        check_output(output, 3, "rm-koch", f"step {k}")
        tracks = output[0]
    assert len(tracks.id) == 1
    with pytest.raises(WrongTracks, match=r"^tracker t, step 4: owner of its StepInfo has the shape \(3,\), not"):
        check_output(output, 4, "t", "step 4")
    with pytest.raises(WrongTracks, match="t, step 4: tracks must be Tracks of an Estimate, got NoneType"):
        check_output((None, output[1]), 3, "t", "step 4")
    singular = tracks._replace(estimate=tracks.estimate._replace(cov=np.zeros((1, 4, 4))))
    check_output((singular, output[1]), 3, "t", "step 4")  # what is known exactly
    classified = tracks._replace(estimate=tracks.estimate._replace(class_probability=np.array([[0.4, 0.6]])))
    check_output((classified, output[1]), 3, "t", "step 4")  # without names
    named = classified._replace(memory=tracks.memory._replace(classes=("car", "bus", "van")))
    with pytest.raises(WrongTracks, match=r"class_probability has the shape \(1, 2\), and .* names car, bus, van$"):
        check_output((named, output[1]), 3, "t", "step 4")


def test_a_start_that_returns_no_tracks_is_refused(user):
    class NoStart(OneTrack):
        def start(self):
            return None

    env = gym.make("testbed/lone-leader-v0", tracker=NoStart([12.0, 0.0, 0.0], [3.0, 0.0]))
    with pytest.raises(WrongTracks, match="tracker NoStart, start: tracks must be Tracks"):
        env.reset(seed=0)


@pytest.mark.parametrize("kind", ["DiscreteMetaAction", "ContinuousAction"])
@pytest.mark.parametrize("action", [np.zeros(3), np.array([1, 2]), "LANE_LEFT", [[0.0, 0.0]], np.full(2, np.nan), 1j])
def test_an_action_of_a_wrong_shape_is_refused_by_an_environment_and_by_its_copies(kind, action):
    env = gym.make("testbed/lone-leader-v0", tracker="truth", config={"action": {"type": kind}})
    env.reset(seed=0)
    for one in (env, deepcopy(env)):
        with pytest.raises(
            gym.error.InvalidAction, match=r"^action .* is not in the action space .*sample\(\) is one$"
        ):
            one.step(action)
        assert one.unwrapped.steps == 0
