"""Quantiles of what was counted, with bootstrap intervals over drives or vehicles."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from studies.traffic.driven import CATALOGUE, DRIVEN
from studies.traffic.rows import Row

SHOWN = (5, 25, 50, 75, 95)  # [%] quantiles of the tables
CURVE = tuple(np.arange(1, 40) * 2.5)  # [%] of the figures
FEWEST = 100  # values of a curve, so that it shows a distribution and no single vehicles
DRAWN = ("car or van", "all", "stop-and-go")  # groups with curves
UNITS = 5  # fewest vehicles of a group, and fewest units of an interval
LEVEL = 90  # [%] of the intervals
RESAMPLES = 200
SLOWEST = 1.0  # [m/s] below which a gap has no time
BANDS = ((0.0, 2.0), (2.0, 10.0), (10.0, 20.0), (20.0, 60.0))  # [m/s] speed of the follower
CLASSES = {
    "car": ("car",), "van": ("van",), "car or van": ("car", "van"), "motorcycle": ("motorcycle",),
    "truck or bus": ("truck", "bus", "articulated"),
}  # fmt: skip
DIGITS = 3  # decimals of the committed results


class Distribution(NamedTuple):
    """Of one quantity of one group of one source."""

    quantity: str  # length, width, speed, gap, time_gap
    source: str
    by: str  # what the group is of: class, speed, scenario, all
    group: str
    vehicles: int
    values: int
    quantiles: list[float]  # at SHOWN
    low: list[float]  # limits of their intervals, empty for few units and where none is shown
    high: list[float]
    curve: list[float]  # at CURVE, empty for few values and where none is drawn


def table_of(rows: Iterable[Row]) -> pd.DataFrame:
    """Rows with the time gap [s], the name of the vehicle, and the unit that is drawn by the bootstrap.

    Units are the seeds of the simulation, as scenarios draw from the same numbers under one seed, and the vehicles of
    recordings, which are too few to draw whole ones. A vehicle that two recordings of one road share is one.
    """
    table = pd.DataFrame(list(rows), columns=list(Row._fields))
    table["time_gap"] = table["gap"] / table["speed"].where(table["speed"] >= SLOWEST)
    simulated, seed = table["source"].isin(list(DRIVEN)), table["drive"].astype(str)
    name = table["vehicle"].where(~simulated, table["scenario"] + " " + seed + " " + table["vehicle"])
    table["name"] = table["source"] + " " + name
    table["unit"] = name.where(~simulated, seed)
    return table


def distributions(table: pd.DataFrame) -> list[Distribution]:
    """All that the page shows."""
    found = [*_sizes(table.drop_duplicates("name")), *_motion(table)]
    return [one for one in found if one.vehicles >= UNITS or (one.by == "scenario" and one.values)]


def _sizes(vehicles: pd.DataFrame) -> Iterator[Distribution]:
    """One value a vehicle."""
    for source, rows in vehicles.groupby("source", sort=False):
        for name, kinds in CLASSES.items():
            chosen = rows[rows["kind"].isin(kinds)]
            if name == "car" and "van" not in set(rows["kind"]):
                continue  # they are those of "car or van"
            for quantity in ("length", "width"):
                yield distribution(chosen, quantity, source, "class", name)


def _motion(table: pd.DataFrame) -> Iterator[Distribution]:
    """One value a vehicle and second."""
    for source, every in table.groupby("source", sort=False):
        rows = every[every["drive"] < DRIVEN.get(source, 1)]
        begun = {"start": every[every["time"] == 0]} if source in DRIVEN else {}
        for group, chosen in (begun | {"all": rows}).items():
            for quantity in ("speed", "gap", "time_gap"):
                yield distribution(chosen, quantity, source, "all", group)
        for low, high in BANDS:
            chosen = rows[rows["speed"].between(low, high, inclusive="left")]
            for quantity in ("gap", "time_gap"):
                yield distribution(chosen, quantity, source, "speed", f"{low:g} to {high:g}")
        if source == CATALOGUE:
            for scenario, chosen in rows.groupby("scenario", sort=False):
                for quantity in ("speed", "gap", "time_gap"):
                    yield distribution(chosen, quantity, source, "scenario", scenario)


def distribution(rows: pd.DataFrame, quantity: str, source: Any, by: str, group: Any) -> Distribution:
    """Of the rows that have the quantity."""
    rows = rows[rows[quantity].notna()]
    if rows.empty:
        return Distribution(quantity, source, by, group, 0, 0, [], [], [], [])
    values = rows[quantity].to_numpy(float)
    units = [g.to_numpy(float) for _, g in rows.groupby("unit", sort=False)[quantity]]
    low, high = interval(units) if len(units) >= UNITS and by != "scenario" else np.zeros((2, 0))
    curve = np.percentile(values, CURVE) if len(values) >= FEWEST and group in DRAWN else np.zeros(0)
    shown = [_rounded(each) for each in (np.percentile(values, SHOWN), low, high, curve)]
    return Distribution(quantity, source, by, group, rows["name"].nunique(), len(values), *shown)


def interval(units: list[NDArray]) -> NDArray:
    """Lower and upper limits (2, 5) of the quantiles by the bootstrap over units."""
    rng = np.random.default_rng(0)
    drawn = [
        np.percentile(np.concatenate([units[k] for k in rng.integers(len(units), size=len(units))]), SHOWN)
        for _ in range(RESAMPLES)
    ]
    return np.percentile(drawn, ((100 - LEVEL) / 2, (100 + LEVEL) / 2), axis=0)


def _rounded(values: NDArray) -> list[float]:
    return np.round(values, DIGITS).tolist()
