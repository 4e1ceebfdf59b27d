"""Rows of plain arrays into a rerun file, many frames in one call.

`send_columns` of a block costs about what a single `log` call costs. Every component has its arrow type in the table
below, or is a plain column.
"""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple
from weakref import finalize

import numpy as np
import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb
from rerun.error_utils import catch_and_log_exceptions

from testbed.log import paths
from testbed.log.block_file import BlockFile
from testbed.log.layers import Row, Strips

Entry = tuple[int, int, Row]  # step, time [ns], row
Block = dict[tuple[str, tuple[str, ...]], list[Entry]]  # (entity, its components) -> rows

_BATCH = {
    "Arrows2D:colors": rr.components.ColorBatch,
    "Arrows2D:origins": rr.components.Position2DBatch,
    "Arrows2D:vectors": rr.components.Vector2DBatch,
    "LineStrips2D:class_ids": rr.components.ClassIdBatch,
    "LineStrips2D:colors": rr.components.ColorBatch,
    "LineStrips2D:strips": rr.components.LineStrip2DBatch,
    "Points2D:colors": rr.components.ColorBatch,
    "Points2D:labels": rr.components.TextBatch,
    "Points2D:positions": rr.components.Position2DBatch,
    "Scalars:scalars": rr.components.ScalarBatch,
    "StateChange:state": rr.components.TextBatch,
    "TextLog:level": rr.components.TextLogLevelBatch,
    "TextLog:text": rr.components.TextBatch,
    "Transform3D:quaternion": rr.components.RotationQuatBatch,
    "Transform3D:translation": rr.components.Translation3DBatch,
}


class ComponentColumn(NamedTuple):
    """One component of a block of rows, in the form that rerun's `send_columns` takes without conversion."""

    descriptor: rr.ComponentDescriptor
    array: pa.Array  # lists of instances, one list a row

    def component_descriptor(self) -> rr.ComponentDescriptor:
        """Name and type of the component."""
        return self.descriptor

    def as_arrow_array(self) -> pa.Array:
        """Instances of all rows."""
        return self.array


def strips_array(parts: list[Strips]) -> pa.Array:
    """Ragged polylines as the list-of-points array of rerun, without a Python loop over lines."""
    kind = rr.components.LineStrip2DBatch._ARROW_DATATYPE
    counts = np.concatenate([part.counts for part in parts])
    offsets = np.append(0, np.cumsum(counts)).astype(np.int32)
    points = np.concatenate([part.xy for part in parts])
    flat = pa.array(points.ravel(), pa.float32())
    inner = pa.FixedSizeListArray.from_arrays(flat, type=kind.value_type)
    return pa.ListArray.from_arrays(pa.array(offsets), inner, type=kind)


@lru_cache(maxsize=1024)
def descriptor(component: str) -> rr.ComponentDescriptor:
    """Descriptor of a component: rerun's own where it is in the table, else a plain column."""
    archetype, _ = component.split(":")
    if component not in _BATCH:
        return rr.ComponentDescriptor(component, archetype=archetype)
    kind = _BATCH[component]([]).component_type()
    return rr.ComponentDescriptor(component, archetype=f"rerun.archetypes.{archetype}", component_type=kind)


def column(component: str, values: list) -> ComponentColumn:
    """One component of a block of rows; values are arrays or lists of instances, or single numbers."""
    kind = _BATCH[component]._ARROW_DATATYPE if component in _BATCH else None
    if isinstance(values[0], float | int):
        data = pa.ListArray.from_arrays(_ones(len(values)), pa.array(values, kind))
        return ComponentColumn(descriptor(component), data)
    if isinstance(values[0], Strips):
        data = strips_array(values)
    elif isinstance(values[0], list):
        data = pa.array([item for value in values for item in value], kind)
    elif component in _BATCH:
        data = _BATCH[component](np.concatenate(values), strict=True).as_arrow_array()
    else:
        data = pa.array(np.concatenate(values))
    offsets = np.cumsum(np.array([0] + [len(value) for value in values], np.int32), dtype=np.int32)
    return ComponentColumn(descriptor(component), pa.ListArray.from_arrays(pa.array(offsets), data))


@lru_cache(maxsize=256)
def _ones(rows: int) -> pa.Array:
    return pa.array(np.arange(rows + 1, dtype=np.int32))


def _indexes(when: tuple[tuple[int, int], ...]) -> list[rr.TimeColumn]:
    step, ns = np.array(when, np.int64).T
    return [rr.TimeColumn(paths.STEP, sequence=step), rr.TimeColumn(paths.TIME, duration=ns.astype("timedelta64[ns]"))]


class Stream:
    """One open log with its blueprint; without `close` it ends when the stream is collected, or the process exits."""

    def __init__(self, path: Path, run_id: str, blueprint: rrb.Blueprint) -> None:
        """Open the file and write the blueprint; raises OSError, in one sentence, where that cannot be."""
        self._file = BlockFile(path)
        self._stream = rr.RecordingStream(paths.APPLICATION, recording_id=run_id)
        rr.set_log_time_enabled(False, recording=self._stream)
        opened = False
        try:
            self._stream.save(self._file.pipe, default_blueprint=blueprint)
            self._write()
            opened = True
        except OSError as error:
            raise OSError(f"{error}; choose another directory") from error
        finally:
            if not opened:
                end(self._stream, self._file, replace=False)
                self._file.part.unlink()
        self._forgotten = finalize(self, end, self._stream, self._file)

    @property
    def path(self) -> Path:
        """Where the file lies now."""
        return self._file.part

    def static(self, path: str, data: rr.AsComponents) -> None:
        """Log data without a time."""
        self._stream.log(path, data, static=True, strict=True)

    def send(self, block: Block) -> None:
        """Write all rows of a block and hand them to the operating system; raises OSError where that cannot be."""
        times: dict[tuple[tuple[int, int], ...], list[rr.TimeColumn]] = {}
        with catch_and_log_exceptions(strict=True):
            for (path, components), entries in block.items():
                when = tuple((step, ns) for step, ns, _ in entries)
                if when not in times:
                    times[when] = _indexes(when)
                columns = [column(name, [row[name] for _, _, row in entries]) for name in components]
                self._stream.send_columns(path, times[when], columns)
        self._write()

    def blueprint(self, blueprint: rrb.Blueprint) -> None:
        """Write another layout, which takes the place of the one before."""
        self._stream.send_blueprint(blueprint, make_active=True, make_default=True)

    def property(self, name: str, values: Mapping[str, str | int | float | bool]) -> None:
        """Write flat values that become columns of a table of runs."""
        with catch_and_log_exceptions(strict=True):
            self._stream.send_property(name, rr.AnyValues(**values))

    def close(self, replace: bool = True) -> None:
        """Write the footer, close the file, give it its name if `replace`; raises OSError where that cannot be."""
        self._forgotten.detach()
        end(self._stream, self._file, replace)

    def _write(self) -> None:
        self._stream.flush()
        self._file.write()


def end(stream: rr.RecordingStream, file: BlockFile, replace: bool = True) -> None:
    """Let rerun write the footer, and finish the file."""
    stream.disconnect()
    file.finish(replace)
