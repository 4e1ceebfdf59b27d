"""A law of every planner: more uncertainty never makes it act later, all else equal."""

from dataclasses import dataclass, replace

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testbed.planners import find
from testbed.planners import settings as settings_of
from testbed.planners.mpc import Mpc, Obstacles, on_belief_road
from tests.testbed.planners.roads import SPEEDS, world

ORDER = ("SLOWER", "IDLE", "FASTER")
KEEPS_LANE = {"type": "DiscreteMetaAction", "target_speeds": SPEEDS, "lateral": False}
STD = st.floats(0.05, 0.8)
SCENES = st.tuples(  # a vehicle beside or ahead: place, speed, uncertainty
    st.floats(208, 250), st.floats(4, 8), st.floats(5, 22), st.floats(-2, 0.5), STD, STD
)


def scene(case, factor: float, **config) -> gym.Env:
    """One vehicle beside or on the path whose covariance is multiplied."""
    x, y, vx, vy, place, drift = case
    env = world({"x": x, "y": y, "vx": vx, "vy": vy}, **config)
    env.unwrapped.road.vehicles[-1].across_cov = factor * np.diag([place**2, drift**2])
    return env


@dataclass(frozen=True)
class OfTracks(Mpc):
    """The planner among obstacles of so much covariance, existence and standard deviation of the bumpers."""

    factor: float = 1.0
    existence: float = 1.0

    def obstacles(self, env: gym.Env) -> Obstacles:
        """What is on the road, as tracks."""
        sure, n = on_belief_road(env, 150.0), len(env.unwrapped.road.vehicles) - 1
        cov = self.factor * np.diag([0.3, 0.1, 0.2, 0.1])
        weight = np.minimum(np.full(n, self.existence) / 0.5, 1.0)
        return Obstacles(sure.others, weight, np.tile(cov, (n, 1, 1)), np.sqrt(self.factor) * np.full((n, 2), 0.4))


@pytest.mark.parametrize("name", ["idm", "idm-keen", "tree"])
@settings(max_examples=25)
@given(case=SCENES)
def test_a_planner_of_pedals_is_never_faster_for_knowing_less(name, case):
    planner = find(name)
    chosen = []
    for factor in (1.0, 4.0):
        env = scene(case, factor, action=KEEPS_LANE)
        chosen.append(ORDER.index(env.unwrapped.action_type.actions[planner.act(env)]))
    assert chosen[1] <= chosen[0]


@pytest.mark.parametrize("margin", ["none", "covariance", "constant", "curve"])
@settings(max_examples=25)
@given(case=SCENES)
def test_model_predictive_control_never_brakes_less_for_knowing_less(margin, case):
    planner = OfTracks(margin=margin)
    found = []
    for factor in (1.0, 4.0):
        env = scene(case, factor, **settings_of(planner))
        found.append(replace(planner, factor=factor).decide(env).acceleration)
    assert found[1] <= found[0]


def test_a_doubt_about_a_reported_track_is_no_reason_to_brake_later():
    env = scene((230.0, 4.0, 8.0, 0.0, 0.1, 0.1), 1.0, **settings_of(Mpc()))
    sure, doubted = (OfTracks(margin="covariance", existence=e).decide(env).acceleration for e in (1.0, 0.55))
    assert doubted == sure < -1.0
