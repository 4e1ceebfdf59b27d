"""Rays against polygon edges: exact first hits, culled to the edges whose angular sector holds the ray.

Rules, so that every implementation finds the same hit; equations in docs/methods/radar.md, section 2:

- The side of a vertex is the sign of `cross(u, vertex - origin)`, zero counting as left. An edge is crossed when its
  ends lie on different sides, so no ray slips between neighbours and an edge seen end-on is never crossed.
- A crossing counts from `NEAREST` on; a sensor on an edge or a vertex does not see that edge.
- The nearest crossing wins; of equal ranges the lowest segment index.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.scene import Bodies, local_boxes
from trackers.geometry import cross, rotation, unit, wrap_angle

NEAREST = 1e-9  # [m]
MARGIN = 1e-6  # [m] by which a reach is widened: far above rounding
SLACK = 1e-9  # [rad] by which a sector is widened: far above rounding, far below a ray spacing


class Edges(NamedTuple):
    """S directed edges of B outlines."""

    a: NDArray  # (S, 2) [m] first vertex
    b: NDArray  # (S, 2) [m] next vertex
    body: NDArray  # (S,) int, row of the outline
    edge: NDArray  # (S,) int, position in the outline; edge c runs from vertex c to vertex c + 1
    start: NDArray  # (B,) int, first edge of each outline


class Crossings(NamedTuple):
    """Every crossing of a ray and a segment, ordered by segment."""

    ray: NDArray  # (P,) int
    segment: NDArray  # (P,) int
    range: NDArray  # (P,) [m]


class Hits(NamedTuple):
    """First hit of each of B rays; inf and -1 for no hit."""

    range: NDArray  # (B,) [m]
    edge: NDArray  # (B,) int, edge of the outline
    body: NDArray  # (B,) int, row of the bodies


def outline_edges(outlines: Sequence[NDArray]) -> Edges:
    """Edges of closed outlines, each (C, 2) [m] with its own C."""
    size = np.array([len(o) for o in outlines], int)
    start = np.cumsum(size) - size
    a = np.concatenate(outlines) if len(outlines) else np.zeros((0, 2))
    index = np.arange(len(a))
    body = np.repeat(np.arange(len(size)), size)
    edge = index - start[body]
    after = np.where(edge + 1 == size[body], start[body], index + 1)
    return Edges(a, a[after], body, edge, start)


def box_edges(bodies: Bodies) -> Edges:
    """The four sides of the box around each outline, in its own frame."""
    low, high = local_boxes(bodies)
    x, y = np.stack([low[:, 0], high[:, 0]]), np.stack([low[:, 1], high[:, 1]])
    local = np.stack([x[[0, 1, 1, 0]].T, y[[0, 0, 1, 1]].T], -1)  # (B, 4, 2)
    corners = bodies.pose[:, None, :2] + local @ rotation(bodies.pose[:, 2]).mT
    each, ends = np.arange(len(low)), corners[:, [1, 2, 3, 0]]
    tiled = np.tile(np.arange(4), len(low))
    return Edges(corners.reshape(-1, 2), ends.reshape(-1, 2), each.repeat(4), tiled, 4 * each)


def crossing_range(u: NDArray, wa: NDArray, wb: NDArray) -> NDArray:
    """Range (...) [m] at which rays along u (..., 2) cross segments wa -> wb (..., 2) [m] seen from the origin.

    inf where they do not, by the rules above.
    """
    sa, sb = cross(u, wa), cross(u, wb)
    crossed = (sa >= 0) != (sb >= 0)  # (RAD.3)
    t = sa / np.where(crossed, sa - sb, 1.0)  # (RAD.4)
    x, y = (wa[..., k] + t * (wb[..., k] - wa[..., k]) for k in (0, 1))  # by columns: rows of two are slow
    r = u[..., 0] * x + u[..., 1] * y  # (RAD.4)
    return np.where(crossed & (r > NEAREST), r, np.inf)


def _sectors(wa: NDArray, wb: NDArray) -> tuple[NDArray, NDArray]:
    """Start [0, 2 pi) and width (P,) [rad] of the widened sector of each segment wa -> wb (P, 2) [m]."""
    first = np.arctan2(wa[..., 1], wa[..., 0])
    turn = wrap_angle(np.arctan2(wb[..., 1], wb[..., 0]) - first)
    low = (first + np.minimum(turn, 0.0) - SLACK) % (2 * np.pi)  # (RAD.5)
    width = np.abs(turn) + 2 * SLACK  # (RAD.5)
    # So close to the line of the segment, rounding decides on which side of it the sensor is: take every ray.
    return low, np.where(np.abs(turn) > np.pi - 1e-6, np.inf, width)


def crossings(
    origin: NDArray, view: NDArray, bearing: NDArray, a: NDArray, b: NDArray, reach: NDArray | None = None
) -> Crossings:
    """All crossings of rays with segments a -> b each (S, 2) [m].

    Ray i starts at origin[view[i]], of V origins (V, 2) [m], along bearing[i], of (B,) [rad]. Segments that lie wholly
    beyond reach (V,) [m] of an origin are left out; of others crossings beyond it are among the answers.
    """
    V = len(origin)
    wa, wb = a - origin[:, None], b - origin[:, None]  # (V, S, 2)
    near = np.ones(wa.shape[:2], bool)
    if reach is not None:
        edge = b - a
        near = np.hypot(wa[..., 0], wa[..., 1]) - np.hypot(edge[:, 0], edge[:, 1]) <= reach[:, None] + MARGIN
    seen_from, segment = np.nonzero(near)
    wa, wb = wa[near], wb[near]  # (P, 2), by origin
    lap = 8 * np.pi * np.arange(V)  # separates the origins in the sorted angles
    angle = bearing % (2 * np.pi) + lap[view]
    order = angle.argsort(kind="stable")
    count = np.bincount(view, minlength=V)
    start = np.cumsum(count) - count  # where the rays of each origin begin
    # The rays of each origin stand twice in a row, the second time a turn further on, so that no sector wraps.
    place = np.arange(len(bearing)) + np.repeat(start, count)
    again = place + np.repeat(count, count)
    twice, ray_at = np.empty(2 * len(bearing)), np.empty(2 * len(bearing), int)
    twice[place] = angle[order]
    twice[again] = twice[place] + 2 * np.pi
    ray_at[place] = ray_at[again] = order
    low, width = _sectors(wa, wb)
    every = np.isinf(width)
    low = low + lap[seen_from]
    begin = np.where(every, 2 * start[seen_from], np.searchsorted(twice, low, "left"))
    end = np.searchsorted(twice, np.where(every, 0.0, low + width), "right")
    size = np.where(every, count[seen_from], np.minimum(end - begin, count[seen_from]))
    sector = np.repeat(np.arange(len(size)), size)
    ray = ray_at[np.arange(len(sector)) + np.repeat(begin - (np.cumsum(size) - size), size)]
    r = crossing_range(unit(bearing).take(ray, 0), wa.take(sector, 0), wb.take(sector, 0))
    hit = np.isfinite(r)
    return Crossings(ray[hit], segment[sector[hit]], r[hit])


def first_hits(found: Crossings, rays: int) -> tuple[NDArray, NDArray]:
    """Range (rays,) [m], inf for no hit, and segment (rays,), -1 for no hit, of the nearest crossing."""
    nearest = np.full(rays, np.inf)
    np.minimum.at(nearest, found.ray, found.range)  # (RAD.6)
    winner = found.range == nearest[found.ray]
    none = np.iinfo(np.int64).max
    segment = np.full(rays, none)
    np.minimum.at(segment, found.ray[winner], found.segment[winner])  # (RAD.6)
    return nearest, np.where(segment == none, -1, segment)


def cast(origin: NDArray, bearing: NDArray, a: NDArray, b: NDArray) -> tuple[NDArray, NDArray]:
    """First segment hit by each ray.

    origin (2,) [m], bearing (B,) [rad], segments a -> b each (S, 2) [m].
    Returns range (B,) [m], inf for no hit, and segment index (B,), -1 for no hit.
    """
    return first_hits(crossings(origin[None], np.zeros(len(bearing), int), bearing, a, b), len(bearing))


def cast_bodies(origin: NDArray, bearing: NDArray, bodies: Bodies) -> Hits:
    """First body and edge hit by each ray from origin (2,) [m] along bearing (B,) [rad]."""
    edges = outline_edges(bodies.outline)
    r, segment = cast(np.asarray(origin, float), np.asarray(bearing, float), edges.a, edges.b)
    if not len(edges.a):
        return Hits(r, segment, segment)
    hit = segment >= 0
    return Hits(r, np.where(hit, edges.edge[segment], -1), np.where(hit, edges.body[segment], -1))
