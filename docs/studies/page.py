"""The frame of every page of the documentation that a command writes.

`PYTHONPATH=docs python -m studies NAME --docs docs` writes docs/NAME.md with its pictures in docs/pictures. A page
begins with its title, the command and the date; below the line NOTES it ends with notes written by hand, which a new
page keeps. A large table is a data file in docs/results/tables, and the page has a link in its place.
"""

import csv
import io
import re
import shlex
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import typer
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from testbed.command_line.terminal import console, progress_bar
from testbed.files import make_directory, write_atomic

NOTES = "<!-- What follows is written by hand, and kept. -->"
PYTHON = ("PYTHONPATH=docs", "python", "-m", "studies")
Docs = Annotated[Path, typer.Option(help="Directory for the page; its pictures go to pictures/ in it.")]
DOCS = Path("runs/docs")  # so that the committed pages change only with `--docs docs`
TABLES = "results/tables"  # where the data files of pages lie, a folder a page
MOST_WORDS = 200  # of a table on a page; a larger one is a data file
STAYS = "<!-- stays -->"  # a line before a table that stays on its page, however large it is
TABLE = re.compile(rf"(?P<stays>^{STAYS}\n)?(?P<rows>(?:^\|.*\|$\n?)+)|^#+ (?P<heading>.*)$", re.M)
INTERVAL = re.compile(r"(\S+) \[(\S+), (\S+)\]")


@dataclass(frozen=True)
class Page:
    """A page and its pictures in a directory, which is made; raises OSError where nothing can be written to it."""

    name: str
    docs: Path

    def __post_init__(self) -> None:
        make_directory(self.docs / "pictures")

    @property
    def file(self) -> Path:
        """The page itself."""
        return self.docs / f"{self.name}.md"

    def picture(self, name: str) -> Path:
        """Where a picture goes; pages name it pictures/NAME.png."""
        return self.docs / "pictures" / f"{name}.png"

    def write(self, text: str, command: str | None = None, date: str | None = None) -> None:
        """Frame a text whose first line is the title, write it atomically, and print where.

        Without `command` and `date` they are the command line and the day of the call.
        """
        text, tables = split_tables(self.name, text)
        framed = frame(text, command or command_line(), date or f"{datetime.now(UTC):%Y-%m-%d}", notes_of(self.file))
        folder = self.docs / TABLES / self.name
        shutil.rmtree(folder, ignore_errors=True)
        for name, content in tables.items():
            make_directory(folder)
            write_atomic(folder / name, content)
        write_atomic(self.file, framed)
        console.print(f"page     {self.file}", soft_wrap=True)


def fill(template: str, **values: Any) -> str:
    """The text of a template of this package, as NAME/page.md.j2; `number | spec(".2f")` is Python's format.

    Raises jinja2.UndefinedError for a name without a value.
    """
    return _TEMPLATES.get_template(template).render(values)


_TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).parent),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
_TEMPLATES.filters["spec"] = format


def split_tables(page: str, text: str) -> tuple[str, dict[str, str]]:
    """The text of a page with a link in the place of each large table, and these tables: name of the file -> CSV."""
    tables: dict[str, str] = {}
    heading = ""

    def shorten(found: re.Match[str]) -> str:
        nonlocal heading
        if found["heading"] is not None:
            heading = re.sub(r"[^a-z0-9]+", "-", found["heading"].partition(":")[0].lower()).strip("-")
            return found[0]
        rows = found["rows"]
        if found["stays"] or len(rows.split()) <= MOST_WORDS:
            return rows
        same = sum(name.startswith(heading) for name in tables)
        name = f"{heading}{f'-{same + 1}' if same else ''}.csv"
        tables[name] = as_csv(rows)
        return f"{len(rows.splitlines()) - 2} rows: [{name}]({TABLES}/{page}/{name}).\n"

    return TABLE.sub(shorten, text), tables


def as_csv(table: str) -> str:
    """A Markdown table as CSV; a column of intervals `x [low, high]` becomes three."""
    lines = [[_plain(cell) for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in table.splitlines()]
    head, rows = lines[0], lines[2:]
    spread = [any(INTERVAL.fullmatch(row[k]) for row in rows) for k in range(len(head))]
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow([n for k, name in enumerate(head) for n in ([name, "low", "high"] if spread[k] else [name])])
    for row in rows:
        writer.writerow([value for cell, wide in zip(row, spread, strict=True) for value in _values(cell, wide)])
    return file.getvalue()


def _plain(cell: str) -> str:
    """A cell of a Markdown table without its marks."""
    return re.sub(r"`|\*\*|\\(?=\|)", "", cell).strip()


def _values(cell: str, spread: bool) -> tuple[str, ...]:
    """A cell, or mean, low and high of an interval."""
    if not spread:
        return (cell,)
    found = INTERVAL.fullmatch(cell)
    return found.groups() if found else (cell, "", "")


def frame(text: str, command: str, date: str, notes: str = "\n") -> str:
    """A whole page from a text whose first line is the title."""
    title, _, body = text.partition("\n")
    written = f"Written by `{command}` on {date}; do not edit it by hand but for the notes at its end."
    return f"{title}\n\n{written}\n\n{body.strip()}\n\n{NOTES}{notes}"


def notes_of(file: Path) -> str:
    """What an older page has below the line NOTES."""
    return file.read_text().partition(NOTES)[2] if file.exists() else "\n"


def command_line(*without: str) -> str:
    """The command that is running, for a page to name, without some of its options."""
    return shlex.join([*PYTHON, *(argument for argument in sys.argv[1:] if argument not in without)])


@contextmanager
def steps(total: int) -> Iterator[Callable[[str], None]]:
    """A progress bar of so many steps; the function is called with what comes next, before each of them."""
    with progress_bar("{task.completed:.0f} of {task.total:.0f}") as bar:
        task, begun = bar.add_task("", total=total), False

        def next_step(what: str) -> None:
            nonlocal begun
            bar.update(task, description=what, advance=int(begun))
            begun = True

        yield next_step
        bar.advance(task)
