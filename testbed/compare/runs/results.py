"""The results of a folder: one table of all runs, and the rows of each run on demand."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from testbed.compare.runs.config import Comparison, Task
from testbed.compare.runs.tasks import RecordingTask, recording_of, recording_path, rows_path
from testbed.evaluation.metric import METRICS
from testbed.experiments.rows import SCHEMA, read_meta
from testbed.files import atomic_file
from testbed.replay.recording import read_seconds

RUNS = "runs.parquet"
UNITS = {"seed": "1", "start": "s", "end": "s"}  # of the columns of `RUNS` that are numbers and no metrics
WHOLE_RUN = "all"  # in place of a phase


class Results(NamedTuple):
    """What is known of the runs of a comparison."""

    comparison: Comparison
    spans: pd.DataFrame  # one row a run and phase, phase "all" for all of it; `METRICS` has units
    seconds: pd.DataFrame  # one row a run: wall time [s] by part
    missing: list[Task]  # runs that failed or have not been made

    @property
    def shares(self) -> dict[str, float]:
        """Wall time [s] by part, over all runs and the recordings that they used; processes side by side add up."""
        parts = self.seconds.drop(columns=list(Task._fields)).sum().to_dict() if len(self.seconds) else {}
        order = ("simulation", "sensing", "loading", "tracking", "metrics", "writing")
        return {name: float(parts[name]) for name in order if name in parts}

    @property
    def runs(self) -> pd.DataFrame:
        """One row a run, without the phases."""
        return self.spans[self.spans["phase"] == WHOLE_RUN]

    def rows(self, columns: Sequence[str], scenario: str | None = None, settled: bool = False) -> pd.DataFrame:
        """Some columns of the rows of all runs, or of those of one scenario; see `rows.COLUMNS`.

        settled: without those of the time that trackers have to settle.
        """
        gone = set(self.missing)
        tasks = [t for t in self.comparison.tasks if t not in gone and scenario in (None, t.scenario)]
        paths = [str(rows_path(task, Path(self.comparison.out))) for task in tasks]
        later = ds.field("time") >= self.comparison.settings.settle if settled else None
        return ds.dataset(paths, schema=SCHEMA, format="parquet").to_table(list(columns), later).to_pandas()


def collect(comparison: Comparison) -> Results:
    """Read what is known of every run."""
    out = Path(comparison.out)
    spans: list[dict[str, Any]] = []
    seconds: list[dict[str, Any]] = []
    missing: list[Task] = []
    recorded: set[RecordingTask] = set()
    for task in comparison.tasks:
        try:
            meta = read_meta(rows_path(task, out))
        except (FileNotFoundError, ValueError):
            missing.append(task)
            continue
        drive = meta["drive"] or {}
        for span in meta["spans"]:
            spans.append({**span, **meta["cost"], **drive} if span["phase"] == WHOLE_RUN else span)
        spent = meta["seconds"]
        recording = recording_of(task)
        if comparison.settings.loop == "open" and recording not in recorded:  # its cost is counted once
            recorded.add(recording)
            spent = {**_recording_seconds(recording, out), **spent}
        seconds.append({**task._asdict(), **spent})
    columns = dict.fromkeys(key for span in spans for key in span)  # of runs, then those that only phases have
    frame = pd.DataFrame(spans, columns=list(columns) or ["phase"])
    return Results(comparison, frame, pd.DataFrame(seconds), missing)


def _recording_seconds(task: RecordingTask, out: Path) -> dict[str, float]:
    """Wall time [s] that a recording took; nothing where its file is gone or damaged."""
    try:
        return read_seconds(recording_path(task, out))
    except ValueError:
        return {}


def write_runs(results: Results) -> Path:
    """Write what is known of every run as one table into the folder, with the units of its columns.

    Raises OSError, in one sentence, where it cannot be written.
    """
    path = Path(results.comparison.out) / RUNS
    table = pa.Table.from_pandas(results.spans, preserve_index=False)
    units = {name: METRICS[name].unit if name in METRICS else UNITS.get(name, "") for name in table.column_names}
    fields = [field.with_metadata({"unit": units[field.name]}) for field in table.schema]
    with atomic_file(path) as file:
        pq.write_table(table.cast(pa.schema(fields, table.schema.metadata)), file)
    return path
