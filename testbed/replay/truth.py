"""The vehicles of truth at the times of scans, from their table, and which detections are of which.

That is as the table of detections says, else those within the box, grown a little.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.origin import CLUTTER, CONTOUR, Origin
from sensors.scene import Bodies, Objects
from testbed.replay.interpolation import Between, between, check_motion, velocities
from testbed.replay.loaded import Loaded
from trackers.geometry import box_corners, to_frame
from trackers.scan import Scan

GROWN = 0.5  # [m] on each side of a box
NONE = "-"  # in place of an id
NOT_SAID = -2
GAP = 1.0  # [s] between two rows of a vehicle that are interpolated


class TruthRows(NamedTuple):
    """K states of vehicles, in the order of the scans that they belong to."""

    scan: NDArray  # (K,) int
    id: NDArray  # (K,) int
    kind: NDArray  # (K,) text
    pose: NDArray  # (K, 3) x, y [m], heading [rad]
    velocity: NDArray  # (K, 2) [m/s]
    yaw_rate: NDArray  # (K,) [rad/s]
    size: NDArray  # (K, 2) [m]
    crashed: NDArray  # (K,) bool
    contour: NDArray  # (K,) text, empty: the box
    expected: NDArray  # (K,) NaN: not given
    visible: NDArray  # (K,) NaN: not given


class There(NamedTuple):
    """The truth of one scan, with N vehicles."""

    objects: Objects
    bodies: Bodies
    expected: NDArray  # (N,) expected detections, NaN: not given
    visible: NDArray  # (N,) share in sight, NaN: not given


class Truth(NamedTuple):
    """The truth of all scans."""

    table: Loaded | None
    rows: TruthRows
    numbers: Mapping[str, int]  # id in the table -> id in scenes
    span: tuple[float, float] | None  # [s] its first and last time; None: there is no truth

    def at(self, scan: int) -> There:
        """The vehicles at a scan."""
        low, high = np.searchsorted(self.rows.scan, (scan, scan + 1))
        r = TruthRows(*(column[low:high] for column in self.rows))
        objects = Objects(r.id, tuple(r.kind.tolist()), r.pose, r.velocity, r.yaw_rate, r.size, r.crashed)
        return There(objects, self._bodies(r), r.expected, r.visible)

    def _bodies(self, r: TruthRows) -> Bodies:
        """Their outlines: those of the table, else boxes; each body moves as its vehicle does."""
        boxes, texts = box_corners(r.pose, r.size), r.contour.tolist()
        outlines = [self._outlines(text) if text else [box] for box, text in zip(boxes, texts, strict=True)]
        owner = np.array([k for k, parts in enumerate(outlines) for _ in parts], int)
        flat = tuple(part for parts in outlines for part in parts)
        return Bodies(owner, r.pose[owner], r.velocity[owner], r.yaw_rate[owner], flat)

    def _outlines(self, text: str) -> list[NDArray]:
        try:
            return parse_contour(text)
        except ValueError as error:
            assert self.table is not None  # it has the text
            row = int(np.argmax(self.table["contour"] == text))
            raise self.table.fault("contour", row, str(error), "write three points or more, x y;x y;x y") from None


def truth_at(table: Loaded | None, times: NDArray) -> Truth:
    """The vehicles at each of the times (F,) [s]; none without a table.

    Raises ValueError, in one sentence, where rows are not sorted, a vehicle is there twice at one time, or all scans
    are before or after the truth.
    """
    if table is None:
        return Truth(None, _no_rows(), {}, None)
    if not table.rows:
        raise ValueError(f"{table.file} has no row; delete it where there is no truth")
    check_motion(table)
    time = table["time"]
    table.check_sorted()
    table.check("id", table["id"] == "", lambda row: "it is empty", "give each vehicle its id")
    if time[-1] < times[0] or times[-1] < time[0]:
        what = f"the truth is from {time[0]} s to {time[-1]} s, the scans are from {times[0]} s to {times[-1]} s"
        raise table.fault("time", 0, what, "give all tables the same clock, or delete this one")
    parts = [_course(table, rows, times) for rows in rows_of_each(table, table["id"])]
    scan, first, second, share = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.lexsort((first, scan))
    where = Between(first[order], second[order], share[order], np.ones(len(order), bool))
    numbers = numbers_of(table["id"])
    return Truth(table, _states(table, scan[order], where, numbers), numbers, (float(time[0]), float(time[-1])))


def _no_rows() -> TruthRows:
    none, flat, text = np.zeros(0, int), np.zeros(0), np.zeros(0, np.str_)
    pair = np.zeros((0, 2))
    return TruthRows(none, none, text, np.zeros((0, 3)), pair, flat, pair, flat > 0, text, flat, flat)


def rows_of_each(table: Loaded, ids: NDArray) -> list[NDArray]:
    """Rows of each of the ids (N,), in the order of time; ValueError where one is there twice at one time."""
    names, of = np.unique(ids, return_inverse=True)
    order = np.lexsort((table["time"], of))
    groups = np.split(order, np.cumsum(np.bincount(of, minlength=len(names)))[:-1])
    for rows in groups:
        twice = np.flatnonzero(np.diff(table["time"][rows]) == 0)
        if len(twice):
            row = int(rows[twice[0] + 1])
            what = f"{str(table['id'][row])!r} is there twice at {table['time'][row]} s"
            raise table.fault("id", row, what, "keep one of the rows")
    return groups


def _course(table: Loaded, rows: NDArray, times: NDArray) -> tuple[NDArray, ...]:
    """Scans at which one vehicle is known, the rows before and after them, and the share of the way between."""
    own = table["time"][rows]
    low, high = np.searchsorted(times, (own[0] - GAP, own[-1] + GAP))
    where = between(own, times[low:high], GAP)
    scan = np.arange(low, high)
    return tuple(a[where.known] for a in (scan, rows[where.first], rows[where.second], where.share))


def _states(table: Loaded, scan: NDArray, where: Between, numbers: Mapping[str, int]) -> TruthRows:
    heading, first = where.angle(table["heading"]), where.first
    kind, contour = table.texts("class"), table.texts("contour")
    return TruthRows(
        scan=scan,
        id=np.array([numbers[name] for name in table["id"].tolist()], int)[first],
        kind=np.where(kind == "", "car", kind)[first],
        pose=np.stack([where.of(table["x"]), where.of(table["y"]), heading], -1),
        velocity=velocities(table, where, heading),
        yaw_rate=where.of(table.numbers("yaw_rate", 0.0)),
        size=np.stack([where.of(table["length"]), where.of(table["width"])], -1),
        crashed=table.numbers("crashed", 0.0)[first] > 0,
        contour=np.where(where.share == 0, contour[first], ""),
        expected=where.of(table.numbers("expected", np.nan)),
        visible=where.of(table.numbers("visible", np.nan)),
    )


def numbers_of(names: NDArray) -> dict[str, int]:
    """Id in scenes of each id: whole numbers as they are, else the place in the order of their first rows, from 1."""
    different = list(dict.fromkeys(names.tolist()))
    if all(name.isascii() and name.isdigit() and str(int(name)) == name and len(name) < 10 for name in different):
        return {name: int(name) for name in different}
    return {name: number for number, name in enumerate(different, 1)}


def parse_contour(text: str) -> list[NDArray]:
    """The outlines in a cell `x y;x y;x y|x y;x y;x y`, each (C, 2) [m]; ValueError for others."""
    try:
        parts = [np.array([point.split() for point in part.split(";")], float) for part in text.split("|")]
    except ValueError:
        parts = []
    if not parts or not all(p.ndim == 2 and len(p) > 2 and p.shape[1] == 2 and np.isfinite(p).all() for p in parts):
        raise ValueError(f"{text[:60]!r} is no outline")
    return parts


def contour_text(outlines: list[NDArray]) -> str:
    """The cell that `parse_contour` reads."""
    return "|".join(";".join(f"{x!r} {y!r}" for x, y in part.tolist()) for part in outlines)


def said_objects(table: Loaded, names: NDArray, truth: Truth) -> NDArray:
    """Id (N,) in scenes of the object of each detection by its name (N,), -1 for none, NOT_SAID where it is empty.

    Raises ValueError, in one sentence, for a name that the truth does not have.
    """
    known = {"": NOT_SAID, NONE: -1, **truth.numbers}
    different, of = np.unique(names, return_inverse=True)
    number = np.array([known.get(name, NOT_SAID - 1) for name in different.tolist()], int)[of]
    if truth.span is not None:
        what = "the table truth has no vehicle"
        wrong = number < NOT_SAID
        table.check(
            "object", wrong, lambda row: f"{what} {str(names[row])!r}", f"write its id there, or {NONE} for none"
        )
    return np.maximum(number, NOT_SAID)


def origin_of(scan: Scan, there: There, said: NDArray, kind: NDArray) -> Origin:
    """The origin of the M detections of a scan.

    said (M,) are the ids of objects, see `said_objects`; kind (M,) is -1 where the table does not say it.
    """
    given = said != NOT_SAID
    owner = np.full(len(said), -1) if given.all() else owners_by_place(there.objects.pose, there.objects.size, scan.xy)
    row_of = {number: row for row, number in enumerate(there.objects.id.tolist())}
    owner = np.where(given, np.array([row_of.get(number, -1) for number in said.tolist()], int), owner)
    count = np.bincount(owner[owner >= 0], minlength=len(there.objects.id))
    return Origin(
        object=owner,
        body=np.where(owner >= 0, np.searchsorted(there.bodies.owner, owner), -1),
        edge=np.full(len(owner), -1),
        kind=np.where(kind >= 0, kind, np.where(owner >= 0, CONTOUR, CLUTTER)),
        expected=np.where(np.isnan(there.expected), count, there.expected),
        visible=np.where(np.isnan(there.visible), count > 0, there.visible),
    )


def owners_by_place(pose: NDArray, size: NDArray, xy: NDArray) -> NDArray:
    """Row (M,) of the grown box, of N poses (N, 3) and sizes (N, 2), that holds each detection (M, 2) [m].

    Of several the one that it is most inside; -1 for none.
    """
    if not len(pose) or not len(xy):
        return np.full(len(xy), -1)
    local = to_frame(pose, np.broadcast_to(xy, (len(pose), *xy.shape)))
    outside = (np.abs(local) - size[:, None] / 2).max(-1)  # (N, M) [m]
    return np.where(outside.min(0) <= GROWN, outside.argmin(0), -1)
