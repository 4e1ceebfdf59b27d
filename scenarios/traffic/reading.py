"""Trajectories of a CSV, CSV.GZ or CommonRoad XML in one of the known layouts.

In metres, seconds and radians, y to the right of x.
"""

import csv
import gzip
from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.traffic import commonroad
from scenarios.traffic.layouts import FOOT, Layout, recognised
from trackers.geometry import unit

LONGEST_GAP = 1.0  # [s] between two rows of a vehicle that is interpolated
LARGEST = 100.0  # [m] of a vehicle
FASTEST = 100.0  # [m/s] of a vehicle, on average
DRIVEN = 10.0  # [m] from where on a way has a direction that headings can be compared with
FEWEST = 5  # rows of a vehicle; those with fewer are left out
NO_LANE = -1
CODES = {"1": "motorcycle", "2": "car", "3": "truck"}  # of NGSIM, and what is derived from it
WORDS = {"auto": "car", "truck_bus": "truck", "trailer": "truck", "motorbike": "motorcycle", "lorry": "truck"}
KINDS = ("car", "van", "bus", "truck", "motorcycle", "tractor")  # contours that a class may name


class Trajectory(NamedTuple):
    """One vehicle as recorded, K rows in the order of time."""

    id: str
    time: NDArray  # (K,) [s]
    xy: NDArray  # (K, 2) [m] of the anchor of its layout, but for `corner`, which has become the centre
    heading: NDArray | None  # (K,) [rad], None where none is given
    size: NDArray  # (2,) length, width [m]
    kind: str  # name of its contour
    lane: NDArray  # (K,) int, `NO_LANE` where none is given


class Recording(NamedTuple):
    """All vehicles of a file."""

    layout: Layout
    vehicles: tuple[Trajectory, ...]  # by id, as numbers where they are


def read(path: Path) -> Recording:
    """The trajectories of a file; one that has not changed is read once.

    Raises:
        ValueError: there is no such file, it cannot be read, or a column or value is missing or wrong.
    """
    try:
        state = path.stat()
    except OSError as error:
        raise ValueError(f"replay: cannot read {path}: {error.strerror}; give a CSV of trajectories") from None
    return _read(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=4)
def _read(path: Path, changed: int, size: int) -> Recording:
    if path.suffix == commonroad.SUFFIX:
        columns = commonroad.columns_of(path)
        return Recording(commonroad.LAYOUT, tuple(_trajectories(columns, commonroad.LAYOUT, path.name)))
    try:
        with _opened(path) as file:
            rows = csv.reader(file)
            header = next(rows, [])
            layout = recognised(header, path.name)
            columns = _columns(rows, layout.places(header), path.name)
    except (OSError, EOFError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"replay: cannot read {path}: {error}; give a CSV, or a CSV compressed as .gz") from None
    return Recording(layout, tuple(_trajectories(columns, layout, path.name)))


def _opened(path: Path) -> IO[str]:
    if path.suffix == ".gz":
        return gzip.open(path, "rt", encoding="utf-8-sig", newline="")
    return path.open(encoding="utf-8-sig", newline="")


def _columns(rows: Iterable[list[str]], places: dict[str, int], file: str) -> dict[str, list[str]]:
    """The cells of each column that is used."""
    found: dict[str, list[str]] = {key: [] for key in places}
    last = max(places.values())
    for number, row in enumerate(rows, 1):
        if not row:
            continue
        if len(row) <= last:
            raise ValueError(f"{file}, row {number}: has {len(row)} cells, needed are {last + 1}; complete the row")
        for key, place in places.items():
            found[key].append(row[place].strip())
    return found


def _numbers(cells: Sequence[str], column: str, file: str) -> NDArray:
    """A column (N,) as finite numbers, or the error about its first other cell."""
    try:
        values = np.array(cells, float)
    except ValueError:
        values = np.array([_number(cell) for cell in cells])
    if not np.isfinite(values).all():
        row = int(np.argmin(np.isfinite(values)))
        raise ValueError(f"{file}, column {column}, row {row + 1}: {cells[row]!r} is no finite number; correct it")
    return values


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return np.nan


