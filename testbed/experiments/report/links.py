"""Where a report page leads: addresses of files as seen from it, and what can be opened of a log."""

import os
import shlex
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

PAGE = ".html"  # of a log, in place of its .rrd


class LogFiles(NamedTuple):
    """What a report page says of one log."""

    href: str = ""  # of the log, empty where there is none
    page: str = ""  # of its page for a browser, empty where that was not written
    command: str = ""  # that opens the log in the viewer
    note: str = ""  # why there is no log


def href(path: Path, folder: Path) -> str:
    """Address of a file as seen from a page in the folder.

    >>> href(Path("runs/logs/a b.rrd"), Path("runs"))
    'logs/a%20b.rrd'
    """
    return quote(Path(os.path.relpath(path, folder)).as_posix(), safe="/")


def found(path: Path, folder: Path, note: str) -> LogFiles:
    """The log, and beside it the page that `testbed review LOG --html PAGE` has written; the note where none is."""
    if not path.exists():
        return LogFiles(note=note)
    page = path.with_suffix(PAGE)
    command = f"testbed review {shlex.quote(str(path))}"
    return LogFiles(href(path, folder), href(page, folder) if page.exists() else "", command)
