"""Writes the page of a run: template, style, program and data in one file."""

import html
import json
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from testbed.files import check_target, write_atomic
from testbed.log.review import readable
from testbed.log.review_page.both import side_by_side, together


def write(logs: str | Path | Sequence[str | Path], page: str | Path) -> Path:
    """Write the page (.html) of one or two logs (.rrd); raises OSError or ValueError where that cannot be.

    Two of the same drive, as of one recording, have all trackers in one scene; others stand side by side.
    """
    page = Path(page)
    if page.suffix.lower() not in (".html", ".htm"):
        raise ValueError(f"a page is an .html file, got {page}")
    logs = [logs] if isinstance(logs, str | Path) else logs
    if len(logs) > 2:
        raise ValueError(f"a page shows one or two logs, got {len(logs)}; leave some out")
    check_target(page)
    readable(*logs)
    found = together(logs)
    pages = [_page(data) for data in found]
    text = pages[0] if len(pages) == 1 else side_by_side(pages, [_title(data) for data in found], asset("both.html"))
    page.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(page, text.encode())
    return page


def _title(data: dict[str, Any]) -> str:
    return f"{data['run']['scenario']}, seed {data['run']['seed']}"


def _page(data: dict[str, Any]) -> str:
    text = asset("page.html")
    for mark, part in (
        ("{{title}}", html.escape(_title(data))),
        ("{{style}}", asset("page.css")),
        ("{{program}}", asset("scene.js") + asset("page.js")),
        ("{{data}}", json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")),
    ):
        text = text.replace(mark, part)
    return text


def asset(name: str) -> str:
    """Text of a file of the page."""
    return files("testbed.log.review_page").joinpath(name).read_text(encoding="utf-8")
