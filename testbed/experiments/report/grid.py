"""A table as data, formatted and marked, and what sets it: markdown, a terminal; the template of a page sets HTML.

A table is made once. The terminal, the page of the documentation and the report page show it, or some of its columns.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from rich.markup import escape
from rich.table import Table

from testbed.command_line.tables import light_table, number
from testbed.evaluation.intervals import Interval
from testbed.experiments.statistics import Change
from testbed.log.text import markdown_table

WARNINGS = 8  # that are spelt out on the terminal


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


def signed(found: Interval, digits: int, remark: str = "", mark: str = "") -> Field:
    """A difference with its sign and its interval."""
    field = estimate(found, digits, remark, mark)
    return field._replace(text=f"{found.value:+.{digits}f}") if np.isfinite(found.value) else field


def mark_of(verdict: str) -> str:
    """The mark of a field for a verdict: only what is resolved has one."""
    return verdict if verdict in ("better", "worse") else ""


def needed(change: Change, verdict: str) -> str:
    """How many seeds would resolve a change that is not resolved."""
    if verdict != "unresolved" or np.isnan(change.needed):
        return ""
    return f"{change.needed:.0f} seeds needed" if np.isfinite(change.needed) else "no number of seeds will do"


def markdown(grid: Grid) -> str:
    """Numbers with their intervals; names of trackers down the side as code."""
    rows = [(f"`{n}`" if grid.corner == "tracker" else n, *map(_wide, fields)) for n, fields in grid.lines]
    return markdown_table((grid.corner, *grid.heads), rows)


def terminal(grid: Grid, title: str, narrow: bool = False, no_wrap: bool = False) -> Table:
    """Numbers with their intervals; narrow: half the width of the interval below the number."""
    table = light_table(title)
    table.add_column(grid.corner, no_wrap=True)
    for head in grid.heads:
        table.add_column(escape(head), justify="left" if head in grid.words else "right", no_wrap=no_wrap)
    for name, fields in grid.lines:
        table.add_row(escape(name), *(escape((_narrow if narrow else _wide)(field)) for field in fields))
    return table


def warnings(sentences: Sequence[str]) -> Iterator[str]:
    """What a terminal says below the tables: the first sentences, and how many more there are."""
    for sentence in sentences[:WARNINGS]:
        yield f"[yellow]![/yellow] {sentence}"
    if len(sentences) > WARNINGS:
        yield f"[yellow]![/yellow] and {len(sentences) - WARNINGS} more that the seeds cannot resolve: see above"


def _wide(field: Field) -> str:
    return f"{field.text} {field.bounds}" if field.bounds else field.text


def _narrow(field: Field) -> str:
    return f"{field.text}\n±{field.half}" if field.half else field.text
