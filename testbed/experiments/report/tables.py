"""The tables of a comparison as data: what stands in them, formatted and marked; `renderers` and the template set them.

A table is made once. The terminal, the page of the documentation and the report page show it, or some of its columns.
"""

from collections.abc import Callable, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from testbed.command_line.tables import DASH, number
from testbed.evaluation.intervals import LEVEL, Interval
from testbed.evaluation.metric import METRICS
from testbed.experiments.bands import BAND_MEASURES, BANDS, DOF, QUANTITIES
from testbed.experiments.statistics import PHASES, Cell, Change

WORST = 2.0  # times the best value of a row, at which shading is full
CONSISTENCY = {
    "nees_position": "NEES position", "nees_velocity": "NEES velocity", "nis": "NIS",
    "length_covered": "length in its interval [%]", "width_covered": "width in its interval [%]",
}  # fmt: skip


class Field(NamedTuple):
    """One field of a table: a number with its interval, or a word."""

    text: str
    bounds: str = ""  # ends of the 95 % interval, in brackets
    half: str = ""  # half the width of it, for narrow columns
    remark: str = ""  # what the number means, in words
    mark: str = ""  # "best" of those that it is compared with; "better" or "worse" than the reference
    heat: float | None = None  # how much worse than the best, 0 to 1


class Line(NamedTuple):
    """One row of a table."""

    name: str
    fields: list[Field]


class Grid(NamedTuple):
    """A table, with an optional line of groups above its heads."""

    caption: str
    corner: str  # what the lines are: "tracker"
    heads: list[str]
    lines: list[Line]
    reference: str = ""  # the line, or the column, that the others are compared with
    words: Sequence[str] = ()  # heads of columns that hold no numbers
    groups: Sequence[tuple[str, int]] = ()  # label and number of columns

    def only(self, *heads: str) -> "Grid":
        """The same without the other columns."""
        kept = [self.heads.index(head) for head in heads]
        return self._replace(heads=list(heads), lines=[Line(n, [f[k] for k in kept]) for n, f in self.lines])

    def transposed(self, corner: str) -> "Grid":
        """The same with lines and columns exchanged."""
        columns = zip(*(line.fields for line in self.lines), strict=True)
        lines = [Line(head, list(fields)) for head, fields in zip(self.heads, columns, strict=True)]
        return self._replace(corner=corner, heads=[line.name for line in self.lines], lines=lines)


def estimate(found: Interval, digits: int, remark: str = "", mark: str = "", heat: float | None = None) -> Field:
    """A number with its interval."""
    known = np.isfinite(found.low)
    half = f"{(found.high - found.low) / 2:.{digits}f}" if known else ""
    return Field(number(found.value, digits), bounds(found, digits), half, remark, mark, heat)


def bounds(found: Interval, digits: int) -> str:
    """The interval in brackets, nothing where there is none."""
    return f"[{found.low:.{digits}f}, {found.high:.{digits}f}]" if np.isfinite(found.low) else ""


OVERVIEW = (
    "Means with 95 % intervals; bold: the best of a column. Below: the difference to the reference on the same seeds, "
    "coloured only where its interval leaves out zero."
)
IDEAL = " For the NEES it is the distance from 2 that counts."
SIGNS = (
    " Of drive score and progress more is better; their differences are turned round, so that negative is better "
    "everywhere."
)


def overview(cells: Sequence[Cell], baseline: str, note: str = IDEAL) -> Grid:
    """Trackers down, measures across: means with intervals, and the difference to the reference in words."""
    return Grid(
        OVERVIEW + note,
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
            verdict = Field(d.verdict, remark=_needed(d), mark=_mark(d))
            lines.append(
                Line(cell.tracker, [Field(METRICS[cell.measure].title), *numbers, Field(str(d.pairs)), verdict])
            )
    return Grid(
        f"Differences to {baseline} on the same seeds, with 95 % intervals; negative is better. For measures with an "
        "ideal value it is the distance from it that is compared. The interquartile mean leaves out the extreme runs.",
        "tracker",
        ["measure", "mean difference", "interquartile mean", "probability of improvement", "pairs", "verdict"],
        lines,
        words=("measure", "verdict"),
    )


def by_scenario(cells: Sequence[Cell], baseline: str) -> Grid:
    """Scenarios down, trackers across, by one measure; shaded by how much worse than the best of the scenario."""
    return Grid(
        f"{METRICS[cells[0].measure].title} by scenario with 95 % intervals; bold: the best of a row. The darker, the "
        f"worse than that; full at {WORST:g} times the best.",
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
        "Means by phase of the maneuver with 95 % intervals, and the difference to the reference as above.",
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
                mark = "best" if row is not None and row[key] == best[b] else ""
                fields.append(Field(DASH) if row is None else estimate(_interval(row, key, scale), digits, mark=mark))
        lines.append(Line(tracker, fields))
    frames = ", ".join(f"{b}: {table.loc[table['band'] == b, 'frames'].median():.0f}" for b in used)
    return Grid(
        "Means over runs with 95 % intervals; bold: the best of a column; bands with few frames are left out. Frames "
        f"of a tracker, median: {frames}.",
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
    return Grid(
        "Do the covariances match the errors? Ideal: NEES and NIS 2, 95 % of the instants inside the chi-square "
        "limits of the mean over runs and objects, 95 % of the true lengths and widths in their 95 % intervals. "
        "“Overconfident” and “conservative” stand where the interval of the mean leaves out the ideal.",
        "tracker",
        heads,
        lines,
        baseline,
        words=("phase",),
    )


def _lines(
    cells: Sequence[Cell],
    name: Callable[[Cell], str],
    column: Callable[[Cell], Any],
    field: Callable[[Cell, float], Field],
    columns: Sequence[Any] | None = None,
) -> list[Line]:
    """Cells as lines; `field` gets the least badness among the trackers, in the same measure and group."""
    best: dict[Any, float] = {}
    for c in cells:
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
        marks.append(_mark(d))
    return estimate(cell.mean, digits, remark, " ".join(filter(None, marks)))


def _shaded(cell: Cell, best: float) -> Field:
    bad = METRICS[cell.measure].badness(cell.mean.value)
    heat = float(np.clip((bad / best - 1) / (WORST - 1), 0, 1)) if np.isfinite(bad) and best > 0 else None
    return estimate(cell.mean, METRICS[cell.measure].digits, mark="best" if bad == best else "", heat=heat)


def _mark(d: Change) -> str:
    return d.verdict if d.verdict in ("better", "worse") else ""


def _needed(d: Change) -> str:
    if d.verdict != "unresolved" or np.isnan(d.needed):
        return ""
    return f"{d.needed:.0f} seeds needed" if np.isfinite(d.needed) else "no number of seeds will do"


def _confidence(found: Interval, ideal: float, sign: int = 1) -> str:
    """Whether the covariances are too small or too large, where the interval leaves out the ideal.

    sign: 1 for NEES, of which more means overconfident, -1 for shares, of which more means conservative.
    """
    if not np.isfinite(found.low) or found.low <= ideal <= found.high:
        return ""
    return "overconfident" if sign * (found.value - ideal) > 0 else "conservative"


def _interval(row: Any, key: str, scale: float) -> Interval:
    return Interval(scale * row[key], scale * row[f"{key}_low"], scale * row[f"{key}_high"])
