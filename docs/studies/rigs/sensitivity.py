"""What other figures of the default rig would change for the default tracker: docs/results/surround.json."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from sensors import RADARS, Roadside, Sensor
from studies.page import Docs
from studies.runs import every_sensor, seen_by, summaries
from testbed.command_line.options import Dask, Jobs
from testbed.command_line.terminal import console
from testbed.experiments.engine import Engine
from testbed.files import write_json
from trackers import DEFAULT

RIG = "surround"
SCENARIOS, SEEDS, DURATION = ("cut-in", "merge", "truck-convoy"), (700, 701, 702), 4.0  # [s]
MEASURES = ("gospa", "missed_percent", "false_per_scan", "rmse_position", "rmse_velocity", "abs_length")
CHANGES: Mapping[str, Callable[[Sensor], Sensor]] = {
    "as it is": lambda sensor: sensor,
    "range rates of 0.03 m/s": lambda sensor: replace(sensor, sigma_rate=0.03),
    "azimuths twice as good": lambda sensor: replace(sensor, sigma_azimuth_deg=sensor.sigma_azimuth_deg / 2),
    "half the detections": lambda sensor: replace(sensor, count_at_15m=sensor.count_at_15m / 2),
    "twice the detections": lambda sensor: replace(sensor, count_at_15m=sensor.count_at_15m * 2),
    "no false alarms": lambda sensor: replace(sensor, clutter=0.0),
    "roadside": lambda sensor: replace(sensor, roadside=Roadside()),
    "roadside, also on the road": lambda sensor: replace(sensor, roadside=Roadside(on_road=0.015)),
}


def main(
    docs: Docs = Path("docs"),
    folder: Annotated[str, typer.Option(help="Directory of the runs.")] = f"runs/{RIG}",
    jobs: Jobs = 1,
    dask: Dask = None,
) -> None:
    """Measure the default tracker on changed figures of the default rig, for docs/radars.md."""
    asked = {
        name: [
            seen_by(every_sensor(RADARS[RIG], change), scenario, seed, DEFAULT, DURATION)
            for scenario in SCENARIOS
            for seed in SEEDS
        ]
        for name, change in CHANGES.items()
    }
    summary = summaries([run for runs in asked.values() for run in runs], folder, Engine(jobs, dask))
    rows = {name: [{key: summary(run)[key] for key in MEASURES} for run in runs] for name, runs in asked.items()}
    out = docs / "results" / f"{RIG}.json"
    write_json(out, {"rig": RIG, "tracker": DEFAULT, "scenarios": SCENARIOS, "seeds": SEEDS, "duration": DURATION,
                     "rows": rows})  # fmt: skip
    console.print(f"results  {out}", soft_wrap=True)
