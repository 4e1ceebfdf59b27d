"""The part of a body that a sensor can see: range and field of view cut it off, and others may hide it.

Other detections hide it from sensors with a ray for each small angle: one that ends before the body has not seen it.
Other tracks keep its side in the shade. Equations: docs/methods/size-from-both-ends.md, section 3.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import box_corners, to_world, wrap_angle
from trackers.scan import Scan
from trackers.shade import Shade
from trackers.size.grid import Grid
from trackers.size.hits import Boxes, Hits, Lit, views
from trackers.size.visible import Cells, Room, in_view, room

CELLS = (Cells(-2.5, 0.25, 98), Cells(-0.5, 0.1, 39))  # along the side, and across the end
DEEPER = (4, 1)  # cells further inwards that have to be in view, too
WIDER = 1.0  # [m] by which a body may reach beyond its box
SHADED = 0.98  # probability to be seen of the least visible cell along a side, below which the side is in the shade


class Around(NamedTuple):
    """All detections of a scan, and whose they are."""

    scan: Scan  # (M,)
    owner: NDArray  # (M,) row of the object, -1 for none
    shade: Shade | None = None  # what of other objects hides them; None: it is not known
    rows: NDArray | None = None  # (H,) of the objects that count, in that; None: all of them

    def among(self, rows: NDArray) -> "Around":
        """The same where rows (H,) are all objects that count."""
        place = np.full(max(self.owner.max(initial=-1), rows.max()) + 2, -1)  # the last one is that of none
        place[rows] = np.arange(len(rows))
        return Around(self.scan, place[self.owner], self.shade, rows)


def open_rooms(
    grids: tuple[Grid, Grid], hits: Hits, boxes: Boxes, sides: Lit, around: Around | None
) -> list[list[Room]]:
    """Rooms of length and of width that range, field of view and others leave to the detections.

    Only detections of bodies that are cut off have one, those of faces that are seen by sensors whose detections hide,
    and, of length, those of sides in the shade.
    """
    key = hits.row * (hits.which.max() + 1) + hits.which
    _, first, pair = np.unique(key, return_index=True, return_inverse=True)  # P pairs of object and sensor
    fov = views(hits, boxes)
    cut = _cut_off(hits, boxes, first, fov[first])
    hides = np.zeros(len(first), bool) if around is None else hits.sensor.hiding[first, 0] > 0
    visible = _visible(hits, boxes, first, ~hides & (sides.end[first, 1] != 0), around)
    shaded = np.zeros((2, len(first)), bool)
    shaded[0] = visible.min(-1) < SHADED
    rooms: list[list[Room]] = []
    for axis, grid in enumerate(grids):
        looks = cut | shaded[axis] | (hides & (sides.end[first, 1 - axis] != 0))
        if not looks.any():
            rooms.append([])
            continue
        g, rows = first[looks], np.flatnonzero(looks[pair])
        points = _on_face(hits, boxes, g, axis)
        seen = in_view(points, hits.pose[g], hits.sensor.max_range[g], fov[g])
        seen[:, : -DEEPER[axis]] &= seen[:, DEEPER[axis] :].copy()  # (ENDS.8)
        if around is not None and hides[looks].any():
            seen &= ~_hidden(points, hits, g, around)  # (ENDS.29)
        dark = shaded[axis, looks]
        if dark.any():
            seen = np.where(dark[:, None], visible[looks], 1.0) * seen
        of_row = (looks.cumsum() - 1)[pair[rows]]
        rooms.append([room(grid, CELLS[axis], seen[of_row], rows, boxes.size[hits.row[rows], axis], dark[of_row])])
    return rooms


def _visible(hits: Hits, boxes: Boxes, g: NDArray, asked: NDArray, around: Around | None) -> NDArray:
    """Probabilities (P, C) that no other object hides the cells along the side from the sensors of hits g (P,).

    1 for those that are not asked for (P,) bool.
    """
    visible = np.ones((len(g), CELLS[0].number))
    if around is None or around.shade is None or not len(around.shade.row):
        return visible
    g = g[asked]
    v = _on_face(hits, boxes, g, 0) - hits.pose[g, None, :2]
    azimuth = np.arctan2(v[..., 1], v[..., 0]) - hits.pose[g, None, 2]
    row = hits.row[g] if around.rows is None else around.rows[hits.row[g]]
    visible[asked] = around.shade.seen(hits.which[g], row, azimuth, np.hypot(v[..., 0], v[..., 1]))  # (MOT.60)
    return visible


def _cut_off(hits: Hits, boxes: Boxes, g: NDArray, fov: NDArray) -> NDArray:
    """Mask (P,) of the detections g (P,) of bodies that range or field of view (P,) of their sensors may cut off."""
    corners = box_corners(boxes.pose, boxes.size + 2 * WIDER)[hits.row[g]]
    return np.asarray(~in_view(corners, hits.pose[g], hits.sensor.max_range[g], fov).all(-1))


def _on_face(hits: Hits, boxes: Boxes, g: NDArray, axis: int) -> NDArray:
    """World points (P, C, 2) of the cells along an axis, on the face that faces the sensors of detections g (P,)."""
    row, other = hits.row[g], 1 - axis
    anchor, half, depth = boxes.anchor[row], boxes.size[row] / 2, CELLS[axis].middles
    body = np.empty((len(g), len(depth), 2))
    body[..., axis] = anchor[:, axis, None] * (half[:, axis, None] - depth)
    body[..., other] = np.clip(hits.place[g], -half, half)[:, other, None]
    return to_world(boxes.pose[row], body)


def _hidden(points: NDArray, hits: Hits, g: NDArray, around: Around) -> NDArray:
    """Mask (P, C) of the points (P, C, 2) that the sensors of detections g (P,) cannot see, (ENDS.29).

    A detection that is not of the object hides a point if it is nearer by the margin and almost in the same direction,
    unless a detection of the object is in that direction, too.
    """
    scan = around.scan
    sensor = np.broadcast_to(scan.sensor, scan.mask.shape)
    v = points - hits.pose[g, None, :2]
    distance = np.hypot(v[..., 0], v[..., 1])
    azimuth = wrap_angle(np.arctan2(v[..., 1], v[..., 0]) - hits.pose[g, None, 2])
    hidden = np.zeros(distance.shape, bool)
    for s in np.unique(hits.which[g]):
        p = np.flatnonzero(hits.which[g] == s)
        m = np.flatnonzero(scan.mask & (sensor == s))
        within, behind = hits.sensor.hiding[g[p[0]]]
        whole = wrap_angle(scan.polar[m, 1])[:, None] + 2 * np.pi * np.array([-1, 0, 1])  # across the seam
        order = np.argsort(whole.ravel(), kind="stable")
        angle, m = whole.ravel()[order], np.repeat(m, 3)[order]
        low, high = np.searchsorted(angle, azimuth[p] - within), np.searchsorted(angle, azimuth[p] + within)
        stopped, own = np.zeros(low.shape, bool), np.zeros(low.shape, bool)
        for k in range((high - low).max()):
            j = m[np.minimum(low + k, len(m) - 1)]
            there, mine = low + k < high, around.owner[j] == hits.row[g[p], None]
            own |= there & mine
            stopped |= there & ~mine & (scan.polar[j, 0] < distance[p] - behind)
        hidden[p] = stopped & ~own
    return hidden
