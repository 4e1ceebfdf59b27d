"""The committed fit of the population `recorded`, and its picture for docs/traffic.md."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from scenarios.drivers import POPULATIONS, Population
from studies.drivers.figure import draw
from studies.drivers.fit import REPORTED, TUNED, Row, compared, fitted, near, simulated
from studies.drivers.motions import QUANTITIES, Flows, halves, of_recordings
from studies.page import DOCS, Docs
from testbed.command_line.terminal import console, user_input
from testbed.files import write_json
from testbed.log.text import markdown_table

RESULTS = "drivers.json"


def read(path: Path) -> dict[str, Any]:
    """The committed fit: `population`, `flows` and `rows`."""
    held: dict[str, Any] = json.loads(path.read_text())
    held["rows"] = [Row(*row) for row in held["rows"]]
    return held


def table(rows: Sequence[Row]) -> str:
    """A row a quantity: of each quantile the half tuned on, the other half, and the population."""
    lines = []
    for name in (*QUANTITIES, "changes"):
        cells = [
            f"{r.tuned:.2f}, {r.held:.2f}: {r.simulated:.2f}{'' if near(r) else '*'}"
            for r in rows if r.quantity == name
        ]  # fmt: skip
        lines.append((name.replace("_", " "), *cells, *[""] * (5 - len(cells))))
    return markdown_table(("quantity", "5 %", "25 %", "50 %", "75 %", "95 %"), lines)


def main(
    data: Annotated[Path, typer.Argument(help="Folder of ngsim_i80 and ngsim_us101.")],
    docs: Docs = DOCS,
    again: Annotated[bool, typer.Option("--fit", help="Fit anew; else the committed one is judged.")] = False,
) -> None:
    """Fit the population `recorded` of `scenarios.drivers` to half of the recorded drivers; judge it on the rest."""
    with user_input((OSError, ValueError)):
        tuned, held = halves(of_recordings(data))
        path = docs / "results" / RESULTS
        if again:
            population, flows = fitted(tuned)
        else:
            population, flows = POPULATIONS["recorded"], Flows(**read(path)["flows"])
        console.print(f"{population}\n{flows}", soft_wrap=True)
        rows = compared(tuned, held, population, flows)
        seeds = {"tuned": [*TUNED], "reported": [*REPORTED]}
        write_json(path, {"seeds": seeds, "population": asdict(population), "flows": flows._asdict(), "rows": rows})
        groups = {
            "recorded, tuned on": tuned, "recorded, held out": held,
            "recorded (population)": simulated(population, flows, REPORTED),
            "default": simulated(Population(), flows, REPORTED),
        }  # fmt: skip
        draw(groups, docs / "pictures" / "drivers.png")
        console.print(f"results  {path}", soft_wrap=True)
