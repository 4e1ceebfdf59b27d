"""Tables of a comparison on the terminal."""

from collections.abc import Sequence

from rich.markup import escape
from rich.table import Table

from testbed.command_line.tables import light_table
from testbed.compare.statistics.analysis import Cell
from testbed.compare.statistics.measures import KEYS
from testbed.evaluation.intervals import Interval

FEW = 3  # trackers that stand side by side in 80 columns with their intervals


def text(found: Interval, digits: int) -> str:
    """An estimate with its interval as people read it."""
    if found.value != found.value:
        return "–"
    if found.low != found.low:
        return f"{found.value:.{digits}f}"
    return f"{found.value:.{digits}f} [{found.low:.{digits}f}, {found.high:.{digits}f}]"


def narrow(found: Interval, digits: int) -> str:
    """The same in two short lines, with half the width of the interval."""
    spread = "" if found.low != found.low else f"\n±{(found.high - found.low) / 2:.{digits}f}"
    return "–" if found.value != found.value else f"{found.value:.{digits}f}{spread}"


def overview(cells: Sequence[Cell], title: str) -> Table:
    """Means with 95 % intervals; trackers down and measures across, or the other way round where trackers are few."""
    trackers = {name: name for name in dict.fromkeys(cell.tracker for cell in cells)}
    measures = {key: escape(label(key)) for key in dict.fromkeys(cell.measure for cell in cells)}
    few = len(trackers) <= FEW
    write = text if few else narrow
    found = {(c.tracker, c.measure): escape(write(c.mean, KEYS[c.measure].digits)) for c in cells}
    down, across = (measures, trackers) if few else (trackers, measures)
    table = light_table(title)
    table.add_column("measure" if few else "tracker", no_wrap=True)
    for head in across.values():
        table.add_column(head, justify="right", no_wrap=few)
    for row, head in down.items():
        keys = [(column, row) if few else (row, column) for column in across]
        table.add_row(head, *(found.get(key, "–") for key in keys))
    return table


def label(measure: str) -> str:
    """Name of a measure with its unit."""
    found = KEYS[measure]
    return found.label if found.unit == "1" else f"{found.label} [{found.unit}]"


def differences(cells: Sequence[Cell], reference: str) -> Table:
    """Every difference to the reference: mean and interquartile mean, probability of improvement, verdict."""
    table = light_table(f"difference to {reference} on the same seeds; negative is better")
    table.add_column("tracker", no_wrap=True)
    table.add_column("measure")
    for label in ("mean difference", "interquartile mean", "probability of improvement", "verdict"):
        table.add_column(label, justify="right" if label != "verdict" else "left")
    for cell in cells:
        d = cell.difference
        if d is not None:
            digits = KEYS[cell.measure].digits + 1
            shown = (text(d.mean, digits), text(d.iqm, digits), text(d.improvement, 2))
            table.add_row(cell.tracker, escape(KEYS[cell.measure].label), *map(escape, shown), d.verdict)
    return table
