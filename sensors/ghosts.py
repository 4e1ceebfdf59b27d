"""Ghosts: detections of things that are there, but not where they seem to be, by the image method.

Equations: docs/methods/ghosts.md.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.illumination import Illuminated, incidence
from sensors.origin import DOUBLE, MIRROR
from sensors.raycast import Edges, crossings, first_hits
from sensors.returns import Returns
from sensors.scattering import choose_elements, draw_counts
from sensors.scene import Scene
from trackers.geometry import perpendicular, point_velocity, unit, wrap_angle

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
    normal: NDArray  # (L, 2) of the mirror
    anchor: NDArray  # (L, 2) [m] one of its points
    velocity: NDArray  # (L, 2) [m/s] of the mirror where the ray meets it


def draw_ghosts(
    ghosts: Ghosts, rig: Rig, scene: Scene, edges: Edges, elements: Illuminated, rail: Illuminated,
    rng: np.random.Generator,
) -> tuple[Returns, Returns]:  # fmt: skip
    """Noise-free ghosts in mirrors, and those of double reflections, given what the rays reach first."""
    mirrors = find_mirrors(rig, scene, edges, elements, rail)
    return in_mirrors(ghosts.mirror, rig, scene, edges, mirrors, rng), doubled(
        ghosts.double, rig, scene, edges, elements, rng
    )


def find_mirrors(rig: Rig, scene: Scene, edges: Edges, elements: Illuminated, rail: Illuminated) -> Mirrors:
    """Where rays meet guard rails and long edges of bodies, one ray in `STRIDE`."""
    length = np.hypot(*(edges.b - edges.a).T)
    smooth = length[elements.segment] >= LONGEST_ROUGH
    body = Illuminated(*(column[smooth][::STRIDE] for column in elements))
    wall = Illuminated(*(column[::STRIDE] for column in rail))
    flat = body.segment
    a = np.concatenate([edges.a[flat], scene.walls[wall.segment, 0]])
    b = np.concatenate([edges.b[flat], scene.walls[wall.segment, 1]])
    sensor, bearing, r = (np.concatenate([getattr(body, n), getattr(wall, n)]) for n in ("sensor", "bearing", "range"))
    along = (b - a) / np.hypot(*(b - a).T)[:, None]
    owner = edges.body[flat]
    point = rig.pose[body.sensor, :2] + body.range[:, None] * unit(body.bearing)
    lever = point - scene.bodies.pose[owner, :2]
    moving = point_velocity(scene.bodies.velocity[owner], scene.bodies.yaw_rate[owner], lever)
    velocity = np.concatenate([moving, np.zeros((len(wall.sensor), 2))])
    return Mirrors(sensor, bearing, r, perpendicular(along), a, velocity)


def in_mirrors(
    share: float, rig: Rig, scene: Scene, edges: Edges, mirrors: Mirrors, rng: np.random.Generator
) -> Returns:
    """Objects seen in mirrors: in the direction of the mirror, as far away as the way over it is long."""
    if not len(mirrors.sensor):
        return _returns(*np.zeros((3, 0)), np.zeros(0, int), MIRROR)
    _, first, view = np.unique(same_mirror(mirrors, scene.ego.pose[:2]), return_index=True, return_inverse=True)
    place = rig.pose[mirrors.sensor, :2]
    image = reflected(place, mirrors.anchor, mirrors.normal)[first]  # (V, 2), of the sensor; (GHO.1)
    met = place + mirrors.range[:, None] * unit(mirrors.bearing)
    way = met - image[view]
    bearing = np.arctan2(way[:, 1], way[:, 0])
    found = crossings(image, view, bearing, edges.a, edges.b)
    beyond = found.range > mirrors.range[found.ray] + APART  # behind the mirror there is nothing
    kept = type(found)(*(column[beyond] for column in found))
    r, segment = first_hits(kept, len(bearing))  # (GHO.2)
    reach = rig.max_range[mirrors.sensor]
    ray = np.flatnonzero(r <= reach)
    sensor, r, segment, view = mirrors.sensor[ray], r[ray], segment[ray], view[ray]
    body = edges.body[segment]
    owner = scene.bodies.owner[body]
    width = STRIDE * rig.spacing[sensor]
    seen = Illuminated(
        view, bearing[ray], r, segment, owner, r * width, incidence(bearing[ray], edges.a[segment], edges.b[segment])
    )
    mean = share * expected(rig, seen, mirrors.sensor[first], len(scene.objects.id))  # (GHO.3)
    counts = draw_some(mean, rig.shape[mirrors.sensor[first]], rng)
    pick = choose_elements(seen, seen.chord, counts, rng)
    s, chosen = sensor[pick], ray[pick]
    point = image[view[pick]] + r[pick, None] * unit(bearing[chosen])
    lever = point - scene.bodies.pose[body[pick], :2]
    v = point_velocity(scene.bodies.velocity[body[pick]], scene.bodies.yaw_rate[body[pick]], lever)
    n, moving = mirrors.normal[chosen], mirrors.velocity[chosen]
    apparent = v - 2 * (n * (v - moving)).sum(-1)[:, None] * n  # (GHO.4)
    rate = (unit(mirrors.bearing[chosen]) * (apparent - rig.velocity[s])).sum(-1)  # (GHO.5)
    r = r[pick] + rig.depth[s] * rng.standard_exponential(len(pick))
    azimuth = mirrors.bearing[chosen] - rig.pose[s, 2] + width[pick] * (rng.random(len(pick)) - 0.5)
    return _returns(r, azimuth, rate, s, MIRROR)


def doubled(
    share: float, rig: Rig, scene: Scene, edges: Edges, elements: Illuminated, rng: np.random.Generator
) -> Returns:
    """Objects whose face and that of the ego look at each other: twice as far away, twice the range rate."""
    near = (elements.incidence >= SQUARE) & (2 * elements.range <= rig.max_range[elements.sensor])
    from_ego = elements.bearing[near] - scene.ego.pose[2]
    across = np.maximum(np.abs(np.cos(from_ego)), np.abs(np.sin(from_ego))) >= SQUARE
    square = np.flatnonzero(near)[across]  # (GHO.6)
    seen = Illuminated(*(column[square] for column in elements))
    S, N = len(rig.pose), len(scene.objects.id)
    if not len(seen.sensor):
        return _returns(*np.zeros((3, 0)), np.zeros(0, int), DOUBLE)
    far = seen._replace(range=2 * seen.range)
    mean = share * expected(rig, far, np.arange(S), N)  # (GHO.7)
    pick = choose_elements(seen, seen.chord, draw_some(mean, rig.shape, rng), rng)
    s, u = seen.sensor[pick], unit(seen.bearing[pick])
    point, body = rig.pose[s, :2] + seen.range[pick, None] * u, edges.body[seen.segment[pick]]
    lever = point - scene.bodies.pose[body, :2]
    v = point_velocity(scene.bodies.velocity[body], scene.bodies.yaw_rate[body], lever)
    rate = 2 * (u * (v - rig.velocity[s])).sum(-1)  # (GHO.8)
    r = 2 * (seen.range[pick] + rig.depth[s] * rng.standard_exponential(len(pick)))  # (GHO.8)
    jitter = rig.spacing[s] * (rng.random(len(pick)) - 0.5)
    return _returns(r, seen.bearing[pick] - rig.pose[s, 2] + jitter, rate, s, DOUBLE)


def same_mirror(mirrors: Mirrors, origin: NDArray) -> NDArray:
    """A number (L,) that points share where one sensor sees them in one straight mirror, of however many pieces."""
    angle = np.arctan2(mirrors.normal[:, 1], mirrors.normal[:, 0]) + np.pi
    away = ((mirrors.anchor - origin) * mirrors.normal).sum(-1)
    turned, moved = (np.rint(x).astype(np.int64) for x in (1e4 * angle, 1e3 * away))
    return (mirrors.sensor * 10**5 + turned) * 10**8 + moved


def reflected(point: NDArray, anchor: NDArray, normal: NDArray) -> NDArray:
    """Mirror images (..., 2) [m] of points in lines through `anchor` (..., 2) [m] with unit normals (..., 2)."""
    return point - 2 * ((point - anchor) * normal).sum(-1)[..., None] * normal  # (GHO.1)


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
    counts = np.zeros(mean.shape, int)
    there = mean > 0
    counts[there] = draw_counts(mean[there], np.broadcast_to(shape[:, None], mean.shape)[there], rng)
    return counts


def _returns(r: NDArray, azimuth: NDArray, rate: NDArray, sensor: NDArray, kind: int) -> Returns:
    none = np.full(len(r), -1)
    return Returns(np.stack([r, wrap_angle(azimuth), rate], -1), sensor, none, none, none, np.full(len(r), kind))
