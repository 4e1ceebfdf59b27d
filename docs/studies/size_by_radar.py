"""What size from both ends earns with other radars than the default rig: docs/results/size-by-radar.json."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from sensors import RADARS
from studies.drives import every_sensor, measured
from studies.page import steps
from testbed.command_line.terminal import console
from testbed.files import write_json
from testbed.replay.recording import record
from trackers import DEFAULT

OFF = f"{DEFAULT}:size=off"
DURATION = 8.0  # [s]
PATCHY = "imaging"  # also as if its detections lay all along what is seen of a side
MANY = ("cut-in", "truck-convoy", "dense-traffic", "hard-brake", "s-curve", "truck-cut-in", "merge")
DRIVES = {  # radar -> (scenario, seed); 400, 401, and 402 of imaging were seen while profiles were chosen
    "nuscenes-like": (("truck-convoy", 400), ("cut-in", 400)),
    PATCHY: tuple((scenario, seed) for seed in (400, 401, 402, 410, 411, 412) for scenario in MANY),
    "lidar-1deg": (("truck-convoy", 400), ("cut-in", 400)),
    "ideal": (
        ("truck-convoy", 400), ("truck-convoy", 401), ("truck-convoy", 402), ("truck-convoy", 403), ("cut-in", 400)
    ),
}  # fmt: skip


def main(out: Annotated[Path, typer.Argument(help="The JSON file.")] = Path("docs/results/size-by-radar.json")) -> None:
    """Measure the default tracker with and without size from both ends, by radar."""
    rows: list[dict[str, Any]] = []
    with steps(sum(map(len, DRIVES.values()))) as step:
        for name, drives in DRIVES.items():
            for scenario, seed in drives:
                step(f"{name} {scenario} {seed}")
                rows.append({"radar": name, "scenario": scenario, "seed": seed, **_row(name, scenario, seed)})
    measured_by = f"GOSPA [m], c = 5 m, mean over the frames of drives of {DURATION:g} s, through {DEFAULT}"
    write_json(out, {"measured": measured_by, "rows": rows})
    console.print(f"results  {out}", soft_wrap=True)


def _row(name: str, scenario: str, seed: int) -> dict[str, float]:
    drive = record(scenario, seed, "ideal", DURATION)
    off, ends = (row["gospa"] for row in measured(drive, RADARS[name], [OFF, DEFAULT], ["gospa"]))
    row = {"off": round(off, 3), "ends": round(ends, 3)}
    if name == PATCHY:
        even = every_sensor(RADARS[name], lambda sensor: replace(sensor, profile=replace(sensor.profile, patchy=False)))
        (taken,) = measured(drive, even, [DEFAULT], ["gospa"])
        row["not_patchy"] = round(taken["gospa"], 3)
    return row
