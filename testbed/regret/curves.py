"""The curves of one drive as a table of its frames, which a Parquet file keeps with the measures of the drive."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from testbed.evaluation.driving import DriveCurves, DriveFrame

COLUMNS = {  # name: unit, note
    "time": ("s", "since the reset"),
    "x": ("m", "of the centre of the ego"),
    "y": ("m", "of the centre of the ego"),
    "heading": ("rad", "of the ego"),
    **dict.fromkeys(DriveFrame._fields, ("", "as in `DriveFrame`")),
    "discrepancy": ("1", "size of the largest difference between tracks and truth, see `discrepancy`"),
}
WORDS = {"action": "the planner's last choice", "cause": "the largest difference between tracks and truth"}
SCHEMA = pa.schema(
    [pa.field(n, pa.float64(), metadata={"unit": unit, "note": note}) for n, (unit, note) in COLUMNS.items()]
    + [pa.field(n, pa.string(), metadata={"unit": "", "note": note}) for n, note in WORDS.items()]
)


class Curves(NamedTuple):
    """One drive over its F frames."""

    drive: DriveCurves
    pose: NDArray  # (F, 3) x, y [m], heading [rad] of the ego
    discrepancy: NDArray  # (F,)
    action: Sequence[str]  # (F,)
    cause: Sequence[str]  # (F,)

    def table(self) -> pa.Table:
        """Columns of `SCHEMA`."""
        found = {**self.drive._asdict(), **dict(zip(("x", "y", "heading"), self.pose.T, strict=True))}
        found |= {"discrepancy": self.discrepancy, "action": list(self.action), "cause": list(self.cause)}
        return pa.table([pa.array(found[f.name], f.type) for f in SCHEMA], schema=SCHEMA)

    @classmethod
    def of(cls, table: pa.Table) -> "Curves":
        """Back from a table."""

        def column(name: str) -> NDArray:
            return table[name].to_numpy()

        pose = np.stack([column(name) for name in ("x", "y", "heading")], -1)
        words = [table[name].to_pylist() for name in WORDS]
        return cls(DriveCurves(*map(column, DriveCurves._fields)), pose, column("discrepancy"), *words)
