"""What a log holds, for tests: its components, its rows, and a digest of its content."""

import hashlib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from sensors.origin import KINDS
from testbed.log import paths
from testbed.log.reader import batches

ROW_ID = "rerun.controls.RowId"
DESCRIBES = ("/run", "/__properties")  # left out of the digest: versions and settings, nothing that happened


def components(path: str | Path) -> dict[str, set[str]]:
    """Entity -> names of its components."""
    found: dict[str, set[str]] = defaultdict(set)
    for entity, batch in batches(path):
        found[entity.lstrip("/")] |= set(_component_names(batch))
    return dict(found)


def rows(path: str | Path, entity: str) -> Iterator[dict[str, Any]]:
    """Everything logged at one entity, a row at a time: component -> values, and the timelines."""
    for _, batch in batches(path, f"/{entity.lstrip('/')}"):
        yield from batch.to_pylist()


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
    ids = np.frombuffer(b"".join(value.as_py() for value in batch[ROW_ID]), ">u8").reshape(-1, 2).astype(np.int64)
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
    return [name for name in batch.schema.names if name not in (ROW_ID, paths.STEP, paths.TIME)]


def scene_layers(trackers: tuple[str, ...]) -> tuple[str, ...]:
    """Every layer of geometry of a run at level full, static ones included."""
    fixed = (paths.RADAR_FOV, paths.RINGS, paths.RING_LABELS, paths.ROAD_SURFACE, paths.ROAD_EDGES, paths.ROAD_LANES)
    around = (paths.FOLLOW, paths.OVERVIEW, paths.EGO, *fixed, paths.WALLS, paths.EGO_PLAN)
    truth = (paths.TRUTH_CONTOUR, paths.TRUTH_HEADING, paths.TRUTH_EGO, paths.TRUTH_NAMES)
    tracked = tuple(paths.tracker(name, layer) for name in trackers for layer in paths.TRACKER_LAYERS)
    after = tuple(paths.smoothed(name, layer) for name in trackers for layer in ("extent", "path"))
    return around + truth + tuple(paths.detections(kind) for kind in KINDS) + tracked + after
