"""The cached road under highway-env's own environments: the states of the stock road, bit by bit."""

import gymnasium as gym
import numpy as np
import pytest
from highway_env.road.regulation import RegulatedRoad
from highway_env.road.road import Road

from scenarios.constants import ProtectedConstants
from scenarios.roads import CachedRegulatedRoad, CachedRoad
from testbed.environment.wrapper import TrackedEnv

IDS = {
    "highway-v0": {"vehicles_count": 15, "simulation_frequency": 5},
    "merge-v1": {},
    "roundabout-v1": {},
    "exit-v1": {"vehicles_count": 10},
    "u-turn-v1": {},
    "two-way-v0": {},
    "intersection-v2": {},
}


def true_road(env):
    """The road that is simulated; between calls the environment shows another one."""
    if not isinstance(env, TrackedEnv):
        return env.unwrapped.road
    env._swap.show()
    road = env.unwrapped.road
    env._swap.hide(env._belief_now())
    return road


def state(env):
    vehicles = true_road(env).vehicles
    moving = [(*v.position, v.heading, v.speed, v.crashed, getattr(v, "timer", 0.0)) for v in vehicles]
    return moving, [getattr(v, "target_lane_index", None) for v in vehicles]


def episodes(env, steps, seed):
    """State, observation, reward and flags of so many steps with the same actions, new episodes included."""
    rng, found = np.random.default_rng(seed), []
    with ProtectedConstants():
        env.reset(seed=seed)
        for _ in range(steps):
            env.action_space.seed(int(rng.integers(2**31)))  # a reset makes a new space
            observation, *rest, info = env.step(env.action_space.sample())
            found.append((state(env), np.asarray(observation).tobytes(), *rest, info["speed"]))
            if any(rest[1:]):
                env.reset(seed=int(rng.integers(2**31)))
    return found


def assert_equal(name, steps, seed):
    native = gym.make(name, config=IDS[name])
    tracked = TrackedEnv(gym.make(name, config=IDS[name]), tracker="truth", radar="front")
    stock = episodes(native, steps, seed)
    assert stock == episodes(tracked, steps, seed)
    assert len({str(moving) for (moving, _), *_ in stock}) == steps  # they do move
    assert type(true_road(native)) in (Road, RegulatedRoad)
    assert type(true_road(tracked)) in (CachedRoad, CachedRegulatedRoad)


@pytest.mark.parametrize("name", IDS)
def test_states_are_those_of_the_stock_environment(name):
    assert_equal(name, 6, 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", IDS)
def test_states_are_those_of_the_stock_environment_over_200_steps(name):
    assert_equal(name, 200, 1)


def test_the_stock_road_stays_where_it_is_wanted_and_where_it_is_of_another_class():
    class Own(Road):
        """A road with rules of its own."""

    env = TrackedEnv(gym.make("two-way-v0"), tracker="truth", radar="front", road="stock")
    env.reset(seed=0)
    assert type(true_road(env)) is Road
    other = TrackedEnv(gym.make("two-way-v0"), tracker="truth", radar="front")
    core = other.unwrapped
    make_vehicles = core._make_vehicles

    def make_on_own_road():
        core.road.__class__ = Own
        make_vehicles()

    core._make_vehicles = make_on_own_road
    other.reset(seed=0)
    assert type(true_road(other)) is Own