def _trajectories(columns: dict[str, list[str]], layout: Layout, file: str) -> list[Trajectory]:
    """Rows in SI units by vehicle and time."""
    names, owner = np.unique(np.array(columns["id"], np.str_), return_inverse=True)
    if not len(names):
        raise ValueError(f"{file} has a header and no rows; give a recording with vehicles")
    texts = {key: cells for key, cells in columns.items() if key not in ("id", "kind")}
    number = {key: _numbers(cells, layout.columns[key], file) for key, cells in texts.items()}
    for key in ("length", "width"):
        if (number[key] <= 0).any():
            row = int(np.argmax(number[key] <= 0))
            given = columns[key][row]
            raise ValueError(f"{file}, column {layout.columns[key]}, row {row + 1}: {given} is no size; leave it out")
        if (large := number[key] * layout.unit > LARGEST).any():
            row = int(np.argmax(large))
            given = f"{columns[key][row]} is more than {LARGEST:g} m"
            raise ValueError(f"{file}, column {layout.columns[key]}, row {row + 1}: {given}; give {_unit(layout)}")
    time, xy, heading, size, lane = _in_si(number, layout)
    order = np.lexsort((time, owner))
    groups = np.split(order, np.flatnonzero(np.diff(owner[order])) + 1)
    found = []
    for k in sorted(range(len(names)), key=lambda k: (len(names[k]), names[k])):
        rows = groups[k]
        _check_times(str(names[k]), time[rows], file)
        if len(rows) < FEWEST:
            continue
        box = np.median(size[rows], axis=0)
        kind = kind_of(columns["kind"][rows[0]] if "kind" in columns else "", float(box[0]), float(box[1]))
        turning = None if heading is None else heading[rows]
        found.append(Trajectory(str(names[k]), time[rows], xy[rows], turning, box, kind, lane[rows]))
    _check_ways(found, layout, file)
    return found


def _unit(layout: Layout) -> str:
    return "feet" if layout.unit == FOOT else "metres"


def _check_ways(vehicles: Sequence[Trajectory], layout: Layout, file: str) -> None:
    """Refuse vehicles that are too fast for their unit, and headings that are not those of the motion."""
    ahead = []
    for v in vehicles:
        way = float(np.hypot(*(v.xy[-1] - v.xy[0])))
        if (speed := way / (v.time[-1] - v.time[0])) > FASTEST:
            raise ValueError(f"{file}: vehicle {v.id} drives {speed:.0f} m/s; give places in {_unit(layout)}, the same "
                             "for all, and times in seconds")  # fmt: skip
        if v.heading is not None and way > DRIVEN:
            ahead.append(float((np.diff(v.xy, axis=0) * unit(v.heading[1:])).sum()) / way)  # 1 and more where it fits
    if ahead and np.median(ahead) < 0.5:
        column, angle = layout.columns["heading"], "degrees" if layout.degrees else "radians"
        raise ValueError(f"{file}, column {column}: most vehicles do not drive where it points; give {angle} from x "
                         "towards y, or leave the column out")  # fmt: skip


def _in_si(number: dict[str, NDArray], layout: Layout) -> tuple[NDArray, NDArray, NDArray | None, NDArray, NDArray]:
    """Time, place, heading, size and lane of all rows, as `Trajectory` has them."""
    time = number["time"] if "time" in number else number["frame"] / layout.rate
    side = -1.0 if layout.left else 1.0
    size = np.column_stack([number["length"], number["width"]]) * layout.unit
    xy = np.column_stack([number["x"], number["y"]]) * layout.unit
    xy = (xy + size / 2 if layout.anchor == "corner" else xy) * [1.0, side]
    heading = None
    if "heading" in number:
        heading = side * (np.deg2rad(number["heading"]) if layout.degrees else number["heading"])
    lane = number["lane"].astype(int) if "lane" in number else np.full(len(time), NO_LANE)
    return time, xy, heading, size, lane


def _check_times(name: str, time: NDArray, file: str) -> None:
    """Refuse a vehicle that is in two places at once, or away for long."""
    step = np.diff(time)
    if (step <= 0).any():
        at = time[int(np.argmax(step <= 0))]
        raise ValueError(
            f"{file}: vehicle {name} has two rows at {at:.2f} s; give one recording of one place, "
            "in which no two vehicles share an id"
        )
    if (step > LONGEST_GAP).any():
        k = int(np.argmax(step > LONGEST_GAP))
        raise ValueError(
            f"{file}: vehicle {name} has no row for {step[k]:.1f} s after {time[k]:.2f} s, allowed is "
            f"{LONGEST_GAP:g} s; give it another id after the gap"
        )


def kind_of(text: str, length: float, width: float) -> str:
    """Contour of a class as written, or of a size [m] where the class says nothing.

    >>> kind_of("3", 12.0, 2.5), kind_of("Car", 4.4, 1.8), kind_of("", 2.2, 0.8), kind_of("", 8.0, 2.4)
    ('truck', 'car', 'motorcycle', 'truck')
    """
    word = text.strip().lower()
    word = CODES.get(word, WORDS.get(word, word))
    if word in KINDS:
        return word
    if length < 3.0 and width < 1.3:
        return "motorcycle"
    return "car" if length < 6.0 else "truck"
