"""What size from both ends earns with other radars than the default rig: docs/results/size-by-radar.json."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from sensors import RADARS
from testbed.command_line.terminal import console
from testbed.compare.runs.recording import record
from testbed.files import write_json
from testbed.studies.drives import every_sensor, measured
from testbed.studies.page import steps
from trackers import DEFAULT
from trackers.scan import DepthProfile

OFF = f"{DEFAULT}:size=off"
DURATION = 8.0  # [s]
DRIVES = {  # radar -> (scenario, seed); 400 and 401 were seen while profiles were chosen, 402 and 403 were not
    "nuscenes-like": (("truck-convoy", 400), ("cut-in", 400)),
    "imaging": (("truck-convoy", 400), ("truck-convoy", 401), ("truck-convoy", 402), ("cut-in", 400), ("cut-in", 402)),
    "lidar-1deg": (("truck-convoy", 400), ("cut-in", 400)),
    "ideal": (
        ("truck-convoy", 400), ("truck-convoy", 401), ("truck-convoy", 402), ("truck-convoy", 403), ("cut-in", 400)
    ),
}  # fmt: skip
BESIDE = "imaging"  # also with the default profile in place of its own


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
    row = {"off": round(off, 2), "ends": round(ends, 2)}
    if name == BESIDE:
        known_less = every_sensor(RADARS[name], lambda sensor: replace(sensor, profile=DepthProfile()))
        (known,) = measured(drive, known_less, [DEFAULT], ["gospa"])
        row["default_profile"] = round(known["gospa"], 2)
    return row
