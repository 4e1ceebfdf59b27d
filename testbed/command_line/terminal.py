"""What commands share on the terminal: the console, bars on stderr, and one sentence for a wrong input."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

console = Console()
INPUT_FAULTS = (LookupError, ValueError, OSError)


@contextmanager
def user_input(faults: tuple[type[Exception], ...] = INPUT_FAULTS) -> Iterator[None]:
    """Around checks of what the user gave: one sentence on stderr and exit status 2, no traceback.

    `faults` says which exceptions are faults of the input; in a run only OSError is, all others are defects.
    """
    try:
        yield
    except faults as error:
        text = error.args[0] if len(error.args) == 1 else str(error)
        print(f"testbed: {text}", file=sys.stderr)
        raise typer.Exit(2) from None


def progress_bar(amount: str, window: float = 30.0) -> Progress:
    """A bar on stderr, one line at the end where that is a file; `amount` says how far it is.

    window [s]: the time left follows from the speed in it.
    """
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn(amount),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=Console(stderr=True), speed_estimate_period=window)


def stages(bar: Progress, prefix: str = "") -> Callable[[int, int, str], None]:
    """progress(done, total, what) on a bar, one line for each kind of work."""
    tasks: dict[str, TaskID] = {}

    def show(done: int, total: int, what: str) -> None:
        if what not in tasks:
            tasks[what] = bar.add_task(prefix + what, total=total)
        bar.update(tasks[what], completed=done, total=total)

    return show
