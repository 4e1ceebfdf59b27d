"""A law of every planner: more uncertainty never makes it act later, all else equal."""

from functools import cache

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from testbed.planners import PLANNERS, find
from testbed.planners import settings as settings_of
from testbed.planners.track_vehicle import track_vehicles
from tests.testbed.planners.roads import SPEEDS, world
from trackers.estimate import prior
from trackers.multi.tracks import Tracks

ORDER = ("SLOWER", "IDLE", "FASTER")
KEEPS_LANE = {"type": "DiscreteMetaAction", "target_speeds": SPEEDS, "lateral": False}
CONTROLS = ("mpc-cautious:margin=constant", "mpc-cautious:margin=curve", "mpc:margin=covariance")
STD = st.floats(0.05, 0.8)
VEHICLES = st.lists(  # alongside or ahead of an ego at x = 200 m, y = 4 m with 20 m/s: place, velocity, uncertainty
    st.tuples(st.floats(201, 240), st.floats(4, 9), st.floats(0, 24), st.floats(-2, 2), STD, STD),
    min_size=1, max_size=2,
)  # fmt: skip


class OfTracks(gym.Wrapper):
    """A hand-made road whose vehicles are tracks, as planners find them in a `TrackedEnv`."""

    def show(self, cases: list[tuple[float, ...]], factor: float, existence: float, age: float) -> None:
        """Put tracks on the road: variances times a factor, a probability of existence, an age [s]."""
        x, y, vx, vy, place, drift = np.array(cases).T
        n, core, wider = len(cases), self.unwrapped, np.sqrt(factor)
        estimate = prior(
            np.stack([x, y, 0 * x], -1), np.stack([vx, vy], -1), position_std=wider * place,
            velocity_std=wider * drift, size_std=wider * np.array([0.4, 0.1]), heading_std=wider * 0.1,
        )  # fmt: skip
        seen = np.full(n, 3), np.full(n, age), np.ones(n, bool)
        self.current_tracks = Tracks(np.arange(n), np.full(n, existence), *seen, estimate.pose, estimate)
        core.road.vehicles = [core.vehicle]
        core.road.vehicles += track_vehicles(core.road, np.arange(n), estimate, [core.vehicle])


@cache
def road(name: str) -> OfTracks:
    return OfTracks(world(**(settings_of(find(name)) or {"action": KEEPS_LANE})))


def chosen(name: str, env: gym.Env) -> NDArray:
    """What is chosen, the faster the greater: of pedals one number, else the acceleration and the way in the end."""
    planner = find(name)
    if settings_of(planner):
        decision = planner.decide(env)
        return np.array([decision.acceleration, decision.arc[-1]])
    return np.array([ORDER.index(env.unwrapped.action_type.actions[planner.act(env)])])


@pytest.mark.parametrize("name", [*PLANNERS, *CONTROLS])
@settings(max_examples=25)
@example([(204.0, 6.4, 5.1, -1.5, 0.6, 0.45)], 4.0, 0.99, 3.0)  # alongside, moving in by 3 standard deviations
@given(VEHICLES, st.sampled_from((1.0, 4.0)), st.sampled_from((0.99, 0.55)), st.floats(0, 20))
def test_a_planner_is_never_faster_for_knowing_less(name, cases, factor, existence, age):
    """Of profiles one that brakes less at first and more later is not faster."""
    env, found = road(name), []
    for less in ((1.0, 0.99, 3.0), (factor, existence, age)):
        env.show(cases, *less)
        found.append(chosen(name, env))
    assert (found[1] <= found[0] + 1e-9).any()


@pytest.mark.parametrize("name", ["idm", "tree", "mpc-cautious"])
def test_what_is_known_less_makes_a_planner_of_covariances_slower_somewhere(name):
    case = [(213.8, 7.6, 8.6, -0.02, 0.2, 0.2)]
    env, found = road(name), []
    for factor in (1.0, 16.0):
        env.show(case, factor, 0.99, 3.0)
        found.append(chosen(name, env)[0])
    assert found[1] < found[0]
