"""The reported tracks of a replay as one file, Parquet or CSV, a row for each tracker, scan and track."""

from contextlib import ExitStack
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from testbed.files import atomic_file, noting_losses
from testbed.frame import Frame
from testbed.replay.columns import COVARIANCES, EDGES, STATE, TRACKS
from testbed.replay.tables import CSV
from testbed.replay.truth import contour_text
from trackers.multi.tracks import Tracks

EVERY = 200  # scans that are written together
QUOTED = pa_csv.WriteOptions(quoting_style="needed")


PLACES: dict[str, tuple[str, tuple[int, ...]]] = {  # column of numbers -> field of `Tracks` or `Estimate`, place in it
    **{name: (name, ()) for name in ("existence", "age", "yaw_rate", "heading_std", "yaw_rate_std")},
    "id": ("id", ()),
    "detections": ("hits", ()),
    **{name: ("pose", (k,)) for k, name in enumerate(("x", "y", "heading"))},
    **{name: ("velocity", (k,)) for k, name in enumerate(("vx", "vy"))},
    **{f"{name}{std}": (f"size{std}", (k,)) for k, name in enumerate(("length", "width")) for std in ("", "_std")},
    **{f"{name}_std": ("edge_std", (k,)) for k, name in enumerate(EDGES)},
    **{f"cov_{a}_{b}": ("cov", (STATE.index(a), STATE.index(b))) for a, b, _ in COVARIANCES},
}
WHOLE = ("id", "detections")  # columns of whole numbers
SCHEMA = pa.schema(
    [
        pa.field(
            column.name,
            pa.int64() if column.name in WHOLE else pa.string() if column.text else pa.float64(),
            metadata={"unit": column.unit},
        )
        for column in TRACKS.columns
        if column.name != "class"  # trackers have probabilities, and no names, of classes
    ]
)


def _column(name: str, tracks: Tracks) -> Any:
    """A column (T,) of the reported tracks; None where nothing is known."""
    estimate = tracks.estimate
    if name == "contour":
        return [None] * len(tracks.id) if estimate.contour is None else [contour_text([c]) for c in estimate.contour]
    field, place = PLACES[name]
    value = getattr(tracks if hasattr(tracks, field) else estimate, field)
    return [None] * len(tracks.id) if value is None else value[(..., *place)]


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
        kind = partial(pa_csv.CSVWriter, write_options=QUOTED) if self._path.suffix == CSV else pq.ParquetWriter
        self._writer = self._open.enter_context(kind(file, SCHEMA))
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
            known = {"tracker": [name] * count, "time": np.full(count, self._times[frame.step])}
            values = (known[f.name] if f.name in known else _column(f.name, reported) for f in SCHEMA)
            columns = [pa.array(v, field.type, from_pandas=True) for v, field in zip(values, SCHEMA, strict=True)]
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
