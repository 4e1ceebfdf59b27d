"""The table of a benchmark: measures with intervals, ranks that say what the seeds cannot resolve, and their variance.

Entries are paired by case and seed. A rank is a range, from one more than the number of entries that are resolved to be
better, to the number of those that are not resolved to be worse; intervals are at 95 % each.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import RenderableType
from rich.markup import escape

from testbed.evaluation.intervals import FEWEST, crossed_interval
from testbed.evaluation.metric import METRICS
from testbed.experiments.benchmark.definition import Track, find
from testbed.experiments.benchmark.entries import Entry, is_frozen
from testbed.experiments.report.grid import Field, Grid, Line, estimate, markdown, terminal
from testbed.experiments.statistics import badness, compare

BESIDE = {"open": ("missed_percent", "false_per_scan", "rmse_position", "nees_position")}
BESIDE |= {"faults": BESIDE["open"], "closed": ("collisions", "progress", "gospa", "nees_position")}
RESOLVED = 0.05  # relative difference for which the number of seeds is given


class Ranked(NamedTuple):
    """An entry in a track."""

    entry: Entry
    best: int
    worst: int

    @property
    def rank(self) -> str:
        """The range of its rank."""
        return str(self.best) if self.best == self.worst else f"{self.best} to {self.worst}"


class Spread(NamedTuple):
    """Shares of the variance of a measure between the runs of one entry, mean over entries; they add up to 1."""

    case: float  # between scenarios
    radar: float  # between radars of the same scenario, 0 of one radar
    seed: float  # between seeds over all cases
    rest: float  # of single runs
    needed: float  # seeds that resolve a difference of 5 % between two entries, median over pairs; NaN of one entry


def alike(entries: Sequence[Entry]) -> tuple[list[Entry], list[str]]:
    """The largest group of entries of the same code and seeds, and what was left out, in sentences.

    Of two entries of one name the later one counts.
    """
    groups: dict[object, dict[str, Entry]] = {}
    for one in entries:
        groups.setdefault(one.same, {})[one.name] = one
    chosen = max(groups.values(), key=len)
    others = [one for group in groups.values() if group is not chosen for one in group.values()]
    said = [f"{one.name} is left out: it rests on other code, or on other seeds" for one in others]
    return list(chosen.values()), said


def ranks(entries: Sequence[Entry], track: Track) -> list[Ranked]:
    """Entries that have whole seeds of a track, the best rank first; pairs are compared on what both have."""
    cases = track.case_names
    there = [one for one in entries if one.whole(track.name, cases)]
    bad = {one.name: [badness(track.measure, v) for v in one.sample(track.name, cases, track.measure)] for one in there}
    better: dict[str, int] = dict.fromkeys(bad, 0)
    worse: dict[str, int] = dict.fromkeys(bad, 0)
    for a, b in combinations(bad, 2):
        verdict = compare(bad[a], bad[b]).verdict
        if verdict in ("better", "worse"):
            winner, loser = (a, b) if verdict == "better" else (b, a)
            better[loser] += 1
            worse[winner] += 1
    found = [Ranked(one, 1 + better[one.name], len(there) - worse[one.name]) for one in there]
    return sorted(found, key=lambda r: (r.best, r.worst, crossed_interval(bad[r.entry.name]).value))


def grid(ranked: Sequence[Ranked], track: Track) -> Grid:
    """The table of a track."""
    cases = track.case_names
    measures = (track.measure, *BESIDE[track.name])
    lines, whole = [], [len(place.entry.whole(track.name, cases)) for place in ranked]
    for place, count in zip(ranked, whole, strict=True):
        one = place.entry
        fields = [Field(place.rank), Field(str(count))]
        for measure in measures:
            found = crossed_interval(one.sample(track.name, cases, measure))
            fields.append(estimate(found, METRICS[measure].digits))
        cost = one.cost.get(track.name)
        fields.append(Field("" if cost is None else f"{cost:.1f}"))
        lines.append(Line(one.name, fields))
    heads = ["rank", "seeds", *(METRICS[measure].title for measure in measures), "ms a scan"]
    return Grid(f"{track.name}: {track.what}", "tracker", heads, lines, words=("rank",))


def spread(entries: Sequence[Entry], track: Track) -> Spread:
    """Shares of the variance, and what the seeds resolve."""
    cases = track.case_names
    tables = [np.array([badness(track.measure, v) for v in one.sample(track.name, cases, track.measure)])
              for one in entries if one.whole(track.name, cases)]  # fmt: skip
    base = [case.partition("@")[0] for case in cases]
    shares = np.mean([_shares(values, base) for values in tables], 0) if tables else np.full(4, np.nan)
    needed = [n for a, b in combinations(tables, 2) if np.isfinite(n := seeds_for(a, b))]
    case, radar, seed, rest = shares.tolist()
    return Spread(case, radar, seed, rest, float(np.median(needed)) if needed else np.nan)


def _shares(values: NDArray, base: Sequence[str]) -> NDArray:
    """Shares (4,) of scenario, radar, seed and the rest in the sum of squares of values (cases, seeds)."""
    values = values[:, np.isfinite(values).any(0)]
    mean, of_case, of_seed = np.nanmean(values), np.nanmean(values, 1), np.nanmean(values, 0)
    names = np.array(base)
    of_base = np.array([of_case[names == name].mean() for name in base])
    scenario, radar = ((of_base - mean) ** 2).mean(), ((of_case - of_base) ** 2).mean()
    seed, whole = ((of_seed - mean) ** 2).mean(), np.nanvar(values)
    return np.array([scenario, radar, seed, whole - scenario - radar - seed]) / whole if whole else np.zeros(4)


def seeds_for(a: NDArray, b: NDArray, share: float = RESOLVED) -> float:
    """Seeds, at least those of an interval, that resolve a share of the mean; values (cases, seeds) of two entries."""
    each = a - b
    each = np.nanmean(each[:, np.isfinite(each).any(0)], 0)
    wanted = share * abs(np.nanmean([a, b]))
    return max(FEWEST, float(np.ceil((1.96 * each.std(ddof=1) / wanted) ** 2))) if len(each) > 1 and wanted else np.nan


def sentences(ranked: Sequence[Ranked], track: Track) -> Iterator[str]:
    """What the ranks do not say, and where the variance is."""
    entries = [place.entry for place in ranked]
    found = spread(entries, track)
    if np.isfinite(found.case):
        shares = {"scenario": found.case, "radar": found.radar, "seed": found.seed, "single run": found.rest}
        parts = ", ".join(f"{name} {100 * value:.0f} %" for name, value in shares.items() if name != "radar" or value)
        yield f"{track.name}: variance of {METRICS[track.measure].title} between runs: {parts}"
    if np.isfinite(found.needed):
        yield (
            f"{track.name}: a difference of {100 * RESOLVED:.0f} % takes {found.needed:.0f} seeds, the median over "
            f"pairs; there are {len(entries[0].seeds)}"
        )
    tied = [one.entry.name for one in ranked if one.best != one.worst]
    if tied:
        yield f"{track.name}: not resolved from a neighbour: {', '.join(tied)}"


def incomplete(entries: Sequence[Entry], track: Track) -> Iterator[str]:
    """Which entries lack runs of a track: their means are of other seeds, or they are no part of its table."""
    cases, alike = track.case_names, dict[str, list[str]]()
    for one in entries:
        runs, wanted = sum(at[0] == track.name for at in one.at), len(cases) * len(one.seeds)
        if 0 < runs < wanted:
            seeds = len(one.whole(track.name, cases))
            rank = f"{seeds} whole seeds of {len(one.seeds)}" if seeds else "no rank"
            alike.setdefault(f"{runs} of {wanted} runs and {rank}", []).append(one.name)
    for what, names in alike.items():
        who = f"all {len(names)} entries" if len(names) == len(entries) > 1 else ", ".join(names)
        yield f"{track.name}: {who} {'has' if len(names) == 1 else 'have'} {what}; the same command makes the rest"


def shown(entries: Sequence[Entry]) -> Iterator[RenderableType]:
    """Tables and sentences for a terminal."""
    chosen, left = alike(entries)
    benchmark, one = find(chosen[0].benchmark), chosen[0]
    seeds = "development seeds" if one.phrase is None else f"seeds of the phrase {one.phrase!r}"
    for track in benchmark.tracks:
        if ranked := ranks(chosen, track):
            found = grid(ranked, track)
            yield terminal(found, f"{benchmark.name}, {found.caption}, {len(one.seeds)} {seeds}", narrow=True)
            yield from map(escape, sentences(ranked, track))
        yield from map(escape, incomplete(chosen, track))
    yield from map(escape, left)
    if not is_frozen(one, benchmark):
        yield f"! not {benchmark.name} as it is frozen: the code of scenarios, sensors or measures is another"


def page(entries: Sequence[Entry]) -> str:
    """The same in markdown."""
    chosen, left = alike(entries)
    parts = []
    for track in find(chosen[0].benchmark).tracks:
        if ranked := ranks(chosen, track):
            found = grid(ranked, track)
            parts += [f"## {found.caption}", markdown(found), *sentences(ranked, track)]
        parts += incomplete(chosen, track)
    return "\n\n".join([*parts, *left]) + "\n"
