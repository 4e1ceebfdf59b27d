"""The planners: each chooses the ego's next action from the belief road, or from the tracks themselves.

A planner may offer two things besides those of `Planner`: `action`, the `config["action"]` that it needs (`settings`
finds it), and `begin(env)`, called after every reset. Those of this table keep no state.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from inspect import isfunction, isroutine
from types import MappingProxyType
from typing import Any, Protocol

import gymnasium as gym
import numpy as np
from highway_env.envs.common.action import DiscreteAction, DiscreteMetaAction

from testbed.planners.idm import Choice, IdmPlanner, straight_on
from testbed.planners.learned import Learned
from testbed.planners.mpc import Mpc
from testbed.planners.stable_baselines import PREFIX, StableBaselines
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

    def choose(self, env: gym.Env) -> Choice:
        """The next action, and points (P, 2) [m] of the path that goes with it, in the world frame."""


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

    def choose(self, env: gym.Env) -> Choice:
        """The action that changes nothing, and the path straight on."""
        return Choice(self.act(env), straight_on(env.unwrapped.vehicle))  # type: ignore[attr-defined]


PLANNERS: Mapping[str, Planner] = MappingProxyType(
    {
        p.name: p
        for p in (
            IdmPlanner(),
            IdmPlanner("idm-keen", "idm that takes small gaps to follow its route", imposed_brake=5.0, route_gain=8.0),
            Mpc(),
            Mpc(
                "mpc-cautious",
                "mpc that allows for covariances and weighs tentative tracks",
                margin="covariance",
                above=0.1,
            ),
            TreeSearch(),
            Idle(),
            IdmPlanner("truth", "idm on the truth instead of tracks", True),
        )
    }
)


@dataclass(frozen=True)
class OwnPlanner:
    """A user's object under the name by which it was found; what it does not have is left out."""

    name: str
    planner: Any  # with `act` or `choose`, and perhaps `plan`, `begin`, `action`, `knows_truth`; or a function

    def __post_init__(self) -> None:
        if not (isroutine(self.planner) or hasattr(self.planner, "act") or hasattr(self.planner, "choose")):
            raise ValueError(
                f"planner {self.name!r} is {self.planner!r}; it must be a function of the environment, or an object "
                "with `act(env)`"
            )

    @property
    def note(self) -> str:
        """The first line of its docstring."""
        return str(getattr(self.planner, "note", None) or (self.planner.__doc__ or "").strip().partition("\n")[0])

    @property
    def knows_truth(self) -> bool:
        """Whether it is to be run on the truth."""
        return bool(getattr(self.planner, "knows_truth", False))

    @property
    def action(self) -> Mapping[str, Any] | None:
        """The actions that it needs, as the config of the environment has them; None: whatever there are."""
        return getattr(self.planner, "action", None)

    def begin(self, env: gym.Env) -> None:
        """Call its `begin`, if it has one, at the begin of an episode."""
        if hasattr(self.planner, "begin"):
            self.planner.begin(env)

    def act(self, env: gym.Env) -> Any:
        """The next action."""
        if isroutine(self.planner):
            return self.planner(env)
        return self.planner.act(env) if hasattr(self.planner, "act") else self.planner.choose(env).action

    def choose(self, env: gym.Env) -> Choice:
        """Action and plan at once; no points where it has no plan."""
        if hasattr(self.planner, "choose"):
            return self.planner.choose(env)
        plan = self.planner.plan(env) if hasattr(self.planner, "plan") else np.zeros((0, 2))
        return Choice(self.act(env), plan)


LEARNED = "learned:"  # before the file of a policy
OF_FILES = (LEARNED, PREFIX)


def find(name: str) -> Planner:
    """The planner of that name: `NAME`, `NAME:key=value,key=value`, `MODULE:OBJECT:...`, `learned:FILE`, `sb3:FILE`.

    One that is not in the catalogue as it stands has the whole text as its name; FILE is one of `save_policy`, or of
    stable-baselines3.

    Raises:
        LookupError: no such planner; the nearest name is suggested.
        ValueError: a parameter or value that it cannot have, an OBJECT that is no planner, or a file without a policy.
    """
    if isinstance(name, str) and name.startswith(LEARNED):
        return Learned(name.removeprefix(LEARNED))
    if isinstance(name, str) and name.startswith(PREFIX):
        return StableBaselines(name.removeprefix(PREFIX))
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
