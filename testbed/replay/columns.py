"""The tables of a recording: names, units, what must be there and what a value can be. docs/own-recordings.md has them.

One frame holds for all tables: angles turn from x towards y. What is not given is an empty cell, or no column at all.
"""

import re
from dataclasses import fields
from math import inf, pi
from types import MappingProxyType
from typing import NamedTuple

from sensors.origin import KINDS
from trackers.scan import DepthProfile
from trackers.validation import MAX_PLACE, MAX_RANGE, MAX_SPEED

TWO_SIDED = ("rounding", "rounding_std", "least_room")  # fields of `DepthProfile` that are pairs: along and across
LATEST = 1e10  # [s] of a time: seconds since 1970 until the year 2286
RADIANS = "angles are in radians: multiply degrees by pi / 180"
METRES = "lengths and places are in metres"
SPEEDS = "speeds are in m/s"


class Column(NamedTuple):
    """One column of a table."""

    name: str
    unit: str  # empty for texts and numbers without one
    note: str  # what it is
    needed: bool = False  # whether each row must have it
    least: float = -inf
    most: float = inf
    remedy: str = "correct the value"  # where a number is outside
    text: bool = False


class Table(NamedTuple):
    """One table, the file NAME.parquet or NAME.csv."""

    name: str
    note: str  # what a row is
    columns: tuple[Column, ...]
    needed: bool = False
    option: str = ""  # of the command line, that renames `column` from `name`

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all columns."""
        return tuple(column.name for column in self.columns)


def _time(note: str) -> Column:
    return Column("time", "s", note, True, -LATEST, LATEST, "times are in seconds, of any beginning")


def _place(axis: str, note: str, needed: bool = True) -> Column:
    return Column(axis, "m", note, needed, -MAX_PLACE, MAX_PLACE, METRES)


def _speed(name: str, note: str) -> Column:
    return Column(name, "m/s", note, False, -MAX_SPEED, MAX_SPEED, SPEEDS)


def _length(name: str, note: str, needed: bool = True) -> Column:
    return Column(name, "m", note, needed, 0.1, 100.0, f"{METRES}, the full length and width")


HEADING = Column("heading", "rad", "direction ahead, from x towards y", True, -4 * pi, 4 * pi, RADIANS)
YAW_RATE = Column("yaw_rate", "rad/s", "turning, from x towards y", False, -10.0, 10.0, RADIANS)
MOTION = (
    _speed("speed", "along the heading; or `vx` and `vy` in its place"),
    _speed("vx", "velocity along the axis x of the frame"),
    _speed("vy", "velocity along its axis y"),
)


def profile_columns() -> tuple[str, ...]:
    """Columns of the `DepthProfile` of a sensor."""
    names = [
        (f"{one.name}_along", f"{one.name}_across") if one.name in TWO_SIDED else (one.name,)
        for one in fields(DepthProfile)
    ]
    return tuple(f"profile_{part}" for parts in names for part in parts)


DETECTIONS = Table(
    "detections",
    "a detection; those of one time make a scan",
    (
        _time("when it was measured; rows are sorted by it"),
        Column("sensor", "", "which sensor, a name of the table sensors", True, text=True),
        Column("range", "m", "distance from the sensor", False, 0.0, MAX_RANGE, METRES),
        Column("azimuth", "rad", "direction in the frame of the sensor", False, -2 * pi, 2 * pi, RADIANS),
        _place("x", "in the frame of the sensor, ahead; with `y` in place of `range` and `azimuth`", False),
        _place("y", "in the frame of the sensor, across", False),
        _speed("range_rate", "as measured, positive for what goes away; empty: not measured"),
        Column("object", "", "id of the object of truth that it is of; `-` for none", text=True),
        Column("kind", "", f"where it comes from: {', '.join(KINDS)}", text=True),
    ),
    needed=True,
)
SCANS = Table(
    "scans",
    "a scan that a sensor delivered, if only an empty one",
    (
        _time("when; rows are sorted by it"),
        Column("sensor", "", "which sensor, a name of the table sensors", True, text=True),
    ),
)
EGO = Table(
    "ego",
    "the vehicle that carries the sensors, at one time",
    (
        _time("when; it grows from row to row"),
        _place("x", "of the point that the sensors' places are given from, in a frame that stands"),
        _place("y", "its other axis"),
        HEADING,
        *MOTION,
        YAW_RATE._replace(needed=True),
        _length("length", "of the vehicle, 4.7 where it is not given", needed=False),
        _length("width", "of the vehicle, 1.9 where it is not given", needed=False),
    ),
    needed=True,
)
SENSORS = Table(
    "sensors",
    "a sensor",
    (
        Column("name", "", "its name in the other tables", True, text=True),
        Column("x", "m", "place on the vehicle, ahead", True, -100.0, 100.0, METRES),
        Column("y", "m", "place on the vehicle, across", True, -100.0, 100.0, METRES),
        Column("yaw", "rad", "its direction, 0 for straight ahead", True, -2 * pi, 2 * pi, RADIANS),
        Column("max_range", "m", "how far it reaches", True, 1e-3, MAX_RANGE, METRES),
        Column("fov", "rad", "full opening angle of its field of view", True, 1e-3, 2 * pi + 1e-9, RADIANS),
        Column("sigma_range", "m", "standard deviation of range", True, 1e-6, 100.0, METRES),
        Column("sigma_azimuth", "rad", "of azimuth", True, 1e-9, 1.0, RADIANS),
        Column("sigma_rate", "m/s", "of range rate; 0.1 where it is not given", False, 1e-6, 100.0, SPEEDS),
        Column("rate", "1/s", "scans a second; compared with the times", False, 1e-3, 1e6, "leave it out if unknown"),
        Column("max_rate", "m/s", "range rates of false alarms lie within", False, 1e-3, MAX_SPEED, SPEEDS),
        Column("fold_rate", "m/s", "range rates beyond it fold; without it none do", False, 1e-3, MAX_SPEED, SPEEDS),
        Column("count_at_15m", "", "expected detections of an object 3 m wide at 15 m", False, 1e-3, 1e6),
        Column("count_falloff", "", "exponent with which they become fewer with range", False, 0.0, 10.0),
        Column("count_max", "", "the most of one object", False, 1e-3, 1e6),
        Column("clutter", "", "expected false alarms a scan", False, 0.0, 1e6),
        *(Column(name, "", "where detections lie on a body, see `DepthProfile`") for name in profile_columns()),
    ),
    needed=True,
)
TRUTH = Table(
    "truth",
    "a vehicle at one time; between two times at most 1 s apart it is interpolated",
    (
        _time("when; rows are sorted by it"),
        Column("id", "", "of the vehicle, the same at all times", True, text=True),
        _place("x", "centre of the box, in the frame of `ego`"),
        _place("y", "its other axis"),
        HEADING,
        *MOTION,
        YAW_RATE,
        _length("length", "of the box"),
        _length("width", "of the box"),
        Column("class", "", "car where it is not given; an `obstacle` never counts", text=True),
        Column(
            "contour", "", "outline in the frame of `ego`, `x y;x y;x y`; a vertical bar between two parts", text=True
        ),
        Column("expected", "", "expected detections; else those within the box", False, 0.0, 1e6),
        Column("visible", "", "share in sight; else whether there is a detection", False, 0.0, 1.0),
        Column("crashed", "", "1 from a collision on; then it counts no more", False, 0.0, 1.0),
    ),
)
LANES = Table(
    "lanes",
    "a point on the centre of a lane, in the direction of travel",
    (
        Column("lane", "", "which lane; its points stand below each other", True, text=True),
        _place("x", "in the frame of `ego`"),
        _place("y", "its other axis"),
        Column("width", "m", "of the lane; that of its first point counts", True, 0.5, 100.0, METRES),
    ),
)
STATE = ("x", "y", "vx", "vy")
EDGES = ("front", "rear", "left", "right")
COVARIANCES = tuple(
    (a, b, ("m^2", "m^2/s", "m^2/s^2")[(i > 1) + (j > 1)])
    for i, a in enumerate(STATE)
    for j, b in enumerate(STATE)
    if i <= j
)
TRACKS = Table(
    "tracks",
    "a track at one time",
    (
        Column("tracker", "", "its name, where a file has several", text=True),
        _time("of the scan, as in the recording"),
        Column("id", "", "of the track, the same at all times", True, text=True),
        _place("x", "centre of the box, in the frame of `ego`"),
        _place("y", "its other axis"),
        HEADING,
        _speed("vx", "velocity of the centre")._replace(needed=True),
        _speed("vy", "its other axis")._replace(needed=True),
        YAW_RATE._replace(note="turning"),
        _length("length", "of the box"),
        _length("width", "of the box"),
        Column("existence", "", "probability; 1 where it is not given, reported above one half", False, 0.0, 1.0),
        Column("age", "s", "since the first scan of the track", False, 0.0, LATEST),
        Column("detections", "", "scans in which it had a detection", False, 0.0, LATEST),
        *(Column(f"cov_{a}_{b}", unit, f"covariance of {a} and {b}") for a, b, unit in COVARIANCES),
        *(
            Column(f"{name}_std", unit, f"standard deviation of the {name.replace('_', ' ')}", False, 0.0, 1e6)
            for name, unit in (("length", "m"), ("width", "m"), ("heading", "rad"), ("yaw_rate", "rad/s"))
        ),
        *(
            Column(f"{name}_std", "m", f"of the {name} edge, where it is not that of centre and size", False, 0.0, 1e6)
            for name in EDGES
        ),
        Column("class", "", "no measure uses it", text=True),
        Column("contour", "", "outline in the frame of `ego`, `x y;x y;x y`, of one number of points", text=True),
    ),
    option="give --columns {column}={name}",
)
LIKE = MappingProxyType(  # column -> other names for it, in small letters and without underscores and units
    {
        "range_rate": (
            "doppler", "dopplervelocity", "dopplerspeed", "vr", "vrad", "vradial", "radialvelocity", "radialspeed",
            "rangevelocity", "rangerate", "rdot", "rr", "velocity", "vel", "speed", "v", "vrcomp", "vcomp",
        ),
        "range": ("r", "rng", "rho", "dist", "distance", "radius"),
        "azimuth": ("az", "azi", "theta", "phi", "alpha", "angle", "bearing"),
        "heading": ("yaw", "psi", "theta", "phi", "course", "orientation"),
        "yaw_rate": ("yawrate", "omega", "psidot", "gyroz", "turnrate", "wz"),
        "speed": ("v", "vel", "velocity", "vego"),
        "time": ("t", "ts", "timestamp", "stamp"),
        "sensor": ("radar", "sensorid", "sensorname"),
        "object": ("objectid", "trackid", "target", "label"),
        "id": ("objectid", "trackid", "track", "vehicle", "vehicleid"),
        "length": ("l", "len"),
        "width": ("w", "wid"),
    }
)  # fmt: skip
UNITS = ("mps", "ms", "kmh", "kph", "mph", "rad", "deg", "m")  # behind names


def like(name: str, table: Table) -> str | None:
    """The column of a table that goes by another name, None where there is none."""
    words = [word for word in re.split(r"[^a-z0-9]+", name.lower()) if word]
    plain = {"".join(words), "".join(words[:-1]) if words[-1:] and words[-1] in UNITS else ""}
    return next((column for column in table.names if plain & {*LIKE.get(column, ())}), None)


TABLES = MappingProxyType({table.name: table for table in (DETECTIONS, SCANS, EGO, SENSORS, TRUTH, LANES)})
