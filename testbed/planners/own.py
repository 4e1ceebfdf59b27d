"""A planner of a user: whatever has `act` or `choose`, or is a function of the environment, as a `Planner`."""

from collections.abc import Mapping
from dataclasses import dataclass
from inspect import isroutine
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from testbed.planners.idm import Choice


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

    def plan(self, env: gym.Env) -> NDArray:
        """Points (P, 2) [m] of its path, none where it does not say."""
        return self.planner.plan(env) if hasattr(self.planner, "plan") else np.zeros((0, 2))

    def choose(self, env: gym.Env) -> Choice:
        """Action and plan at once."""
        if hasattr(self.planner, "choose"):
            return self.planner.choose(env)
        return Choice(self.act(env), self.plan(env))
