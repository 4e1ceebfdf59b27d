"""Kinematic observations without data frames: the numbers of highway-env, last bit included."""

import gymnasium as gym
import highway_env  # noqa: F401 - registers the ids
import numpy as np
import pytest
from highway_env.envs.common.observation import KinematicObservation, observation_factory
from highway_env.vehicle.objects import Obstacle

from testbed.environment.observation import ColumnKinematics, every_part, without_frames

ALL = ["presence", "x", "y", "vx", "vy", "heading", "cos_h", "sin_h", "cos_d", "sin_d", "long_off", "lat_off"]


def scene(seed=3):
    """A highway with an obstacle beside the ego vehicle; obstacles have fewer features than vehicles."""
    env = gym.make("highway-v0", config={"vehicles_count": 12, "simulation_frequency": 5}).unwrapped
    env.reset(seed=seed)
    env.road.objects.append(Obstacle(env.road, env.vehicle.position + np.array([15.0, 4.0])))
    return env


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"features": ALL, "see_behind": True},
        {"features": ALL, "normalize": False, "vehicles_count": 30},
        {"features": ALL, "observe_intentions": True, "absolute": True},
        {"features": ["presence", "vx", "x"], "features_range": {"presence": [0, 2], "x": [-9.0, 9.0]}, "clip": False},
        {"order": "shuffled", "vehicles_count": 6, "include_obstacles": False},
        {"vehicles_count": 1},
    ],
)
def test_every_option_gives_the_numbers_of_highway_env(options):
    env = scene()
    stock, plain = (observation_factory(env, {"type": "Kinematics", **options}) for _ in range(2))
    without_frames(plain)
    for _ in range(3):
        state = env.np_random.bit_generator.state
        expected = stock.observe()
        env.np_random.bit_generator.state = state
        seen = plain.observe()
        np.testing.assert_array_equal(seen, expected)
        assert seen.dtype == expected.dtype
        env.step(1)


def test_only_stock_kinematics_are_turned():
    config = {"type": "TupleObservation", "observation_configs": [{"type": "Kinematics"}, {"type": "OccupancyGrid"}]}
    both = observation_factory(scene(), config)
    without_frames(both)
    kinds = [type(part).__name__ for part in every_part(both)]
    assert kinds == ["TupleObservation", "ColumnKinematics", "OccupancyGridObservation"]
    own = type("Own", (KinematicObservation,), {})(scene())
    without_frames(own)
    assert not isinstance(own, ColumnKinematics)
