"""What is found wrong in a recording, and what can be put right while its tables are read.

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

GOOD, OPEN, DOUBT, FAULT = "right", "nothing can be said", "doubt", "fault"
NEAR = 0.1  # share up to which a factor is that of a unit, and one reading explains as much as another
FACTORS = MappingProxyType(
    {"km/h": 1 / 3.6, "mph": 0.44704, "ft": 0.3048, "cm": 0.01, "mm": 0.001, "deg": pi / 180, "mirrored": -1.0,
     "reversed": -1.0}
)  # fmt: skip
SPEEDS, LENGTHS = ("km/h", "mph"), ("ft", "cm", "mm")
GROUND, MEASURED, RENAMED = "ground", "measured", "range_rate"
FIXES = MappingProxyType(  # what -> columns that a factor is for, and what it can be
    {
        "range_rate": (("range_rate",), (*SPEEDS, "reversed", GROUND, "none")),  # ground: the ego's motion is taken out
        "azimuth": (("azimuth", "y"), ("deg", "mirrored")),
        "range": (("range", "x", "y"), LENGTHS),
        "detections": ((), ("once",)),  # one of equal rows
        "clutter": ((), (MEASURED,)),  # of the sensors, instead of what their table says
        "ego.speed": (("speed", "vx", "vy"), (*SPEEDS, "places")),  # places: from the places
        "ego.yaw_rate": (("yaw_rate",), ("deg", "reversed", "heading")),
        "ego.places": ((), ("speed",)),  # from speed and heading
        "ego.heading": (("heading",), ("deg", "places")),
        "truth.speed": (("speed", "vx", "vy"), (*SPEEDS, "places")),
        "truth.size": ((), ("swapped",)),
    }
)
OF_SENSORS = ("range_rate", "azimuth", "range")


class Finding(NamedTuple):
    """One line of the report."""

    test: str
    figure: str
    fits: str
    verdict: str  # GOOD, OPEN, DOUBT or FAULT
    remedy: str = ""

    @property
    def sentence(self) -> str:
        """What is wrong and what to do, for doubts and faults."""
        return f"{self.test}: {self.fits} ({self.figure}); {self.remedy}"


class Fix(NamedTuple):
    """One thing that is put right."""

    what: str  # a key of `FIXES`, or a column of the detections that is another by its name
    how: str
    sensor: str = ""  # empty: of all

    @property
    def table(self) -> str:
        """Name of the table that it changes."""
        return self.what.partition(".")[0] if self.what in FIXES and "." in self.what else "detections"

    @property
    def renames(self) -> bool:
        """Whether it gives a column its name."""
        return self.how == RENAMED


def parse(texts: Sequence[str]) -> tuple[Fix, ...]:
    """The fixes as a user writes them; ValueError or LookupError, in one sentence, for one that there is not."""
    fixes = []
    for text in texts:
        left, equal, how = text.partition("=")
        what, _, sensor = left.partition("@")
        if not equal or not what:
            raise ValueError(f"--fix is COLUMN=HOW, got {text!r}; as in --fix range_rate=km/h")
        if how != RENAMED and how not in (known := look_up(what, FIXES, "thing to fix")[1]):
            raise ValueError(f"--fix {what} can be {', '.join(known)}, got {how!r}")
        if sensor and what not in OF_SENSORS:
            raise ValueError(f"--fix {text}: only {', '.join(OF_SENSORS)} can be of one sensor; leave out @{sensor}")
        fixes.append(Fix(what, how, sensor))
    return tuple(fixes)


def repair(table: Loaded, fixes: Sequence[Fix]) -> Loaded:
    """A table with its fixes, one after the other; ValueError, in one sentence, for a sensor that has no detection."""
    for fix in fixes:
        if fix.how == "once":
            same = np.stack([value for value in table.columns.values() if value.dtype.kind == "f"], -1)
            rows = np.sort(np.unique(same, axis=0, return_index=True, equal_nan=True)[1])
            table = replace(table, columns={name: v[rows] for name, v in table.columns.items()}, rows=len(rows))
        else:
            table = replace(table, columns={**table.columns, **_changed(table, fix)})
    return table


def _changed(table: Loaded, fix: Fix) -> dict[str, NDArray]:
    """The columns that a fix changes."""
    chosen = table.texts("sensor") == fix.sensor if fix.sensor else np.ones(table.rows, bool)
    if not chosen.any() and table.rows:
        raise ValueError(f"--fix {fix.what}@{fix.sensor}: no detection is of such a sensor; see the table sensors")
    if fix.how in FACTORS:
        names = [n for n in FIXES[fix.what][0] if n in table and not (n == "y" and fix.how == "deg")]
        return {name: np.where(chosen, FACTORS[fix.how] * table[name], table[name]) for name in names}
    if fix.how == "none":
        return {"range_rate": np.where(chosen, np.nan, table.numbers("range_rate", np.nan))}
    if fix.how == "swapped":
        return {"length": table["width"], "width": table["length"]}
    if fix.how == "heading" and table.rows > 1:
        return {"yaw_rate": np.gradient(np.unwrap(table["heading"]), table["time"])}
    if fix.how == "speed":
        return _places(table)
    if fix.what == "ego.heading":
        return {"heading": _course(table)}
    return _velocities(table) if fix.how == "places" else {}


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
