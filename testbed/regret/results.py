"""The results of a folder: one row a drive, and the curves of each drive on demand."""

from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from testbed.experiments.rows import read_meta
from testbed.files import atomic_file
from testbed.regret.curves import SCHEMA, Curves
from testbed.regret.drives import drive_path
from testbed.regret.study import Study, Task

DRIVES, PAIRS = "drives.parquet", "pairs.parquet"  # tables in the folder of a study


class Drive(NamedTuple):
    """One drive as it was made."""

    task: Task
    measures: dict[str, float]
    tracking: dict[str, float | None]
    decisions: list[list[float]]
    times: list[float]  # [s] of the decisions
    cpu: float  # [s]

    @property
    def row(self) -> dict[str, Any]:
        """One flat row; collisions as a number."""
        measures = {key: float(value) for key, value in self.measures.items()}
        return {**self.task._asdict(), **measures, **self.tracking, "cpu": self.cpu}


class Results:
    """What is known of the drives of a study."""

    def __init__(self, study: Study) -> None:
        """Read the measures of all drives that have been made."""
        self.study = study
        self.drives: dict[Task, Drive] = {}
        self.missing: list[Task] = []  # that failed or have not been made
        for task in study.tasks:
            try:
                meta = read_meta(drive_path(task, Path(study.out)), SCHEMA)
            except (FileNotFoundError, ValueError):
                self.missing.append(task)
                continue
            seconds = float(meta["seconds"]["cpu"])
            self.drives[task] = Drive(
                task, meta["measures"], meta["tracking"], meta["decisions"], meta["times"], seconds
            )

    @cached_property
    def table(self) -> pd.DataFrame:
        """One row a drive: scenario, planner, condition, seed, measures, errors of its tracker, CPU time [s]."""
        return pd.DataFrame([drive.row for drive in self.drives.values()])

    def curves(self, task: Task) -> Curves:
        """The curves of a drive; ValueError where its file is damaged."""
        return Curves.of(pq.read_table(drive_path(task, Path(self.study.out))))


def write_table(table: pd.DataFrame, path: Path) -> Path:
    """Write a table of drives or of pairs; raises OSError, in one sentence, where it cannot be written."""
    with atomic_file(path) as file:
        pq.write_table(pa.Table.from_pandas(table, preserve_index=False), file)
    return path
