"""The tables of a comparison: what stands in them. Captions are in `templates/captions.md`."""

from collections.abc import Callable, Iterable, Sequence
from itertools import groupby
from typing import Any

import numpy as np
import pandas as pd

from testbed.command_line.tables import DASH, number
from testbed.evaluation.intervals import LEVEL, Interval
from testbed.evaluation.metric import METRICS
from testbed.experiments.report.grid import Field, Grid, Line, estimate, mark_of, needed
from testbed.experiments.report.texts import say
from testbed.experiments.series import BAND_MEASURES, BANDS, DOF, QUANTITIES
from testbed.experiments.statistics import PHASES, Cell, Change, compare, samples
from testbed.experiments.store import Results

WORST = 2.0  # times the best value of a row, at which shading is full
CONSISTENCY = {
    "nees_position": "NEES position", "nees_velocity": "NEES velocity", "nis": "NIS",
    "length_covered": "length in its interval [%]", "width_covered": "width in its interval [%]",
}  # fmt: skip
RANKED = "gospa"
SAID = {"worse": "behind", "better": "ahead on shared runs", "the same": "level",
        "unresolved": "not resolved", "too few seeds": "too few seeds to judge"}  # fmt: skip


def overview(cells: Sequence[Cell], baseline: str, note: str = "ideal") -> Grid:
    """Trackers down, measures across: means with intervals, and the difference to the reference in words.

    note: name of a text that the caption ends with, "ideal" or "signs".
    """
    several = _several(c.tracker for c in cells)
    return Grid(
        f"{say('overview', several=several)} {say(note, several=several)}",
        "tracker",
        list(dict.fromkeys(METRICS[c.measure].title for c in cells)),
        _lines(cells, lambda c: c.tracker, lambda c: c.measure, _with_difference),
        baseline,
    )


def differences(cells: Sequence[Cell], baseline: str) -> Grid:
    """Every paired difference with all that is known of it."""
    lines = []
    for cell in cells:
        d = cell.difference
        if d is not None:
            digits = METRICS[cell.measure].digits + 1
            numbers = [estimate(d.mean, digits), estimate(d.iqm, digits), estimate(d.improvement, 2)]
            verdict = Field(d.verdict, remark=needed(d, d.verdict), mark=mark_of(d.verdict))
            lines.append(
                Line(cell.tracker, [Field(METRICS[cell.measure].title), *numbers, Field(str(d.pairs)), verdict])
            )
    return Grid(
        say("differences", reference=baseline),
        "tracker",
        ["measure", "mean difference", "interquartile mean", "probability of improvement", "pairs", "verdict"],
        lines,
        words=("measure", "verdict"),
    )


def by_scenario(cells: Sequence[Cell], baseline: str) -> Grid:
    """Scenarios down, trackers across, by one measure; shaded by how much worse than the best of the scenario."""
    return Grid(
        say(
            "by scenario",
            measure=METRICS[cells[0].measure].title,
            several=_several(c.tracker for c in cells),
            worst=f"{WORST:g}",
        ),
        "scenario",
        list(dict.fromkeys(c.tracker for c in cells)),
        _lines(cells, lambda c: c.group, lambda c: c.tracker, _shaded),
        baseline,
    )


def by_phase(cells: Sequence[Cell], baseline: str, every: bool = False) -> Grid:
    """Trackers down, phases across within each measure; every: also phases in which nothing was measured."""
    found = {(c.measure, c.group) for c in cells}
    columns = [(key, phase) for key in METRICS for phase in PHASES if (key, phase) in found]
    if every:
        columns = [(key, phase) for key in dict(columns) for phase in PHASES]
    return Grid(
        say("by phase", several=_several(c.tracker for c in cells)),
        "tracker",
        [phase for _, phase in columns],
        _lines(cells, lambda c: c.tracker, lambda c: (c.measure, c.group), _with_difference, columns),
        baseline,
        groups=[(METRICS[key].title, len(list(part))) for key, part in groupby(columns, key=lambda column: column[0])],
    )


def by_band(table: pd.DataFrame, band: str, baseline: str) -> Grid:
    """Trackers down, bands across within each error; table as from `analysis.by_band`."""
    used = [b for b in BANDS[band][1] if b in set(table["band"])]
    at = {(row["tracker"], row["band"]): row for _, row in table.iterrows()}
    per_band = table.groupby("band")
    lines = []
    for tracker in dict.fromkeys(table["tracker"]):
        fields = []
        for key, _, scale, digits in BAND_MEASURES:
            best = per_band[key].max() if key == "held" else per_band[key].min()
            for b in used:
                row = at.get((tracker, b))
                mark = "best" if row is not None and row[key] == best[b] and _several(table["tracker"]) else ""
                fields.append(Field(DASH) if row is None else estimate(_interval(row, key, scale), digits, mark=mark))
        lines.append(Line(tracker, fields))
    frames = ", ".join(f"{b}: {table.loc[table['band'] == b, 'frames'].median():.0f}" for b in used)
    return Grid(
        say("by band", several=_several(table["tracker"]), frames=frames),
        "tracker",
        used * len(BAND_MEASURES),
        lines,
        baseline,
        groups=[(title, len(used)) for _, title, _, _ in BAND_MEASURES],
    )


