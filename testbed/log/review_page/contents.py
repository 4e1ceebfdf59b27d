"""What the page of a run holds, read from its log: plain lists and texts, lengths in cm, angles in mrad.

A rigid outline is kept once, and after that only where it is and how it is turned.
"""

import json
from collections.abc import Hashable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sensors.origin import KINDS
from testbed.evaluation.metric import METRICS
from testbed.log import palette, paths
from testbed.log.reader import Columns, events, properties
from testbed.log.text import NOTHING_WRONG, RINGS
from trackers.geometry import to_world

CURVES = ("gospa", "gwd", "position", "velocity", "heading_deg", "length", "width", "unassigned", "ghosts")
SAME = 0.015  # [m] every point of a known shape lies as near as this, else the shape is a new one
CM = 100.0
MILLIRAD = 1000.0
PLAIN_LEVELS = ("INFO", "WARN", "ERROR")
NO_TRUTH = "This log has no truth: nothing is measured against it."
INTERRUPTED = "The run was interrupted: worst moments and objects are found when a run ends."


def contents(path: str | Path) -> dict[str, Any]:
    """Everything that the page draws; raises OSError or ValueError, in one sentence, for a log that cannot be read."""
    columns, groups = Columns(path), properties(path)
    times = columns.times
    if not times:
        raise ValueError(f"the log {path} has no step")
    run = groups.get("run", {})
    trackers = str(run.get("trackers", "")).split()
    if not trackers:
        raise ValueError(f"the log {path} is of several drives, or of none with a tracker; `testbed review` opens it")
    tables = {name: json.loads(str(text)) for name, text in groups.get("tables", {}).items()}
    steps = list(times)
    shapes = Shapes()
    return {
        "run": {key: run.get(key) for key in ("scenario", "seed", "radar", "planner")} | {"log": Path(path).name},
        "time": [round(t, 3) for t in times.values()],
        "trackers": [
            {"name": name, "color": palette.css(palette.tracker(i))} | _tracks(columns, shapes, name, steps)
            for i, name in enumerate(trackers)
        ],
        "kinds": [
            {"name": kind, "color": palette.css(palette.DETECTION[kind]), "note": palette.KIND_NOTES[kind]}
            for kind in KINDS
        ],
        "rings": RINGS,
        "names": _names(columns, tables.get("objects", [])),
        "truth": _truth(columns, shapes, steps),
        "ego": _ego(columns, shapes, steps),
        "detections": _detections(columns, steps),
        "road": _road(columns),
        "curves": [{"key": key, "title": METRICS[key].title} for key in CURVES],
        "shapes": shapes.found,
        "action": [texts[0] for texts in columns.held(paths.EGO_ACTION, "StateChange:state", "").values()],
        "events": [[round(e.time, 3), e.level, e.text] for e in events(path) if e.level in PLAIN_LEVELS],
        "moments": tables.get("moments", []),
        "no_moments": NOTHING_WRONG if tables else INTERRUPTED if columns.entities("metrics/") else NO_TRUTH,
        "objects": [row for row in tables.get("objects", []) if row["scans_counted"]],
    }


def centimetres(xy: NDArray) -> list[int]:
    """Points (P, 2) [m] as one list x, y, x, y, ... of whole centimetres."""
    return np.rint(CM * np.asarray(xy, float)).astype(int).ravel().tolist()


class Shapes:
    """The shapes of all outlines of a run, in the order in which they were first met."""

    def __init__(self) -> None:
        self.found: list[list[int]] = []  # [cm] about the middle of the points, as x, y, x, y, ...
        self._known: dict[Hashable, tuple[int, NDArray]] = {}

    def place(self, whose: Hashable, ring: NDArray) -> list[int]:
        """Number of the shape, x, y [cm] and turn [mrad] of an outline (P, 2) [m]; `whose` had the shape before."""
        middle = ring.mean(0)
        around = ring - middle
        number, shape = self._known.get(whose, (-1, around[:0]))
        turn = 0.0
        if len(shape) == len(around):
            turn = _turn(shape, around)
            if np.abs(to_world(np.array([0.0, 0.0, turn]), shape) - around).max(initial=0.0) > SAME:
                number, turn = -1, 0.0
        else:
            number = -1
        if number < 0:
            number = len(self.found)
            self.found.append(centimetres(around))
            self._known[whose] = number, around
        return [number, *centimetres(middle), round(MILLIRAD * turn)]


def _turn(shape: NDArray, around: NDArray) -> float:
    """Angle [rad] that turns one set of points (P, 2) best into another."""
    a, b = shape[:, 0] + 1j * shape[:, 1], around[:, 0] + 1j * around[:, 1]
    return float(np.angle((a.conj() * b).sum()))


