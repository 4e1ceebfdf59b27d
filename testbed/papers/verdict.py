"""What a reproduction reports: figures beside the reference's, and a verdict on every claim; shared by all papers."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from math import isnan
from pathlib import Path
from typing import Any

from rich import box
from rich.markup import escape
from rich.table import Table

from testbed.files import write_json

CONFIRMED, REFUTED = "confirmed", "not confirmed"
Progress = Callable[[float, float, str], None]  # done, total, what is being done; may raise Stopped


class Stopped(Exception):
    """A progress callback's wish to end a reproduction; what is finished until then is reported."""


@dataclass(frozen=True)
class Claim:
    """A sentence of a paper that an experiment can decide."""

    text: str
    source: str  # where the paper says it


@dataclass(frozen=True)
class Verdict:
    """Our answer to a claim."""

    claim: Claim
    outcome: str  # "confirmed", "confirmed under ..." or "not confirmed"
    numbers: str  # what was measured, with units

    @property
    def holds(self) -> bool:
        """Whether the claim holds at least under a condition."""
        return self.outcome != REFUTED


def judge(claim: Claim, cases: Mapping[str, bool], numbers: str) -> Verdict:
    """Verdict from the conditions that were tried: all hold, these hold, or none.

    >>> judge(Claim("better", "IV"), {"noise-free": True, "sigma 0.5 m": False}, "").outcome
    'confirmed under noise-free'
    """
    if not cases:
        raise ValueError(f"cases is empty; the claim {claim.text!r} needs at least one condition that was tried")
    held = [name for name, holds in cases.items() if holds]
    if len(held) == len(cases):
        return Verdict(claim, CONFIRMED, numbers)
    return Verdict(claim, f"confirmed under {'; '.join(held)}" if held else REFUTED, numbers)


@dataclass(frozen=True)
class Row:
    """One method in one case of an experiment."""

    case: str  # what is measured on: contour, noise, course
    method: str
    measured: Mapping[str, float]
    reference: Mapping[str, float] = field(default_factory=dict)  # figures of the paper or of the method's card


@dataclass(frozen=True)
class Report:
    """A reproduction: settings, rows, verdicts and pictures."""

    paper: str  # name on the command line
    title: str
    settings: Mapping[str, Any]
    columns: Mapping[str, int]  # measure -> digits
    legend: str  # what the columns are, where their names do not say it
    rows: tuple[Row, ...]
    verdicts: tuple[Verdict, ...]
    figures: tuple[Path, ...] = ()
    interrupted: bool = False  # it was stopped: rows are missing, and with them the verdicts

    @property
    def file(self) -> str:
        """Name of the JSON file."""
        return f"{self.paper}.json"

    @property
    def holds(self) -> bool:
        """Whether every claim holds at least under a condition."""
        return all(v.holds for v in self.verdicts)

    def row(self, case: str, method: str) -> Mapping[str, float]:
        """What was measured for a method in a case."""
        for row in self.rows:
            if (row.case, row.method) == (case, method):
                return row.measured
        raise LookupError(f"{self.paper} has no row {method!r} in case {case!r}; cases: {', '.join(self.cases)}")

    @property
    def cases(self) -> tuple[str, ...]:
        """Cases in the order of the rows."""
        return tuple(dict.fromkeys(row.case for row in self.rows))

    def tables(self) -> list[Table]:
        """One table a case, the reference's figure in brackets, and the verdicts last, if there are any."""
        return [*(self._case(case) for case in self.cases), *([self._verdicts()] if self.verdicts else [])]

    def _case(self, case: str) -> Table:
        rows = [row for row in self.rows if row.case == case]
        caption = f"reference in brackets; {self.legend}" if case == self.cases[0] else None
        table = light_table(f"{self.paper}: {case}", caption)
        table.add_column("method")
        for column, digits in self.columns.items():
            widest = max(len(line) for row in rows for line in cell(row, column, digits).splitlines())
            table.add_column(escape(column), justify="right", min_width=widest)
        for row in rows:
            table.add_row(escape(row.method), *(cell(row, name, n) for name, n in self.columns.items()))
        return table

    def _verdicts(self) -> Table:
        table = light_table(f"{self.paper}: claims")
        table.add_column("verdict", width=20)
        table.add_column("claim, and what was measured")
        for v in self.verdicts:
            claim = f"[bold]{escape(v.claim.text)}[/bold] ({escape(v.claim.source)})"
            table.add_row(escape(v.outcome), f"{claim}\n{escape(v.numbers)}\n")
        return table

    def as_dict(self) -> dict[str, Any]:
        """Everything as JSON takes it."""
        return {
            "paper": self.paper,
            "title": self.title,
            "interrupted": self.interrupted,
            "settings": dict(self.settings),
            "versions": {name: version(name) for name in ("eot-testbed", "numpy", "scipy")},
            "rows": [
                {"case": r.case, "method": r.method, "measured": finite(r.measured), "reference": finite(r.reference)}
                for r in self.rows
            ],
            "verdicts": [
                {"claim": v.claim.text, "source": v.claim.source, "outcome": v.outcome, "numbers": v.numbers}
                for v in self.verdicts
            ],
            "figures": [figure.name for figure in self.figures],
        }

    def write(self, out: Path) -> Path:
        """Write `<paper>.json` into the folder `out` and return its path."""
        out.mkdir(parents=True, exist_ok=True)
        path = out / self.file
        write_json(path, self.as_dict())
        return path


def cell(row: Row, column: str, digits: int) -> str:
    """One figure, below it half its 95 % interval and the reference's in brackets; a dash where it was not measured."""
    value, reference = row.measured.get(column), row.reference.get(column)
    half = row.measured.get(f"{column} 95 %", float("nan"))
    text = "–" if value is None or isnan(value) else f"{value:.{digits}f}"
    text += "" if isnan(half) else f"\n±{half:.{digits}f}"
    return text if reference is None else f"{text}\n({reference:.{digits}f})"


def light_table(title: str, caption: str | None = None) -> Table:
    """Narrow: nine figures and their names fit into 80 columns."""
    return Table(
        title=escape(title), title_justify="left", title_style="bold", caption=caption, caption_justify="left",
        box=box.SIMPLE_HEAD, padding=0, min_width=len(title) + 2,
    )  # fmt: skip


def finite(values: Mapping[str, float]) -> dict[str, float | None]:
    """Figures for JSON, which has no NaN."""
    return {name: float(v) if abs(v) < float("inf") else None for name, v in values.items()}


def differences(rows: Iterable[Row], column: str) -> dict[tuple[str, str], float]:
    """Measured minus reference of every row that has both."""
    return {
        (r.case, r.method): r.measured[column] - r.reference[column]
        for r in rows
        if column in r.measured and column in r.reference
    }
