"""Verdicts of the reproductions as they are committed: one small JSON a paper, for the page that shows all of them.

`make reproduce` ends with `PYTHONPATH=docs python -m studies verdicts`, which takes them out of the files that the
reproductions wrote.
"""

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from studies.papers.catalogue import PAPERS
from testbed.command_line.terminal import console, user_input
from testbed.files import write_json


def take(source: Path, target: Path) -> list[Path]:
    """Write the verdicts of all complete reproductions in a folder; returns the files.

    Raises ValueError where the folder holds none.
    """
    written = []
    for name in PAPERS:
        path = source / f"{name}.json"
        if not path.exists():
            continue
        found = json.loads(path.read_text())
        if found["interrupted"]:
            continue
        date = f"{datetime.fromtimestamp(path.stat().st_mtime, UTC):%Y-%m-%d}"
        settings = {key: found["settings"][key] for key in ("runs", "seed")}
        kept = {"paper": name, "settings": settings, "date": date, "verdicts": found["verdicts"]}
        target.mkdir(parents=True, exist_ok=True)
        written.append(target / path.name)
        write_json(written[-1], kept)
    if not written:
        raise ValueError(f"source: {source} holds no complete reproduction; `testbed reproduce PAPER --out` writes one")
    return written


def read(folder: Path) -> list[dict[str, Any]]:
    """Committed verdicts in the order of the catalogue; none for papers that were not reproduced."""
    known = []
    for name, paper in PAPERS.items():
        path = folder / f"{name}.json"
        found = json.loads(path.read_text()) if path.exists() else {"paper": name, "verdicts": []}
        known.append({**found, "title": paper.source})
    return known


def main(
    source: Annotated[Path, typer.Argument(help="What `testbed reproduce --out` left.")] = Path("runs/reproduce"),
    target: Annotated[Path, typer.Argument(help="Directory of the committed verdicts.")] = Path(
        "docs/results/reproduce"
    ),
) -> None:
    """Take the verdicts out of reproductions, small enough to be committed."""
    with user_input((OSError, ValueError)):
        for path in take(source, target):
            console.print(f"verdicts {path}", soft_wrap=True)
