"""Reads review logs: numbers, events, properties, and a digest of the content.

Works on logs of finished runs and of runs that were killed; the latter have no footer, see `complete`. Raises
ValueError for a damaged log; at some damages rerun ends the process, so a log that comes from elsewhere goes through
`testbed.log.review.readable` before.
"""

import hashlib
import warnings
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from testbed.log import paths

_ROW_ID = "rerun.controls.RowId"
DESCRIBES = ("/run", "/__properties")  # left out of the digest: versions and settings, nothing that happened


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


def components(path: str | Path) -> dict[str, set[str]]:
    """Entity -> names of its components."""
    found: dict[str, set[str]] = defaultdict(set)
    for entity, batch in batches(path):
        found[entity.lstrip("/")] |= set(_component_names(batch))
    return dict(found)


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
    return {
        entity: _sorted(*(np.concatenate(column) for column in zip(*found, strict=True)))
        for entity, found in parts.items()
    }


def rows(path: str | Path, entity: str) -> Iterator[dict[str, Any]]:
    """Everything logged at one entity, a row at a time: component -> values, and the timelines."""
    for _, batch in batches(path, f"/{entity.lstrip('/')}"):
        yield from batch.to_pylist()


def _sorted(steps: NDArray, values: NDArray) -> tuple[NDArray, NDArray]:
    order = np.argsort(steps, kind="stable")
    return steps[order], values[order]


def events(path: str | Path) -> list[LoggedEvent]:
    """The event list in the order it was written."""
    rows = [row for _, batch in batches(path, f"/{paths.EVENTS}") for row in batch.to_pylist()]
    rows = sorted(rows, key=lambda row: (row[paths.STEP], row[_ROW_ID]))
    return [
        LoggedEvent(row[paths.STEP], _seconds(row[paths.TIME]), row["TextLog:level"][0], row["TextLog:text"][0])
        for row in rows
    ]


def _seconds(duration: Any) -> float:
    return duration.total_seconds()


def properties(path: str | Path) -> dict[str, dict[str, Any]]:
    """Flat values of the run by group: its settings in "run", its results in "summary"."""
    groups: dict[str, dict[str, Any]] = {}
    for entity, batch in batches(path, "/__properties/**"):
        row = {name: batch[name][0].as_py() for name in _component_names(batch)}
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


def digests(path: str | Path) -> dict[str, str]:
    """SHA-256 of the content of each column by "entity component"; it does not depend on the blocks in the file."""
    pieces: dict[str, list[tuple[NDArray, pa.Array]]] = defaultdict(list)
    for entity, batch in batches(path):
        if entity.startswith(DESCRIBES):
            continue
        order = _order(batch)
        for name in _component_names(batch):
            there = batch[name].is_valid()
            pieces[f"{entity} {name}"].append((order[np.asarray(there)], batch[name].filter(there)))
    return {key: _sha(pieces[key]) for key in sorted(pieces)}


def digest(path: str | Path) -> str:
    """One SHA-256 of all columns: equal runs have equal digests, although their files differ."""
    total = hashlib.sha256()
    for key, value in digests(path).items():
        total.update(f"{key} {value}\n".encode())
    return total.hexdigest()


def _order(batch: pa.RecordBatch) -> NDArray:
    """Sort keys (n, 4) of rows: step, time, and the row id, which counts up while a log is written."""
    ids = np.frombuffer(b"".join(value.as_py() for value in batch[_ROW_ID]), ">u8").reshape(-1, 2).astype(np.int64)
    if paths.STEP not in batch.schema.names:
        when = np.full((len(ids), 2), -1)
    else:
        when = np.stack([np.asarray(batch[name].cast(pa.int64())) for name in (paths.STEP, paths.TIME)], -1)
    return np.hstack([when, ids])


def _sha(pieces: list[tuple[NDArray, pa.Array]]) -> str:
    """Hash of one column with its times, rows in order; row ids only order."""
    keys = np.concatenate([order for order, _ in pieces])
    rows = np.lexsort(keys.T[::-1])
    column = pa.concat_arrays([values for _, values in pieces]).take(pa.array(rows))
    total = hashlib.sha256(str(column.type).encode())
    total.update(keys[rows, :2].tobytes())
    _feed(total, column)
    return total.hexdigest()


def _feed(total: Any, array: pa.Array) -> None:
    """Hash an array by value: validity, lengths and plain numbers, independent of its buffers."""
    total.update(np.asarray(array.is_valid()).tobytes())
    kind = array.type
    if pa.types.is_list(kind):
        total.update(np.asarray(array.value_lengths().fill_null(0)).tobytes())
        _feed(total, array.flatten())
    elif pa.types.is_fixed_size_list(kind):
        _feed(total, array.flatten())
    elif pa.types.is_struct(kind):
        for i in range(kind.num_fields):
            _feed(total, array.field(i))
    elif pa.types.is_floating(kind) or pa.types.is_integer(kind):
        total.update(np.asarray(array.fill_null(0)).tobytes())
    else:
        total.update(repr(array.to_pylist()).encode())


def _component_names(batch: pa.RecordBatch) -> list[str]:
    return [name for name in batch.schema.names if name not in (_ROW_ID, paths.STEP, paths.TIME)]
