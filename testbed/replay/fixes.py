"""What can be put right while tables are read: units, signs, what was taken out or is there twice, one name.

A fix is written COLUMN=HOW, or COLUMN@SENSOR=HOW for one sensor: `range_rate=km/h`, `azimuth@left=mirrored`.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import pi
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from testbed.replay.loaded import Loaded
from trackers.geometry import unit
from trackers.lookup import look_up

SPEEDS = MappingProxyType({"km/h": 1 / 3.6, "mph": 0.44704})
LENGTHS = MappingProxyType({"ft": 0.3048, "cm": 0.01, "mm": 0.001})
ANGLES = MappingProxyType({"deg": pi / 180})
SIGNED = MappingProxyType({"mirrored": -1.0, "reversed": -1.0})
FACTORS = MappingProxyType({**SPEEDS, **LENGTHS, **ANGLES, **SIGNED})
PLACES, SPEED, HEADING, ONCE, NONE, GROUND, MEASURED = (
    "places",
    "speed",
    "heading",
    "once",
    "none",
    "ground",
    "measured",
)
FIXES = MappingProxyType(
    {
        "range_rate": (*SPEEDS, "reversed", GROUND, NONE),  # ground: the motion of the ego has been taken out
        "azimuth": (*ANGLES, "mirrored"),
        "range": tuple(LENGTHS),
        "detections": (ONCE,),  # one of equal rows
        "clutter": (MEASURED,),  # of the sensors, instead of what their table says
        "ego.speed": (*SPEEDS, PLACES),  # places: from the places
        "ego.yaw_rate": (*ANGLES, "reversed", HEADING),
        "ego.places": (SPEED,),  # from speed and heading
        "ego.heading": (*ANGLES, PLACES),
        "truth.speed": (*SPEEDS, PLACES),
    }
)
OF_SENSORS = ("range_rate", "azimuth", "range")
SCALED = MappingProxyType(  # columns that a factor is for
    {
        "range_rate": ("range_rate",),
        "azimuth": ("azimuth", "y"),
        "range": ("range", "x", "y"),
        "speed": ("speed", "vx", "vy"),
        "yaw_rate": ("yaw_rate",),
        "heading": ("heading",),
    }
)


class Fix(NamedTuple):
    """One of them."""

    what: str  # a key of FIXES, or a column of the detections that is another by its name
    how: str
    sensor: str = ""  # empty: of all

    @property
    def table(self) -> str:
        """Name of the table that it changes."""
        table, dot, _ = self.what.partition(".")
        return table if dot and table in ("ego", "truth") else "detections"

    @property
    def column(self) -> str:
        """What of the table."""
        return self.what.removeprefix(f"{self.table}.")

    @property
    def renames(self) -> bool:
        """Whether it gives a column its name."""
        return self.how == "range_rate"


def parse(texts: Sequence[str]) -> tuple[Fix, ...]:
    """The fixes as a user writes them; ValueError or LookupError, in one sentence, for one that there is not."""
    fixes = []
    for text in texts:
        left, equal, how = text.partition("=")
        what, _, sensor = left.partition("@")
        if not equal or not what:
            raise ValueError(f"--fix is COLUMN=HOW, got {text!r}; as in --fix range_rate=km/h")
        fix = Fix(what, how, sensor)
        if not fix.renames and how not in look_up(what, FIXES, "thing to fix"):
            raise ValueError(f"--fix {what} can be {', '.join(FIXES[what])}, got {how!r}")
        if sensor and what not in OF_SENSORS:
            raise ValueError(f"--fix {text}: only {', '.join(OF_SENSORS)} can be of one sensor; leave out @{sensor}")
        fixes.append(fix)
    return tuple(fixes)


def repair(table: Loaded, fixes: Sequence[Fix]) -> Loaded:
    """A table with its fixes, one after the other."""
    for fix in fixes:
        table = _repair(table, fix)
    return table


def _repair(table: Loaded, fix: Fix) -> Loaded:
    if fix.how == ONCE:
        return _rows(table, _first_of_equals(table))
    columns = dict(table.columns)
    chosen = table.texts("sensor") == fix.sensor if fix.sensor else np.ones(table.rows, bool)
    if not chosen.any() and table.rows:
        raise ValueError(f"--fix {fix.what}@{fix.sensor}: no detection is of such a sensor; see the table sensors")
    if fix.how in FACTORS:
        for name in SCALED[fix.column]:
            if name in columns and not (name == "y" and fix.how == "deg"):
                columns[name] = np.where(chosen, FACTORS[fix.how] * columns[name], columns[name])
    elif fix.how == NONE:
        columns["range_rate"] = np.where(chosen, np.nan, table.numbers("range_rate", np.nan))
    elif fix.how == HEADING and table.rows > 1:
        columns["yaw_rate"] = np.gradient(np.unwrap(table["heading"]), table["time"])
    elif fix.how == SPEED:
        columns |= _places(table)
    elif fix.column == "heading":
        columns["heading"] = _course(table)
    elif fix.how == PLACES:
        columns |= _velocities(table)
    return replace(table, columns=columns)


def _rows(table: Loaded, rows: NDArray) -> Loaded:
    return replace(table, columns={name: value[rows] for name, value in table.columns.items()}, rows=len(rows))


def _first_of_equals(table: Loaded) -> NDArray:
    """Rows of a table of detections without those whose time and numbers were there before."""
    same = np.stack([value for name, value in table.columns.items() if value.dtype.kind == "f"], -1)
    return np.sort(np.unique(same, axis=0, return_index=True, equal_nan=True)[1])


def _places(table: Loaded) -> dict[str, NDArray]:
    """Places of the ego, from its speed and heading."""
    v = np.stack([table.numbers("vx", np.nan), table.numbers("vy", np.nan)], -1)
    v = np.where(np.isnan(v), table.numbers("speed", np.nan)[:, None] * unit(table["heading"]), v)
    way = np.diff(table["time"], prepend=table["time"][:1])[:, None] * (v + np.roll(v, 1, 0)) / 2
    return dict(zip(("x", "y"), np.cumsum(way, axis=0).T, strict=True))


def _velocities(table: Loaded) -> dict[str, NDArray]:
    """Velocities, from the places of each vehicle; 0 of one that is there once."""
    v = np.zeros((table.rows, 2))
    names = table.texts("id")
    for name in np.unique(names):
        rows = np.flatnonzero(names == name)
        if len(rows) > 1 and (np.diff(table["time"][rows]) > 0).all():
            v[rows] = np.stack([np.gradient(table[axis][rows], table["time"][rows]) for axis in "xy"], -1)
    return dict(zip(("vx", "vy"), v.T, strict=True))


def _course(table: Loaded) -> NDArray:
    """Headings (N,) [rad] in which the places move; where they stand, as before or after."""
    v = np.stack(list(_velocities(table).values()), -1)
    moves = np.hypot(*v.T) > 1.0
    if not moves.any():
        return table["heading"]
    return np.interp(table["time"], table["time"][moves], np.unwrap(np.arctan2(v[moves, 1], v[moves, 0])))