def ring_at(shape: list[int], x: int, y: int, turn: int) -> NDArray:
    """The outline (P, 2) [m] that `Shapes.place` has described."""
    points = np.reshape(shape, (-1, 2)) / CM
    return to_world(np.array([x / CM, y / CM, turn / MILLIRAD]), points)


def _names(columns: Columns, objects: list[dict[str, Any]]) -> dict[str, str]:
    """Id of an object -> its name and class, as far as the log knows it."""
    found = {key: paths.vehicle(key) for key in columns.vehicles()}
    found |= {row["object"]: f"{paths.vehicle(row['object'])} {row['kind']}" for row in objects}
    return {str(key): name for key, name in (found | columns.names()).items()}


def _truth(columns: Columns, shapes: Shapes, steps: list[int]) -> list[list[list[int]]]:
    """For each scan and outline: object, visible share [%], shape, x, y, turn."""
    rings = columns.strips(paths.TRUTH_CONTOUR)
    owner = columns.numbers(paths.TRUTH_CONTOUR, "truth:object_id")
    ids = sorted({int(i) for row in owner.values() for i in row})
    visible = {i: columns.numbers(paths.of_object(i, paths.SEEN), "radar:visible") for i in ids}
    return [
        [
            [key, _percent(visible[key].get(step)), *shapes.place(("truth", key, part), ring)]
            for key, part, ring in _parts(owner.get(step, ()), rings.get(step, []))
        ]
        for step in steps
    ]


def _parts(owner: NDArray | tuple, rings: list[NDArray]) -> Iterator[tuple[int, int, NDArray]]:
    """Object, number of the outline among those of the object, outline."""
    count: dict[int, int] = {}
    for key, ring in zip(map(int, owner), rings, strict=True):
        count[key] = count.get(key, -1) + 1
        yield key, count[key], ring


def _percent(share: NDArray | None) -> int:
    return 100 if share is None else round(100 * float(share[0]))


def _ego(columns: Columns, shapes: Shapes, steps: list[int]) -> list[list[int]]:
    """Shape, x, y, turn of the ego at each scan; nothing in a log without geometry."""
    rings = columns.strips(paths.TRUTH_EGO)
    return [shapes.place("ego", rings[step][0]) for step in steps if step in rings]


def _tracks(columns: Columns, shapes: Shapes, name: str, steps: list[int]) -> dict[str, Any]:
    """Tracks, errors of every scan and of every object of one tracker."""
    entity = paths.tracker(name, "extent")
    rings, ids = columns.strips(entity), columns.numbers(entity, "track:id")
    means, of = {}, {}
    for key in CURVES:
        found = columns.numbers(paths.metric(key, name), "Scalars:scalars")
        means[key] = [_round(found.get(step)) for step in steps]
    leaf = paths.plain(name)
    for other in columns.entities("objects/"):
        if other.rpartition("/")[2] == leaf:
            number = other.split("/")[1].rpartition("_")[2]
            of[str(int(number))] = {
                key: [_round(found.get(step)) for step in steps]
                for key in CURVES
                if (found := columns.numbers(other, f"metrics:{key}"))
            }
    return {
        "tracks": [
            [
                [int(i), *shapes.place((name, int(i)), ring)]
                for i, ring in zip(ids.get(step, ()), rings.get(step, []), strict=True)
            ]
            for step in steps
        ],
        "means": means,
        "of": of,
    }


def _round(value: NDArray | None) -> float | None:
    return None if value is None or not len(value) or not np.isfinite(value[0]) else round(float(value[0]), 2)


def _detections(columns: Columns, steps: list[int]) -> list[list[list[int]]]:
    """For each scan and kind x, y, x, y, ... [cm]."""
    of = [columns.points(paths.detections(kind), "Points2D:positions") for kind in KINDS]
    return [[centimetres(kind[step]) if step in kind else [] for kind in of] for step in steps]


def _road(columns: Columns) -> dict[str, Any]:
    """Lines of the road [cm], and half widths of its lanes."""

    def lines(entity: str) -> list[list[int]]:
        return [centimetres(np.array(line)) for line in columns.static(entity, "LineStrips2D:strips")]

    half = columns.static(paths.ROAD_SURFACE, "LineStrips2D:radii")
    return {
        "surface": lines(paths.ROAD_SURFACE),
        "half": [round(100 * float(h)) for h in half],
        "edges": lines(paths.ROAD_EDGES),
        "lanes": lines(paths.ROAD_LANES),
    }
