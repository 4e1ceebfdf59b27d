"""`testbed benchmark check`: the runs of an entry, or some of them, made again and compared value by value."""

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import ClassVar

import numpy as np
from rich.console import Console
from rich.markup import escape

from testbed.experiments.benchmark.entries import KEYS, TRACKER, Entry, differing, read
from testbed.experiments.benchmark.runs import BenchmarkRuns
from testbed.experiments.run import Run
from testbed.experiments.store import Results
from testbed.experiments.study import Findings, Tally
from testbed.frame import TRUTH
from testbed.limits import check_whole

SHOWN = 20  # values that differ


@dataclass(frozen=True)
class Again(BenchmarkRuns):
    """The runs of an entry."""

    entry: Entry | None = None
    count: int | None = None  # None: all

    name: ClassVar[str] = "benchmark-check"

    @classmethod
    def of(cls, path: Path, count: int | None, out: str) -> "Again":
        """Of the file of an entry; ValueError, in one sentence, for one that no run makes, or of other code."""
        entry = read(path)
        if count is not None:
            check_whole("runs", count, 1, max(1, len(entry.runs)))
        if entry.kind != TRACKER:
            raise ValueError(
                f"{path} is of files of tracks; score them again, and give both entries to `testbed benchmark check`"
            )
        made = cls(entry.benchmark, (entry.name,), entry.phrase, out=out, entry=entry, count=count)
        if dict(entry.digests) != made.version.digests():
            raise ValueError(f"{path} rests on other code of {entry.benchmark}; check it with the version that made it")
        if list(entry.seeds) != list(made.version.seeds(entry.phrase)):
            raise ValueError(f"{path} has other seeds than those of its phrase; it is no entry of {entry.benchmark}")
        return made

    def work(self) -> list[Run]:
        """Those that the entry has, or some, and the drives on the truth that these are scored against."""
        chosen = {(self.placed[run].track, self.placed[run].case, run.seed) for run in self.chosen}
        place = self.placed
        against = [run for run, p in place.items() if run.source == TRUTH and (p.track, p.case, run.seed) in chosen]
        return list(dict.fromkeys([*against, *self.chosen]))

    @cached_property
    def chosen(self) -> list[Run]:
        """The runs of the entry that are compared, drawn by what it says."""
        assert self.entry is not None
        at = self.entry.at
        found = [r for r, p in self.placed.items() if r.source == self.entry.name and (p.track, p.case, r.seed) in at]
        if self.count is None:
            return found
        entropy = int.from_bytes(sha256(repr(self.entry.runs).encode()).digest())
        drawn = np.random.default_rng(entropy).choice(len(found), self.count, False)
        return [found[k] for k in sorted(drawn)]

    def judge(self, results: Results, tally: Tally) -> Findings:
        """What differs."""
        assert self.entry is not None
        return compared(self.entry, self.entries(results)[0], len(self.chosen))

    def write(self, results: Results, found: Findings, console: Console) -> None:
        """Nothing."""


def compared(one: Entry, again: Entry, runs: int) -> Findings:
    """What differs between an entry and what was made again, which has so many runs if it is whole."""
    found = list(differing(one, again))
    wrong = [each for each in found if not each[3]]
    lines = [f"{what}: {a!r} in the entry, {b!r} now" for what, a, b, _ in (wrong or found)[:SHOWN]]
    values = sum(len(run) - len(KEYS) for run in again.runs)
    said = "bit for bit the same" if not found else "the same but for rounding" if not wrong else "not the same"
    verdict = f"{len(again.runs)} of {len(one.runs)} runs, {values} values: {said}; {len(found)} differ"
    return Findings([*map(escape, lines), verdict], bool(wrong) or len(again.runs) < runs)


def of_files(first: Path, second: Path) -> Findings:
    """What differs between two entries; ValueError, in one sentence, where they are not of the same files and seeds."""
    one, again = read(first), read(second)
    if one.same != again.same:
        raise ValueError(f"{first} and {second} rest on other code or other seeds; score the files with one version")
    for key in ("files", "recordings"):
        if one.code.get(key) != again.code.get(key):
            raise ValueError(f"{first} and {second} are of other {key}; {one.code.get(key)} and {again.code.get(key)}")
    return compared(one, again, len(one.runs))
