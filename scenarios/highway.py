"""The highway-env environment of a scenario: time, spaces, reward and end of an episode."""

from collections.abc import Mapping
from copy import copy
from math import inf
from typing import Any

import numpy as np
from highway_env.envs.common.abstract import AbstractEnv
from highway_env.envs.common.action import DiscreteMetaAction
from highway_env.envs.common.finite_mdp import finite_mdp
from highway_env.vehicle.objects import Obstacle
from numpy.typing import NDArray

from scenarios.bodies import parts
from scenarios.corridor import drive_value, gap_ahead, time_to_collision
from scenarios.record import Scenario
from scenarios.registry import find
from scenarios.stage import TARGET_SPEEDS, Phase, maneuver_end
from scenarios.vehicles import PedalEgo
from trackers.geometry import box_corners, unit

FEATURES = ("presence", "x", "y", "vx", "vy", "cos_h", "sin_h")
SPEED_RANGE = (0.0, 30.0)  # [m/s] over which the reward rises
MAX_FREQUENCY = 100  # [Hz] of simulated frames: no automotive radar scans faster, and each frame is a scan
REWARDS = ("speed", "drive")  # speed as a share of the range; the drive value
UNUSED = "other_vehicles_type"  # a key of every environment of highway-env
ACTION_TYPES = ("ContinuousAction", "DiscreteAction", "DiscreteMetaAction")


def is_positive(value: Any) -> bool:
    """Whether a value is a positive, finite number."""
    number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    return bool(number and 0 < value < inf)


def check_clock(config: Mapping[str, Any]) -> None:
    """Raise ValueError for frequencies with which no frame, or far too many, are simulated; any highway-env config."""
    for key in ("simulation_frequency", "policy_frequency"):
        if not is_positive(config[key]):
            raise ValueError(f"config[{key!r}] must be positive and finite, got {config[key]!r}; give it in Hz")
    simulation, policy = config["simulation_frequency"], config["policy_frequency"]
    if simulation > MAX_FREQUENCY:
        raise ValueError(f"config['simulation_frequency'] must be at most {MAX_FREQUENCY} Hz, got {simulation} Hz")
    if policy > simulation:
        raise ValueError(f"policy_frequency {policy} Hz must not exceed simulation_frequency {simulation} Hz")


def build_config(default: dict[str, Any], config: dict[str, Any] | None) -> dict[str, Any]:
    """The default with the given keys replaced; unknown keys and frequencies that do not divide are errors.

    Nested dicts (observation, action) replace the default as a whole, as everywhere in highway-env.
    """
    unknown = sorted(set(config or {}) - set(default))
    if unknown:
        raise ValueError(f"config has no key {', '.join(map(repr, unknown))}; known: {', '.join(sorted(default))}")
    merged = {**default, **(config or {})}
    if merged[UNUSED] != default[UNUSED]:
        raise ValueError(f"config[{UNUSED!r}] is not used by scenarios, which choose their vehicles; leave the key out")
    for key in ("observation", "action"):
        if not isinstance(merged[key], dict) or "type" not in merged[key]:
            raise ValueError(f"config[{key!r}] must be a whole dict with its 'type', got {merged[key]!r}")
    action = merged["action"]
    if action["type"] not in ACTION_TYPES:
        raise ValueError(f"config['action'] must have a type of {', '.join(ACTION_TYPES)}, got {action['type']!r}")
    if action.get("dynamical"):
        raise ValueError("config['action'] must not be dynamical, the ego is a kinematic bicycle; leave the key out")
    check_clock(merged)
    simulation, policy = merged["simulation_frequency"], merged["policy_frequency"]
    if simulation % policy != 0:
        raise ValueError(f"policy_frequency {policy} Hz must divide simulation_frequency {simulation} Hz")
    if merged["reward"] not in REWARDS:
        raise ValueError(f"config['reward'] must be one of {', '.join(REWARDS)}, got {merged['reward']!r}")
    if not is_positive(merged["duration"]):
        raise ValueError(f"config['duration'] must be positive and finite, got {merged['duration']!r}; give seconds")
    if merged["after"] is not None and not is_positive(merged["after"]):
        raise ValueError(f"config['after'] must be positive and finite, got {merged['after']!r}; give seconds or None")
    return merged


