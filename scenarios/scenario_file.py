"""A scenario as a TOML file: its fields by their names, and a table for each parameter.

`builder` is `module:function`, of ours or of the user. Units: m, s, m/s, m/s^2.
"""

from dataclasses import replace
from inspect import isfunction
from typing import Any

from scenarios.record import TRAFFIC, Scenario
from trackers.toml_file import lines, read_record

HEAD = "# Units: duration in s, max_lateral in m/s^2; of a parameter those that its unit says\n"


def text_of(scenario: Any) -> str:
    """The file of a scenario, every field written, density and speed of its traffic too.

    ValueError, in one sentence, for what has no builder with a name, as recorded traffic.
    """
    if not isinstance(scenario, Scenario) or not (isinstance(scenario.builder, str) or isfunction(scenario.builder)):
        raise ValueError(
            f"only a `scenarios.Scenario` with a function as builder is written as a file, got {scenario!r}"
        )
    more = tuple(parameter for parameter in TRAFFIC if parameter.name not in scenario.defaults)
    return HEAD + "\n".join(lines(replace(scenario, parameters=scenario.parameters + more)))


def read_scenario(path: str) -> Scenario:
    """The scenario of a file.

    Raises:
        LookupError: the file cannot be read.
        ValueError: it is no TOML, or has a key or value that no scenario has; one sentence names file and key.
    """
    scenario: Scenario = read_record(Scenario, path, "scenario", purpose=f"from {path}")
    for parameter in scenario.parameters:
        parameter.check(parameter.default)
    return scenario
