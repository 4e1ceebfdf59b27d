"""The page docs/comparison.md and the figures of the README, from the entries of the benchmark in docs/results.

Whatever entries are there are shown: with fewer seeds, or of some trackers only. `imm-spline:size=off` and the like,
the default tracker without a layer, have a table of their own.
"""

import re
import shutil
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from studies.page import DOCS, Docs, Page, fill
from testbed.command_line.terminal import console, user_input
from testbed.evaluation.intervals import Interval, crossed_interval
from testbed.evaluation.metric import METRICS
from testbed.experiments.benchmark.definition import Benchmark, Track, find
from testbed.experiments.benchmark.entries import Entry, read_all
from testbed.experiments.benchmark.table import alike, grid, incomplete, ranks, sentences
from testbed.experiments.report.grid import Field, Grid, Line, estimate, markdown, signed
from testbed.experiments.statistics import MAIN, badness, compare
from testbed.files import make_directory, write_atomic
from trackers import DEFAULT, TRACKERS

ENTRIES, BEFORE = "results/benchmark", "results/record-2026-11-23.csv"  # under docs
MOVED = {"open": ("gospa", "rmse_position", "nees_position"), "closed": ("progress", "gospa")}  # in both records
SHARED = {"closed": ("following", "hard-brake", "cut-in", "cut-out", "dense-traffic", "merge")}  # cases of both
FIGURES = re.compile(r"(?<=<!-- figures: written by `make benchmark` -->\n).*?(?=<!-- end of figures -->)", re.S)
Cases = Sequence[str]


def main(
    folder: Annotated[
        Path | None, typer.Argument(help="What `testbed benchmark run` left; without it: what is committed.")
    ] = None,
    docs: Docs = DOCS,
) -> None:
    """Take the entries of a folder, and write the page "How the trackers compare" and the figures of the README."""
    with user_input((OSError, ValueError)):
        target = docs / ENTRIES
        if folder is not None:
            take(folder, target)
        page = Page("comparison", docs)
        entries = alike(read_all(target))[0]
        page.write(render(entries, pd.read_csv(docs / BEFORE) if (docs / BEFORE).exists() else None))
        readme = docs.parent / "README.md"
        if readme.exists() and (text := figures(entries)):
            write_atomic(readme, FIGURES.sub(lambda _: text, readme.read_text()))
            console.print(f"figures  {readme}", soft_wrap=True)


def take(folder: Path, target: Path) -> None:
    """Put the entries of a folder, those of the same code and seeds, in the place of the committed ones."""
    entries, left = alike(read_all(folder))
    shutil.rmtree(target, ignore_errors=True)
    make_directory(target)
    for one in entries:
        one.write(target)
    for said in left:
        console.print(said, highlight=False, soft_wrap=True)


def render(entries: Sequence[Entry], before: pd.DataFrame | None) -> str:
    """What the page says about entries of the same code and seeds, and what moved since an older record."""
    one, record = entries[0], [each for each in entries if not _layer(each)]
    version = find(one.benchmark)
    names = [each.name for each in record]
    return fill(
        "comparison/page.md.j2",
        version=version.name,
        digests=dict(one.digests),
        phrase=one.phrase,
        seeds=one.seeds,
        names=names,
        missing=[name for name in TRACKERS if name not in names],
        dates=sorted({str(each.made.get("date", ""))[:10] for each in entries}),
        machines=sorted({str(each.made.get("machine")) for each in entries}),
        commits=sorted({str(each.made.get("commit"))[:10] for each in entries}),
        tracks="\n\n".join(part for track in version.tracks for part in of_track(record, track)),
        layers=layers(entries, version),
        moved=None if before is None else moved(record, version, before),
    )


def _layer(one: Entry) -> bool:
    return one.name.startswith(f"{DEFAULT}:")