class ScenarioEnv(AbstractEnv):
    """One scenario; `scenario` is a name of the catalogue or a `Scenario`.

    After a reset, `walls` (W, 2, 2) [m] are the guard rails and `phases` the parts of the maneuver.
    """

    config: dict[str, Any]
    walls: NDArray
    phases: tuple[Phase, ...]

    def __init__(
        self,
        scenario: str | Scenario = "cut-in",
        config: dict[str, Any] | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.scenario = find(scenario) if isinstance(scenario, str) else scenario
        super().__init__(config, render_mode)  # builds the first world, so the scenario must be known

    @classmethod
    def default_config(cls) -> dict[str, Any]:
        """Kinematics of ten vehicles around the ego, meta-actions in steps of 2.5 m/s, 15 and 5 Hz."""
        return {
            **super().default_config(),
            "observation": {
                "type": "Kinematics",
                "vehicles_count": 10,
                "features": list(FEATURES),
                "see_behind": True,
            },
            "action": {"type": "DiscreteMetaAction", "target_speeds": list(TARGET_SPEEDS)},
            "simulation_frequency": 15,
            "policy_frequency": 5,
            "duration": 20.0,  # [s]
            "after": None,  # [s] from the end of the maneuver, at which an episode ends where `duration` is longer
            "reward": "speed",
            "collision_reward": 0.0,  # what a step that ends in a crash is worth
            "neighbour_vehicles_connected_lanes": True,
        }

    def configure(self, config: dict[str, Any] | None) -> None:
        """Take over a config after checking it; what the scenario sets holds unless the config names it."""
        if self.config == self.default_config():
            self.config |= {"duration": self.scenario.duration, **self.scenario.defaults}
            if not self.scenario.lateral:
                self.config["action"] = {**self.config["action"], "lateral": False}
        self.config = build_config(self.config, config)
        super().configure(None)

    def _reset(self) -> None:
        values = {key: self.config[key] for key in self.scenario.defaults}
        world = self.scenario.build(self.scenario.stream(self.np_random), values)
        self.road, self.walls, self.phases = world.road, world.walls, world.phases
        self.vehicle = world.ego
        if self.config["action"]["type"] != "DiscreteMetaAction":
            self.vehicle = PedalEgo.create_from(world.ego)
            self.road.vehicles = [self.vehicle if v is world.ego else v for v in self.road.vehicles]
            return
        speeds = self.config["action"].get("target_speeds")
        if speeds is not None:
            world.ego.target_speeds = np.asarray(speeds, float)
            world.ego.speed_index = world.ego.speed_to_index(world.ego.speed)
            world.ego.target_speed = world.ego.index_to_speed(world.ego.speed_index)

    def _rewards(self, action: Any) -> dict[str, float]:
        low, high = SPEED_RANGE
        speed = float(self.vehicle.speed * np.cos(self.vehicle.lane_offset[2]))
        return {
            "speed": float(np.clip((speed - low) / (high - low), 0.0, 1.0)),
            "crashed": float(self.vehicle.crashed),
        }

    def _reward(self, action: Any) -> float:
        """What the step was worth: `collision_reward` after a crash, else by `config["reward"]`; docs/contract.md."""
        if self.vehicle.crashed:
            return float(self.config["collision_reward"])
        if self.config["reward"] == "drive":
            return self._drive_value() / self.config["policy_frequency"]
        return self._rewards(action)["speed"]

    def _drive_value(self) -> float:
        """Rate of the drive value now (MET.28)."""
        ego, direction = self.vehicle, unit(self.vehicle.heading)
        others = [v for v in self.road.vehicles if v is not ego]
        others += [o for o in self.road.objects if isinstance(o, Obstacle) and o.solid]
        bodies = [part for v in others for part in parts(v)]
        pose = np.array([b.pose for b in bodies]).reshape(-1, 3)
        size = np.array([b.size for b in bodies]).reshape(-1, 2)
        closing = (ego.velocity - np.array([b.velocity for b in bodies]).reshape(-1, 2)) @ direction
        own = np.array([*ego.position, ego.heading])
        gap = gap_ahead(own, np.array([ego.LENGTH, ego.WIDTH]), box_corners(pose, size))
        ttc = np.min(time_to_collision(gap, closing), initial=inf)
        braking = max(0.0, -float(ego.action["acceleration"]))
        return float(drive_value(ego.velocity @ direction, ttc, np.asarray(braking)))

    def _is_terminated(self) -> bool:
        return bool(self.vehicle.crashed)

    def _is_truncated(self) -> bool:
        """Time is over, by the frame counter: highway-env's own clock may drift."""
        return bool(self.steps >= round(self._length * self.config["simulation_frequency"]))

    @property
    def _length(self) -> float:
        """Time [s] at which the episode is over."""
        after, end = self.config["after"], maneuver_end(self.phases)
        return self.config["duration"] if after is None or end is None else min(self.config["duration"], end + after)

    def to_finite_mdp(self) -> Any:
        """highway-env's finite Markov decision process over times to collision, with the reward of this environment.

        A state is worth its share of the highest target speed; a collision at that speed `collision_reward`.

        Raises:
            ValueError: the actions are not the five meta-actions, whose transitions highway-env knows.
            ModuleNotFoundError: the package finite_mdp is not installed.
        """
        if not (isinstance(self.action_type, DiscreteMetaAction) and self.action_space.n == 5):
            raise ValueError(
                "to_finite_mdp needs config['action'] of type DiscreteMetaAction, lateral and longitudinal, got "
                f"{self.config['action']}"
            )
        weighted = copy(self)
        weighted.config = {
            **self.config,
            "collision_reward": self.config["collision_reward"] - 1.0,
            "high_speed_reward": 1.0,
            "right_lane_reward": 0.0,
            "lane_change_reward": 0.0,
        }
        return finite_mdp(weighted, time_quantization=1 / self.config["policy_frequency"])
