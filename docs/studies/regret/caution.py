"""Does knowing the uncertainty help? A cautious planner beside a plain one, on the same seeds and tracks."""

from collections.abc import Iterator, Sequence

import pandas as pd

from testbed.experiments.pairs import ALL, Cell, change

MEASURES = ("score", "collisions", "drive_value", "drac_max", "tit", "progress", "deceleration_max")
CAUTIOUS, PLAIN = "mpc-cautious", "mpc"


def differences(drives: pd.DataFrame, measures: Sequence[str] = MEASURES) -> Iterator[Cell]:
    """The cautious planner minus the plain one, by condition and scenario and over all scenarios.

    drives: one row a drive. The truth is among the conditions, so that what caution costs without need is seen.
    """
    keys = ["condition", "scenario", "seed"]
    of = {name: drives[drives["planner"] == name].set_index(keys) for name in (CAUTIOUS, PLAIN)}
    both = of[CAUTIOUS].index.intersection(of[PLAIN].index)
    d = (of[CAUTIOUS].loc[both, list(measures)] - of[PLAIN].loc[both, list(measures)]).reset_index()
    for condition in drives["condition"].unique():
        part = d[d["condition"] == condition]
        scenarios = tuple(part["scenario"].unique())
        for name, within in [*((s, (s,)) for s in scenarios), (ALL, scenarios)]:
            for key in measures if scenarios else ():
                values = [part.loc[part["scenario"] == s, key].to_numpy(float) for s in within]
                yield Cell(name, f"{CAUTIOUS} minus {PLAIN}", condition, key, change(values))
