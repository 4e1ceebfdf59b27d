"""The reported tracks of a replay as one Parquet file, a row for each tracker, scan and track."""

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from testbed.files import atomic_file, noting_losses
from testbed.frame import Frame
from trackers.estimate import Estimate
from trackers.multi.tracks import Tracks

EVERY = 200  # scans that are written together


class Field(NamedTuple):
    """One column of the file."""

    name: str
    unit: str  # empty for what has none
    note: str
    get: Callable[[Tracks], Any]  # values (T,) of the reported tracks
    type: pa.DataType = pa.float64()


def _of(name: str, *column: int) -> Callable[[Tracks], NDArray]:
    """One column of a field of the estimate."""
    return lambda tracks: getattr(tracks.estimate, name)[(..., *column)]


FIELDS = (
    Field("track", "", "id of the track", lambda t: t.id, pa.int64()),
    Field("x", "m", "centre, in the frame of `ego`", _of("pose", 0)),
    Field("y", "m", "its other axis", _of("pose", 1)),
    Field("heading", "rad", "direction ahead", _of("pose", 2)),
    Field("vx", "m/s", "velocity of the centre", _of("velocity", 0)),
    Field("vy", "m/s", "its other axis", _of("velocity", 1)),
    Field("yaw_rate", "rad/s", "turning", _of("yaw_rate")),
    Field("length", "m", "of the box", _of("size", 0)),
    Field("width", "m", "of the box", _of("size", 1)),
    Field("existence", "", "probability that there is such a vehicle", lambda t: t.existence),
    Field("age", "s", "since the first scan of the track", lambda t: t.age),
    Field("detections", "", "scans in which it had a detection", lambda t: t.hits, pa.int64()),
    *(
        Field(f"cov_{'_'.join((a, b))}", f"{unit}", f"covariance of {a} and {b}", _of("cov", i, j))
        for i, a in enumerate(("x", "y", "vx", "vy"))
        for j, b in enumerate(("x", "y", "vx", "vy"))
        for unit in [("m^2", "m^2/s", "m^2/s^2")[(i > 1) + (j > 1)]]
        if i <= j
    ),
    Field("length_std", "m", "standard deviation of the length", _of("size_std", 0)),
    Field("width_std", "m", "of the width", _of("size_std", 1)),
    Field("heading_std", "rad", "of the heading", _of("heading_std")),
    Field("yaw_rate_std", "rad/s", "of the yaw rate", _of("yaw_rate_std")),
    Field(
        "contour_x",
        "m",
        "outline, where the tracker has one",
        lambda t: _contour(t.estimate, 0),
        pa.list_(pa.float64()),
    ),
    Field("contour_y", "m", "its other axis", lambda t: _contour(t.estimate, 1), pa.list_(pa.float64())),
)


def _contour(estimate: Estimate, axis: int) -> list[NDArray | None]:
    if estimate.contour is None:
        return [None] * len(estimate.pose)
    return list(estimate.contour[..., axis])


SCHEMA = pa.schema(
    [
        pa.field("tracker", pa.string()),
        pa.field("time", pa.float64(), metadata={"unit": "s"}),
        *(pa.field(f.name, f.type, metadata={"unit": f.unit}) for f in FIELDS),
    ]
)


class TracksFile:
    """Observer that writes the tracks of all trackers; use as a context manager, the file is there when it ends.

    A disk that becomes full on the way ends the file with a `LostFileWarning`, whose sentence goes into `lost`.

    Args:
        path: of the file.
        times: (F,) [s] of each frame by its step, as they go into the file.
        lost: sentences about what could not be written.
    """

    def __init__(self, path: Path, times: NDArray, lost: list[str]) -> None:
        self._path, self._times, self._lost = path, times, lost
        self._waiting: list[pa.RecordBatch] = []
        self._fault: OSError | None = None
        self._open = ExitStack()
        self.written: Path | None = None

    def __enter__(self) -> Self:
        file = self._open.enter_context(atomic_file(self._path))
        self._writer = self._open.enter_context(pq.ParquetWriter(file, SCHEMA))
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if error is None:
            self._write()
            kind, error = (None, None) if self._fault is None else (type(self._fault), self._fault)
        with noting_losses(self._lost):
            if not self._open.__exit__(kind, error, trace) and error is None:
                self.written = self._path

    def __call__(self, frame: Frame) -> None:
        """Take the reported tracks of one frame."""
        for name, (tracks, _) in frame.outputs.items():
            reported = tracks._replace(state=None).reported
            count = len(reported.id)
            columns = [pa.array([name] * count, pa.string()), pa.array(np.full(count, self._times[frame.step]))]
            columns += [pa.array(field.get(reported), field.type) for field in FIELDS]
            self._waiting.append(pa.record_batch(columns, SCHEMA))
        if len(self._waiting) >= EVERY * len(frame.outputs):
            self._write()

    def _write(self) -> None:
        """Write what waits; after a fault of the disk nothing more."""
        waiting, self._waiting = self._waiting, []
        if self._fault is None:
            try:
                self._writer.write_table(pa.Table.from_batches(waiting, SCHEMA))
            except OSError as error:
                self._fault = error
