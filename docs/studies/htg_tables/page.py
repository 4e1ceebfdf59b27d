"""The page docs/htg-tables.md: the shipped tables with their commands, and how the model stands on real detections.

The comparison takes some minutes.
"""

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from studies.htg_tables.comparison import BLOCK, FOLDS, MOST, compare
from studies.page import DOCS, PYTHON, Docs, Page, fill
from testbed.command_line.terminal import progress_bar, stages, user_input
from testbed.learn.detections import GROWN, KINDS
from testbed.log.text import markdown_table
from trackers.htg.bins import SHIPPED


def shipped() -> str:
    """One row for each shipped table."""
    rows = []
    for file in sorted(SHIPPED.glob("*.json")):
        facts = json.loads(file.read_text())["provenance"]
        mean = np.average(facts["log_likelihood"], weights=facts["counts"])
        cells = (file.stem, f"`{facts['command']}`", facts["detections"], f"{mean:.3f}", f"{min(facts['mass']):.2g}")
        rows.append(tuple(map(str, cells)))
    return markdown_table(("table", "made by", "detections", "log p", "least c_D"), rows)


def render(sections: list[str]) -> str:
    """What the page says; sections are the comparisons, `compare` of each data source."""
    least = min(min(json.loads(file.read_text())["provenance"]["mass"]) for file in SHIPPED.glob("*.json"))
    return fill(
        "htg_tables/page.md.j2",
        least=least,
        most_imaginary=1 / least,
        tables=shipped(),
        folds=FOLDS,
        most=MOST,
        grown=GROWN,
        block=BLOCK,
        sections="\n\n".join(sections),
    )


def main(
    folder: Annotated[Path, typer.Argument(help="That of the real extract, the one with objects.npz.")],
    docs: Docs = DOCS,
) -> None:
    """Compare densities on real detections, and write htg-tables.md with the shipped tables."""
    with user_input():
        page = Page("htg-tables", docs)
        with progress_bar("{task.completed:.0f} of {task.total:.0f} folds") as bar:
            show = stages(bar)
            sections = [f"### {kind.capitalize()}s\n\n{compare(f'{folder}:{kind}', progress=show)}" for kind in KINDS]
    page.write(render(sections), " ".join((*PYTHON, "htg-tables", "FOLDER")))
