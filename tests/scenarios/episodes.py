"""Episodes for tests that ask for the world and not for observations."""

from typing import Any

from scenarios.highway import ScenarioEnv

ONE_NUMBER = {"type": "AttributesObservation", "attributes": ["steps"]}


def world_only(scenario: Any) -> ScenarioEnv:
    """The environment of a scenario with an observation that costs nothing: the usual table takes most of a step."""
    return ScenarioEnv(scenario, config={"observation": ONE_NUMBER})
