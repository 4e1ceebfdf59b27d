"""What the rays of mounted radars reach: which surface is lit, which object is seen and how much of it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.raycast import Crossings, Edges, crossings, first_hits
from trackers.geometry import cross, unit

GRAZING = 0.05  # cosine of incidence below which a surface shows no more length a ray


class Fans(NamedTuple):
    """The rays of S radars at one instant, radar after radar."""

    pose: NDArray  # (S, 3) x, y [m], heading [rad]
    sensor: NDArray  # (B,) int, the radar of each ray
    bearing: NDArray  # (B,) [rad] world
    spacing: NDArray  # (S,) [rad] between rays
    max_range: NDArray  # (S,) [m]


class Lit(NamedTuple):
    """L surface elements, each lit by one ray of one of S radars."""

    sensor: NDArray  # (L,) int
    bearing: NDArray  # (L,) [rad] world
    range: NDArray  # (L,) [m]
    segment: NDArray  # (L,) int, edge of the scene or row of the walls
    object: NDArray  # (L,) int, row of the objects, -1 for walls
    chord: NDArray  # (L,) [m] projected length: range times spacing
    incidence: NDArray  # (L,) cosine between the ray and the surface normal, at least `GRAZING`


class Sight(NamedTuple):
    """What each of S radars sees of each of N objects."""

    chord: NDArray  # (S, N) [m] visible projected length
    nearest: NDArray  # (S, N) [m] nearest visible point, inf where nothing is visible
    share: NDArray  # (S, N) of the rays that meet the object, those that no other object stops


def fan(fov: float, spacing: float) -> NDArray:
    """Azimuths (B,) [rad] of rays that cut a field of view into equal sectors, each ray in the middle of its own."""
    count = max(int(np.ceil(fov / spacing)), 1)
    return ((np.arange(count) + 0.5) / count - 0.5) * fov


def incidence(bearing: NDArray, a: NDArray, b: NDArray) -> NDArray:
    """Cosine (L,) between rays and the normals of the segments a -> b (L, 2) that they hit, at least `GRAZING`."""
    e = b - a
    return np.maximum(np.abs(cross(unit(bearing), e)) / np.hypot(e[:, 0], e[:, 1]), GRAZING)


def illuminate(fans: Fans, edges: Edges, owner: NDArray, objects: int, walls: NDArray) -> tuple[Lit, Sight, Lit]:
    """Cast all rays at bodies and walls: what is lit, what is seen of each object, and the lit walls.

    owner (B,) is the object of each body; a body hides itself and whatever is behind it. walls (W, 2, 2) [m] hide each
    other but no body.
    """
    S, B, E = len(fans.pose), len(fans.bearing), len(edges.a)
    a, b = np.concatenate([edges.a, walls[:, 0]]), np.concatenate([edges.b, walls[:, 1]])
    found = crossings(fans.pose[:, :2], fans.sensor, fans.bearing, a, b)
    reach = fans.max_range[fans.sensor]
    body = found.segment < E
    solid = Crossings(found.ray[body], found.segment[body], found.range[body])
    r, segment = first_hits(solid, B)
    segment_owner = owner[edges.body]
    lit = _lit(fans, np.flatnonzero(r <= reach), r, segment, a, b, segment_owner)
    key = lit.sensor * objects + lit.object
    nearest = np.full(S * objects, np.inf)
    np.minimum.at(nearest, key, lit.range)
    near = solid.range <= reach[solid.ray]
    meets = np.zeros(B * objects, bool)  # each object once a ray
    meets[solid.ray[near] * objects + segment_owner[solid.segment[near]]] = True
    ray, row = np.divmod(np.flatnonzero(meets), max(objects, 1))
    met = np.bincount(fans.sensor[ray] * objects + row, minlength=S * objects)
    share = np.bincount(key, minlength=S * objects) / np.maximum(met, 1)
    chord = np.bincount(key, lit.chord, S * objects)
    sight = Sight(*(column.reshape(S, objects) for column in (chord, nearest, share)))
    behind, wall = first_hits(Crossings(found.ray[~body], found.segment[~body], found.range[~body]), B)
    rail = _lit(fans, np.flatnonzero((behind <= reach) & (behind < r)), behind, wall, a, b, np.full(len(a), -1))
    return lit, sight, rail._replace(segment=rail.segment - E)


def _lit(fans: Fans, ray: NDArray, r: NDArray, segment: NDArray, a: NDArray, b: NDArray, owner: NDArray) -> Lit:
    """Elements that the rays `ray` (L,) light, with range r (B,) [m] and segment (B,) of the first hit of every ray."""
    sensor, bearing, r, segment = fans.sensor[ray], fans.bearing[ray], r[ray], segment[ray]
    cosine = incidence(bearing, a.take(segment, 0), b.take(segment, 0))
    return Lit(sensor, bearing, r, segment, owner[segment], r * fans.spacing[sensor], cosine)
