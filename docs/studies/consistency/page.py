"""The page docs/consistency.md from the rows of a comparison."""

from pathlib import Path
from typing import Annotated

import typer

from studies.consistency.figure import draw
from studies.consistency.tables import (
    GROUPS,
    MOST_OUTLIERS,
    OUTLIER,
    QUANTITIES,
    Judged,
    by_group,
    judge,
    pairs,
)
from studies.page import DOCS, Docs, Page, fill
from studies.stored import stored_comparison
from testbed.command_line.terminal import user_input
from testbed.experiments.store import Results
from testbed.log.text import markdown_table
from trackers import DEFAULT

HEADINGS = {
    "scenario": "By scenario",
    "class": "By class",
    "view": "By view",
    "range": "By range",
    "age": "By time since the vehicle was first counted",
    "ends": "By what was seen of its length",
}


def main(
    folder: Annotated[Path, typer.Argument(help="What `testbed compare --out` left.")],
    docs: Docs = DOCS,
    tracker: Annotated[str, typer.Option(help="One that was compared.")] = DEFAULT,
) -> None:
    """Write the page "Does the tracker know how wrong it is?" from the runs of a comparison."""
    with user_input((OSError, ValueError)):
        comparison = stored_comparison(folder)
        if tracker not in comparison.trackers:
            known = ", ".join(comparison.trackers)
            raise ValueError(f"tracker: {folder} has no runs of {tracker!r}; choose one of {known}")
        page = Page("consistency", docs)
        rows = pairs(Results.read(comparison), tracker)
        groups = {name: by_group(rows, name) for name in GROUPS}
        draw({name: groups[name] for name in GROUPS if name != "scenario"}, page.picture("consistency"))
        ranges = "; ".join(f"{q.low:g} to {q.high:g} for {q.name}" for q in QUANTITIES)
        text = fill(
            "consistency/page.md.j2",
            tracker=tracker,
            scenarios=len(comparison.scenarios),
            seeds=f"{min(comparison.seeds)} to {max(comparison.seeds)}",
            pairs=len(rows),
            outlier=OUTLIER,
            most=MOST_OUTLIERS,
            ranges=ranges,
            total=table({"all pairs": {q.name: judge(rows, q) for q in QUANTITIES}}),
        )
        parts = [f"## {HEADINGS[name]}\n\n{table(found)}" for name, found in groups.items()]
        page.write("\n\n".join([text, *parts]))


def table(found: dict[str, dict[str, Judged]]) -> str:
    """A row a group, a column a quantity."""
    head = ("", "pairs", *(q.name for q in QUANTITIES))
    body = []
    for label, row in found.items():
        cells = [cell(row[q.name], row[q.name].good(q)) for q in QUANTITIES]
        body.append((label, f"{row[QUANTITIES[0].name].pairs:,}", *cells))
    return markdown_table(head, body)


def cell(judged: Judged, good: bool) -> str:
    """Mean, interval, median and outliers of one quantity."""
    mean = judged.mean
    text = f"{mean.value:.2f} [{mean.low:.2f}, {mean.high:.2f}]; {judged.median:.2f}; {judged.outliers:.1%}"
    return text if good else f"**{text}**"
