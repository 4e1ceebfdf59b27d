"""Columns of a log by entity: one pass over the file, and its lists as arrays, a row at a time."""

from collections import defaultdict
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from testbed.log import paths
from testbed.log.reader import batches


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
        """Step -> points (n, 2)."""
        found: dict[int, NDArray] = {}
        for steps, lists in self._timed(entity, component):
            found |= zip(steps.tolist(), _split(_xy(lists.flatten()), lists), strict=True)
        return found

    def strips(self, entity: str, component: str = "LineStrips2D:strips") -> dict[int, list[NDArray]]:
        """Step -> polylines (P, 2)."""
        found: dict[int, list[NDArray]] = {}
        for steps, lists in self._timed(entity, component):
            lines = lists.flatten()
            each = _split(_xy(lines.flatten()), lines)
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


def _xy(points: pa.Array) -> NDArray:
    return points.flatten().to_numpy(zero_copy_only=False).reshape(-1, 2).astype(float)


def _split(values: NDArray, lists: pa.Array) -> list[NDArray]:
    """The values of each list."""
    return np.split(values, np.cumsum(np.asarray(lists.value_lengths()))[:-1]) if len(lists) else []
