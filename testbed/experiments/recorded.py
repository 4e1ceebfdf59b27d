"""`testbed compare --recording`: trackers and files of tracks on recordings, paired; a recording counts as a seed.

Recordings that are called SCENARIO_seedN, as `testbed record --seeds` calls them, are of that scenario and seed; any
others are one group.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from hashlib import sha256
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, ClassVar, Self

from rich.markup import escape

from testbed.environment.perception import Cost, tracker_of
from testbed.experiments.compare import Comparison, Settings
from testbed.experiments.episode import Played
from testbed.experiments.identity import modules_digest, shared_digest, tracker_digest
from testbed.experiments.rows import Rows
from testbed.experiments.store import Results
from testbed.experiments.study import Findings, Kept, Study, Tally
from testbed.files import file_stem, versions
from testbed.frame import Frame
from testbed.limits import check_settle
from testbed.replay.plausibility import faults, judged
from testbed.replay.reading import Recorded, read
from testbed.replay.recorded_tracks import RecordedTracks, TracksSource, recorded_tracks
from testbed.replay.recording import Recording
from testbed.replay.replaying import ACCEPT, RECORDED, ReplayConfig, prepare
from testbed.replay.replaying import replay as replay_once
from testbed.replay.rescan import REPLAY, RecordedRadar, replay
from trackers import DEFAULT

SEEDED = re.compile(r"(.+)_seed(\d{1,9})")
GROUP = "recordings"  # in place of a scenario


@dataclass(frozen=True)
class RecordedSettings(Settings):
    """Of recordings; only `settle` is free."""

    radar: str = RECORDED

    def __post_init__(self) -> None:
        check_settle(self.settle)

    @property
    def length(self) -> str:
        """How long a run is, in words."""
        return "those of the recordings"


@dataclass(frozen=True)
class RecordedRun:
    """One tracker, or the tracks of one file, on one recording."""

    scenario: str
    seed: int
    source: str  # name of the tracker, or of the tracks
    folder: str
    tracks: TracksSource | None = None
    settle: float = 0.0

    loop: ClassVar[str] = RECORDED
    radar: ClassVar[str] = RECORDED
    planner: ClassVar[str] = REPLAY
    faults: ClassVar[tuple[str, ...]] = ()

    @property
    def case(self) -> str:
        """The scenario."""
        return self.scenario

    @property
    def name(self) -> str:
        """Stem of its file."""
        return file_stem(self.scenario, self.source, f"seed{self.seed}")

    @property
    def key(self) -> dict[str, Any]:
        """What the file of the run says it holds."""
        return {"recording": Path(self.folder).resolve().name, "source": self.source, "settle": self.settle}

    def mounted(self, recorded: Recorded) -> str | RecordedTracks:
        """What gives the tracks; ValueError, in one sentence, where a file is wrong."""
        if self.tracks is None:
            return self.source
        found = recorded_tracks(self.tracks, self.source, recorded)
        if len(found) > 1:
            names = ", ".join(one.name for one in found)
            raise ValueError(f"tracks: {self.tracks.path} has several trackers, {names}; give files of one each")
        return found[0]


@dataclass(frozen=True)
class RecordedComparison(Comparison):
    """All trackers and tracks on all recordings; made by `of`."""

    recordings: tuple[str, ...] = ()  # folder of each scenario and seed, in the order of `places`
    places: tuple[tuple[str, int], ...] = ()
    tracks: tuple[tuple[str, str, TracksSource], ...] = ()  # name, folder of the recording, file
    accept: bool = False  # take recordings that cannot be right

    @classmethod
    def of(
        cls,
        recordings: Sequence[Path],
        trackers: Sequence[str],
        tracks: Mapping[str, Mapping[Path, TracksSource]],
        settle: float = 0.0,
        reference: str | None = None,
        accept: bool = False,
        **options: Any,
    ) -> Self:
        """From folders, names of trackers, and tracks by name and recording."""
        found = [SEEDED.fullmatch(path.resolve().name) for path in recordings]
        seeded = [(match[1], int(match[2])) for match in found if match]
        places = tuple(seeded) if len(seeded) == len(found) else tuple((GROUP, k) for k in range(len(found)))
        scenarios, seeds = dict.fromkeys(s for s, _ in places), sorted({seed for _, seed in places})
        files = tuple((name, str(path), file) for name, own in tracks.items() for path, file in own.items())
        names = (*(trackers or (() if tracks else (DEFAULT,))), *tracks)
        return cls(
            tuple(scenarios), names, tuple(seeds), RecordedSettings(settle=settle), reference,
            tuple(map(str, recordings)), places, files, accept, **options,
        )  # fmt: skip

    def work(self) -> list[RecordedRun]:  # type: ignore[override]
        """A run for each recording and tracker; tracks without a file for a recording have none there."""
        return [
            self.run(scenario, name, seed)
            for (scenario, seed), folder in zip(self.places, self.recordings, strict=True)
            for name in self.trackers
            if name not in self._named or (name, folder) in self._files
        ]

    @cached_property
    def _files(self) -> dict[tuple[str, str], TracksSource]:
        return {(name, folder): source for name, folder, source in self.tracks}

    @cached_property
    def _named(self) -> set[str]:
        return {name for name, _, _ in self.tracks}

    def run(self, case: str, tracker: str, seed: int) -> RecordedRun:  # type: ignore[override]
        """One run."""
        folder = self.recordings[self.places.index((case, seed))]
        return RecordedRun(case, seed, tracker, folder, self._files.get((tracker, folder)), self.settings.settle)

    def shared(self) -> dict[str, Any]:
        """The settings, and what the recordings hold."""
        return {"loop": RECORDED, "settle": self.settings.settle, "recordings": files_digest(self.recordings)}

    def check(self) -> None:
        """Raise LookupError or ValueError, in one sentence, for recordings or tracks that cannot be compared."""
        Study.check(self)
        for run in self.work():
            _check(run, self.accept)

    def runs(self) -> list[Any]:
        """None in the simulation."""
        return []

    def identity(self) -> dict[str, Any]:
        """Settings, versions, digests of recordings, of files of tracks, and of the code of trackers."""
        own = [name for name in self.trackers if name not in self._named]
        files = {
            name: repr(
                [
                    (str(s.path), s.columns, s.matching, files_digest((str(s.path),)))
                    for n, _, s in self.tracks
                    if n == name
                ]
            )
            for name in self.trackers
            if name in self._named
        }
        return {
            "study": self.name,
            **self.shared(),
            **{f"version of {name}": version for name, version in versions().items()},
            "code": shared_digest(),
            "code of the study": modules_digest(("testbed.replay",)),
            **{f"code of {name}": tracker_digest(name) for name in own},
            **{f"code of {name}": sha256(text.encode()).hexdigest()[:12] for name, text in files.items()},
        }

    def facts(self) -> list[tuple[str, str]]:
        """What the report says of the recordings."""
        names = (f"{seed}: {Path(f).resolve().name}" for (_, seed), f in zip(self.places, self.recordings, strict=True))
        return [("recordings", ", ".join(names))]

    def make(self, work: Any, store: Any) -> Kept:
        """Give one recording to one tracker, and score the frames whose truth is known."""
        start, recorded = perf_counter(), read(Path(work.folder))
        tracker, frames, known = work.mounted(recorded), recorded.frames, recorded.known
        radar, loading = RecordedRadar(recorded.sensors.models, None, frames), perf_counter() - start
        drive = Recording(work.case, work.seed, radar, frames, (), recorded.road, recorded.drawn, {})
        watch, cpu = Rows(work), process_time()
        watch.begin(())

        def scored(frame: Frame) -> None:
            if known is not None and known[0] <= frame.time <= known[1]:
                watch(frame)

        done = replay(drive, (tracker,), [scored])
        costs = done.costs if work.tracks is None else {work.source: Cost()}  # reading is no tracking
        seconds = {"loading": loading, "tracking": done.seconds["track"]}
        kept = watch.kept(Played((), costs, seconds, process_time() - cpu, recorded.drawn))
        return kept._replace(seconds=seconds | {"metrics": perf_counter() - start - sum(seconds.values())})

    def judge(self, results: Results, tally: Tally) -> Findings:
        """As of scenarios, and what was left out of files of tracks."""
        found = super().judge(results, tally)
        left = [f"! {run.source}, {run.folder}: {said}" for run in self.work() if (said := _check(run, self.accept))]
        return found._replace(shown=[*found.shown, *map(escape, left)])

    def log(self, run: RecordedRun, names: Sequence[str], out: Path) -> Path:
        """Write the review log of one recording with some of the trackers and tracks; OSError where that cannot be."""
        tracks = tuple((n, self._files[n, run.folder]) for n in names if (n, run.folder) in self._files)
        own = tuple(name for name in names if name not in self._named)
        config = ReplayConfig(run.folder, own, out=str(out), accept=True, tracks=tracks)
        done = replay_once(config, prepare(config))
        for sentence in done.lost:
            raise OSError(sentence)
        assert done.rrd is not None  # its level is full
        return done.rrd


def files_digest(paths: Sequence[str]) -> str:
    """Digest of files, and of the tables in folders."""
    found = sha256()
    for path in map(Path, paths):
        for file in sorted(path.iterdir()) if path.is_dir() else [path]:
            if file.is_file():
                found.update(f"{path.resolve().name}/{file.name} {sha256(file.read_bytes()).hexdigest()}\n".encode())
    return found.hexdigest()[:12]


@lru_cache(maxsize=2)
def _judged(folder: str, accept: bool) -> Recorded:
    recorded, findings = judged(Path(folder))
    if (wrong := faults(findings)) and not accept:
        raise ValueError(f"{folder}: {wrong[0]}. Or go on with {ACCEPT}")
    if recorded.known is None:
        raise ValueError(f"{folder} has no table truth to compare with; replay it instead")
    return recorded


@cache
def _check(run: RecordedRun, accept: bool) -> str:
    """What is left out of the tracks of a run, in words; LookupError or ValueError where it cannot be made."""
    recorded = _judged(run.folder, accept)
    mounted = run.mounted(recorded)
    if not isinstance(mounted, str):
        return mounted.said
    tracker_of(mounted, RecordedRadar(recorded.sensors.models, None, recorded.frames))
    return ""
