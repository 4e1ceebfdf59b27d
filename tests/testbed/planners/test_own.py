"""Planners of users: functions and objects with some of the methods of a planner."""

import sys

import numpy as np
import pytest

from testbed.planners import begin, find, settings
from testbed.planners.idm import Choice
from testbed.planners.registry import OwnPlanner

MODULE = """
class Counting:
    \"\"\"Counts its calls.

    More words.
    \"\"\"

    action = {"type": "ContinuousAction"}

    def __init__(self, start=0):
        self.count = start

    def begin(self, env):
        self.count = 0

    def act(self, env):
        self.count += 1
        return self.count

def act(env):
    return 3

number = 3
"""


@pytest.fixture
def _user(tmp_path, monkeypatch):
    (tmp_path / "my_planners.py").write_text(MODULE)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    yield
    sys.modules.pop("my_planners", None)


@pytest.mark.usefixtures("_user")
def test_a_function_is_a_planner():
    planner = find("my_planners:act")
    assert planner.name == "my_planners:act"
    choice = planner.choose(None)
    assert choice.action == 3
    assert choice.plan.shape == (0, 2)
    assert settings(planner) == {}
    assert not planner.knows_truth
    begin(planner, None)


@pytest.mark.usefixtures("_user")
def test_a_class_is_made_with_the_parameters_and_what_it_has_is_used():
    planner = find("my_planners:Counting:start=5")
    assert planner.name == "my_planners:Counting:start=5"
    assert planner.note == "Counts its calls."
    assert settings(planner) == {"action": {"type": "ContinuousAction"}}
    assert planner.act(None) == 6
    begin(planner, None)
    assert planner.choose(None).action == 1


def test_choose_alone_is_enough():
    class Chooses:
        def choose(self, env):
            return Choice(7, np.ones((1, 2)))

    assert OwnPlanner("mine", Chooses()).act(None) == 7


@pytest.mark.usefixtures("_user")
def test_what_is_no_planner_is_refused():
    with pytest.raises(ValueError, match="planner 'my_planners:number' is 3; it must be a function of the environment"):
        find("my_planners:number")
    with pytest.raises(LookupError, match="no planner 'idmm'; did you mean 'idm'"):
        find("idmm")


def test_planners_of_the_catalogue_take_parameters_and_are_told_apart():
    planner = find("idm:imposed_brake=4.0")
    assert planner.imposed_brake == 4.0
    assert planner.name == "idm:imposed_brake=4.0"
    with pytest.raises(ValueError, match="idm has no parameter imposed_brakes"):
        find("idm:imposed_brakes=4.0")