def consistency(table: pd.DataFrame, baseline: str) -> Grid:
    """One line a tracker and phase: NEES, NIS, and how often the truth lies in the intervals of the extent."""
    lines = []
    for _, row in table.iterrows():
        fields = [Field(row["phase"])]
        for key in QUANTITIES:
            found = _interval(row, key, 1.0)
            fields += [estimate(found, 1, _confidence(found, DOF)), Field(number(100 * row[f"{key}_inside"], 0))]
        for side in ("length_covered", "width_covered"):
            found = _interval(row, side, 100.0)
            fields.append(estimate(found, 0, _confidence(found, 100 * LEVEL, -1)))
        lines.append(Line(row["tracker"], fields))
    heads = ["phase"]
    for key, text in CONSISTENCY.items():
        heads += [text, "inside [%]"] if key in QUANTITIES else [text]
    return Grid(say("consistency"), "tracker", heads, lines, baseline, words=("phase",))


def _several(names: Iterable[str]) -> bool:
    return len(set(names)) > 1


def _lines(
    cells: Sequence[Cell],
    name: Callable[[Cell], str],
    column: Callable[[Cell], Any],
    field: Callable[[Cell, float], Field],
    columns: Sequence[Any] | None = None,
) -> list[Line]:
    """Cells as lines; `field` gets the least badness among several trackers, in the same measure and group, or NaN."""
    best: dict[Any, float] = {}
    for c in cells if _several(c.tracker for c in cells) else ():
        bad = METRICS[c.measure].badness(c.mean.value)
        if np.isfinite(bad):
            best[c.measure, c.group] = min(bad, best.get((c.measure, c.group), np.inf))
    found = {(name(c), column(c)): field(c, best.get((c.measure, c.group), np.nan)) for c in cells}
    across = columns or dict.fromkeys(column(c) for c in cells)
    names = dict.fromkeys(name(c) for c in cells)
    return [Line(n, [found.get((n, k), Field(DASH)) for k in across]) for n in names]


def _with_difference(cell: Cell, best: float) -> Field:
    digits = METRICS[cell.measure].digits
    marks = ["best"] if METRICS[cell.measure].badness(cell.mean.value) == best else []
    remark, d = "", cell.difference
    if d is not None and np.isfinite(d.mean.value):
        remark = f"{d.mean.value:+.{digits + 1}f} {d.verdict}"
        marks.append(mark_of(d.verdict))
    return estimate(cell.mean, digits, remark, " ".join(filter(None, marks)))


def _shaded(cell: Cell, best: float) -> Field:
    bad = METRICS[cell.measure].badness(cell.mean.value)
    heat = float(np.clip((bad / best - 1) / (WORST - 1), 0, 1)) if np.isfinite(bad) and best > 0 else None
    return estimate(cell.mean, METRICS[cell.measure].digits, mark="best" if bad == best else "", heat=heat)


def _confidence(found: Interval, ideal: float, sign: int = 1) -> str:
    """Whether the covariances are too small or too large, where the interval leaves out the ideal.

    sign: 1 for NEES, of which more means overconfident, -1 for shares, of which more means conservative.
    """
    if not np.isfinite(found.low) or found.low <= ideal <= found.high:
        return ""
    return "overconfident" if sign * (found.value - ideal) > 0 else "conservative"


def _interval(row: Any, key: str, scale: float) -> Interval:
    return Interval(scale * row[key], scale * row[f"{key}_low"], scale * row[f"{key}_high"])


def order(cells: Sequence[Cell]) -> list[Cell]:
    """The cells of the GOSPA over all runs, the least mean first; without those that have none."""
    found = [c for c in cells if c.measure == RANKED and np.isfinite(c.mean.value)]
    return sorted(found, key=lambda c: c.mean.value)


def ranking(results: Results, cells: Sequence[Cell]) -> Grid | None:
    """Place, mean and distance to the first on the same seeds, a line a tracker; None for fewer than two of them."""
    ranked = order(cells)
    if len(ranked) < 2:
        return None
    comparison, measure = results.study, METRICS[RANKED]
    found = samples(results.runs, RANKED, comparison.scenarios, comparison.seeds)
    first = ranked[0].tracker
    lines = []
    for place, cell in enumerate(ranked, 1):
        behind = None if place == 1 else compare(found[cell.tracker], found[first])
        mean = estimate(cell.mean, measure.digits, mark="best" if place == 1 else "")
        lines.append(Line(cell.tracker, [Field(str(place)), mean, *_behind(behind, measure.digits)]))
    return Grid(
        say("ranking", measure=measure.label, first=first),
        "tracker",
        ["place", measure.title, f"behind {first} [{measure.unit}]", "verdict"],
        lines,
        comparison.baseline,
        words=("verdict",),
    )


def _behind(d: Change | None, digits: int) -> list[Field]:
    if d is None:
        return [Field(""), Field("first")]
    remark = needed(d, d.verdict) if np.isfinite(d.needed) else ""
    return [estimate(d.mean, digits), Field(SAID[d.verdict], remark=remark, mark=mark_of(d.verdict))]
