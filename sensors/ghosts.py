"""Ghosts by the image method: detections of things that are there, but elsewhere; docs/methods/ghosts.md."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.illumination import Illuminated
from sensors.origin import DOUBLE, MIRROR
from sensors.raycast import Edges, box_edges, crossing_range
from sensors.returns import Returns
from sensors.scattering import choose_elements, draw_counts
from sensors.scene import Scene
from trackers.geometry import dot, perpendicular, point_velocity, unit, wrap_angle

LONGEST_ROUGH = 4.0  # [m] edges of bodies that are longer are flat enough to mirror: the sides of trucks
STRIDE = 8  # of the rays that reach a mirror, one in so many is followed
SQUARE = float(np.cos(np.radians(15.0)))  # least cosine of incidence on both bodies of a double reflection
APART = 1e-3  # [m] by which the second leg of a path is longer than nothing


@dataclass(frozen=True)
class Ghosts:
    """How strong ghosts are, as shares of the detections that an object in plain view at their range would give."""

    mirror: float = 0.3  # of objects seen in guard rails and in the sides of trucks
    double: float = 0.3  # of objects seen twice as far away, after a second way between them and the ego

    def __post_init__(self) -> None:
        for name in ("mirror", "double"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"ghosts.{name} must be within 0 and 1, got {getattr(self, name)}; it is a share")


class Rig(NamedTuple):
    """What ghosts need to know of the S mounted radars at one instant."""

    pose: NDArray  # (S, 3) x, y [m], heading [rad]
    velocity: NDArray  # (S, 2) [m/s]
    max_range: NDArray  # (S,) [m]
    counts: NDArray  # (3, S) expected at 15 m, falloff, largest of the data sheet
    shape: NDArray  # (S,) of the counts
    depth: NDArray  # (S,) [m] mean depth of a detection behind the surface
    spacing: NDArray  # (S,) [rad] between rays


class Mirrors(NamedTuple):
    """L points of mirrors, each reached by one ray."""

    sensor: NDArray  # (L,) int
    bearing: NDArray  # (L,) [rad] of the ray in the world
    range: NDArray  # (L,) [m]
    point: NDArray  # (L, 2) [m] where the ray meets the mirror
    normal: NDArray  # (L, 2) of the mirror
    anchor: NDArray  # (L, 2) [m] another one of its points
    velocity: NDArray  # (L, 2) [m/s] of the mirror where the ray meets it
    body: NDArray  # (L,) int, whose side it is, -1 for a rail


class Paths(NamedTuple):
    """L rays that end on objects, on the way of a ghost."""

    view: NDArray  # (L,) int; rays of one sensor by one mirror have one view
    sensor: NDArray  # (L,) int
    bearing: NDArray  # (L,) [rad] from which the echo comes, in the world
    range: NDArray  # (L,) [m] half the way
    body: NDArray  # (L,) int
    point: NDArray  # (L, 2) [m] on the body
    normal: NDArray  # (L, 2) of the mirror, 0 without one
    moving: NDArray  # (L, 2) [m/s] velocity of the mirror


def draw_ghosts(
    ghosts: Ghosts, rig: Rig, scene: Scene, edges: Edges, elements: Illuminated, rail: Illuminated,
    rng: np.random.Generator,
) -> Returns:  # fmt: skip
    """Noise-free ghosts in mirrors and of double reflections, given what the rays reach first."""
    mirrors = find_mirrors(rig, scene, edges, elements, rail)
    seen = in_mirrors(rig, scene, box_edges(scene.bodies), mirrors)  # boxes: enough for a mirror
    twice = doubled(rig, scene, edges, elements)
    V, S, N = int(seen.view.max(initial=-1)) + 1, len(rig.pose), len(scene.objects.id)
    paths = Paths(*map(np.concatenate, zip(seen, twice._replace(view=twice.view + V), strict=True)))
    if not len(paths.view):
        none, nobody = np.zeros(0), np.zeros(0, int)
        return _returns(none, none, none, nobody, nobody)
    is_double = paths.view >= V
    step = np.where(is_double, 1, STRIDE) * rig.spacing[paths.sensor]
    sensor_of = np.maximum(np.arange(V + S) - V, 0)
    sensor_of[seen.view] = seen.sensor
    owner, chord = scene.bodies.owner[paths.body], paths.range * step
    none = np.zeros(len(owner))
    lit = Illuminated(paths.view, paths.bearing, paths.range, none, owner, chord, none)
    share = np.where(np.arange(V + S) < V, ghosts.mirror, ghosts.double)
    mean = share[:, None] * expected(rig, lit, sensor_of, N)  # (GHO.3)
    pick = choose_elements(lit, chord, draw_some(mean, rig.shape[sensor_of], rng), rng)
    chosen, again = Paths(*(column[pick] for column in paths)), is_double[pick]
    s, n = chosen.sensor, chosen.normal
    lever = chosen.point - scene.bodies.pose[chosen.body, :2]
    v = point_velocity(scene.bodies.velocity[chosen.body], scene.bodies.yaw_rate[chosen.body], lever)
    apparent = v - 2 * dot(n, v - chosen.moving)[:, None] * n  # (GHO.4)
    times = np.where(again, 2, 1)
    rate = times * (unit(chosen.bearing) * (apparent - rig.velocity[s])).sum(-1)  # (GHO.5), (GHO.8)
    r = chosen.range + times * rig.depth[s] * rng.standard_exponential(len(pick))
    azimuth = chosen.bearing - rig.pose[s, 2] + step[pick] * (rng.random(len(pick)) - 0.5)
    return _returns(r, azimuth, rate, s, np.where(again, DOUBLE, MIRROR))


def find_mirrors(rig: Rig, scene: Scene, edges: Edges, elements: Illuminated, rail: Illuminated) -> Mirrors:
    """Where rays meet guard rails and long edges of bodies, one ray in `STRIDE`."""
    side = edges.b - edges.a
    smooth = np.flatnonzero((np.hypot(side[:, 0], side[:, 1]) >= LONGEST_ROUGH)[elements.segment])[::STRIDE]
    flat, wall = elements.segment[smooth], rail.segment[::STRIDE]
    a = np.concatenate([edges.a[flat], scene.walls[wall, 0]])
    b = np.concatenate([edges.b[flat], scene.walls[wall, 1]])
    sensor, bearing, r = (np.concatenate([x[smooth], y[::STRIDE]]) for x, y in zip(elements[:3], rail[:3], strict=True))
    way = b - a
    along = way / np.hypot(way[:, 0], way[:, 1])[:, None]
    owner = edges.body[flat]
    point = rig.pose[:, :2][sensor] + r[:, None] * unit(bearing)
    lever = point[: len(flat)] - scene.bodies.pose[owner, :2]
    moving = point_velocity(scene.bodies.velocity[owner], scene.bodies.yaw_rate[owner], lever)
    velocity = np.concatenate([moving, np.zeros((len(wall), 2))])
    body_of = np.concatenate([owner, np.full(len(wall), -1)])
    return Mirrors(sensor, bearing, r, point, perpendicular(along), a, velocity, body_of)


def in_mirrors(rig: Rig, scene: Scene, edges: Edges, mirrors: Mirrors) -> Paths:
    """Objects seen in mirrors: in the direction of the mirror, as far away as the way over it is long."""
    _, first, view = np.unique(same_mirror(mirrors, scene.ego.pose[:2]), return_index=True, return_inverse=True)
    place = rig.pose[mirrors.sensor[first], :2]
    image = reflected(place, mirrors.anchor[first], mirrors.normal[first])  # (V, 2), of the sensor; (GHO.1)
    way = mirrors.point - image[view]
    along = way / np.hypot(way[:, 0], way[:, 1])[:, None]
    ray, segment, r = crossed_sides(image, view, along, edges)
    reach = rig.max_range[mirrors.sensor]
    beyond = (r > mirrors.range[ray] + APART) & (r <= reach[ray]) & (edges.body[segment] != mirrors.body[ray])
    seen = np.flatnonzero(beyond)
    order = seen[np.lexsort((r[seen], ray[seen]))]
    first = np.ones(len(order), bool)
    first[1:] = ray[order[1:]] != ray[order[:-1]]
    nearest = order[first]  # (GHO.2)
    ray, segment, r = ray[nearest], segment[nearest], r[nearest]
    view, sensor, arrival, normal, moving = (
        column[ray] for column in (view, mirrors.sensor, mirrors.bearing, mirrors.normal, mirrors.velocity)
    )
    point = image[view] + r[:, None] * along[ray]
    return Paths(view, sensor, arrival, r, edges.body[segment], point, normal, moving)


def crossed_sides(origin: NDArray, view: NDArray, along: NDArray, edges: Edges) -> tuple[NDArray, NDArray, NDArray]:
    """Rays (P,), the sides (P,) of outlines that they cross, and where (P,) [m], by ray and then by side.

    Ray i starts at origin[view[i]], of V origins (V, 2) [m], along the unit vector along[i], of (L, 2).
    """
    x, y = (edges.a[:, k] - origin[:, k, None] for k in (0, 1))  # (V, E), by columns: rows of two are slow
    left = along[:, :1] * y.take(view, 0) >= along[:, 1:] * x.take(view, 0)  # (L, E)
    end = np.arange(1, len(edges.a) + 1)  # the corner where each side ends begins the next one
    end[edges.start - 1] = edges.start[np.arange(len(edges.start)) - 1]
    crossed = np.flatnonzero(left != left.take(end, 1))  # of a flat array: several times as fast as of (L, E)
    ray, segment = np.divmod(crossed, max(len(end), 1))
    start = origin[view[ray]]
    return ray, segment, crossing_range(along[ray], edges.a[segment] - start, edges.b[segment] - start)


def doubled(rig: Rig, scene: Scene, edges: Edges, elements: Illuminated) -> Paths:
    """Objects whose face and that of the ego look at each other: twice as far away, one view a sensor."""
    near = (elements.incidence >= SQUARE) & (2 * elements.range <= rig.max_range[elements.sensor])
    from_ego = elements.bearing[near] - scene.ego.pose[2]
    across = np.maximum(np.abs(np.cos(from_ego)), np.abs(np.sin(from_ego))) >= SQUARE
    square = np.flatnonzero(near)[across]  # (GHO.6)
    s, bearing, r, body = (a[square] for a in (elements.sensor, elements.bearing, elements.range, elements.segment))
    point, still = rig.pose[:, :2][s] + r[:, None] * unit(bearing), np.zeros((len(s), 2))
    return Paths(s, s, bearing, 2 * r, edges.body[body], point, still, still)  # (GHO.7)


def same_mirror(mirrors: Mirrors, origin: NDArray) -> NDArray:
    """A number (L,) that points share where one sensor sees them in one straight mirror, of however many pieces."""
    angle = np.arctan2(mirrors.normal[:, 1], mirrors.normal[:, 0]) + np.pi
    away = dot(mirrors.anchor - origin, mirrors.normal)
    turned, moved = (np.rint(x).astype(np.int64) for x in (1e4 * angle, 1e3 * away))
    return (mirrors.sensor * 10**5 + turned) * 10**8 + moved


def reflected(point: NDArray, anchor: NDArray, normal: NDArray) -> NDArray:
    """Mirror images (..., 2) [m] of points in lines through `anchor` (..., 2) [m] with unit normals (..., 2)."""
    return point - 2 * dot(point - anchor, normal)[..., None] * normal  # (GHO.1)


def expected(rig: Rig, seen: Illuminated, sensor: NDArray, objects: int) -> NDArray:
    """Expected detections (V, N) in plain view of what V views show; sensor (V,) is that of each view."""
    shape = len(sensor), objects
    key = seen.sensor * objects + seen.object
    chord = np.bincount(key, seen.chord, shape[0] * objects)
    nearest = np.full(len(chord), np.inf)
    np.minimum.at(nearest, key, seen.range)
    there = np.flatnonzero(chord)
    at_15m, falloff, most = rig.counts[:, sensor[there // objects]]
    count = at_15m * (15.0 / np.maximum(nearest[there], 1.0)) ** falloff * np.sqrt(chord[there] / 3.0)
    rate = np.zeros(len(chord))
    rate[there] = np.minimum(count, most)  # (RAD.9)
    return rate.reshape(shape)


def draw_some(mean: NDArray, shape: NDArray, rng: np.random.Generator) -> NDArray:
    """Counts (V, N) of the given mean (V, N), with the shape (V,) of their law; nothing is drawn for a mean of 0."""
    counts = np.zeros(mean.size, int)
    there = np.flatnonzero(mean)
    counts[there] = draw_counts(mean.ravel()[there], shape[there // max(mean.shape[1], 1)], rng)
    return counts.reshape(mean.shape)


def _returns(r: NDArray, azimuth: NDArray, rate: NDArray, sensor: NDArray, kind: NDArray) -> Returns:
    none = np.full(len(r), -1)
    polar = np.empty((len(r), 3))
    polar[:, 0], polar[:, 1], polar[:, 2] = r, wrap_angle(azimuth), rate
    return Returns(polar, sensor, none, none, none, kind)
