"""The gymnasium ids: `testbed/NAME-v0` for every scenario and probe."""

import gymnasium as gym

from scenarios.probes import PROBES
from scenarios.registry import SCENARIOS

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
