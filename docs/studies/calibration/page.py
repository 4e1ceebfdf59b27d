"""The page docs/calibration.md: the imaging radar beside real detections of vehicles that it was not fitted on."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

import sensors
from sensors.aspects import Aspects
from studies.calibration.figure import draw
from studies.page import DOCS, Docs, Page, steps
from testbed.command_line.terminal import console, user_input
from testbed.files import make_directory, write_json
from testbed.learn.calibration import ASPECTS, BANDS, BLOCK, SHORT, halves, read_real, simulate
from testbed.learn.calibration_report import LEVEL, NOTE, SEED, TITLES, Compared, compared, tables
from testbed.log.text import markdown_table

RADAR = "imaging"
ABOUT = (
    "Detections of real vehicles (Meyer and Kuschk, EuRAD 2019) beside those that the radar `imaging` makes of the "
    "same frames, on the half of the frames that it was not fitted on: real/simulated. " + NOTE + ". `testbed "
    "calibrate` shows it, [calibration.md](calibration.md) explains it."
)
TEXT = """# The imaging radar beside a real one

The real detections are those of an Astyx 6455 HiRes on annotated vehicles (M. Meyer, G. Kuschk, "Automotive Radar
Dataset for Deep Learning Based 3D Object Detection", EuRAD 2019; CC BY-NC-SA 4.0, not part of this project). The
simulated ones are those of `imaging` in the same frames: all annotated vehicles of a frame with the outlines of our
catalogue, so that they hide each other. Detections in the box grown by a fifth belong to a vehicle.

Frames are cut into blocks of {block}. Every second block was used to fit the radar; all figures below are of the other
blocks. Neighbouring frames show the same vehicles, so intervals ({level:.0f} %) of simulated / real are bootstrapped
over blocks. A statistic is met when that ratio is within 10 % of one.

{met}

![real and simulated detections in the unit frame](pictures/calibration.png)

## Tables

{note}.

{tables}

The rows: share of the detections on the half that faces the radar, within .2 m and .4 m of the outline of the box, more
than .4 m inside, outside the box; root mean square unit coordinates along and across; median, mean and standard
deviation of the detections a vehicle.

## What is missed

Statistics whose whole interval is off by more than 10 %:

{missed}

{open} more are missed by their value, with an interval that does not exclude that they are met.

## What makes the sides differ

`Aspects` of [sensors/aspects.py](../sensors/aspects.py), an option of a sensor; equations:
[section 10](methods/radar.md#10-sides). `imaging` has:

{parameters}

- **Other vehicles hide more than rays say.** Half of the real cars are partly hidden by another one. With the vehicles
  of the frame simulated together, the great spread of counts is explained by hiding; what is left is far less than a
  negative binomial with shape 2, which the radar had when cars were simulated alone.
- **A side has a limit of its own** on how many points it can be resolved into, and a spread of its own: a rear returns
  few points and about as many each time, a flank flashes when it is seen square and is dim otherwise.
- **Height.** The points of a vehicle are spread in height too, which a plane does not have: a bus, truck or van
  returns more than its outline says.
- **Smooth faces reflect where they look at the radar** (`specular`), and the middle of front and rear, with number
  plate and beam, more than the rest of them (`plate`).
- **Wheels and axles, on paths beneath the body** (`under`): the bright spots on the far side of cars that are seen from
  a corner, and most of what lies deep inside. From the ends all of an axle is seen, from the flank its wheels.
- **Weak paths fade with range** (`fade`): far cars return from the outline that faces the radar and little else.

One difference is probably not the radar's. Of the detections on cars that show their front, twice as many lie outside
the box as on those that show their rear, up to .4 m before it (row "outside"). No path is shorter than the direct one,
and an error of range or of time would move rears too. The annotated boxes most likely end too early in front; the cars
of the extract are shorter than usual, which agrees with it. The simulated vehicles therefore have fronts {short:g} m
before those of the annotated boxes, a length fitted with the rest; the radar itself puts nothing before a body.

## Limits

No annotated object has a track number, so nothing here says how long a scattering centre lives. There are two
motorcycles in the data, and trailers hardly more: their figures are those of the car. Everything beyond annotated
vehicles (bushes, rails, parked vehicles without a box) neither hides nor adds detections in the simulated frames.
"""


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
        TEXT.format(
            block=BLOCK, short=SHORT, level=100 * LEVEL, note=NOTE, open=doubtful, parameters=parameters(aspects),
            met=f"Of {total} statistics of cars by range and by aspect, {met} are met, {len(rows)} are surely missed.",
            tables="\n\n".join(
                f"{t['title']}\n\n{markdown_table(tuple(t['heads']), [tuple(r) for r in t['rows']])}" for t in shown
            ),
            missed=markdown_table(("cars", "statistic", "real", "simulated", "ratio"), rows),
        )
    )  # fmt: skip
    console.print(f"results  {docs / 'results' / 'calibration.json'}", soft_wrap=True)
