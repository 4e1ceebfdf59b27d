"""What commands share on the terminal: the console, bars on stderr, and one sentence for a wrong input."""

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from typing import IO, Any, NamedTuple, TypeVar, cast

import typer
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.markup import escape
from rich.measure import Measurement
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.status import Status
from rich.table import Table

Made = TypeVar("Made")
LONGEST = 600  # characters of a sentence
INPUT_FAULTS = (LookupError, ValueError, OSError)
WORD = 8  # characters of a column of words, however narrow the terminal is
AMOUNT, WHOLE_BAR = 24, 60  # characters of a bar without anything else, and with all
WIDEST = 10_000  # characters of a cell that is measured
BORDER = 3  # characters of a table beside the text of a column, at most


class Terminal(Console):
    """A console on which no number of a table is cut: what does not fit goes on in the next line of the terminal."""

    def print(self, *objects: Any, **options: Any) -> None:
        """As rich does, but for tables that are wider than the terminal."""
        if any(isinstance(o, Table) for o in objects):
            options["crop"] = False
        super().print(*(Uncut(o) if isinstance(o, Table) else o for o in objects), **options)


class Uncut(NamedTuple):
    """A table as wide as its numbers need; its words are folded."""

    table: Table

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        least = 0
        for column in self.table.columns:
            cells = [Measurement.get(console, options.update(width=WIDEST), c) for c in (column.header, *column.cells)]
            longest = max(cell.maximum if column.no_wrap else cell.minimum for cell in cells)
            if column.justify != "right" and not column.no_wrap:
                column.overflow, longest = "fold", min(longest, WORD)
            column.min_width = longest
            least += longest + BORDER
        width = max(options.max_width, least)
        self.table.min_width = min(self.table.min_width or 0, width)
        yield from console.render(self.table, options.update(width=width))


console = Terminal()


@contextmanager
def user_input(faults: tuple[type[Exception], ...] = INPUT_FAULTS) -> Iterator[None]:
    """Around checks of what the user gave: one sentence on stderr and exit status 2, no traceback.

    `faults` says which exceptions are faults of the input; in a run only OSError is, all others are defects.
    """
    try:
        yield
    except faults as error:
        complain(error.args[0] if len(error.args) == 1 else error)
        raise typer.Exit(2) from None


def complain(sentence: object) -> None:
    """Print what is wrong on stderr: one line, without control characters, its middle left out where it is long."""
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in f"testbed: {sentence}")
    if len(text) > LONGEST:
        text = f"{text[: LONGEST // 2]} [...] {text[-LONGEST // 2 :]}"
    with suppress(OSError):  # nothing else can be done where stderr cannot be written
        print(text, file=sys.stderr, flush=True)


def show(*parts: RenderableType) -> None:
    """Print tables, and lines that are not broken: they may hold a path."""
    for part in parts:
        console.print(part, soft_wrap=isinstance(part, str))


@contextmanager
def losses(lost: Iterable[str]) -> Iterator[None]:
    """Say at the end what could not be written, also where the tables go to the same full disk."""
    try:
        yield
    finally:
        for sentence in lost:
            complain(sentence)


def lenient_streams() -> None:
    """Let stdout and stderr show a question mark for what their encoding does not have, and take all where closed."""
    sys.stdout = sys.stdout or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - open to the end
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")


def drop_stdout() -> bool:
    """Whether stdout cannot be written; what is still to be printed then goes nowhere, or the process would fail."""
    with suppress(OSError):
        print(flush=True)
        return False
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)
    return True


def progress_bar(amount: str, window: float = 30.0) -> Progress:
    """A bar on stderr, one line at the end where that is a file; `amount` says how far it is.

    window [s]: the time left follows from the speed in it.
    """
    console = Console(file=cast(IO[str], LossyStderr()))
    columns: list[ProgressColumn] = [TextColumn(amount)]
    if console.width >= AMOUNT + WORD:
        columns.insert(0, TextColumn("{task.description}"))
    if console.width >= WHOLE_BAR:
        columns.insert(1, BarColumn())
        columns += [TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn()]
    console.width = max(console.width, AMOUNT)
    return Progress(*columns, console=console, speed_estimate_period=window)


def reported(
    work: Callable[[Callable[[float, float, str], None]], Made],
    name: str,
    amount: str = "part {task.completed:.0f} / {task.total:.0f}",
    window: float = 30.0,
) -> Made:
    """What `work(progress)` returns, under a bar that it moves by `progress(done, total, what)`."""
    bar = progress_bar(amount, window)
    task = bar.add_task(name, total=1)

    def show(done: float, total: float, what: str) -> None:
        bar.start()  # not before the input is known to be valid: then a fault stays one sentence
        bar.update(task, completed=done, total=total, description=what)

    try:
        return work(show)
    finally:
        if bar.live.is_started:
            bar.stop()


def busy(what: str) -> Status:
    """Says on a terminal what is going on while nothing measures how far it is; nothing where stderr is a file."""
    return Console(file=cast(IO[str], LossyStderr())).status(escape(what))


class LossyStderr:
    """Stderr for bars: what cannot be written is dropped, for a bar must not end a run when the disk is full."""

    def __getattr__(self, name: str) -> Any:
        return getattr(sys.stderr, name)

    def write(self, text: str) -> int:
        """Write the text if that is possible."""
        with suppress(OSError):
            sys.stderr.write(text)
        return len(text)

    def flush(self) -> None:
        """Flush if that is possible."""
        with suppress(OSError):
            sys.stderr.flush()


def stages(bar: Progress, prefix: str = "") -> Callable[[int, int, str], None]:
    """progress(done, total, what) on a bar, one line for each kind of work."""
    tasks: dict[str, TaskID] = {}

    def show(done: int, total: int, what: str) -> None:
        if what not in tasks:
            tasks[what] = bar.add_task(prefix + what, total=total)
        bar.update(tasks[what], completed=done, total=total)

    return show
