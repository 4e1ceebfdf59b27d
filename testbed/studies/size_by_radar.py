"""What size from both ends earns with other radars than the default rig: docs/results/size-by-radar.json."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from sensors import RADARS, Radar, Sensor
from testbed.command_line.terminal import console
from testbed.compare.runs.recording import record
from testbed.files import write_json
from testbed.studies.drives import every_sensor, measured
from testbed.studies.page import steps
from trackers import DEFAULT
from trackers.scan import DepthProfile

OFF = f"{DEFAULT}:size=off"
DURATION = 8.0  # [s]
MANY = ("cut-in", "truck-convoy", "dense-traffic", "hard-brake", "s-curve", "truck-cut-in", "merge")
DRIVES = {  # radar -> (scenario, seed); those below 402, and 402 of imaging, were seen while profiles were chosen
    "nuscenes-like": (("truck-convoy", 400), ("cut-in", 400)),
    "imaging": tuple((scenario, seed) for seed in (400, 401, 402, 410, 411, 412) for scenario in MANY),
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
                drive = record(scenario, seed, "ideal", DURATION)
                off, ends = (row["gospa"] for row in measured(drive, counting(name), [OFF, DEFAULT], ["gospa"]))
                rows.append({"radar": name, "scenario": scenario, "seed": seed, "off": off, "ends": ends})
    measured_by = f"GOSPA [m], c = 5 m, mean over the frames of drives of {DURATION:g} s, through {DEFAULT}"
    write_json(out, {"measured": measured_by, "rows": rows})
    console.print(f"results  {out}", soft_wrap=True)


def counting(name: str) -> Radar:
    """A radar whose detections count for sizes, also where its rig has them count for nothing."""

    def counted(sensor: Sensor) -> Sensor:
        profile = sensor.profile
        return replace(sensor, profile=replace(profile, weight=profile.weight or DepthProfile.weight))

    return every_sensor(RADARS[name], counted)
