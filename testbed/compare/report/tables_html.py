"""The tables of the report page, as plain entries that the template only has to set."""

from collections.abc import Callable, Iterable, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from testbed.compare.statistics.analysis import BANDS, DOF, PHASES, QUANTITIES, Cell
from testbed.compare.statistics.differences import Difference
from testbed.compare.statistics.measures import KEYS, badness
from testbed.evaluation.intervals import LEVEL, Interval

DASH = "–"
WORST = 2.0  # times the best value of a row, at which shading is full
BAND_COLUMNS = (("position", "position RMSE [m]"), ("velocity", "velocity RMSE [m/s]"), ("length", "length RMSE [m]"))
HELD = "looks with a track that fits [%]"
CONSISTENCY = {
    "nees_position": "NEES position", "nees_velocity": "NEES velocity", "nis": "NIS",
    "length_covered": "length in its interval [%]", "width_covered": "width in its interval [%]",
}  # fmt: skip


class Entry(NamedTuple):
    """One field of a table."""

    text: str
    note: str = ""  # small below: the interval
    tag: str = ""  # smaller still: what it means, in words
    mark: str = ""  # classes: best, better, worse
    heat: float | None = None  # 0 to 1


class Row(NamedTuple):
    """One line of a table."""

    name: str
    entries: list[Entry]
    reference: bool = False


class Table(NamedTuple):
    """A table with an optional line of groups above its heads."""

    caption: str
    corner: str
    heads: list[str]
    rows: list[Row]
    groups: Sequence[tuple[str, int]] = ()  # label and number of columns


def label(key: str) -> str:
    """Name of a measure with its unit."""
    measure = KEYS[key]
    return measure.label if measure.unit == "1" else f"{measure.label} [{measure.unit}]"


def number(value: float, digits: int) -> str:
    """A value as people read it."""
    return DASH if not np.isfinite(value) else f"{value:.{digits}f}"


def bounds(found: Interval, digits: int) -> str:
    """The interval in brackets, nothing where there is none."""
    return "" if not np.isfinite(found.low) else f"[{found.low:.{digits}f}, {found.high:.{digits}f}]"


def overview(cells: Sequence[Cell], baseline: str) -> Table:
    """Trackers down, measures across: means with intervals, and the difference to the reference in words."""
    return Table(
        "Means with 95 % intervals; bold: the best of a column. Below: the difference to the reference on the same "
        "seeds, coloured only where its interval leaves out zero. For the NEES it is the distance from 2 that counts.",
        "tracker",
        [label(key) for key in _distinct(c.measure for c in cells)],
        _rows(cells, baseline, lambda c: c.tracker, lambda c: c.measure, lambda c: c.measure, _with_difference),
    )


def differences(cells: Sequence[Cell], baseline: str) -> Table:
    """Every paired difference with all that is known of it."""
    rows = []
    for cell in cells:
        d = cell.difference
        if d is not None:
            digits = KEYS[cell.measure].digits + 1
            entries = [
                Entry(label(cell.measure), mark="left"),
                Entry(number(d.mean.value, digits), bounds(d.mean, digits)),
                Entry(number(d.iqm.value, digits), bounds(d.iqm, digits)),
                Entry(number(d.improvement.value, 2), bounds(d.improvement, 2)),
                Entry(str(d.pairs)),
                Entry(d.verdict, mark=f"left {_mark(d)}", note=_needed(d)),
            ]
            rows.append(Row(cell.tracker, entries))
    return Table(
        f"Differences to {baseline} on the same seeds, with 95 % intervals; negative is better. For measures with an "
        "ideal value it is the distance from it that is compared. The interquartile mean leaves out the extreme runs.",
        "tracker",
        ["measure", "mean difference", "interquartile mean", "probability of improvement", "pairs", "verdict"],
        rows,
    )


def by_scenario(cells: Sequence[Cell], baseline: str) -> Table:
    """Scenarios down, trackers across, shaded by how much worse than the best of the scenario."""
    trackers = _distinct(c.tracker for c in cells)
    heads = [f"{t} (reference)" if t == baseline else t for t in trackers]
    return Table(
        f"{label(cells[0].measure)} by scenario with 95 % intervals; bold: the best of a row. The darker, the "
        f"worse than that; full at {WORST:g} times the best.",
        "scenario",
        heads,
        _rows(cells, "", lambda c: c.group, lambda c: c.tracker, lambda c: c.group, _shaded),
    )


def by_phase(cells: Sequence[Cell], baseline: str) -> Table:
    """Trackers down, phases across within each measure."""
    columns = _distinct((c.measure, c.group) for c in sorted(cells, key=_measure_then_phase))
    groups = [(label(key), len(list(part))) for key, part in groupby(columns, key=lambda column: column[0])]
    rows = _rows(
        cells, baseline, lambda c: c.tracker, lambda c: (c.measure, c.group), lambda c: (c.measure, c.group),
        _with_difference, columns,
    )  # fmt: skip
    return Table(
        "Means by phase of the maneuver with 95 % intervals, and the difference to the reference as above.",
        "tracker", [phase for _, phase in columns], rows, groups,
    )  # fmt: skip


