"""The record of a scenario: everything but the seed.

A builder named as `module:function` is imported when the first world is built, so that listing stays light.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from math import inf
from numbers import Real
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np

from scenarios.drivers import DEFAULT, Population, find
from trackers.lookup import parse

if TYPE_CHECKING:
    from scenarios.stage import World

Builder = Callable[..., "World"]


@dataclass(frozen=True)
class Parameter:
    """A number that says how hard a scenario is; `config={name: value}` of its environment sets it."""

    name: str
    default: float
    easy: float  # the easiest value allowed
    hard: float  # the hardest value allowed; it may lie below or above `easy`
    unit: str
    note: str  # what it is
    traffic: bool = False  # what the stage takes, see `TRAFFIC`, and not the builder

    def check(self, value: Any) -> float:
        """The value as a number; ValueError for one that is none, or outside the range."""
        low, high = sorted((self.easy, self.hard))
        if not isinstance(value, Real) or isinstance(value, bool) or not low <= float(value) <= high:
            unit = "" if self.unit == "1" else f" {self.unit}"
            raise ValueError(f"{self.name} must be a number from {low:g} to {high:g}{unit}, got {value!r}")
        return float(value)


TRAFFIC = (  # what every scenario on a `Stage` can be given: `cut-in:density=1.5,speed=0.8`
    Parameter("density", 1.0, 0.25, 2.0, "1", "vehicles of each platoon, and the inverse of their headways", True),
    Parameter("speed", 1.0, 0.5, 1.25, "1", "of everybody, the ego too: the same ways in another time", True),
)


@dataclass(frozen=True)
class Scenario:
    """One scene; everything but the seed."""

    name: str
    purpose: str  # one sentence: what a tracker or planner has to show here
    builder: str | Builder  # "module:function", or a function from a generator (and the parameters) to a world
    vehicles: int  # besides the ego
    max_lateral: float = 4.0  # [m/s^2] bound on every prescribed course
    duration: float = 20.0  # [s]
    parameters: tuple[Parameter, ...] = ()  # the builder takes them by name
    lateral: bool = True  # whether the ego may change lane, unless the config has an action of its own
    calm: bool = False  # whether nothing in it calls for braking
    drivers: str = DEFAULT  # population of those that no course is prescribed to: a name, or a file

    def __post_init__(self) -> None:
        if not (isinstance(self.duration, Real) and 0 < self.duration < inf):
            raise ValueError(f"{self.name}: duration must be positive and finite, got {self.duration!r}; give seconds")
        if isinstance(self.builder, str) and self.builder.count(":") != 1:
            raise ValueError(f"{self.name}: builder must read 'module:function', got {self.builder!r}")

    def stream(self, rng: np.random.Generator) -> np.random.Generator:
        """The generator of an episode, of its own for each scenario under one seed; parameters do not count."""
        name = self.name if self.name.startswith("replay:") else parse(self.name)[0]
        return np.random.default_rng([*rng.integers(2**32, size=4).tolist(), crc32(name.encode())])

    @property
    def population(self) -> Population | None:
        """Of its drivers; None for `DEFAULT`. Errors are those of `drivers.find`."""
        return find(self.drivers)

    @property
    def defaults(self) -> dict[str, float]:
        """The parameters at their defaults."""
        return {parameter.name: parameter.default for parameter in self.parameters}

    def build(self, rng: np.random.Generator, values: Mapping[str, float] | None = None) -> "World":
        """Road, vehicles, guard rails and phases of one episode, drawn from the generator; `values` replace defaults.

        Raises:
            ValueError: a value is outside the range of its parameter.
        """
        given = {**self.defaults, **(values or {})}
        checked = {parameter.name: parameter.check(given.pop(parameter.name)) for parameter in self.parameters}
        if given:
            known = ", ".join(self.defaults) or "none"
            raise ValueError(f"{self.name} has no parameter {', '.join(given)}; it has {known}")
        traffic = {parameter.name: checked.pop(parameter.name) for parameter in self.parameters if parameter.traffic}
        with import_module("scenarios.stage").traffic(**traffic, population=self.population):
            world = self._builder()(rng, **checked)
        for vehicle in world.road.vehicles:
            if hasattr(vehicle, "table"):
                import_module("scenarios.courses").check(vehicle.table.rows, self.max_lateral)
        return world

    def _builder(self) -> Builder:
        if not isinstance(self.builder, str):
            return self.builder
        module, function = self.builder.split(":")
        return getattr(import_module(module), function)
