"""The planners: each chooses the ego's next action from the belief road, and from nothing else.

Planners have no state: the same belief road gives the same action.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol

import gymnasium as gym
import numpy as np
from highway_env.envs.common.action import DiscreteAction, DiscreteMetaAction
from numpy.typing import NDArray

from testbed.planners.idm import Choice, IdmPlanner
from trackers.lookup import look_up


class Planner(Protocol):
    """What chooses the actions of the ego vehicle."""

    @property
    def name(self) -> str:
        """Name in the table."""

    @property
    def note(self) -> str:
        """What it is, in one line."""

    @property
    def knows_truth(self) -> bool:
        """Whether it is to be run in an environment whose first tracker is the truth."""

    def act(self, env: gym.Env) -> Any:
        """The next action."""

    def plan(self, env: gym.Env) -> NDArray:
        """Points (P, 2) [m] of the path that it means to take, in the world frame."""

    def choose(self, env: gym.Env) -> Choice:
        """Action and plan at once."""


@dataclass(frozen=True)
class Idle:
    """Keeps speed and lane."""

    name: str = "idle"
    note: str = "keeps speed and lane whatever happens"
    knows_truth: bool = False

    def act(self, env: gym.Env) -> Any:
        """The action that changes nothing."""
        action_type = env.unwrapped.action_type  # type: ignore[attr-defined]
        if isinstance(action_type, DiscreteMetaAction):
            return action_type.actions_indexes["IDLE"]
        if isinstance(action_type, DiscreteAction):
            if action_type.actions_per_axis % 2 == 0:
                raise TypeError(
                    f"planner 'idle' needs an odd number of actions_per_axis, got {action_type.actions_per_axis}: "
                    "no action of an even number keeps speed and lane"
                )
            return int(env.action_space.n) // 2  # type: ignore[attr-defined]  # the middle of every axis
        return np.zeros(env.action_space.shape, env.action_space.dtype)

    def plan(self, env: gym.Env) -> NDArray:
        """Straight on for three seconds."""
        ego = env.unwrapped.vehicle  # type: ignore[attr-defined]
        return ego.position + np.linspace(0, 3, 7)[:, None] * ego.velocity

    def choose(self, env: gym.Env) -> Choice:
        """The action that changes nothing, and the path straight on."""
        return Choice(self.act(env), self.plan(env))


PLANNERS: Mapping[str, Planner] = MappingProxyType(
    {p.name: p for p in (IdmPlanner(), Idle(), IdmPlanner("truth", "idm on the truth instead of tracks", True))}
)


def find(name: str) -> Planner:
    """The planner of that name.

    Raises:
        LookupError: no such planner; the nearest name is suggested.

    """
    return look_up(name, PLANNERS, "planner")
