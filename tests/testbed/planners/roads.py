"""Hand-made roads for planners: a straight highway with the ego in its middle lane, and what is given."""

from typing import Any

import gymnasium as gym
import numpy as np
from highway_env.vehicle.controller import MDPVehicle
from highway_env.vehicle.kinematics import Vehicle

from testbed.planners.track_vehicle import TrackVehicle

SPEEDS = [float(v) for v in np.arange(0.0, 35.1, 2.5)]


def world(*others: dict, speed: float = 20.0, lane: int = 1, name: str = "highway-v0", **config: Any) -> gym.Env:
    """A three-lane road, y = 0, 4, 8 m, with the ego at x = 200 m and others at {x, y, vx, vy, size}."""
    action = {"type": "DiscreteMetaAction", "target_speeds": SPEEDS}
    config = {"vehicles_count": 0, "lanes_count": 3, "policy_frequency": 5, "action": action, **config}
    env = gym.make(name, config=config)
    env.reset(seed=0)
    core = env.unwrapped
    core.steps = 1000  # long after the start
    if name == "highway-v0":
        at = [200.0, 4.0 * lane]
        pedals = core.config["action"]["type"] == "ContinuousAction"
        place(
            core,
            Vehicle(core.road, at, 0.0, speed) if pedals else MDPVehicle(core.road, at, 0.0, speed, None, None, SPEEDS),
        )
    for o in others:
        velocity = np.array([o.get("vx", 0.0), o.get("vy", 0.0)])
        position = np.array([o["x"], o["y"]], float)
        size = o.get("size", (4.7, 1.9))
        core.road.vehicles.append(TrackVehicle(core.road, position, speed=velocity[0], size=size, velocity=velocity))
    return env


def place(core: Any, ego: Vehicle) -> None:
    """Make a vehicle the only one on the road, and the controlled one."""
    core.road.vehicles = [ego]
    core.vehicle = ego


def blocked(y: float) -> dict:
    """A long vehicle beside the ego, so that this lane is no way out."""
    return {"x": 203.0, "y": y, "vx": 20.0, "size": (18.0, 2.5)}
