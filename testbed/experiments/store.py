"""The folder of a study: a file of each run, which is whole or not there, and what all of them have in common.

`study.json` says what identifies the runs, `rows/RUN.parquet` holds what is kept of one, `recordings/RUN.npz` a drive
that runs in open loop replay. Two processes may work on one folder: each replaces whole files.
"""

import json
import shutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import Any
from zlib import crc32

import pandas as pd
import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from testbed.experiments.run import FOUND, Outcome, Run, outcome_of
from testbed.experiments.study import WHOLE_RUN, Kept, Study
from testbed.files import atomic_file, compiled, make_directory, write_json
from testbed.replay import recording as recordings
from trackers.json_file import read_json

ABOUT, RUNS = "study.json", "runs.parquet"
ROWS, RECORDINGS, LOGS = "rows", "recordings", "logs"
FILES, FOLDERS = (ABOUT, RUNS), (ROWS, RECORDINGS, LOGS)  # all that a study leaves, beside its report
OLDER = ("comparison.json", "regress.json", "drives")  # that older versions left
NO_TRACKERS = tuple(f"code of {what} " for what in ("the", "scenario", "radar", "planner"))  # keys of other code
VERSION = 4  # of the layout of a file
META, CHECKSUM = b"testbed", b"testbed checksum"
PARTS = ("simulation", "sensing", "loading", "tracking", "metrics", "writing")  # of the wall time, in order


