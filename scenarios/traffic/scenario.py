"""`replay:FILE:key=value,...`: a recording by the text that a user writes, as a `Scenario`."""

import re
from dataclasses import dataclass
from importlib import import_module
from math import floor, inf
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenarios.record import Scenario
from trackers.lookup import parse

if TYPE_CHECKING:
    from scenarios.stage import World
    from scenarios.traffic.plan import Plan

FAMILY = "replay:"
DECISION = 0.2  # [s] of a planner, as in all scenarios
REACT = 5.0  # [m] from its recorded place at which the ego has left its record
NAME = re.compile(r"replay:(?P<file>.+?)(?::(?P<parameters>\w+=[^/]*))?")
KEYS = ("ego", "react", "smooth")


@dataclass(frozen=True)
class Replay:
    """Builder of an episode of recorded traffic."""

    file: str
    ego: str | None = None  # id of the vehicle whose place the ego takes; None: see `plan.default_ego`
    react: float | None = REACT  # [m] from its record beyond which those behind the ego react; None: never
    smooth: float | None = None  # [s] window of the smoothing; None: that of the layout

    def __post_init__(self) -> None:
        for key, value in (("react", self.react), ("smooth", self.smooth)):
            if value is not None and not (isinstance(value, Real) and not isinstance(value, bool) and 0 <= value < inf):
                remedy = "metres, or off" if key == "react" else "seconds, 0 for none"
                raise ValueError(f"{key} must be a number from 0 on, got {value!r}; give {remedy}")

    @property
    def plan(self) -> "Plan":
        """What is played; ValueError where the file cannot be used."""
        from scenarios.traffic.plan import plan_of  # loaded by the first recording that is played

        path = Path(self.file)
        changed = path.stat().st_mtime_ns if path.is_file() else 0
        return plan_of(path, changed, self.ego, self.smooth)

    def __call__(self, rng: np.random.Generator) -> "World":
        """The episode before its first frame."""
        built: World = import_module("scenarios.traffic.road").world(self.plan, self.react, rng)
        return built


def is_replay(name: Any) -> bool:
    """Whether a text names recorded traffic.

    >>> is_replay("replay:i80.csv:react=off"), is_replay("cut-in")
    (True, False)
    """
    return isinstance(name, str) and name.startswith(FAMILY)


def replay_of(name: str) -> Replay:
    """The builder that a text stands for; the file is not read.

    >>> replay_of("replay:data/i80.csv:ego=12,react=off")
    Replay(file='data/i80.csv', ego='12', react=None, smooth=None)

    Raises:
        ValueError: the text has no file, or a parameter that there is not.
    """
    match = NAME.fullmatch(name)
    if match is None:
        raise ValueError(f"scenario {name!r} has no file; write replay:FILE, or replay:FILE:ego=ID,react=5")
    given = match["parameters"] or ""
    values = parse(f"replay:{given}")[1] if given else {}
    if unknown := values.keys() - {*KEYS}:
        raise ValueError(f"replay has no parameter {', '.join(sorted(unknown))}; it has {', '.join(KEYS)}")
    if "ego" in values:
        texts = (part.partition("=") for part in given.split(","))
        values["ego"] = next(text.strip() for key, _, text in texts if key.strip() == "ego")  # 007 and 1e3 are ids
    if values.get("react", 0) is False:
        values["react"] = None
    return Replay(match["file"], **values)


def replayed(name: str) -> Scenario:
    """Recorded traffic as a scenario that lasts as long as the ego is on record.

    Raises:
        ValueError: as `replay_of`, or the file cannot be used.
    """
    builder = replay_of(name)
    plan = builder.plan
    react = "nobody reacts" if builder.react is None else f"those behind react beyond {builder.react:g} m"
    return Scenario(
        name,
        f"Recorded traffic around vehicle {plan.ego.id} of {Path(builder.file).name}; {react}.",
        builder,
        len(plan.others),
        max_lateral=inf,
        duration=whole_decisions(float(plan.ego.table[-1, 0])),
    )


def whole_decisions(time: float) -> float:
    """The end [s] of the last decision that ends by then: after the record nobody is there any more.

    >>> whole_decisions(8.7)
    8.6
    """
    return round(floor(time / DECISION + 1e-9) * DECISION, 6)
