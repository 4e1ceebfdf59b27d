"""What `testbed run` and `testbed replay` print alike: the measures of the trackers, and where the files are."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape

from testbed.command_line import tables

if TYPE_CHECKING:
    from testbed.run import RunResult


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


def show_run(result: "RunResult", console: Console) -> None:
    """What a run was: the measures, or only the costs, its events, and where the files are."""
    if result.config.metrics:
        show_measures(result.result, console)
        console.print(tables.drive(result.result))
    else:
        console.print(tables.costs(result.result))
    for event in result.result["run"].get("events", ()):
        console.print(escape(f"at {event['time']:.1f} s: {event['text']}"))
    focus, there = result.config.focus, sorted({row["object"] for row in result.result["objects"]})
    if focus not in (None, *there):
        known = ", ".join(map(str, there)) or "none"
        console.print(f"[yellow]--focus: there was no vehicle {focus}; vehicles: {known}[/yellow]", highlight=False)
    if result.interrupted:
        console.print("[yellow]interrupted: the tables and files hold what was run until then[/yellow]")
    show_files({"results": result.json, "log": result.rrd}, console)