class Store:
    """The files of a study."""

    def __init__(self, study: Study, out: str | Path | None = None) -> None:
        """The folder of the study, or a copy of it at `out`."""
        self.study, self.out = study, Path(out or study.out)

    def path(self, work: Any) -> Path:
        """Where the file of a run lies."""
        return self.out / ROWS / f"{work.name}.parquet"

    def recording_path(self, run: Run) -> Path:
        """Where the recording that a run replays lies."""
        return self.out / RECORDINGS / f"{run.recording_name}.npz"

    # The folder

    def open(self) -> None:
        """Make the folder ready for the runs of the study.

        A folder of other settings, versions or code is refused, or emptied where the study says so.

        Raises:
            ValueError, OSError: in one sentence that names what differs, or why nothing can be written.
        """
        self.check()
        wanted, found = self.study.identity(), self.about()
        if found and self.study.fresh and self._differs(wanted, found):
            others = {key for key in {*wanted, *found} if found.get(key) != wanted.get(key)}
            of_trackers = all(key.startswith("code of ") and not key.startswith(NO_TRACKERS) for key in others)
            self._empty((ROWS, LOGS) if of_trackers else FOLDERS)
            found = {}
        for folder in (ROWS, RECORDINGS):
            make_directory(self.out / folder)
        if (known := {**wanted, **found}) != found:
            write_json(self.out / ABOUT, known)

    def check(self) -> None:
        """Raise ValueError or OSError as `open` does, without writing into the folder."""
        make_directory(self.out)
        found = self.about()
        if not found:
            if any((self.out / name).exists() for name in (ROWS, RECORDINGS, *OLDER)):
                raise ValueError(
                    f"out: {self.out} holds other files than those of `testbed {self.study.name}`, or runs of an older "
                    "version; choose another directory, or delete that one"
                )
        elif found.get("study") != self.study.name:
            raise ValueError(
                f"out: {self.out} holds runs of `testbed {found.get('study')}`, wanted are those of "
                f"`testbed {self.study.name}`; choose another directory"
            )
        elif not self.study.fresh and (key := self._differs(wanted := self.study.identity(), found)):
            raise ValueError(
                f"out: {self.out} holds runs with {key} {found.get(key)!r}, wanted is {wanted[key]!r}; "
                "choose another directory, or delete that one"
            )

    def about(self) -> dict[str, Any]:
        """What the folder says of its runs, nothing where there is none; ValueError where it is damaged."""
        path = self.out / ABOUT
        try:
            found = read_json(path)
        except FileNotFoundError:
            return {}
        except (ValueError, OSError):
            found = None
        if not isinstance(found, dict) or not found:
            raise ValueError(f"out: {path} is damaged; delete the folder, or choose another directory")
        return found

    def _differs(self, wanted: Mapping[str, Any], found: Mapping[str, Any]) -> str | None:
        """The first key that differs; a tracker of which the folder has no run yet may be new."""
        known = (key for key in wanted if not key.startswith("code of ") or key in found)
        return next((key for key in known if found.get(key) != wanted[key]), None)

    def _empty(self, folders: Sequence[str]) -> None:
        """Delete the files of the study, and these of its folders: recordings hold whatever the trackers are."""
        try:
            for path in sorted(self.out.iterdir()):
                if path.name in folders:
                    shutil.rmtree(path)
                elif path.name in FILES:
                    path.unlink()
        except OSError as error:
            raise OSError(f"out: cannot empty {self.out}: {error.strerror}; choose another directory") from error

    # Runs

    def missing(self, works: Sequence[Any]) -> list[Any]:
        """The work that has no file, or a damaged one."""
        return [work for work in works if not self.is_made(work)]

    def is_made(self, work: Any) -> bool:
        """Whether the file of a run is there, undamaged."""
        if not self.path(work).exists():
            return False
        with suppress(ValueError):
            self.verify(work)
            return True
        return False

    def write(self, work: Any, kept: Kept) -> None:
        """Write the file of a run; the time that it takes is in its seconds.

        Raises OSError, in one sentence, where it cannot be written.
        """
        start, table = perf_counter(), kept.table
        with (
            atomic_file(self.path(work)) as file,
            pq.ParquetWriter(file, table.schema, compression="zstd", write_page_checksum=True) as writer,
        ):
            writer.write_table(table)
            seconds = {**kept.seconds, "writing": perf_counter() - start}
            known = {"layout": VERSION, "rows": table.num_rows, "content": content(table), "run": work.key}
            known |= {"spans": list(kept.spans), "seconds": seconds, "compiled": compiled(), **kept.more}
            text = json.dumps(known, allow_nan=False).encode()
            writer.add_key_value_metadata({META: text, CHECKSUM: _checksum(text)})  # pages have theirs, this has not

    def meta(self, work: Any) -> dict[str, Any]:
        """What a file says of its run, beside the table.

        Raises:
            FileNotFoundError: it has not been made.
            ValueError: the file is damaged, of another layout, or of another run.
        """
        path = self.path(work)
        found = read_meta(path, self.study.schema)
        if found.get("run") != work.key:
            raise ValueError(f"{path} holds the run {found.get('run')}")
        return found

    def verify(self, work: Any) -> None:
        """Raise ValueError or FileNotFoundError as `meta` does, and where the table itself is damaged."""
        meta, path = self.meta(work), self.path(work)
        try:
            table = pq.read_table(path, page_checksum_verification=True)
            if content(table) != meta["content"]:  # page headers have no checksum
                raise ValueError("its rows are not those that were written")
        except (pa.ArrowException, ValueError, OSError) as error:
            raise ValueError(f"{path} is damaged ({_one_line(error)})") from None

    def table(self, work: Any) -> pa.Table:
        """What was kept of a run, frame by frame."""
        return pq.read_table(self.path(work))

    # Recordings

    def recording(self, run: Run) -> recordings.Recording:
        """The drive that a run replays; it is made where it is missing or damaged."""
        path, drive = self.recording_path(run), run.recording
        if path.exists():
            with suppress(ValueError):
                return recordings.load(path, drive.scenario, drive.seed, drive.radar)
        made = recordings.record(drive.scenario, drive.seed, drive.radar, config=drive.settings)
        recordings.save(made, path)
        return made


def read_meta(path: Path, schema: pa.Schema) -> dict[str, Any]:
    """What the file of a run says beside its table, which has this schema; raises as `Store.meta`."""
    try:
        with pq.ParquetFile(path) as file:
            kept = file.metadata.metadata or {}
            rows, found_schema = file.metadata.num_rows, file.schema_arrow
        if kept[CHECKSUM] != _checksum(kept[META]):
            raise ValueError("wrong checksum")
        found = json.loads(kept[META])
    except FileNotFoundError:
        raise
    except (pa.ArrowException, KeyError, ValueError, OSError) as error:
        raise ValueError(f"{path} is damaged ({_one_line(error)})") from None
    complete = found.get("layout") == VERSION and found.get("rows") == rows
    if not (complete and found_schema.equals(schema, check_metadata=True)):
        raise ValueError(f"{path} is of another layout or not complete")
    return found


