"""`testbed benchmark run`, `check` and `score`: the runs of a benchmark as a study, and the entry that they give."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pyarrow as pa
from rich.console import Console

from testbed.evaluation.driving import drive_score
from testbed.experiments.benchmark import table
from testbed.experiments.benchmark.definition import LENGTH, SCORE, Benchmark, find
from testbed.experiments.benchmark.entries import TRACKER, TRACKS, Entry, entry
from testbed.experiments.episode import episode
from testbed.experiments.identity import own_module, tracker_digest
from testbed.experiments.recorded import RecordedComparison, files_digest
from testbed.experiments.rows import SCHEMA, Rows
from testbed.experiments.run import Run
from testbed.experiments.store import RECORDINGS, Results, Store
from testbed.experiments.study import Findings, Study, Tally
from testbed.files import file_stem, make_directory
from testbed.frame import TRUTH, Frame
from testbed.limits import check_names, check_whole
from testbed.replay.recording import RecordedFrame, Recording
from testbed.replay.writing import write
from trackers.json_file import read_json


@dataclass(frozen=True)
class Place:
    """Where a run belongs."""

    track: str
    case: str  # with its radar where that is not the first of the track
    run: Run


def places(benchmark: Benchmark, tracker: str, seeds: Sequence[int], tracks: Sequence[str]) -> Iterator[Place]:
    """All runs of one tracker."""
    for name in tracks:
        for seed in seeds:
            for case, run in benchmark.track(name).runs(tracker, seed):
                yield Place(name, case, run)


@dataclass(frozen=True)
class BenchmarkRuns(Study):
    """All runs of some trackers."""

    benchmark: str
    trackers: tuple[str, ...]
    phrase: str | None = None  # from which the seeds are made; None: the development seeds
    only: tuple[str, ...] = ()  # tracks; none: all
    first: int | None = None  # so many of the seeds; None: all

    name: ClassVar[str] = "benchmark"
    schema: ClassVar[pa.Schema] = SCHEMA

    def __post_init__(self) -> None:
        check_names("trackers", self.trackers)
        super().__post_init__()
        for name in self.only:
            self.version.track(name)
        if self.first is not None:
            check_whole("first", self.first, 1, len(self.version.development))

    @property
    def version(self) -> Benchmark:
        """The benchmark."""
        return find(self.benchmark)

    @cached_property
    def placed(self) -> dict[Run, Place]:
        """Every run with where it belongs."""
        seeds, tracks = self.version.seeds(self.phrase), [track.name for track in self.version.tracks]
        scored = [track.name for track in self.version.tracks if track.scored]
        asked = [(TRUTH, scored), *((tracker, tracks) for tracker in self.trackers)]
        return {p.run: p for tracker, names in asked for p in places(self.version, tracker, seeds, names)}

    def work(self) -> list[Run]:
        """All runs, or those of the tracks and seeds that are asked for."""
        seeds = self.version.seeds(self.phrase)[: self.first]
        return [r for r, p in self.placed.items() if r.seed in seeds and (not self.only or p.track in self.only)]

    def shared(self) -> dict[str, Any]:
        """The version."""
        return {"benchmark": self.benchmark, **{f"digest of {k}": v for k, v in self.version.digests().items()}}

    def columns(self, work: Run) -> dict[str, Any]:
        """What names a run in tables."""
        place = self.placed[work]
        return {"track": place.track, "scenario": place.case, "tracker": work.source, "seed": work.seed}

    def watch(self, run: Run) -> Rows:
        """Keeps the rows of the tracker."""
        return Rows(run)

    def entries(self, results: Results) -> list[Entry]:
        """An entry for each tracker, of the runs that there are, those of other tracks and seeds too."""
        results = Results.read(replace(self, only=(), first=None)) if self.only or self.first else results
        return [
            entry(
                self.version, name, TRACKER, self.phrase, list(_runs(self.version, results.runs, name)),
                results.compiled, cost=_cost(results, name), code=_code(name),
            )
            for name in self.trackers
        ]  # fmt: skip

    def judge(self, results: Results, tally: Tally) -> Findings:
        """The table of these trackers."""
        return Findings(list(table.shown(self.entries(results))))

    def write(self, results: Results, found: Findings, console: Console) -> None:
        """Write the entry of each tracker."""
        for one in self.entries(results):
            console.print(f"entry    {one.write(Path(self.out))}", soft_wrap=True, highlight=False)


def _runs(benchmark: Benchmark, spans: Any, name: str) -> Iterator[dict[str, Any]]:
    """The runs of one tracker as an entry has them, in the order of the definition."""
    key = ["track", "scenario", "seed"]
    aims = spans[spans["tracker"] == TRUTH].set_index(key)["progress"] if "progress" in spans else {}
    for row in spans[spans["tracker"] == name].to_dict("records"):
        track = benchmark.track(row["track"])
        if track.scored:
            row[SCORE] = float(drive_score(row, aims.get(tuple(row[k] for k in key), np.nan)))
        values = {measure: row.get(measure) for measure in track.measures}
        known = {k: float(v) if v is not None and np.isfinite(v) else None for k, v in values.items()}
        yield {"track": row["track"], "case": row["scenario"], "seed": int(row["seed"]), **known}


def _cost(results: Results, name: str) -> dict[str, float]:
    """Mean time of a scan [ms] by track."""
    own = results.runs[results.runs["tracker"] == name]
    return {str(k): round(float(v), 3) for k, v in own.groupby("track")["ms_per_scan"].mean().items() if np.isfinite(v)}


def _code(name: str) -> dict[str, str]:
    own = own_module(name, "tracker")
    return {"digest": tracker_digest(name), **({"module": own} if own else {})}


LISTED = "benchmark.json"  # in the folder of the recordings: which they are


def folder_of(case: str, seed: int) -> str:
    """Name of the folder of a recording."""
    return file_stem(case, f"seed{seed}")


def recorded(benchmark: Benchmark, phrase: str | None, tracks: Sequence[str], first: int | None = None) -> list[Place]:
    """What is recorded for trackers of any origin: the runs of the tracks in open loop, on the truth."""
    names = [name for name in tracks if benchmark.track(name).loop == "open"]
    return list(places(benchmark, TRUTH, benchmark.seeds(phrase)[:first], names))


def record(place: Place, study: Study, out: Path, format: str) -> list[Path]:
    """Write the scans of a run, by its radar with its faults, and the truth as tables; OSError where that cannot be."""
    store = Store(study)
    make_directory(store.out / RECORDINGS)
    drive = store.recording(place.run)
    frames: list[RecordedFrame] = []

    def keep(frame: Frame) -> None:
        frames.append(RecordedFrame(frame.scene, frame.scan, frame.origin))

    episode(place.run, [keep], drive)
    seen = Recording(place.run.scenario, place.run.seed, place.run.radar, tuple(frames), *drive[4:])
    return write(seen, out / folder_of(place.case, place.run.seed), format)


@dataclass(frozen=True)
class ScoredTracks(RecordedComparison):
    """Files of tracks on the recordings of a benchmark; made by `of_folder`."""

    benchmark: str = ""
    phrase: str | None = None

    name: ClassVar[str] = "benchmark-score"

    @classmethod
    def of_folder(
        cls, name: str, folder: Path, called: str, files: Mapping[Path, Any], recordings: Sequence[Path], out: str
    ) -> "ScoredTracks":
        """Of files by recording; ValueError, in one sentence, for a folder that is not of the benchmark."""
        try:
            about = read_json(folder / LISTED)
            phrase = about["phrase"]
            fits = about["benchmark"] == name
        except (OSError, ValueError, KeyError, TypeError):
            raise ValueError(
                f"against: {folder} has no {LISTED}; `testbed benchmark record {name}` writes it"
            ) from None
        if not fits:
            raise ValueError(f"against: {folder} holds recordings of {about['benchmark']}, not of {name}")
        return cls.of(recordings, (), {called: files}, LENGTH["settle"], benchmark=name, phrase=phrase, out=out)

    def entry(self, results: Results) -> Entry:
        """The entry of the tracks."""
        version = find(self.benchmark)
        every = recorded(version, self.phrase, [track.name for track in version.tracks])
        known = {folder_of(p.case, p.run.seed): p for p in every}
        rows = results.runs.copy()
        found = [known.get(folder_of(c, s)) for c, s in zip(rows["scenario"], rows["seed"])]
        rows["track"] = [None if p is None else p.track for p in found]
        rows["scenario"] = [None if p is None else p.case for p in found]
        files = sorted(str(source.path) for _, _, source in self.tracks)
        code = {"files": files_digest(files), "recordings": files_digest(self.recordings)}
        runs = list(_runs(version, rows[rows["track"].notna()], self.trackers[0]))
        return entry(version, self.trackers[0], TRACKS, self.phrase, runs, results.compiled, code=code)

    def judge(self, results: Results, tally: Tally) -> Findings:
        """The table of the entry."""
        left = super().judge(results, tally).shown[len(super(RecordedComparison, self).judge(results, tally).shown) :]
        return Findings([*table.shown([self.entry(results)]), *left])

    def write(self, results: Results, found: Findings, console: Console) -> None:
        """Write the entry."""
        console.print(f"entry    {self.entry(results).write(Path(self.out))}", soft_wrap=True, highlight=False)

    def page(self, *_: Any) -> None:
        """None: the table has it all."""
        return None
