"""Trackers on the scenes of one drive, as a rig sees them whose scattering centres last for different times."""

from collections.abc import Sequence
from dataclasses import replace

import pandas as pd

from sensors import RADARS, Persistence, Radar
from studies.drives import every_sensor, measured
from studies.effects import Factor
from studies.page import steps
from testbed.replay.recording import record

RIG = "surround"
LIFETIMES = (0.0, 0.2, 1.0, 5.0)  # [s]; 0: drawn anew in each scan
LIFETIME = Factor("lifetime", 0.0, lambda lifetime: f"{lifetime:g} s" if lifetime else "off")
TRACKERS = ("imm-spline", "rm-feldmann")
SCENARIOS, SEEDS, DURATION = ("cut-in", "dense-traffic"), tuple(range(320, 330)), 6.0  # [s]
MEASURES = ("gospa", "nees_position", "nees_length", "abs_length", "rmse_position")
COLUMNS = ("scenario", "lifetime", "tracker", "seed", *MEASURES)


def lasting(radar: Radar, lifetime: float) -> Radar:
    """The rig with scattering centres that last for so long [s], 0 for those drawn anew in each scan."""
    option = Persistence(lifetime) if lifetime else None
    return every_sensor(radar, lambda sensor: replace(sensor, persistence=option))


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
                    rows = measured(drive, lasting(RADARS[RIG], lifetime), trackers, MEASURES)
                    found += [
                        (scenario, lifetime, t, seed, *row.values()) for t, row in zip(trackers, rows, strict=True)
                    ]
    return pd.DataFrame(found, columns=list(COLUMNS))