def make(work: Any, study: Study, out: Path) -> Outcome:
    """Do one unit of work, unless it has a valid file; what `engine.perform` calls, here or elsewhere."""
    store = Store(study, out)

    def done() -> str:
        note = ""
        if store.path(work).exists():
            try:
                store.verify(work)
                return FOUND
            except ValueError as error:
                note = str(error)
        store.write(work, study.make(work, store))
        return note

    return outcome_of(work.name, done)


def record(run: Run, study: Study, out: Path) -> Outcome:
    """Make the recording that a run replays, unless it is there."""
    store = Store(study, out)

    def done() -> str:
        if store.recording_path(run).exists():
            return FOUND
        store.recording(run)
        return ""

    return outcome_of(f"recording {run.recording_name}", done)


def reads(work: Any, study: Study, out: Path) -> list[Path]:
    """What a unit of work reads: its recording, and its own file, which it replaces where that is damaged."""
    store = Store(study, out)
    open_loop = isinstance(work, Run) and work.loop == "open"
    return [*([store.recording_path(work)] if open_loop else []), store.path(work)]


@dataclass
class Results:
    """What is known of the runs of a study: one table of all of them, and the table of each on demand."""

    study: Any  # the `Study`
    spans: pd.DataFrame  # one row a run and phase, phase "all" for all of it; `METRICS` has units
    missing: list[Any] = field(default_factory=list)  # runs that failed or have not been made
    metas: dict[Any, dict[str, Any]] = field(default_factory=dict)  # what the file of each run says beside its table

    @classmethod
    def read(cls, study: Study) -> "Results":
        """What the files in the folder of a study say of their runs; their tables are not read."""
        metas, missing = dict[Any, dict[str, Any]](), []
        for work in study.work():
            try:
                metas[work] = Store(study).meta(work)
            except (FileNotFoundError, ValueError):
                missing.append(work)
        found = [{**study.columns(work), **span} for work, meta in metas.items() for span in meta["spans"]]
        columns = dict.fromkeys(key for span in found for key in span)  # of runs, then those that only phases have
        return cls(study, pd.DataFrame(found, columns=list(columns) or ["phase"]), missing, metas)

    @property
    def store(self) -> Store:
        """The files of the runs."""
        return Store(self.study)

    @property
    def runs(self) -> pd.DataFrame:
        """One row a run, without the phases."""
        return self.spans[self.spans["phase"] == WHOLE_RUN]

    @property
    def compiled(self) -> str:
        """What the processes that made the runs had run in compiled form, each of what they say once."""
        return "; ".join(sorted({str(meta["compiled"]) for meta in self.metas.values() if "compiled" in meta}))

    @cached_property
    def seconds(self) -> pd.DataFrame:
        """One row a run: wall time [s] by part; that of a recording is counted with the first run that replays it."""
        recorded: set[Path] = set()
        found = []
        for work, meta in self.metas.items():
            spent = meta["seconds"]
            path = self.store.recording_path(work) if isinstance(work, Run) and work.loop == "open" else None
            if path is not None and path not in recorded:
                recorded.add(path)
                with suppress(ValueError):  # its file is gone or damaged
                    spent = {**recordings.read_seconds(path), **spent}
            found.append({**self.study.columns(work), **spent})
        return pd.DataFrame(found)

    @property
    def shares(self) -> dict[str, float]:
        """Wall time [s] by part, over all runs and the recordings that they used; processes side by side add up."""
        return {name: float(self.seconds[name].sum()) for name in PARTS if name in self.seconds}

    def rows(self, columns: Sequence[str], scenario: str | None = None, after: float = 0.0) -> pd.DataFrame:
        """Some columns of the tables of all runs, or of those of one scenario, from a time [s] on."""
        works = [work for work in self.metas if scenario in (None, self.study.columns(work)["scenario"])]
        paths = [str(self.store.path(work)) for work in works]
        later = ds.field("time") >= after if after else None
        return ds.dataset(paths, schema=self.study.schema, format="parquet").to_table(list(columns), later).to_pandas()


def content(table: pa.Table) -> int:
    """Checksum of the rows, however they are stored."""
    return crc32(pd.util.hash_pandas_object(table.to_pandas(), index=False).to_numpy().tobytes())


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _checksum(text: bytes) -> bytes:
    return f"{crc32(text):08x}".encode()
