"""The frame of every page of the documentation that a command writes.

`PYTHONPATH=docs python -m studies NAME --docs docs` writes docs/NAME.md with its pictures in docs/pictures. A page
begins with its title, the command and the date; below the line NOTES it ends with notes written by hand, which a new
page keeps.
"""

import shlex
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
        framed = frame(text, command or command_line(), date or f"{datetime.now(UTC):%Y-%m-%d}", notes_of(self.file))
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
