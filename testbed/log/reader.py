"""Reads review logs: numbers, events and properties from the file, or all columns in memory.

Works on logs of finished runs and of runs that were killed; the latter have no footer, see `complete`. Raises
ValueError for a damaged log; at some damages rerun ends the process, so a log that comes from elsewhere goes through
`testbed.log.review.readable` before.
"""

import warnings
from collections import defaultdict
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from testbed.log import paths

_ROW_ID = "rerun.controls.RowId"


class LoggedEvent(NamedTuple):
    """One line of the event list."""

    step: int
    time: float  # [s]
    level: str
    text: str


def batches(path: str | Path, content: str | None = None) -> Iterator[tuple[str, pa.RecordBatch]]:
    """Entity path with a leading slash, and the rows of each chunk."""
    try:
        stream = _open(path).stream()
        for chunk in (stream.filter(content=content) if content else stream).to_chunks():
            yield chunk.entity_path, chunk.to_record_batch()
    except RuntimeError as error:
        raise ValueError(f"the log {path} is damaged ({error}); `testbed review` says what can be done") from None


def complete(path: str | Path) -> bool:
    """Whether the log was closed. One that was not is readable; `rerun rrd optimize PATH -o NEW` adds the footer."""
    try:
        _open(path).store()
    except RuntimeError as error:
        if "footer" in str(error):
            return False
        raise
    return True


def _open(path: str | Path) -> Any:
    """Rerun's reader of the file, without its warning that a file without footer is of an old format."""
    from rerun.chunk import RrdReader

    if not Path(path).is_file():
        raise FileNotFoundError(f"there is no log {path}")
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "RRD file has no footer")
        return RrdReader(path)


def entity_paths(path: str | Path) -> set[str]:
    """All entities of the run, without the leading slash and without properties."""
    return {entity.lstrip("/") for entity, _ in batches(path) if not entity.startswith("/__")}


def scalars(path: str | Path, content: str, component: str = "Scalars:scalars") -> dict[str, tuple[NDArray, NDArray]]:
    """Steps (n,) and values (n,) of one component by entity, in the order of the steps.

    `content` selects entities: "metrics/gwd/**", or "objects/veh_03/rm-koch" with component "metrics:gwd".
    """
    parts: dict[str, list[tuple[NDArray, NDArray]]] = defaultdict(list)
    for entity, batch in batches(path, f"/{content.lstrip('/')}"):
        if component in batch.schema.names and paths.STEP in batch.schema.names:
            column = batch[component]
            there = column.is_valid().to_numpy(zero_copy_only=False)
            values = column.drop_null().flatten().to_numpy(zero_copy_only=False)
            steps = batch[paths.STEP].to_numpy(zero_copy_only=False)[there]
            if len(values) != len(steps):
                raise ValueError(f"{component} of {entity} has several values a step; it is not a scalar")
            parts[entity.lstrip("/")].append((steps, values))
    if not parts:
        raise LookupError(f"no entity {content!r} with component {component!r} in {path}")
    found = {}
    for entity, pieces in parts.items():
        steps, values = (np.concatenate(column) for column in zip(*pieces, strict=True))
        order = np.argsort(steps, kind="stable")
        found[entity] = steps[order], values[order]
    return found


def events(path: str | Path) -> list[LoggedEvent]:
    """The event list in the order it was written."""
    lines = [row for _, batch in batches(path, f"/{paths.EVENTS}") for row in batch.to_pylist()]
    return [
        LoggedEvent(row[paths.STEP], row[paths.TIME].total_seconds(), row["TextLog:level"][0], row["TextLog:text"][0])
        for row in sorted(lines, key=lambda row: (row[paths.STEP], row[_ROW_ID]))
    ]


def properties(path: str | Path) -> dict[str, dict[str, Any]]:
    """Flat values of the run by group: its settings in "run", its results in "summary"."""
    groups: dict[str, dict[str, Any]] = {}
    for entity, batch in batches(path, "/__properties/**"):
        held = [name for name in batch.schema.names if name not in (_ROW_ID, paths.STEP, paths.TIME)]
        row = {name: batch[name][0].as_py() for name in held}
        groups[entity.rpartition("/")[2]] = {name: value[0] for name, value in row.items() if value}
    return groups


def steps(path: str | Path) -> NDArray:
    """The steps (n,) that reached the file."""
    return scalars(path, paths.EGO_SPEED)[paths.EGO_SPEED][0]


def span(path: str | Path) -> tuple[float, float]:
    """First and last time [s] of the run."""
    times = [
        batch[paths.TIME].cast(pa.int64())
        for _, batch in batches(path, f"/{paths.EGO_SPEED}")
        if paths.TIME in batch.schema.names
    ]
    if not times:
        raise ValueError(f"the log {path} has no step")
    ns = np.concatenate([np.asarray(column) for column in times])
    return float(ns.min() / 1e9), float(ns.max() / 1e9)


