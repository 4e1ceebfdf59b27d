"""The page docs/calibration.md: the imaging radar beside real detections of vehicles that it was not fitted on."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

import sensors
from sensors.aspects import Aspects
from studies.calibration.figure import draw
from studies.calibration.report import LEVEL, NOTE, SEED, TITLES, Compared, compared, tables
from studies.calibration.statistics import ASPECTS, BANDS, BLOCK, SHORT, halves, read_real, simulate
from studies.page import DOCS, Docs, Page, fill, steps
from testbed.command_line.terminal import console, user_input
from testbed.files import make_directory, write_json
from testbed.log.text import markdown_table

RADAR = "imaging"
ABOUT = (
    "Detections of real vehicles (Meyer and Kuschk, EuRAD 2019) beside those that the radar `imaging` makes of the "
    "same frames, on the half of the frames that it was not fitted on: real/simulated. " + NOTE + ". `testbed "
    "calibrate` shows it, [calibration.md](calibration.md) explains it."
)


def plain(table: Table) -> dict[str, Any]:
    """Title, heads and rows of a table as JSON takes them."""
    columns = [list(column.cells) for column in table.columns]
    heads = [str(column.header) for column in table.columns]
    return {"title": str(table.title), "heads": heads, "rows": [list(map(str, row)) for row in zip(*columns)]}


def missed(found: dict[str, Compared]) -> tuple[list[tuple[str, ...]], int]:
    """Rows of the statistics that are surely missed by cars, and how many more are missed by value."""
    rows: list[tuple[str, ...]] = []
    doubtful = 0
    for name in car_groups(found):
        one = found[name]
        for k, title in enumerate(TITLES):
            if not one.met[k] and one.sure[k]:
                ratio = f"{one.ratio[k]:.2f} ({one.low[k]:.2f} to {one.high[k]:.2f})"
                rows.append((name, title, f"{one.real[k]:.2f}", f"{one.simulated[k]:.2f}", ratio))
            doubtful += bool(not one.met[k] and not one.sure[k])
    return rows, doubtful


def car_groups(found: dict[str, Compared]) -> list[str]:
    """Names of the groups by range and by aspect."""
    return [name for name in (*(f"{low:.0f}-{high:.0f} m" for low, high in BANDS), *ASPECTS) if name in found]


def parameters(aspects: Aspects) -> str:
    """A table of the fields of `imaging`."""
    rows = []
    for name, value in vars(aspects).items():
        text = ", ".join(f"{x:g}" for x in value) if isinstance(value, tuple) else f"{value:g}"
        rows.append((f"`{name}`", text))
    return markdown_table(("field", "value; of front, flank, rear where there are three"), rows)


def main(
    data: Annotated[Path | None, typer.Option(help="Folder of the real detections, with objects.npz.")] = None,
    docs: Docs = DOCS,
) -> None:
    """Write docs/calibration.md, its picture, and the results behind it."""
    with user_input(), steps(2) as step:
        step("tables")
        found = compared(data, RADAR)
        step("picture")
        real = halves(read_real(data))[1]
        radar = sensors.find(RADAR)
        twins = simulate(radar, real, np.random.default_rng(SEED))
    page = Page("calibration", docs)
    draw({"real": real, "simulated": twins}, page.picture("calibration"))
    shown = [plain(table) for table in tables(found, RADAR)]
    make_directory(docs / "results")
    write_json(docs / "results" / "calibration.json", {"note": ABOUT, "tables": shown})
    rows, doubtful = missed(found)
    total, met = len(TITLES) * len(car_groups(found)), sum(int(found[name].met.sum()) for name in car_groups(found))
    aspects = radar.sensors[0].aspects
    assert aspects is not None
    page.write(
        fill(
        "calibration/page.md.j2",
            block=BLOCK, short=SHORT, level=100 * LEVEL, note=NOTE, open=doubtful, parameters=parameters(aspects),
            met=f"Of {total} statistics of cars by range and by aspect, {met} are met, {len(rows)} are surely missed.",
            tables="\n\n".join(
                f"{t['title']}\n\n{markdown_table(tuple(t['heads']), [tuple(r) for r in t['rows']])}" for t in shown
            ),
            missed=markdown_table(("cars", "statistic", "real", "simulated", "ratio"), rows),
        )
    )  # fmt: skip
    console.print(f"results  {docs / 'results' / 'calibration.json'}", soft_wrap=True)
