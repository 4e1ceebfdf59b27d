"""What size from both ends earns with other radars than the default rig: docs/results/size-by-radar.json."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from sensors import RADARS
from studies.page import Docs
from studies.runs import every_sensor, seen_by, summaries
from testbed.command_line.options import Dask, Jobs
from testbed.command_line.terminal import console
from testbed.experiments.engine import Engine
from testbed.experiments.run import Run
from testbed.files import write_json
from trackers import DEFAULT

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


def main(
    docs: Docs = Path("docs"),
    folder: Annotated[str, typer.Option(help="Directory of the runs.")] = "runs/size-by-radar",
    jobs: Jobs = 1,
    dask: Dask = None,
) -> None:
    """Measure the default tracker with and without size from both ends, by radar."""
    asked = {
        (name, scenario, seed): variants(name, scenario, seed)
        for name, drives in DRIVES.items()
        for scenario, seed in drives
    }
    runs = [run for each in asked.values() for run in each.values()]
    summary = summaries(runs, folder, Engine(jobs, dask))
    rows: list[dict[str, Any]] = [
        {"radar": name, "scenario": scenario, "seed": seed}
        | {what: round(summary(run)["gospa"], 3) for what, run in each.items()}
        for (name, scenario, seed), each in asked.items()
    ]
    measured_by = f"GOSPA [m], c = 5 m, mean over the frames of drives of {DURATION:g} s, through {DEFAULT}"
    out = docs / "results" / "size-by-radar.json"
    write_json(out, {"measured": measured_by, "rows": rows})
    console.print(f"results  {out}", soft_wrap=True)


def variants(name: str, scenario: str, seed: int) -> dict[str, Run]:
    """Runs of one drive, by what they are called in the results."""
    radar = RADARS[name]
    found = {
        "off": seen_by(radar, scenario, seed, f"{DEFAULT}:size=off", DURATION),
        "ends": seen_by(radar, scenario, seed, DEFAULT, DURATION),
    }
    if name == PATCHY:
        even = every_sensor(radar, lambda sensor: replace(sensor, profile=replace(sensor.profile, patchy=False)))
        found["not_patchy"] = seen_by(even, scenario, seed, DEFAULT, DURATION)
    return found
