"""Writes the page of a run: template, style, program and data in one file."""

import html
import json
from importlib.resources import files
from pathlib import Path

from testbed.files import check_target, write_atomic
from testbed.log.review import readable
from testbed.log.review_page.contents import contents


def write(log: str | Path, page: str | Path) -> Path:
    """Write the page (.html) of the log (.rrd) of a run; raises OSError or ValueError where that cannot be."""
    page = Path(page)
    if page.suffix.lower() not in (".html", ".htm"):
        raise ValueError(f"a page is an .html file, got {page}")
    check_target(page)
    readable(log)
    data = contents(log)
    title = f"{data['run']['scenario']}, seed {data['run']['seed']}"
    text = asset("page.html")
    for mark, part in (
        ("{{title}}", html.escape(title)),
        ("{{style}}", asset("page.css")),
        ("{{program}}", asset("scene.js") + asset("page.js")),
        ("{{data}}", json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")),
    ):
        text = text.replace(mark, part)
    page.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(page, text.encode())
    return page


def asset(name: str) -> str:
    """Text of a file of the page."""
    return files("testbed.log.review_page").joinpath(name).read_text(encoding="utf-8")
