"""Writes the page of a run: template, style, program and data in one file."""

import html
import json
from importlib.resources import files
from pathlib import Path

from testbed.files import check_target, write_atomic
from testbed.log.review import readable
from testbed.log.review_page.contents import contents


def write(log: str | Path, page: str | Path) -> Path:
    """Write the page of a log; raises OSError or ValueError, in one sentence, where that cannot be.

    Args:
        log: the .rrd of a run; with the level metrics the page has no scene.
        page: the .html; its directory is made.
    """
    page = Path(page)
    if page.suffix.lower() not in (".html", ".htm"):
        raise ValueError(f"a page is an .html file, got {page}")
    check_target(page)
    readable(log)
    data = contents(log)
    title = f"{data['run']['scenario']}, seed {data['run']['seed']}"
    text = _part("page.html")
    for mark, part in (
        ("{{title}}", html.escape(title)),
        ("{{style}}", _part("page.css")),
        ("{{program}}", _part("scene.js") + _part("page.js")),
        ("{{data}}", json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")),
    ):
        text = text.replace(mark, part)
    page.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(page, text.encode())
    return page


def _part(name: str) -> str:
    return files("testbed.log.review_page").joinpath(name).read_text(encoding="utf-8")
