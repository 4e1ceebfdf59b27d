"""Which surfaces the rays of mounted radars reach, and how much of each object; docs/methods/radar.md, section 3."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.raycast import Crossings, Edges, crossings, first_hits
from trackers.geometry import cross, unit

GRAZING = 0.05  # least cosine of incidence: at a flatter angle a ray stands for no more length of the surface


class Beams(NamedTuple):
    """The B rays of S radars at one instant, radar after radar."""

    pose: NDArray  # (S, 3) x, y [m], heading [rad] of the radar
    sensor: NDArray  # (B,) int, the radar of each ray
    bearing: NDArray  # (B,) [rad] in the world
    spacing: NDArray  # (S,) [rad] between rays
    max_range: NDArray  # (S,) [m]


class Illuminated(NamedTuple):
    """L surface elements, each illuminated by one ray of one of S radars."""

    sensor: NDArray  # (L,) int
    bearing: NDArray  # (L,) [rad] in the world
    range: NDArray  # (L,) [m]
    segment: NDArray  # (L,) int, edge of the scene or row of the walls
    object: NDArray  # (L,) int, row of the objects, -1 for walls
    chord: NDArray  # (L,) [m] projected length: range times spacing
    incidence: NDArray  # (L,) cosine between the ray and the surface normal, at least `GRAZING`


class Visible(NamedTuple):
    """The visible part of each of N objects for each of S radars."""

    chord: NDArray  # (S, N) [m] projected length
    nearest: NDArray  # (S, N) [m] range of the nearest visible point, inf where nothing is visible
    share: NDArray  # (S, N) of the rays that cross the object, those that no other object stops


def beam_azimuths(fov: float, spacing: float) -> NDArray:
    """Azimuths (B,) [rad] of rays in the middle of the equal sectors of a field of view, at most `spacing` wide."""
    count = max(int(np.ceil(fov / spacing)), 1)
    return ((np.arange(count) + 0.5) / count - 0.5) * fov  # (RAD.2)


def incidence(bearing: NDArray, a: NDArray, b: NDArray) -> NDArray:
    """Cosine (L,) between rays and the normals of the segments a -> b (L, 2) that they hit, at least `GRAZING`."""
    e = b - a
    return np.maximum(np.abs(cross(unit(bearing), e)) / np.hypot(e[:, 0], e[:, 1]), GRAZING)  # (RAD.7)


def illuminate(
    beams: Beams, edges: Edges, owner: NDArray, objects: int, walls: NDArray
) -> tuple[Illuminated, Visible, Illuminated]:
    """Cast all rays at bodies and walls: illuminated elements of bodies, visible parts of objects, elements of walls.

    owner (B,) is the object of each body; a body hides its own far side and all that is behind it. walls (W, 2, 2) [m]
    hide each other but no body.
    """
    S, B, E = len(beams.pose), len(beams.bearing), len(edges.a)
    a, b = np.concatenate([edges.a, walls[:, 0]]), np.concatenate([edges.b, walls[:, 1]])
    found = crossings(beams.pose[:, :2], beams.sensor, beams.bearing, a, b, beams.max_range)
    reach = beams.max_range[beams.sensor]
    body = found.segment < E
    solid = Crossings(found.ray[body], found.segment[body], found.range[body])
    r, segment = first_hits(solid, B)
    segment_owner = owner[edges.body]
    elements = elements_of(beams, np.flatnonzero(r <= reach), r, segment, a, b, segment_owner)
    key = elements.sensor * objects + elements.object
    nearest = np.full(S * objects, np.inf)
    np.minimum.at(nearest, key, elements.range)  # (RAD.8)
    near = solid.range <= reach[solid.ray]
    meets = np.zeros(B * objects, bool)  # a ray counts once for each object that it crosses
    meets[solid.ray[near] * objects + segment_owner[solid.segment[near]]] = True
    ray, row = np.divmod(np.flatnonzero(meets), max(objects, 1))
    met = np.bincount(beams.sensor[ray] * objects + row, minlength=S * objects)
    share = np.bincount(key, minlength=S * objects) / np.maximum(met, 1)  # (RAD.8)
    chord = np.bincount(key, elements.chord, S * objects)  # (RAD.8)
    visible = Visible(*(column.reshape(S, objects) for column in (chord, nearest, share)))
    if not len(walls):
        return elements, visible, Illuminated(*(column[:0] for column in elements))
    behind, wall = first_hits(Crossings(found.ray[~body], found.segment[~body], found.range[~body]), B)
    rail = elements_of(beams, np.flatnonzero((behind <= reach) & (behind < r)), behind, wall, a, b, np.full(len(a), -1))
    return elements, visible, rail._replace(segment=rail.segment - E)


def elements_of(
    beams: Beams, ray: NDArray, r: NDArray, segment: NDArray, a: NDArray, b: NDArray, owner: NDArray
) -> Illuminated:
    """Elements illuminated by the rays `ray` (L,); r (B,) [m] and segment (B,) are the first hit of every ray."""
    sensor, bearing, r, segment = beams.sensor[ray], beams.bearing[ray], r[ray], segment[ray]
    cosine = incidence(bearing, a.take(segment, 0), b.take(segment, 0))
    return Illuminated(sensor, bearing, r, segment, owner[segment], r * beams.spacing[sensor], cosine)  # (RAD.7)