def by_band(table: pd.DataFrame, band: str, baseline: str) -> Table:
    """Trackers down, bands across within each error."""
    used = [b for b in BANDS[band][1] if b in set(table["band"])]
    found = {(row["tracker"], row["band"]): row for _, row in table.iterrows()}
    columns = [(key, b, 1.0, 2) for key, _ in BAND_COLUMNS for b in used] + [("held", b, 100.0, 1) for b in used]
    best = {}
    for key, b, _, _ in columns:
        values = [_bad(row[key], key) for (_, at), row in found.items() if at == b]
        best[key, b] = np.nanmin(values) if np.isfinite(values).any() else np.nan
    rows = []
    for tracker in _distinct(table["tracker"]):
        entries = []
        for key, b, scale, digits in columns:
            row = found.get((tracker, b))
            if row is None:
                entries.append(Entry(DASH))
                continue
            interval = _interval(row, key, scale)
            mark = "best" if _bad(row[key], key) == best[key, b] else ""
            entries.append(Entry(number(interval.value, digits), bounds(interval, digits), mark=mark))
        rows.append(Row(tracker, entries, tracker == baseline))
    looks = ", ".join(f"{b}: {table.loc[table['band'] == b, 'looks'].median():.0f}" for b in used)
    return Table(
        f"Means over runs with 95 % intervals; bold: the best of a column; bands with few looks are left out. Looks of "
        f"a tracker, median: {looks}.",
        "tracker",
        used * (len(BAND_COLUMNS) + 1),
        rows,
        [(text, len(used)) for text in (*(text for _, text in BAND_COLUMNS), HELD)],
    )


def consistency(table: pd.DataFrame, baseline: str) -> Table:
    """One row a tracker and phase: NEES, NIS, and how often the truth lies in the intervals of the extent."""
    rows = []
    for _, row in table.iterrows():
        entries = [Entry(row["phase"], mark="left")]
        for key in QUANTITIES:
            found = _interval(row, key, 1.0)
            entries.append(Entry(number(found.value, 1), bounds(found, 1), _claims(found, DOF)))
            inside = row[f"{key}_inside"]
            entries.append(Entry(number(100 * inside, 0)))
        for side in ("length_covered", "width_covered"):
            found = _interval(row, side, 100.0)
            entries.append(Entry(number(found.value, 0), bounds(found, 0), _claims(found, 100 * LEVEL, -1)))
        rows.append(Row(row["tracker"], entries, row["tracker"] == baseline))
    heads = ["phase"]
    for key, text in CONSISTENCY.items():
        heads += [text, "inside [%]"] if key in QUANTITIES else [text]
    return Table(
        "Do the trackers know how wrong they are? Ideal: NEES and NIS 2, 95 % of the instants inside the chi-square "
        "limits of the mean over runs and objects, 95 % of the true lengths and widths in the claimed 95 % intervals. "
        "“Too sure” and “too cautious” stand where the interval of the mean leaves out the ideal.",
        "tracker", heads, rows,
    )  # fmt: skip


def _rows(
    cells: Sequence[Cell],
    baseline: str,
    name: Callable[[Cell], str],
    column: Callable[[Cell], Any],
    contest: Callable[[Cell], Any],
    entry: Callable[[Cell, float], Entry],
    columns: Sequence[Any] | None = None,
) -> list[Row]:
    """Cells as rows; the best of those with the same `contest` is given to `entry`."""
    best: dict[Any, float] = {}
    for c in cells:
        bad = badness(c.measure, c.mean.value)
        if np.isfinite(bad):
            best[contest(c)] = min(bad, best.get(contest(c), np.inf))
    found = {(name(c), column(c)): entry(c, best.get(contest(c), np.nan)) for c in cells}
    columns = columns or _distinct(column(c) for c in cells)
    names = _distinct(name(c) for c in cells)
    return [Row(n, [found.get((n, k), Entry(DASH)) for k in columns], n == baseline) for n in names]


def _with_difference(cell: Cell, best: float) -> Entry:
    digits = KEYS[cell.measure].digits
    marks = ["best"] if badness(cell.measure, cell.mean.value) == best else []
    tag, d = "", cell.difference
    if d is not None and np.isfinite(d.mean.value):
        tag = f"{d.mean.value:+.{digits + 1}f} {d.verdict}"
        marks.append(_mark(d))
    return Entry(number(cell.mean.value, digits), bounds(cell.mean, digits), tag, " ".join(filter(None, marks)))


def _shaded(cell: Cell, best: float) -> Entry:
    digits, bad = KEYS[cell.measure].digits, badness(cell.measure, cell.mean.value)
    heat = float(np.clip((bad / best - 1) / (WORST - 1), 0, 1)) if np.isfinite(bad) and best > 0 else None
    return Entry(
        number(cell.mean.value, digits), bounds(cell.mean, digits), mark="best" if bad == best else "", heat=heat
    )


def _mark(d: Difference) -> str:
    return d.verdict if d.verdict in ("better", "worse") else ""


def _needed(d: Difference) -> str:
    if d.verdict != "unresolved" or np.isnan(d.needed):
        return ""
    return f"{d.needed:.0f} seeds needed" if np.isfinite(d.needed) else "no number of seeds will do"


def _claims(found: Interval, ideal: float, sign: int = 1) -> str:
    """What an interval that leaves out the ideal says about the claims; sign -1: more is more cautious."""
    if not np.isfinite(found.low) or found.low <= ideal <= found.high:
        return ""
    return "too sure" if sign * (found.value - ideal) > 0 else "too cautious"


def _interval(row: Any, key: str, scale: float) -> Interval:
    return Interval(scale * row[key], scale * row[f"{key}_low"], scale * row[f"{key}_high"])


def _bad(value: float, key: str) -> float:
    return -value if key == "held" else value


def _distinct(values: Iterable[Any]) -> list[Any]:
    return list(dict.fromkeys(values))


def _measure_then_phase(cell: Cell) -> tuple[int, int]:
    return list(KEYS).index(cell.measure), PHASES.index(cell.group)
