"""Files of stable-baselines3 as planners; those in `policies` are of its version 2.9.2, cut to what is read."""

import io
import json
import pickle
import zipfile
from pathlib import Path

import gymnasium as gym
import highway_env
import numpy as np
import pytest
from typer.testing import CliRunner

from testbed.cli import app
from testbed.experiments.identity import own_names
from testbed.limits import UnfitPolicy
from testbed.planners import find
from testbed.planners.stable_baselines import read

gym.register_envs(highway_env)
POLICIES = Path(__file__).parent / "policies"
PREDICTED = json.loads((POLICIES / "predicted.json").read_text())  # deterministic actions, by that library itself
ALGORITHMS = sorted(PREDICTED)


@pytest.fixture
def env():
    made = []

    def make(algorithm):
        action = "ContinuousAction" if algorithm == "sac" else "DiscreteMetaAction"
        made.append(gym.make("highway-fast-v0", config={"action": {"type": action}}))
        made[-1].reset(seed=3)
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_policy_acts_as_the_library_says(algorithm, env):
    planner = find(f"sb3:{POLICIES / algorithm}.zip")
    assert planner.name == f"sb3-{algorithm}"
    assert algorithm.upper() in planner.note
    one = env(algorithm)
    np.testing.assert_allclose(one.unwrapped.observation_type.observe(), PREDICTED[algorithm]["observation"], atol=1e-5)
    np.testing.assert_allclose(planner.act(one), PREDICTED[algorithm]["action"], atol=1e-5)
    assert one.action_space.contains(planner.choose(one).action)


def test_the_activation_of_the_file_counts():
    assert read(POLICIES / "dqn.zip").network.activations == (
        "tanh",
        "tanh",
    )  # the library has ReLU where none is given
    assert read(POLICIES / "ppo.zip").network.activations == ("tanh", "tanh")
    assert read(POLICIES / "sac.zip").network.activations == ("relu", "relu")


@pytest.mark.parametrize(
    ("config", "got"),
    [
        (
            {"observation": {"type": "Kinematics", "vehicles_count": 7}},
            r"shape \(5, 5\) and 5 discrete actions, got \(7, 5\)",
        ),
        (
            {"action": {"type": "DiscreteMetaAction", "lateral": False}},
            r"5 discrete actions, got \(5, 5\) and Discrete\(3\)",
        ),
    ],
)
def test_another_observation_or_action_is_refused(config, got):
    env = gym.make("highway-fast-v0", config=config)
    env.reset(seed=0)
    with pytest.raises(UnfitPolicy, match=got):
        find(f"sb3:{POLICIES / 'dqn.zip'}").act(env)
    env.close()


def changed(tmp_path, weights=None, **about):
    """A copy of a file with other things in it."""
    with zipfile.ZipFile(POLICIES / "dqn.zip") as old, zipfile.ZipFile(tmp_path / "new.zip", "w") as new:
        new.writestr("data", json.dumps(json.loads(old.read("data")) | about))
        new.writestr("policy.pth", old.read("policy.pth") if weights is None else weights)
    return tmp_path / "new.zip"


def torch_file(value):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("policy/data.pkl", pickle.dumps(value))
    return file.getvalue()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"policy_class": {"__module__": "sb3_contrib.qrdqn.policies"}}, "is of SB3_CONTRIB; known are DQN, PPO"),
        ({"policy_class": {}}, "is of an unknown algorithm"),
        ({"policy_kwargs": {"activation_fn": "<class 'torch.nn.modules.activation.ELU'>"}}, "ELU|elu"),
        ({"policy_class": {"__module__": "stable_baselines3.sac.policies"}}, "not of layers alone; train MlpPolicy"),
        ({"weights": b"no zip"}, "holds no policy of stable-baselines3: File is not a zip file"),
        ({"weights": torch_file({"a": Path("x")})}, "an object pathlib.*, which is no array"),
    ],
)
def test_what_is_no_policy_is_said_in_a_sentence(change, said, tmp_path):
    with pytest.raises(ValueError, match=said) as raised:
        read(changed(tmp_path, **change))
    assert "\n" not in str(raised.value)


def test_nothing_of_a_file_runs(tmp_path):
    class Bomb:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "gone off",))

    with pytest.raises(ValueError, match="which is no array"):
        read(changed(tmp_path, torch_file({"q_net.q_net.0.weight": Bomb()})))
    assert not (tmp_path / "gone off").exists()


def test_a_file_that_is_not_there_is_one_sentence_of_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["run", "highway-fast-v0", "--planner", "sb3:gone.zip"])
    assert done.exit_code == 2
    assert "policy 'gone.zip' cannot be read: No such file" in done.output
    assert own_names(planners=["sb3:gone.zip"]) == []


def test_a_run_is_driven_by_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    planner = f"sb3:{POLICIES / 'dqn.zip'}"
    call = ["run", "highway-fast-v0", "--planner", planner, "--tracker", "rm-koch", "--duration", "1", "--log", "off"]
    done = CliRunner().invoke(app, call)
    assert done.exit_code == 0, done.output
