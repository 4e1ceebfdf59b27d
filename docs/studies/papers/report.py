"""What a reproduction reports: figures beside reference figures and an answer to every claim, as tables and JSON.

`carry_out` is the one way through an experiment: run it, judge the claims, draw the figures, write the file.
"""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from math import isnan
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from studies.papers.answer import Answer
from testbed.command_line.tables import light_table
from testbed.experiments.engine import Engine
from testbed.files import noting_losses, write_json

HERE = Engine()  # this process alone
Progress = Callable[[float, float, str], None]  # done, total, what is being done; may raise Stopped


class Stopped(Exception):
    """Raised by a progress callback to end an experiment; what is finished until then is reported."""


def silent(done: float, total: float, what: str) -> None:
    """Progress that is not shown."""


@dataclass(frozen=True)
class MethodRow:
    """One method in one case of an experiment."""

    case: str  # what is measured on: contour, noise, course
    method: str
    measured: Mapping[str, float]
    reference: Mapping[str, float] = field(default_factory=dict)  # of the paper or an independent implementation


@dataclass(frozen=True)
class PaperReport:
    """A reproduction: settings, rows, answers and pictures."""

    paper: str  # name on the command line
    title: str
    settings: Mapping[str, Any]
    columns: Mapping[str, int]  # measure -> digits
    legend: str  # of the columns, where their names are not enough
    rows: tuple[MethodRow, ...] = ()
    answers: tuple[Answer, ...] = ()
    figures: tuple[Path, ...] = ()
    interrupted: bool = False  # it was stopped: rows are missing, and with them the answers
    lost: tuple[str, ...] = ()  # what could not be written, in sentences
    json: Path | None = None  # where it was written

    @property
    def file(self) -> str:
        """Name of the JSON file."""
        return f"{self.paper}.json"

    @property
    def holds(self) -> bool:
        """Whether no claim is refuted."""
        return all(v.holds for v in self.answers)

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
        """One table a case, the reference's figure in brackets, and the answers last, if there are any."""
        return [*(self._case(case) for case in self.cases), *([self._answers()] if self.answers else [])]

    def _case(self, case: str) -> Table:
        rows = [row for row in self.rows if row.case == case]
        caption = f"reference in brackets; {self.legend}" if case == self.cases[0] else None
        table = narrow_table(f"{self.paper}: {case}", caption)
        table.add_column("method")
        for column, digits in self.columns.items():
            widest = max(len(line) for row in rows for line in cell(row, column, digits).splitlines())
            table.add_column(escape(column), justify="right", min_width=widest)
        for row in rows:
            table.add_row(escape(row.method), *(cell(row, name, n) for name, n in self.columns.items()))
        return table

    def _answers(self) -> Table:
        table = narrow_table(f"{self.paper}: claims")
        table.add_column("verdict", width=20)
        table.add_column("claim, and what was measured")
        for v in self.answers:
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
                for v in self.answers
            ],
            "figures": [figure.name for figure in self.figures],
        }

    def write(self, out: Path) -> Path:
        """Write `<paper>.json` into the folder `out` and return its path."""
        out.mkdir(parents=True, exist_ok=True)
        path = out / self.file
        write_json(path, self.as_dict())
        return path


def cell(row: MethodRow, column: str, digits: int) -> str:
    """One figure, below it half its 95 % interval and the reference's in brackets; a dash where it was not measured."""
    value, reference = row.measured.get(column), row.reference.get(column)
    half = row.measured.get(f"{column} 95 %", float("nan"))
    text = "–" if value is None or isnan(value) else f"{value:.{digits}f}"
    text += "" if isnan(half) else f"\n±{half:.{digits}f}"
    return text if reference is None else f"{text}\n({reference:.{digits}f})"


def narrow_table(title: str, caption: str | None = None) -> Table:
    """A table in which nine figures and their names fit into 80 columns."""
    table = light_table(title)
    table.padding, table.caption, table.caption_justify = 0, caption, "left"
    return table


def finite(values: Mapping[str, float]) -> dict[str, float | None]:
    """Figures for JSON, which has no NaN."""
    return {name: float(v) if abs(v) < float("inf") else None for name, v in values.items()}


def carry_out(
    blank: PaperReport,
    experiment: Callable[[], None],
    rows: Callable[[], Iterable[MethodRow]],
    answers: Callable[[], tuple[Answer, ...]],
    draw: Callable[[Path], tuple[Path, ...]],
    out: Path | None = None,
    progress: Progress = silent,
) -> PaperReport:
    """Run an experiment and report on it: `blank` with rows and answers; with a folder `out`, also figures and JSON.

    A Stopped from `progress`, which the experiment calls too, ends it: the report then holds the rows that are finished
    and no answers. What cannot be written is a `LostFileWarning`, and a sentence in `lost`.

    Raises ValueError for fewer than one run.
    """
    if blank.settings["runs"] < 1:
        raise ValueError(f"runs must be at least 1, got {blank.settings['runs']}")
    report, lost = replace(blank, interrupted=True), list[str]()
    with suppress(Stopped):
        experiment()
        progress(1, 1, "claims")
        judged = answers()
        progress(1, 1, "figures")
        if out is not None:
            with noting_losses(lost):
                out.mkdir(parents=True, exist_ok=True)
                report = replace(report, figures=draw(out))
        report = replace(report, answers=judged, interrupted=False)
    report = replace(report, rows=tuple(rows()))
    if out is not None:
        with noting_losses(lost):
            report = replace(report, json=report.write(out))
    return replace(report, lost=tuple(lost))
