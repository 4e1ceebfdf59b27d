"""A folder of tables as a recording: scans with the truth beside them, ready to be replayed."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.scene import Scene
from testbed.log.record import RoadGeometry
from testbed.replay.columns import DETECTIONS, EGO, SENSORS, TABLES, Table, like
from testbed.replay.fixes import GROUND, Finding, Fix
from testbed.replay.interpolation import egos
from testbed.replay.lanes import lanes_of
from testbed.replay.loaded import Loaded
from testbed.replay.recording import RecordedFrame
from testbed.replay.scans import scans_of
from testbed.replay.sensor_sheets import SensorSheets, sensor_sheets
from testbed.replay.tables import read_table
from testbed.replay.truth import origin_of, said_objects, truth_at
from trackers.multi.road import RoadMap

STAND_IN = ((("range", "azimuth"), ("x", "y")), (("speed",), ("vx", "vy")))  # columns, and others in their place


class Unread(NamedTuple):
    """A column of a file that is not read."""

    file: str
    name: str
    like: str | None  # the column that it seems to be, where that is not there


class Recorded(NamedTuple):
    """What a folder holds of F chosen scans; times of scenes count from the first scan of the folder."""

    name: str  # of the folder
    sensors: SensorSheets
    frames: tuple[RecordedFrame, ...]  # (F,)
    times: NDArray  # (F,) [s] as in the tables
    known: tuple[float, float] | None  # [s] first and last time of truth, as in scenes; None: there is no truth
    road: RoadMap
    drawn: RoadGeometry
    unread: tuple[Unread, ...] = ()
    findings: tuple[Finding, ...] = ()  # of `testbed.replay.plausibility`, where they were looked for
    tracks: tuple[Any, ...] = ()  # `RecordedTracks` of files, where there are any
    names: Mapping[int, str] = MappingProxyType({})  # id in scenes -> id in the tables, where that is another


def read(folder: Path, start: float | None = None, end: float | None = None, fixes: Sequence[Fix] = ()) -> Recorded:
    """The recording of a folder, repaired, or its part from `start` to `end` [s] after the first scan.

    Raises:
        ValueError: a table is missing or wrong; one sentence names file, column and row, and what to do.
    """
    if not folder.is_dir():
        raise ValueError(f"{folder} is not a folder; give that of the tables, docs/own-recordings.md describes them")
    tables = {table.name: read_table(folder, table, fixes) for table in TABLES.values()}
    detections, vehicle, sheets = (_there(tables[table.name]) for table in (DETECTIONS, EGO, SENSORS))
    sensors = sensor_sheets(sheets)
    scans = scans_of(detections, tables["scans"], sensors, [f.sensor for f in fixes if f.how == GROUND])
    first = float(scans.times[0])
    chosen = np.flatnonzero(_window(scans.times - first, start, end))
    road, drawn = lanes_of(tables["lanes"])
    vehicles = egos(vehicle, scans.times[chosen])
    truth = truth_at(tables["truth"], scans.times)
    objects = said_objects(detections, scans.object, truth)
    frames = []
    for ego, f in zip(vehicles, chosen.tolist(), strict=True):
        rows = slice(scans.bounds[f], scans.bounds[f + 1])
        there, scan = truth.at(f), scans.scan(f, sensors, ego.platform)
        origin = origin_of(scan, there, objects[rows], scans.kind[rows])
        scene = Scene(float(scans.times[f] - first), 0.0, ego, there.objects, there.bodies)
        frames.append(RecordedFrame(scene, scan, origin))
    known = None if truth.span is None else (truth.span[0] - first, truth.span[1] - first)
    unread = tuple(one for name, table in tables.items() if table is not None for one in _unread(table, TABLES[name]))
    names = {number: name for name, number in truth.numbers.items() if name != str(number)}
    found = folder.resolve().name, sensors, tuple(frames), scans.times[chosen], known, road, drawn, unread
    return Recorded(*found, names=names)


def _there(table: Loaded | None) -> Loaded:
    assert table is not None  # else reading has raised
    return table


def _unread(table: Loaded, known: Table) -> list[Unread]:
    """Columns that are not read; one seems to be another where that is absent, and what can stand in its place too."""
    given = {*table.columns} | {name for a, b in STAND_IN for name in a if {*b} <= {*table.columns}}
    of = {name: like(name, known) for name in table.unread}
    return [Unread(table.file, name, None if column in given else column) for name, column in of.items()]


def _window(time: NDArray, start: float | None, end: float | None) -> NDArray:
    """Mask (F,) of the times [s] from start to end."""
    for name, value in (("from", start), ("to", end)):
        if value is not None and not np.isfinite(value):
            raise ValueError(f"--{name} must be a number of seconds, got {value}; leave it out for the whole recording")
    low, high = -np.inf if start is None else start, np.inf if end is None else end
    chosen = (low <= time) & (time <= high)
    if not chosen.any():
        raise ValueError(
            f"no scan is from {max(low, 0.0):g} s to {min(high, time[-1]):g} s; the {len(time)} scans of the recording "
            f"are from 0 s to {time[-1]:g} s, counted from the first"
        )
    return chosen