def of_track(entries: Sequence[Entry], track: Track) -> Iterator[str]:
    """The parts of the page about a track: ranks, what they do not say, and each case."""
    ranked = ranks(entries, track)
    if ranked:
        found = grid(ranked, track)
        yield f"## {found.caption}"
        yield f"<!-- stays -->\n{markdown(found)}" if track.name != "faults" else markdown(found)
        yield "\n".join(f"- {said}" for said in sentences(ranked, track))
        yield f"### {METRICS[track.measure].title} by case, {track.name}"
        yield markdown(by_case([place.entry for place in ranked], track))
    if left := [f"- {said}" for said in incomplete(entries, track)]:
        yield "\n".join(left)


def by_case(entries: Sequence[Entry], track: Track) -> Grid:
    """Cases down, trackers across."""
    digits, cases = METRICS[track.measure].digits, track.case_names
    samples = [one.sample(track.name, cases, track.measure) for one in entries]
    lines = [Line(case, [estimate(crossed_interval([s[k]]), digits) for s in samples]) for k, case in enumerate(cases)]
    return Grid("", "case", [one.name for one in entries], lines)


def layers(entries: Sequence[Entry], version: Benchmark) -> str | None:
    """The default tracker without a layer, minus the complete one, in the first track; None without such entries."""
    track = version.tracks[0]
    there = [one for one in entries if one.whole(track.name, track.case_names)]
    lines = []
    for whole in (one for one in there if one.name == DEFAULT):
        for one, measure in product(filter(_layer, there), MAIN):
            bad = [[badness(measure, v) for v in each.sample(track.name, track.case_names, measure)]
                   for each in (one, whole)]  # fmt: skip
            found = compare(*bad)
            fields = [Field(METRICS[measure].title), signed(found.mean, METRICS[measure].digits + 1)]
            lines.append(Line(one.name, [*fields, Field(found.verdict)]))
    heads = ["measure", "difference", "verdict"]
    return markdown(Grid("", "tracker", heads, lines, words=("measure", "verdict"))) if lines else None


def moved(entries: Sequence[Entry], version: Benchmark, before: pd.DataFrame) -> str:
    """The means of an older record beside those of now, in the cases of both, and how many are apart."""
    old = {(r.track, r.tracker, r.measure): Interval(r.value, r.low, r.high) for r in before.itertuples()}
    heads, lines, said = [], dict[str, list[Field]](), []
    for name, measures in MOVED.items():
        track = version.track(name)
        cases = [case for case in track.case_names if case in SHARED.get(name, track.cases)]
        for measure in measures:
            metric, apart, known = METRICS[measure], 0, 0
            heads += [f"{metric.title}, {name}, then", "now"]
            for one in entries:
                then = old.get((name, one.name, measure), Interval(*3 * (float("nan"),)))
                now = crossed_interval(one.sample(name, cases, measure))
                lines.setdefault(one.name, []).extend(estimate(each, metric.digits) for each in (then, now))
                known += then.low <= then.high and now.low <= now.high
                apart += then.high < now.low or now.high < then.low
            said.append(f"- {metric.title}, {name}: intervals are apart for {apart} of {known} trackers")
    table = markdown(Grid("", "tracker", heads, [Line(*each) for each in lines.items() if each[0] in TRACKERS]))
    return "\n".join(said) + "\n\n" + table


def figures(entries: Sequence[Entry]) -> str | None:
    """What the README says about the default tracker and some others; None without an entry of it."""
    track = find(entries[0].benchmark).tracks[0]
    cases, words = track.case_names, dict[tuple[str, str], str]()
    there = {one.name: one for one in entries if one.whole(track.name, cases)}
    for one in there.values():
        for measure in MAIN:
            found = estimate(crossed_interval(one.sample(track.name, cases, measure)), METRICS[measure].digits)
            words[one.name, measure] = found.text
            unit = METRICS[measure].unit.replace("1", "")
            words[f"{one.name} whole", measure] = " ".join(filter(None, (found.text, unit, found.bounds)))
    if DEFAULT not in there:
        return None
    seeds = len(there[DEFAULT].whole(track.name, cases))
    return fill("comparison/readme.md.j2", default=DEFAULT, track=track, seeds=seeds, words=words, there=list(there))
