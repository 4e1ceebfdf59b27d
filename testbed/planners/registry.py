"""The planners: each chooses the ego's next action from the belief road, or from the tracks themselves.

A planner may offer two things besides those of `Planner`. `action`, a dict, is the `config["action"]` that it needs:
`settings` finds it. `begin(env)` is called after every reset, for planners with a state; those of this table have none,
so that one object may serve many environments.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from inspect import isfunction
from types import MappingProxyType
from typing import Any, Protocol

import gymnasium as gym
import numpy as np
from highway_env.envs.common.action import DiscreteAction, DiscreteMetaAction
from numpy.typing import NDArray

from testbed.planners.idm import Choice, IdmPlanner
from testbed.planners.learned import Learned
from testbed.planners.mpc import Caution, Mpc
from testbed.planners.own import OwnPlanner
from testbed.planners.tree import TreeSearch
from trackers.lookup import find_own, look_up, parse, with_parameters


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
    {
        p.name: p
        for p in (
            IdmPlanner(),
            IdmPlanner("idm-keen", "idm that takes small gaps to follow its route", imposed_brake=5.0, route_gain=8.0),
            Mpc(),
            Mpc("mpc-cautious", "mpc that allows for covariances and weighs tentative tracks", caution=Caution()),
            TreeSearch(),
            Idle(),
            IdmPlanner("truth", "idm on the truth instead of tracks", True),
        )
    }
)


LEARNED = "learned:"  # before the file of a policy


def find(name: str) -> Planner:
    """The planner of that name: `NAME`, `NAME:key=value,key=value`, `MODULE:OBJECT:...`, or `learned:FILE`.

    One that is not in the catalogue as it stands has the whole text as its name; FILE is one of `save_policy`.

    Raises:
        LookupError: no such planner; the nearest name is suggested.
        ValueError: a parameter or value that it cannot have, an OBJECT that is no planner, or a file without a policy.

    """
    if isinstance(name, str) and name.startswith(LEARNED):
        return Learned(name.removeprefix(LEARNED))
    if not isinstance(name, str) or name in PLANNERS:
        return look_up(name, PLANNERS, "planner")
    entry, parameters = parse(name)
    if entry in PLANNERS:
        return with_parameters(PLANNERS[entry], entry, {**parameters, "name": name})
    own = find_own(entry, PLANNERS, "planner")
    return OwnPlanner(name, own if isfunction(own) and not parameters else with_parameters(own, entry, parameters))


def settings(planner: Any) -> dict[str, Any]:
    """The part of an environment's `config` that a planner needs: {"action": ...}, or nothing.

    >>> settings(find("mpc"))["action"]["type"]
    'ContinuousAction'
    >>> settings(find("idm"))
    {}
    """
    action = getattr(planner, "action", None)
    return {} if action is None else {"action": dict(action)}


def begin(planner: Any, env: gym.Env) -> None:
    """Call `planner.begin(env)`, if the planner has it: after every reset."""
    if hasattr(planner, "begin"):
        planner.begin(env)
