"""Environments on the base of highway-env as scenarios: `highway-v0`, ids and classes of users, or functions.

`ID`, or `MODULE:ID` of an id that a module registers when it is imported; `MODULE:CLASS`; or `MODULE:FUNCTION`, of a
function from a config to an environment. Behind each `:key=value,key=value`, values of its config.
"""

import re
from collections.abc import Callable, Mapping
from difflib import get_close_matches
from functools import partial
from inspect import isclass, signature
from math import inf
from typing import Any, NamedTuple

import gymnasium as gym

from trackers.lookup import imported, parse

ID = re.compile(r"(?:(?P<module>[^\W\d][\w.]*):)?(?P<id>(?:[\w-]+/)?[\w-]+-v\d+)(?::(?P<values>.*))?")
WHAT = "scenario"


class Native(NamedTuple):
    """An environment of highway-env, or of a user on its base."""

    name: str  # as the user wrote it
    id: str  # or MODULE:OBJECT
    values: Mapping[str, Any]  # of its config, that the name gives
    default: Mapping[str, Any]  # its config
    create: Callable[..., gym.Env]  # of the argument `config`

    @property
    def duration(self) -> float:
        """Duration [s] of an episode; infinite where the environment has no limit of its own."""
        return float({**self.default, **self.values}.get("duration", inf))

    def check(self, config: Mapping[str, Any]) -> None:
        """Raise ValueError for a key that its config does not have."""
        if unknown := sorted(set(config) - set(self.default)):
            raise ValueError(f"{self.id} has no config {', '.join(unknown)}; it has {', '.join(sorted(self.default))}")

    def make(self, config: Mapping[str, Any]) -> gym.Env:
        """The environment with a config on top of its values; ValueError for a key that it does not have."""
        self.check(config)
        return self.create(config={**self.values, **config})


def ids() -> tuple[str, ...]:
    """Ids of all environments of highway-env that gymnasium knows, in alphabetical order."""
    return tuple(sorted(i for i, s in gym.registry.items() if str(s.entry_point).startswith("highway_env.")))


def find_native(name: str) -> Native:
    """The environment of an id, see `ID`.

    Raises:
        LookupError: gymnasium knows no such environment; the nearest id is suggested.
        ValueError: it is not on the base of highway-env, or has no such config.
    """
    import highway_env  # noqa: F401 - registers the ids

    match = ID.fullmatch(name)
    if match is None:
        raise LookupError(f"no scenario {name!r}; an id reads like highway-v0 or my_module:my-scene-v0")
    if match["module"]:
        imported(match["module"], name, WHAT)
    entry = match["id"]
    if entry not in gym.registry:
        close = get_close_matches(entry, ids(), n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(ids())}"
        raise LookupError(f"no scenario {entry!r} of the testbed or of highway-env; {hint}")
    point = gym.registry[entry].entry_point
    kind = gym.envs.registration.load_env_creator(point) if isinstance(point, str) else point
    values = parse(f"{entry}:{match['values']}")[1] if match["values"] else {}
    return _native(name, entry, values, kind, partial(gym.make, entry))


def native_of(name: str, found: Any) -> Native:
    """The environment of a class or function that a user has named, as `find_native`; `found` is what `name` names."""
    entry, values = parse(name)
    return _native(name, entry, values, found, found)


def module_of_id(name: str) -> str | None:
    """The module that has the environment of an id; None for another name, and for an id that nobody has registered."""
    match = ID.fullmatch(name)
    if match is None:
        return None
    spec = gym.registry.get(match["id"])
    point = None if spec is None else spec.entry_point
    return match["module"] or (
        point.partition(":")[0] if isinstance(point, str) else getattr(point, "__module__", None)
    )


def _native(name: str, entry: str, values: Mapping[str, Any], kind: Any, create: Callable[..., gym.Env]) -> Native:
    """The record of an environment that `create(config=...)` makes; `kind` is its class, or a function."""
    from highway_env.envs.common.abstract import AbstractEnv

    if not isclass(kind):
        if "config" not in signature(kind).parameters:
            raise ValueError(f"scenario {entry!r} must have the argument config, a dict or None, for its environment")
        made = create(config=None)
        kind = type(made.unwrapped) if isinstance(made, gym.Env) else type(made)
    if not issubclass(kind, AbstractEnv):
        raise ValueError(f"scenario {entry!r} is {kind.__name__}, which is no environment on the base of highway-env")
    found = Native(name, entry, values, kind.default_config(), create)
    found.check(values)
    return found
