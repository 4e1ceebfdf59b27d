"""The highway-env environment of a scenario: time, spaces, reward and end of an episode."""

from typing import Any

import numpy as np
from highway_env.envs.common.abstract import AbstractEnv
from numpy.typing import NDArray

from scenarios.registry import Scenario, find
from scenarios.stage import TARGET_SPEEDS, Phase

FEATURES = ("presence", "x", "y", "vx", "vy", "cos_h", "sin_h")
SPEED_RANGE = (0.0, 30.0)  # [m/s] over which the reward rises


def build_config(default: dict[str, Any], config: dict[str, Any] | None) -> dict[str, Any]:
    """The default with the given keys replaced; unknown keys and frequencies that do not divide are errors.

    highway-env accepts a misspelt key in silence, and its clock runs wrong when the frequencies do not divide. Nested
    dicts (observation, action) replace the default as a whole, as everywhere in highway-env.
    """
    unknown = sorted(set(config or {}) - set(default))
    if unknown:
        raise ValueError(f"config has no key {', '.join(map(repr, unknown))}; known: {', '.join(sorted(default))}")
    merged = {**default, **(config or {})}
    for key in ("observation", "action"):
        if not isinstance(merged[key], dict) or "type" not in merged[key]:
            raise ValueError(f"config[{key!r}] must be a whole dict with its 'type', got {merged[key]!r}")
    if merged["action"]["type"] != "DiscreteMetaAction":
        raise ValueError(f"config['action'] must be a DiscreteMetaAction, got {merged['action']['type']!r}")
    simulation, policy = merged["simulation_frequency"], merged["policy_frequency"]
    if not (policy > 0 and simulation > 0 and simulation % policy == 0):
        raise ValueError(f"policy_frequency {policy} Hz must divide simulation_frequency {simulation} Hz")
    if not merged["duration"] > 0:
        raise ValueError(f"config['duration'] must be positive, got {merged['duration']} s")
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
            "collision_reward": 0.0,  # what a step that ends in a crash is worth
            "neighbour_vehicles_connected_lanes": True,
        }

    def configure(self, config: dict[str, Any] | None) -> None:
        """Take over a config after checking it; the scenario's duration holds unless the config names one."""
        if "duration" not in (config or {}) and self.config == self.default_config():
            self.config["duration"] = self.scenario.duration
        self.config = build_config(self.config, config)
        super().configure(None)

    def _reset(self) -> None:
        world = self.scenario.build(self.np_random)
        self.road, self.walls, self.phases = world.road, world.walls, world.phases
        self.vehicle = world.ego
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
        """Speed along the lane as a share of 30 m/s, or the worth of a crash; in [0, 1]."""
        terms = self._rewards(action)
        return float(self.config["collision_reward"]) if terms["crashed"] else terms["speed"]

    def _is_terminated(self) -> bool:
        return bool(self.vehicle.crashed)

    def _is_truncated(self) -> bool:
        """Time is over, by the frame counter: highway-env's own clock may drift."""
        return bool(self.steps >= round(self.config["duration"] * self.config["simulation_frequency"]))
