"""An entry: what one tracker, or one set of files of tracks, reached in a benchmark, as JSON that can be made again.

`{"layout", "benchmark", "digests", "name", "kind", "phrase", "seeds", "runs": [{"track", "case", "seed",
MEASURE: value}], "cost": {track: ms a scan}, "code", "made"}`, where "code" has also the digests of files of
tracks and of recordings.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import isclose
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from testbed.experiments.benchmark.definition import Benchmark, frozen
from testbed.files import file_stem, provenance, write_json
from trackers.json_file import read_json

LAYOUT = 1
TRACKER, TRACKS = "tracker", "tracks"  # kinds: made again bit for bit, or known by the digests of their files
KEYS = ("track", "case", "seed")  # of a run, beside its measures
ROUNDING = 1e-6  # relative difference of values that only rounding on another machine makes


@dataclass(frozen=True)
class Entry:
    """One entry."""

    benchmark: str
    name: str
    kind: str
    phrase: str | None  # None: development seeds
    seeds: tuple[int, ...]
    digests: Mapping[str, str]  # of the definition and of the code that it rests on
    runs: tuple[dict[str, Any], ...]
    cost: Mapping[str, float] = field(default_factory=dict)  # track -> mean time of a scan [ms]
    code: Mapping[str, str] = field(default_factory=dict)  # what identifies the code of the tracker, or the files
    made: Mapping[str, Any] = field(default_factory=dict)

    @property
    def same(self) -> tuple[Any, ...]:
        """What entries that are compared have in common."""
        return self.benchmark, tuple(sorted(self.digests.items())), self.seeds

    @cached_property
    def at(self) -> dict[tuple[str, str, int], dict[str, Any]]:
        """Each run by track, case and seed."""
        return {(run["track"], run["case"], run["seed"]): run for run in self.runs}

    def whole(self, track: str, cases: Sequence[str]) -> list[int]:
        """The seeds of which every run of a track is there."""
        return [seed for seed in self.seeds if all((track, case, seed) in self.at for case in cases)]

    def sample(self, track: str, cases: Sequence[str], measure: str) -> list[NDArray]:
        """Values (seeds) for each case, NaN where a run has none, and for seeds that are not whole."""
        whole = self.whole(track, cases)
        found = [[self.at[track, c, s].get(measure) if s in whole else None for s in self.seeds] for c in cases]
        return [np.array(values, float) for values in found]

    @property
    def file(self) -> str:
        """Name of its file."""
        seeds = "development" if self.phrase is None else f"seed{self.seeds[0]}"
        return f"{file_stem(self.benchmark, self.name, seeds)}.json"

    def write(self, folder: Path) -> Path:
        """Write it; returns the file, OSError in one sentence where it cannot be written."""
        path = folder / self.file
        known = {"layout": LAYOUT, **self.__dict__, "seeds": list(self.seeds), "runs": list(self.runs)}
        known.pop("at", None)
        write_json(path, known)
        return path


def entry(
    benchmark: Benchmark, name: str, kind: str, phrase: str | None, runs: Sequence[dict[str, Any]], compiled: str,
    **more: Any,
) -> Entry:  # fmt: skip
    """An entry of the present code; compiled says what the processes that made the runs had in compiled form."""
    shared = benchmark.name, name, kind, phrase, benchmark.seeds(phrase), benchmark.digests()
    return Entry(*shared, tuple(runs), **more, made={**provenance(), "compiled": compiled})


def read(path: Path) -> Entry:
    """The entry of a file; OSError or ValueError, in one sentence, for what is none."""
    found = read_json(path)
    try:
        if found.pop("layout") != LAYOUT:
            raise ValueError("another layout")
        one = Entry(**{**found, "seeds": tuple(found["seeds"]), "runs": tuple(found["runs"])})
        if any(key not in run for run in one.runs for key in KEYS):
            raise ValueError("a run without track, case or seed")
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is no entry of a benchmark ({error}); `testbed benchmark run` writes one") from None
    return one


def read_all(folder: Path) -> list[Entry]:
    """All entries in a folder and below, by name; ValueError where there are none."""
    found = []
    for path in sorted(folder.rglob("*.json")) if folder.is_dir() else [folder]:
        try:
            found.append(read(path))
        except ValueError:
            if path == folder:
                raise
    if not found:
        raise ValueError(f"{folder} holds no entry of a benchmark; `testbed benchmark run` writes one")
    return found


def is_frozen(one: Entry, benchmark: Benchmark) -> bool:
    """Whether an entry rests on the code that the version was frozen with."""
    return dict(one.digests) == frozen(benchmark)


def differing(one: Entry, other: Entry) -> Iterator[tuple[str, float, float, bool]]:
    """Run and measure, both values, and whether only rounding parts them, of all values of runs of both that differ."""
    for key, run in one.at.items():
        again = other.at.get(key)
        for measure, value in run.items():
            if again is not None and measure not in KEYS and value != again.get(measure):
                a, b = (np.nan if v is None else float(v) for v in (value, again.get(measure)))
                yield f"{key[0]}, {key[1]}, seed {key[2]}, {measure}", a, b, isclose(a, b, rel_tol=ROUNDING)
