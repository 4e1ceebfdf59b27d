"""What other figures of the default rig would change for the default tracker: docs/results/surround.json."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from sensors import RADARS, Roadside, Sensor
from studies.drives import every_sensor, measured
from studies.page import steps
from testbed.command_line.terminal import console
from testbed.files import write_json
from testbed.replay.recording import record
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


def main(out: Annotated[Path, typer.Argument(help="The JSON file.")] = Path(f"docs/results/{RIG}.json")) -> None:
    """Measure the default tracker on changed figures of the default rig, for docs/radars.md."""
    cells = [(scenario, seed) for scenario in SCENARIOS for seed in SEEDS]
    rows: dict[str, list[dict[str, float]]] = {name: [] for name in CHANGES}
    with steps(len(cells)) as step:
        for scenario, seed in cells:
            step(f"{scenario} {seed}")
            drive = record(scenario, seed, "ideal", DURATION)
            for name, change in CHANGES.items():
                rows[name] += measured(drive, every_sensor(RADARS[RIG], change), [DEFAULT], MEASURES)
    write_json(out, {"rig": RIG, "tracker": DEFAULT, "scenarios": SCENARIOS, "seeds": SEEDS, "duration": DURATION,
                     "rows": rows})  # fmt: skip
    console.print(f"results  {out}", soft_wrap=True)
