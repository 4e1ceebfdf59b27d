"""The gymnasium ids, `testbed/NAME-v0` for every scenario and probe, and environments by what a user wrote."""

from collections.abc import Mapping
from inspect import isclass, isfunction, signature
from typing import Any

import gymnasium as gym

import scenarios
from scenarios.native import ID, Native, find_native, native_of
from scenarios.probes import PROBES
from scenarios.record import Scenario
from scenarios.registry import SCENARIOS
from scenarios.traffic.scenario import is_replay
from trackers.lookup import find_own, installed, is_own, parse
from trackers.toml_file import SUFFIX

ENTRY_POINT = "testbed.environment.wrapper:scenario_env"  # a string: highway-env is loaded by the first `make`


def env_id(scenario: str) -> str:
    """Gymnasium id of a scenario.

    >>> env_id("cut-in")
    'testbed/cut-in-v0'
    """
    return f"testbed/{scenario}-v0"


def register_scenarios() -> None:
    """Register all scenarios and probes; a second call changes nothing.

    The entry point makes the wrapped environment, so that `gym.make(id, tracker=..., radar=...)` takes its arguments
    and `env.truth` and `env.tracks` need no unwrapping. Gymnasium's own checking wrappers are left out: `TrackedEnv`
    itself refuses a step before the first reset, and the tests run `check_env` on every id.
    """
    for name in (*SCENARIOS, *PROBES):
        if env_id(name) not in gym.registry:
            gym.register(
                id=env_id(name),
                entry_point=ENTRY_POINT,
                kwargs={"scenario": name},
                order_enforce=False,
                disable_env_checker=True,
            )


def scenario_of(text: str) -> Scenario | Native:
    """What a scenario as a user writes it stands for.

    `NAME`, `MODULE:OBJECT`, a file `PATH.toml`, `replay:FILE`, or an id of gymnasium, see `scenarios.native`. Each may
    have `:key=value,key=value` behind it: parameters of the scenario, or config of highway-env.

    Raises:
        LookupError: there is no such scenario; the nearest name is suggested.
        ValueError: a parameter or value that it cannot have.
    """
    if not isinstance(text, str) or is_replay(text):
        return scenarios.find(text)
    if ID.fullmatch(text) and text.partition(":")[0] not in installed("scenario"):
        return find_native(text)
    if is_own(text, catalogue := {**SCENARIOS, **PROBES}) and not (entry := parse(text)[0]).endswith(SUFFIX):
        found = find_own(entry, catalogue, "scenario")
        if isclass(found) or (isfunction(found) and "config" in signature(found).parameters):
            return native_of(text, found)
    return scenarios.find(text)


def make(scenario: str, config: Mapping[str, Any] | None = None, **options: Any) -> gym.Env:
    """The tracked environment of a scenario as a user writes it, see `scenario_of`; options are those of `TrackedEnv`.

    The files of its episodes have the scenario's text as its name.
    """
    if scenario in SCENARIOS or scenario in PROBES:
        return gym.make(env_id(scenario), config=dict(config or {}), **options)
    from testbed.environment.wrapper import TrackedEnv, scenario_env

    found = scenario_of(scenario)
    if isinstance(found, Scenario):
        return scenario_env(found, config=dict(config or {}), **options)
    env = TrackedEnv(found.make(config or {}), **options)
    env.title = scenario
    return env
