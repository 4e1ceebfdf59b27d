"""The first step at which two logs part, layer by layer, and what differs there."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sensors.origin import KINDS
from testbed.log import paths
from testbed.log.reader import Columns, properties
from testbed.log.review import readable

LAYERS = "extent", "tentative"


class Parting(NamedTuple):
    """One layer that differs."""

    what: str
    step: int
    time: float  # [s]
    difference: str  # what differs at that step, the first log's before the second's


class Difference(NamedTuple):
    """Everything that differs between two logs; nothing where they are equal."""

    settings: list[tuple[str, str, str]]  # name, in the first log, in the second
    partings: list[Parting]  # by step; at one step in the order in which a frame is made
    steps: int  # that both have
    time: float  # [s] of the last of them


def compare_logs(first: str | Path, second: str | Path) -> Difference:
    """Compare two logs exactly; raises OSError or ValueError, in one sentence, for one that cannot be read."""
    readable(first, second)
    a, b = Columns(first), Columns(second)
    times = a.times, b.times
    shared = [step for step in times[0] if step in times[1]]
    if not shared:
        raise ValueError(f"{first} and {second} have no step in common; give the logs of two runs")
    runs = [properties(log).get("run", {}) for log in (first, second)]
    names = [str(run.get("trackers", "")).split() for run in runs]
    found = []
    for what, one, other in _layers(a, b, pairs_of(*names)):
        for step in shared:
            if said := _difference(one.get(step), other.get(step)):
                found.append(Parting(what, step, times[0][step], said))
                break
    longer = max(times, key=len)
    if len(longer) > len(shared):
        step = next(step for step in longer if step not in times[0] or step not in times[1])
        ends = " / ".join(f"{len(t)} steps" for t in times)
        found.append(Parting("length of the run", step, longer[step], ends))
    return Difference(_settings(*runs), sorted(found, key=lambda p: p.step), len(shared), times[0][shared[-1]])


def pairs_of(first: Sequence[str], second: Sequence[str]) -> list[tuple[str, str]]:
    """Trackers that are compared: each with itself, and those that only one log has in their order."""
    alone = [[n for n in first if n not in second], [n for n in second if n not in first]]
    return [*((n, n) for n in first if n in second), *zip(*alone)]


def _layers(a: Columns, b: Columns, trackers: Sequence[tuple[str, str]]) -> Iterator[tuple[str, Mapping, Mapping]]:
    """Name of each layer, and step -> values in both logs, in the order in which a frame is made."""

    def both(method: str, *where: str) -> tuple[Mapping, Mapping]:
        return getattr(a, method)(*where), getattr(b, method)(*where)

    def of_each(method: str, one: str, other: str, *where: str) -> tuple[Mapping, Mapping]:
        return getattr(a, method)(one, *where), getattr(b, method)(other, *where)

    yield "pose of the ego", *both("strips", paths.TRUTH_EGO)
    yield "vehicles", *both("strips", paths.TRUTH_CONTOUR)
    for kind in KINDS:
        yield f"detections, {kind}", *both("points", paths.detections(kind), "Points2D:positions")
    for pair in trackers:
        name, (extent, tentative) = said(*pair), ([paths.tracker(n, layer) for n in pair] for layer in LAYERS)
        yield f"ids of {name}", *of_each("numbers", *extent, "track:id")
        yield f"tracks of {name}", *of_each("strips", *extent)
        yield f"tentative tracks of {name}", *of_each("strips", *tentative)
    yield "plan", *both("strips", paths.EGO_PLAN)
    yield "action", *both("held", paths.EGO_ACTION, "StateChange:state", "nothing")
    yield "speed of the ego [m/s]", *both("numbers", paths.EGO_SPEED, "Scalars:scalars")
    there = {entity.split("/")[1]: None for entity in (*a.entities("metrics/"), *b.entities("metrics/"))}
    for pair in trackers:
        for key in there:
            where = [paths.metric(key, name) for name in pair]
            yield f"{key} of {said(*pair)}", *of_each("numbers", *where, "Scalars:scalars")


def said(one: str, other: str) -> str:
    """Two trackers that are compared, as text."""
    return one if one == other else f"{one} / {other}"


def _difference(one: Any, other: Any) -> str:
    """What differs between two values of a layer, empty where nothing does."""
    if one is None or other is None:
        return "" if one is other else f"{_short(one)} / {_short(other)}"
    if isinstance(one, list) and one and isinstance(one[0], str):
        return "" if one == other else f"{one[0]} / {other[0]}"
    if len(one) != len(other):
        return f"{len(one)} / {len(other)}"
    apart = 0.0
    for x, y in zip_longest(one, other):
        if np.shape(x) != np.shape(y):
            return f"{len(x)} / {len(y)} points of an outline"
        if not np.array_equal(x, y, equal_nan=True):
            if np.ndim(x) == 0:
                return f"{_short(one)} / {_short(other)}"
            apart = max(apart, float(np.nanmax(np.hypot(*(np.asarray(x) - y).T))))
    return f"up to {apart:.3g} m apart" if apart else ""


def _short(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, np.ndarray) and value.ndim == 1:
        words = " ".join(f"{v:.6g}" for v in value[:6])
        return words + (" ..." if len(value) > 6 else "") or "none"
    return f"{len(value)} of them"


def _settings(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    names = [name for name in dict.fromkeys([*one, *other]) if one.get(name) != other.get(name)]
    return [(name, str(one.get(name, "-")), str(other.get(name, "-"))) for name in names]
