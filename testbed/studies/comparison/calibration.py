"""The radar `imaging` against real cars, as the page of the comparison shows it: docs/results/calibration.json."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from testbed.command_line.terminal import console, user_input
from testbed.files import write_json
from testbed.learn.calibration import report

NOTE = (
    "Detections of real cars (Meyer and Kuschk, EuRAD 2019) beside those that the radar `imaging` makes of the same "
    "cars, pose by pose: real/simulated. Fitted and compared on the same cars; `testbed calibrate` shows it."
)


def plain(table: Table) -> dict[str, Any]:
    """Title, heads and rows of a table as JSON takes them."""
    columns = [list(column.cells) for column in table.columns]
    heads = [str(column.header) for column in table.columns]
    return {"title": str(table.title), "heads": heads, "rows": [list(map(str, row)) for row in zip(*columns)]}


def main(
    out: Annotated[Path, typer.Argument(help="The JSON file.")] = Path("docs/results/calibration.json"),
) -> None:
    """Write the comparison of `imaging` with the real cars, for the page that shows it."""
    with user_input():
        write_json(out, {"note": NOTE, "tables": [plain(table) for table in report()]})
    console.print(f"results  {out}", soft_wrap=True)
