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
        console.print(escape(tables.SEVERITY))
        console.print()


def show_files(files: Mapping[str, Path | None], console: Console) -> None:
    """Where each file is that was written, and how to open the one called "log"."""
    for name, path in files.items():
        if path is not None:
            console.print(f"{name:8} {path}", soft_wrap=True)
    if files["log"] is not None:
        console.print(f"open it  testbed review {shlex.quote(str(files['log']))}", soft_wrap=True)


def show_run(result: Mapping[str, Any], files: Mapping[str, Path | None], focus: int | None, console: Console) -> None:
    """What a run was: the measures, or where there are none the costs; its events, and where the files are.

    focus: id of the vehicle that the user wants to see first, None for no wish.
    """
    if "objects" in result:
        show_measures(result, console)
        console.print(tables.drive(result))
    else:
        console.print(tables.costs(result))
    for event in result["run"].get("events", ()):
        console.print(escape(f"at {event['time']:.1f} s: {event['text']}"))
    there = sorted({row["object"] for row in result.get("objects", ())})
    if focus not in (None, *there):
        known = ", ".join(map(str, there)) or "none"
        console.print(f"[yellow]--focus: there was no vehicle {focus}; vehicles: {known}[/yellow]", highlight=False)
    if result["interrupted"]:
        console.print("[yellow]interrupted: the tables and files hold what was run until then[/yellow]")
    show_files(files, console)
