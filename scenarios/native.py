"""Environments of highway-env itself as scenarios, by their ids: `highway-v0`, `merge-v0:other_vehicles_type=...`."""

from collections.abc import Mapping
from difflib import get_close_matches
from math import inf
from typing import Any, NamedTuple

import gymnasium as gym

from trackers.lookup import parse


class Native(NamedTuple):
    """An environment of highway-env."""

    name: str  # as the user wrote it
    id: str
    values: Mapping[str, Any]  # of its config, that the name gives
    default: Mapping[str, Any]  # its config

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
        return gym.make(self.id, config={**self.values, **config})


def ids() -> tuple[str, ...]:
    """Ids of all environments of highway-env that gymnasium knows, in alphabetical order."""
    return tuple(sorted(i for i, s in gym.registry.items() if str(s.entry_point).startswith("highway_env.")))


def find_native(name: str) -> Native:
    """The environment of that id.

    Raises:
        LookupError: highway-env has no such environment; the nearest id is suggested.
        ValueError: it has no such config.
    """
    import highway_env  # noqa: F401 - registers the ids

    entry, values = parse(name)
    if entry not in ids():
        close = get_close_matches(entry, ids(), n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(ids())}"
        raise LookupError(f"no scenario {entry!r} of the testbed or of highway-env; {hint}")
    kind: Any = gym.envs.registration.load_env_creator(str(gym.registry[entry].entry_point))
    found = Native(name, entry, values, kind.default_config())
    found.check(values)
    return found
