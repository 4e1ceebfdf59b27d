"""One scan's evidence: which ends face the sensors, and what the detections add to the grids.

Equations: docs/methods/size-from-both-ends.md, sections 1 to 3.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import to_world, vector
from trackers.size.grid import LEAST, Grid
from trackers.size.hidden import Around, open_rooms
from trackers.size.hits import Boxes, Hits, Lit, depths, lit, views
from trackers.size.likelihood import Depths, log_likelihood
from trackers.size.visible import Room, in_view

ACROSS = np.linspace(-0.9, 0.9, 10)  # places on an end, in halves of the width
SIDE = np.sin(np.radians(10.0))  # a line of sight further off the axis meets sides ahead of a load
LEAST_SHOWN = 0.05  # share of an end in view, below which it is out of view


def facing(anchor: NDArray, size: NDArray, place: NDArray) -> NDArray:
    """Anchors (H, 2) for sensors at place (H, 2) [m] in the axes of boxes of size (H, 2) [m], (ENDS.11).

    anchor (H, 2) is the one so far, 0 where none was chosen. Beside the body it stays.
    """
    nearer = np.where(place < 0, -1.0, 1.0)
    return np.where((np.abs(place) > size / 2) | (anchor == 0), nearer, anchor)


def open_near_end(hits: Hits, boxes: Boxes, start: NDArray) -> NDArray:
    """Mask (H,) of the boxes whose anchor end, front or rear, no sensor has in view, and half of them the other one."""
    near, far = (_seen(hits, boxes, end) for end in (1, -1))
    n = np.diff(start, append=len(hits.row))
    return ~np.logical_or.reduceat(near, start) & (np.add.reduceat(far.astype(float), start) >= n / 2)  # (ENDS.43)


def _seen(hits: Hits, boxes: Boxes, end: int) -> NDArray:
    """Mask (G,) of the detections whose sensors have some of an end in view: +1 the anchor end, -1 the other."""
    half = boxes.size / 2
    y = half[:, 1:] * ACROSS
    x = np.broadcast_to(end * boxes.anchor[:, :1] * half[:, :1], y.shape)
    points = to_world(boxes.pose, vector(x, y))[hits.row]
    return np.asarray(in_view(points, hits.pose, hits.sensor.max_range, views(hits, boxes)).any(-1))


class Said(NamedTuple):
    """What a scan says of H objects."""

    length: NDArray  # (H, K, N) added to the grid of the length
    width: NDArray  # (H, K', N')
    sharper: NDArray  # (H, 2) how often it counts for offsets
    unseen: NDArray  # (H,) share of the detections whose sensors have the anchor end of the length out of view
    behind: NDArray  # (H, 2, D) detections along it as of `from_behind`


def evidence(
    grids: tuple[Grid, Grid], hits: Hits, boxes: Boxes, start: NDArray, fully_visible: NDArray,
    outliers: float, independent: int | NDArray, part_weight: float, offset_share: float, around: Around | None,
) -> Said:  # fmt: skip
    """What detections say of the size of H objects.

    start (H,) is the first detection of each object, independent (H,) how many of them count, fully_visible (H,)
    bool whether the scan shows it completely; around is the complete scan, None where it is not known.
    """
    n = np.diff(start, append=len(hits.row))
    sides = lit(hits, boxes)
    rooms = open_rooms(grids, hits, boxes, sides, around)
    both = depths(hits, boxes, sides, rooms)
    of_length, of_width = (log_likelihood(grid, z, start, outliers) for grid, z in zip(grids, both, strict=True))
    weight = np.add.reduceat(hits.sensor.weight, start) / n * np.minimum(1.0, independent / n)  # (ENDS.9)
    cut = ~fully_visible & width_is_cut(hits, boxes, sides, start)
    if cut.any():
        of_width[cut] = part_weight * np.maximum.accumulate(of_width[cut], axis=1)  # (ENDS.10)
    on_end = np.add.reduceat(sides.shown / np.maximum(sides.shown.sum(-1, keepdims=True), 1e-9), start) / n[:, None]
    sharper = np.maximum(1.0, offset_share * (1 - on_end) / weight[:, None])  # (ENDS.39)
    behind = from_behind(grids[0], hits, boxes, sides, both[0], weight)
    weight = weight[:, None, None]
    unseen = np.add.reduceat(_out_of_view(rooms[1], hits) * (sides.end[:, 0] > 0), start) / n
    return Said(weight * of_length, weight * of_width, sharper, unseen, behind)


def from_behind(grid: Grid, hits: Hits, boxes: Boxes, sides: Lit, z: Depths, weight: NDArray) -> NDArray:
    """Detections (H, 2, D) that lie along the bodies and were made from behind, weight (H,) each, (ENDS.45).

    They are counted in cells of the grid's step, by their depths from the rear: where the rear alone is in view, and
    where a side is in view, too, which count less the further off the axis they were made. Sensors whose detections of
    the inside are not even over the body have none.
    """
    out = np.zeros((len(boxes.pose), 2, grid.depths))
    even = np.where(np.isinf(z.inside), (1 - z.face) / boxes.size[hits.row, 0], 0.0)
    var = z.sigma**2 + z.behind[:, 1] ** 2
    on_face = z.face * np.exp(-0.5 * (z.depth - z.behind[:, 0]) ** 2 / var) / np.sqrt(2 * np.pi * var)
    aslant = sides.end[:, 1] != 0
    square = np.where(aslant, np.maximum(1 - np.abs(hits.sight[:, 1]) / SIDE, 0.0), 1.0)
    n = weight[hits.row] * square * even / np.maximum(even + on_face, LEAST)
    cell = np.maximum(np.ceil(z.depth / grid.step).astype(int), 0)
    some = np.flatnonzero((boxes.anchor[hits.row, 0] < 0) & (sides.end[:, 0] > 0) & (cell < grid.depths))
    np.add.at(out, (hits.row[some], aslant[some].astype(int), cell[some]), n[some])  # (ENDS.45)
    return out


def _out_of_view(across: list[Room], hits: Hits) -> NDArray:
    """1 for each of G detections whose sensor has the end of the box out of view that the cells `across` lie on.

    Of sensors whose detections hide it is not known why an end is not seen: 0.
    """
    out = np.zeros(len(hits.row))
    for room in across:
        out[room.rows] = (room.share < LEAST_SHOWN) & (hits.sensor.hiding[room.rows, 0] == 0)
    return out


def with_evidence(A: NDArray, log_p: NDArray, sharper: NDArray) -> NDArray:
    """A (H, K, N) after a scan's log_p (H, K, N), which counts more often, sharper (H,), for offsets given the size."""
    new, given = A + log_p, A + sharper[:, None, None] * log_p
    new = given + _total(new) - _total(given)  # (ENDS.39)
    return new - new.max((-2, -1), keepdims=True)


def _total(A: NDArray) -> NDArray:
    """Logarithms (H, K, 1) of the sums of exp A over the offsets."""
    top = A.max(-1, keepdims=True)
    return top + np.log(np.exp(A - top).sum(-1, keepdims=True))


def width_is_cut(hits: Hits, boxes: Boxes, sides: Lit, start: NDArray) -> NDArray:
    """Mask (H,) of the objects whose ends show more than their sides: a part of such a view is a part of the width."""
    shown = np.where(sides.end != 0, np.abs(hits.sight) * boxes.size[hits.row, ::-1], 0.0)
    end_shown, side_shown = np.add.reduceat(shown, start, axis=0).T
    return side_shown < end_shown
