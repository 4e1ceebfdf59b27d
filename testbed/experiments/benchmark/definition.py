"""BENCHMARKS: scenarios, seeds, radars, lengths and measures by the name of a version, and the code that they rest on.

What changes the results of a version makes another version. `benchmarks.json` holds the digests of the code that a
version was frozen with; until 1.0.0 `testbed benchmark freeze NAME` makes them anew.
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from sensors.fault_text import split_faults
from testbed.experiments.identity import world_digest
from testbed.experiments.run import Run
from testbed.experiments.statistics import DRIVE, MAIN
from testbed.files import write_json
from trackers.json_file import read_json
from trackers.lookup import look_up

FROZEN = Path(str(files("testbed.experiments.benchmark"))) / "benchmarks.json"
EVALUATION = (10**6, 10**9)  # seeds made from a phrase lie between these, and development seeds below


@dataclass(frozen=True)
class Track:
    """One part of a benchmark, with a rank of its own."""

    name: str
    what: str  # in one line
    cases: tuple[str, ...]  # scenarios, NAME or with faults of the radar NAME+FAULT+FAULT
    measure: str  # by which entries are ranked
    measures: tuple[str, ...]  # all that an entry holds
    loop: str = "open"
    radars: tuple[str, ...] = ("surround",)  # the first records, the others scan what it recorded anew
    planner: str = "idm"  # in closed loop

    @property
    def scored(self) -> bool:
        """Whether its drives are scored against those on the truth."""
        return SCORE in self.measures

    @property
    def case_names(self) -> list[str]:
        """Each case as `runs` names it, which is the same for every seed."""
        return [case for case, _ in self.runs("", 0)]

    def runs(self, tracker: str, seed: int) -> Iterator[tuple[str, Run]]:
        """Each run of one seed, after its case, which is CASE@RADAR where the radar is not the first."""
        for case in self.cases:
            scenario, faults = split_faults(case)
            for radar in self.radars:
                other = None if radar == self.radars[0] else self.radars[0]
                run = Run(scenario, seed, tracker, self.planner, radar, faults, self.loop, other, **LENGTH)
                yield case if radar == self.radars[0] else f"{case}@{radar}", run


@dataclass(frozen=True)
class Benchmark:
    """A version."""

    name: str
    tracks: tuple[Track, ...]
    development: tuple[int, ...]  # public seeds, for whoever makes a tracker

    def seeds(self, phrase: str | None) -> tuple[int, ...]:
        """The development seeds, or as many that only the phrase decides."""
        if phrase is None:
            return self.development
        if not phrase.strip():
            raise ValueError("phrase must have words, got none; choose a sentence that nobody can know before")
        entropy = int.from_bytes(sha256(f"{self.name}:{phrase}".encode()).digest())
        drawn = np.random.default_rng(entropy).choice(EVALUATION[1] - EVALUATION[0], len(self.development), False)
        return tuple(sorted((EVALUATION[0] + drawn).tolist()))

    def track(self, name: str) -> Track:
        """A part by its name."""
        return look_up(name, {track.name: track for track in self.tracks}, f"track of {self.name}")

    def definition(self) -> dict[str, Any]:
        """All of it as JSON types."""
        parts = [{k: list(v) if isinstance(v, tuple) else v for k, v in asdict(track).items()} for track in self.tracks]
        return {"name": self.name, "development": list(self.development), "length": LENGTH, "tracks": parts}

    def digests(self) -> dict[str, str]:
        """Short digests of the definition, and of the code of scenarios, sensors, planner and measures."""
        text = repr(self.definition())
        scenarios = {split_faults(case)[0] for track in self.tracks for case in track.cases}
        return {"definition": sha256(text.encode()).hexdigest()[:12], "code": world_digest(scenarios)}


SCORE = "score"
LENGTH: dict[str, Any] = {
    "duration": 60.0,
    "after": 3.0,
    "settle": 2.0,
}  # [s] at most, after the maneuver, before the first measure
FAULTS = ("front:outage:2:4", "drop:0.2", "corners:yaw:2+clock:0.05", "blind:rain:0.5+burst:3:100")
OPEN = (
    "following", "hard-brake", "stop-and-go", "cut-in", "cut-out", "truck-cut-in", "lane-change", "overtake",
    "dense-traffic", "truck-convoy", "merge", "oncoming", "articulated-turn", "roundabout",
)  # fmt: skip
CLOSED = ("following", "hard-brake", "cut-in", "cut-out", "truck-cut-in", "dense-traffic", "merge", "oncoming")
FAULTY = ("cut-in", "lane-change", "merge")

BENCHMARKS: Mapping[str, Benchmark] = MappingProxyType({b.name: b for b in (
    Benchmark("v1", (
        Track("open", "tracking on recordings, by two radars", OPEN, "gospa", MAIN, radars=("surround", "imaging")),
        Track("closed", "driving on tracks, by the planner idm", CLOSED, SCORE, (SCORE, *DRIVE, *MAIN), "closed"),
        Track("faults", "tracking on recordings of a radar with faults",
              tuple(f"{scenario}+{fault}" for scenario in FAULTY for fault in FAULTS), "gospa", MAIN),
    ), tuple(range(1000, 1008))),
)})  # fmt: skip


def find(name: str) -> Benchmark:
    """The benchmark of that name; LookupError for none."""
    return look_up(name, BENCHMARKS, "benchmark")


def frozen(benchmark: Benchmark) -> dict[str, str]:
    """The digests that the version was frozen with; empty where it was not."""
    return dict(read_json(FROZEN).get(benchmark.name, {}))


def freeze(benchmark: Benchmark) -> Path:
    """Write the digests of the present code as those of the version; returns the file."""
    known = read_json(FROZEN) if FROZEN.exists() else {}
    write_json(FROZEN, {**known, benchmark.name: benchmark.digests()})
    return FROZEN