class Columns:
    """All rows of a log in memory."""

    def __init__(self, path: str | Path) -> None:
        """Read the log; raises OSError or ValueError, in one sentence, where that cannot be."""
        self._batches: dict[str, list[pa.RecordBatch]] = defaultdict(list)
        for entity, batch in batches(path):
            self._batches[entity.lstrip("/")].append(batch)

    def entities(self, start: str) -> list[str]:
        """Entities whose path begins so, sorted."""
        return sorted(entity for entity in self._batches if entity.startswith(start))

    def static(self, entity: str, component: str) -> list[Any]:
        """Values of a component without a time, those that were logged last; empty where there are none."""
        found: list[Any] = []
        for batch in self._batches.get(entity, []):
            if component in batch.schema.names and paths.STEP not in batch.schema.names:
                found = next((row for row in reversed(batch[component].to_pylist()) if row is not None), found)
        return found

    def vehicles(self) -> list[int]:
        """Ids of all vehicles, ascending."""
        return sorted({int(entity.split("/")[1].rpartition("_")[2]) for entity in self.entities("objects/")})

    def names(self) -> dict[int, str]:
        """Id of an object -> the name that the viewer shows, which ends with its class."""
        found = {}
        for entry in self.static(paths.TRUTH_CONTOUR, "AnnotationContext:context"):
            for info in entry if isinstance(entry, list) else [entry]:
                described = info["class_description"]["info"]
                found[described["id"] - 1] = described["label"]
        return found

    def _timed(self, entity: str, component: str) -> Iterator[tuple[NDArray, pa.Array]]:
        """Steps and lists of the rows that have a component."""
        for batch in self._batches.get(entity, []):
            if component in batch.schema.names and paths.STEP in batch.schema.names:
                there = batch[component].is_valid()
                steps = batch[paths.STEP].filter(there).to_numpy(zero_copy_only=False)
                yield steps, batch[component].filter(there)

    def numbers(self, entity: str, component: str) -> dict[int, NDArray]:
        """Step -> numbers (n,)."""
        found: dict[int, NDArray] = {}
        for steps, lists in self._timed(entity, component):
            values = lists.flatten().to_numpy(zero_copy_only=False)
            found |= zip(steps.tolist(), _split(values, lists), strict=True)
        return found

    def texts(self, entity: str, component: str) -> dict[int, list[str]]:
        """Step -> texts."""
        return {
            step: texts
            for steps, lists in self._timed(entity, component)
            for step, texts in zip(steps.tolist(), lists.to_pylist(), strict=True)
        }

    def held(self, entity: str, component: str, first: str) -> dict[int, list[str]]:
        """Step of every scan -> texts of what is logged when it changes; `first` before that."""
        changes = self.texts(entity, component)
        found, last = {}, [first]
        for step in self.times:
            found[step] = last = changes.get(step, last)
        return found

    def points(self, entity: str, component: str) -> dict[int, NDArray]:
        """Step -> points (n, 2), or vectors (n, 3), (n, 4)."""
        found: dict[int, NDArray] = {}
        for steps, lists in self._timed(entity, component):
            found |= zip(steps.tolist(), _split(_points(lists.flatten()), lists), strict=True)
        return found

    def strips(self, entity: str, component: str = "LineStrips2D:strips") -> dict[int, list[NDArray]]:
        """Step -> polylines (P, 2)."""
        found: dict[int, list[NDArray]] = {}
        for steps, lists in self._timed(entity, component):
            lines = lists.flatten()
            each = _split(_points(lines.flatten()), lines)
            ends = np.cumsum(np.asarray(lists.value_lengths()))
            for step, end, count in zip(steps.tolist(), ends.tolist(), np.asarray(lists.value_lengths()), strict=True):
                found[step] = each[end - count : end]
        return found

    @cached_property
    def times(self) -> dict[int, float]:
        """Step -> time [s] of every scan."""
        found: dict[int, float] = {}
        for batch in self._batches.get(paths.EGO_SPEED, []):
            if paths.STEP in batch.schema.names:
                ns = np.asarray(batch[paths.TIME].cast(pa.int64()))
                found |= zip(
                    batch[paths.STEP].to_numpy(zero_copy_only=False).tolist(), (ns / 1e9).tolist(), strict=True
                )
        return dict(sorted(found.items()))


def _points(vectors: pa.Array) -> NDArray:
    """Vectors of fixed length as rows."""
    return vectors.flatten().to_numpy(zero_copy_only=False).reshape(-1, vectors.type.list_size).astype(float)


def _split(values: NDArray, lists: pa.Array) -> list[NDArray]:
    return np.split(values, np.cumsum(np.asarray(lists.value_lengths()))[:-1]) if len(lists) else []
