"""Trackers on the scenes of one drive, as a rig sees them whose scattering centres last for different times."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from sensors import RADARS, Persistence, Radar
from testbed.compare.runs.recording import Recording, record
from testbed.compare.runs.replay import REPLAY
from testbed.environment.perception import Perception
from testbed.evaluation.tracking import Evaluator
from testbed.frame import Frame
from testbed.studies.page import steps

RIG = "surround"
LIFETIMES = (0.0, 0.2, 1.0, 5.0)  # [s]; 0: drawn anew in each scan
TRACKERS = ("imm-spline", "rm-feldmann")
SCENARIOS, SEEDS, DURATION = ("cut-in", "dense-traffic"), (320, 321, 322), 6.0  # [s]
MEASURES = ("gospa", "nees_position", "nees_length", "abs_length", "rmse_position")
COLUMNS = ("scenario", "lifetime", "tracker", "seed", *MEASURES)
DIGITS = 6  # significant, of the committed results


def lasting(radar: Radar, lifetime: float) -> Radar:
    """The rig with scattering centres that last for so long [s], 0 for those drawn anew in each scan."""
    option = Persistence(lifetime) if lifetime else None
    return replace(radar, sensors=tuple(replace(sensor, persistence=option) for sensor in radar.sensors))


def measure(drive: Recording, radar: Radar, trackers: Sequence[str], seed: int) -> list[dict[str, float]]:
    """`MEASURES` of each tracker on the scenes of a drive, as the radar sees them."""
    evaluators = {name: Evaluator(name) for name in trackers}

    def keep(frame: Frame) -> None:
        for name, evaluator in evaluators.items():
            evaluator.step(frame.time, frame.scene, frame.origin, frame.outputs[name][0])

    perception = Perception.mount(radar, list(trackers))
    perception.observers.append(keep)
    rng = np.random.default_rng([seed, 1])
    perception.start(lambda step: drive.frames[step].scene, drive.road, rng, action=REPLAY)
    perception.notify()
    for _ in drive.frames[1:]:
        perception.step(REPLAY, np.zeros((0, 2)))
    summaries = [evaluator.summary() for evaluator in evaluators.values()]
    return [{name: float(summary[name]) for name in MEASURES} for summary in summaries]


def runs(
    scenarios: Sequence[str] = SCENARIOS,
    seeds: Sequence[int] = SEEDS,
    duration: float = DURATION,
    trackers: Sequence[str] = TRACKERS,
) -> pd.DataFrame:
    """One row a scenario, lifetime, tracker and seed, with `COLUMNS`; all lifetimes see the same drive."""
    found: list[tuple[str | float, ...]] = []
    with steps(len(scenarios) * len(seeds)) as step:
        for scenario in scenarios:
            for seed in seeds:
                step(f"{scenario} {seed}")
                drive = record(scenario, seed, "ideal", duration)
                for lifetime in LIFETIMES:
                    rows = measure(drive, lasting(RADARS[RIG], lifetime), trackers, seed)
                    found += [
                        (scenario, lifetime, t, seed, *row.values()) for t, row in zip(trackers, rows, strict=True)
                    ]
    return pd.DataFrame(found, columns=list(COLUMNS))


def write(table: pd.DataFrame, path: Path) -> None:
    """Write the committed results."""
    table.to_csv(path, index=False, float_format=f"%.{DIGITS}g", lineterminator="\n")


def read(path: Path) -> pd.DataFrame:
    """The committed results; ValueError where there are none."""
    if not path.exists():
        raise ValueError(f"{path} is not there yet; give the seeds to run, --seeds 320:323")
    return pd.read_csv(path)
