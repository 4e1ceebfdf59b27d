"""Environments of users on the base of highway-env as scenarios: an id, a class, a function."""

import sys

import gymnasium as gym
import pytest

from testbed.environment.registration import make, scenario_of
from testbed.experiments.identity import own_code, own_module, own_names

MODULE = """
import gymnasium as gym
from highway_env.envs.highway_env import HighwayEnv
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.objects import RoadObject


class Bus(IDMVehicle):
    LENGTH, WIDTH = 11.0, 2.5


class Bike(IDMVehicle):
    LENGTH, WIDTH = 2.1, 0.8


class Crate(RoadObject):
    LENGTH, WIDTH = 1.0, 1.0

    def __init__(self, road, position):
        super().__init__(road, position)


class Mixed(HighwayEnv):
    @classmethod
    def default_config(cls):
        return {**super().default_config(), "vehicles_count": 1, "duration": 3, "crates": 1}

    def _create_vehicles(self):
        super()._create_vehicles()
        for kind in (Bus, Bike):
            self.road.vehicles.append(kind.create_random(self.road, spacing=1))
        for _ in range(self.config["crates"]):
            self.road.objects.append(Crate(self.road, [self.vehicle.position[0] + 30.0, 0.0]))


def narrow(config=None):
    return gym.wrappers.TimeLimit(Mixed(config={"lanes_count": 2, **(config or {})}), 50)


def deaf():
    return Mixed()


gym.register("mixed-v0", entry_point=Mixed)
"""


@pytest.fixture
def module(tmp_path, monkeypatch):
    (tmp_path / "my_envs.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    sys.modules.pop("my_envs", None)
    gym.registry.pop("mixed-v0", None)


@pytest.mark.parametrize("name", ["my_envs:Mixed", "my_envs:narrow", "my_envs:mixed-v0"])
def test_an_environment_of_a_user_runs_and_its_vehicles_are_what_they_are(name, module):
    text = f"{name}:crates=2"
    found = scenario_of(text)
    assert (found.name, found.duration, found.values) == (text, 3.0, {"crates": 2})
    env = make(text, {"vehicles_count": 2}, tracker="truth", log="off")
    env.reset(seed=0)
    assert sorted(env.truth.objects.kind) == ["car", "car", "motorcycle", "obstacle", "obstacle", "truck"]
    assert env.unwrapped.config["lanes_count"] == (2 if "narrow" in name else 4)
    env.step(env.action_space.sample())
    env.close()


@pytest.mark.parametrize("name", ["my_envs:Mixed", "my_envs:narrow", "my_envs:mixed-v0"])
def test_its_code_counts_for_a_study(name, module):
    assert own_module(name, "scenario") == "my_envs"
    assert own_module("highway-v0:lanes_count=2", "scenario") is None
    names = own_names(scenarios=[name, "cut-in", "highway-v0"])
    assert names == [("scenario", name)]
    before = own_code(names)
    (module / "my_envs.py").write_text(MODULE.replace("30.0", "31.0"))
    assert own_code(names) != before


@pytest.mark.parametrize(
    ("text", "fault", "sentence"),
    [
        ("my_envs:Mixed:crate=2", ValueError, "my_envs:Mixed has no config crate; it has "),
        ("my_envs:Bus", ValueError, "is Bus, which is no environment on the base of highway-env"),
        ("my_envs:deaf", ValueError, "its class or a function of a config"),
        ("my_envs:other-v0", LookupError, "no scenario 'other-v0'"),
        ("no_envs:other-v0", LookupError, "there is no module 'no_envs'"),
        ("CartPole-v1", ValueError, "CartPoleEnv, which is no environment on the base of highway-env"),
    ],
)
def test_what_is_no_such_environment_is_said_in_a_sentence(text, fault, sentence, module):
    with pytest.raises(fault) as caught:
        scenario_of(text)
    assert sentence in str(caught.value)
