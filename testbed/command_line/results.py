"""What `testbed run` and `testbed replay` print alike: the measures of the trackers, and where the files are."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from testbed.command_line import tables


def show_measures(result: Mapping[str, Any], console: Console, title: str | None = None) -> None:
    """Errors of the trackers and what they mean, and the worst moments if any; see `tables.metrics` for the title."""
    console.print(tables.metrics(result, title))
    for line in tables.EXPLAINED:
        console.print(line)
    console.print()
    if result["moments"]:
        console.print(tables.moments(result))
        console.print(escape(tables.HARM))
        console.print()


def show_files(files: Mapping[str, Path | None], console: Console) -> None:
    """Where each file is that was written, and how to open the one called "log"."""
    for name, path in files.items():
        if path is not None:
            console.print(f"{name:8} {path}", soft_wrap=True)
    if files["log"] is not None:
        console.print(f"open it  testbed review {shlex.quote(str(files['log']))}", soft_wrap=True)
