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
    trackers = list(dict.fromkeys(name for run in runs for name in str(run.get("trackers", "")).split()))
    found = []
    for what, one, other in _layers(a, b, trackers):
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


def _layers(a: Columns, b: Columns, trackers: Sequence[str]) -> Iterator[tuple[str, Mapping, Mapping]]:
    """Name of each layer, and step -> values in both logs, in the order in which a frame is made."""

    def both(method: str, *where: str) -> tuple[Mapping, Mapping]:
        return getattr(a, method)(*where), getattr(b, method)(*where)

    yield "pose of the ego", *both("strips", paths.TRUTH_EGO)
    yield "vehicles", *both("strips", paths.TRUTH_CONTOUR)
    for kind in KINDS:
        yield f"detections, {kind}", *both("points", paths.detections(kind), "Points2D:positions")
    for name in trackers:
        yield f"ids of {name}", *both("numbers", paths.tracker(name, "extent"), "track:id")
        yield f"tracks of {name}", *both("strips", paths.tracker(name, "extent"))
        yield f"tentative tracks of {name}", *both("strips", paths.tracker(name, "tentative"))
    yield "plan", *both("strips", paths.EGO_PLAN)
    yield "action", *both("held", paths.EGO_ACTION, "StateChange:state", "nothing")
    yield "speed of the ego [m/s]", *both("numbers", paths.EGO_SPEED, "Scalars:scalars")
    for name in trackers:
        leaf = f"/{paths.plain(name)}"
        for entity in dict.fromkeys([*a.entities("metrics/"), *b.entities("metrics/")]):
            if entity.endswith(leaf):
                yield f"{entity.split('/')[1]} of {name}", *both("numbers", entity, "Scalars:scalars")


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
