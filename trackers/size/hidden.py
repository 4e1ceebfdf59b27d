"""The part of a body that a sensor can see: range and field of view cut it off, and other detections may hide it.

The latter for sensors with a ray for each small angle: one that ends before the body has not seen it. Equations:
docs/methods/size-from-both-ends.md, section 3.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import box_corners, to_world, wrap_angle
from trackers.scan import Scan
from trackers.size.grid import Grid
from trackers.size.hits import Boxes, Hits, Lit, views
from trackers.size.visible import Cells, Room, in_view, room

CELLS = (Cells(-2.5, 0.25, 98), Cells(-0.5, 0.1, 39))  # along the side, and across the end
DEEPER = (4, 1)  # cells further inwards that have to be in view, too
WIDER = 1.0  # [m] by which a body may reach beyond its box


class Around(NamedTuple):
    """All detections of a scan, and whose they are."""

    scan: Scan  # (M,)
    owner: NDArray  # (M,) row of the object, -1 for none

    def among(self, rows: NDArray) -> "Around":
        """The same where rows (H,) are all objects that count."""
        place = np.full(max(self.owner.max(initial=-1), rows.max()) + 2, -1)  # the last one is that of none
        place[rows] = np.arange(len(rows))
        return Around(self.scan, place[self.owner])


def open_rooms(
    grids: tuple[Grid, Grid], hits: Hits, boxes: Boxes, sides: Lit, around: Around | None
) -> list[list[Room]]:
    """Rooms of length and of width that range, field of view and the detections of others leave to the detections.

    Only detections of bodies that are cut off have one, and those of faces that are seen by sensors whose detections
    hide.
    """
    key = hits.row * (hits.which.max() + 1) + hits.which
    _, first, pair = np.unique(key, return_index=True, return_inverse=True)  # P pairs of object and sensor
    fov = views(hits, boxes)
    cut = _cut_off(hits, boxes, first, fov[first])
    hides = np.zeros(len(first), bool) if around is None else hits.sensor.hiding[first, 0] > 0
    rooms: list[list[Room]] = []
    for axis, grid in enumerate(grids):
        looks = cut | (hides & (sides.end[first, 1 - axis] != 0))
        if not looks.any():
            rooms.append([])
            continue
        g, rows = first[looks], np.flatnonzero(looks[pair])
        points = _on_face(hits, boxes, g, axis)
        seen = in_view(points, hits.pose[g], hits.sensor.max_range[g], fov[g])
        seen[:, : -DEEPER[axis]] &= seen[:, DEEPER[axis] :].copy()  # (ENDS.8)
        if around is not None and hides[looks].any():
            seen &= ~_hidden(points, hits, g, around)  # (ENDS.29)
        size, cells = boxes.size[hits.row[rows], axis], seen[(looks.cumsum() - 1)[pair[rows]]]
        rooms.append([room(grid, CELLS[axis], cells, rows, size)])
    return rooms


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
