"""What stands beside and on a road but for guard rails: poles, signs, trees, facades, bridges, seams of the surface.

Scattering points that stay where they are, the same for every radar and every run with the same `seed`. Beside the road
is what lies across a guard rail from the ego. Equations: docs/methods/radar.md, section 7.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from sensors.hashing import mix
from sensors.illumination import Illuminated
from sensors.returns import Returns, standing
from sensors.scene import Scene
from trackers.geometry import cross, unit, wrap_angle
from trackers.scan import SensorModel

FAINTEST = 7.0  # (range / reach)^4 beyond which a point is left out: it would be detected less often than 1 in 1000
PLACE_X, PLACE_Y, LOT = range(3)  # independent numbers of one cell


@dataclass(frozen=True)
class Roadside:
    """What stands around the road for one radar. The defaults are fitted to a real one: docs/standing-returns.md."""

    density: float = 0.32  # [1/m^2] of points beside the road, directly behind the rail
    depth: float = 16.0  # [m] behind the rail in which that falls to 1/e
    on_road: float = 0.0  # [1/m^2] of points on the road itself: bridges, gantries, seams, covers of shafts
    reach: float = 75.0  # [m] range on the axis at which a point is detected with probability 1/e
    beam_deg: float = 45.0  # off the axis at which the reach falls to 1/e
    share_astray: float = 0.15  # of the detections, whose azimuth is off by more than noise: mixed cells, multipath
    astray_deg: float = 3.0  # standard deviation of that
    seed: int = 0  # of the landscape

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"roadside.{one.name} must be finite and at least 0, got {value}")
        for name in ("depth", "reach", "beam_deg"):
            if getattr(self, name) == 0:
                raise ValueError(f"roadside.{name} must be positive, got 0; set density to 0 for no roadside")
        if self.share_astray > 1:
            raise ValueError(f"roadside.share_astray must be within 0 and 1, got {self.share_astray}")


def hashed(cell: NDArray, number: int, seed: int) -> NDArray:
    """Uniform numbers (K,) within [0, 1) of cells (K, 2) int: the same for the same cell, number and seed."""
    x, y = cell.astype(np.uint64).T
    key = x * np.uint64(0x9E3779B97F4A7C15) + y * np.uint64(0xC2B2AE3D27D4EB4F)
    key = key ^ np.uint64((seed * 4 + number + 1) * 0x165667B19E3779F9 % 2**64)
    return mix(key) / 2.0**64


def landscape(low: NDArray, high: NDArray, density: float, seed: int) -> tuple[NDArray, NDArray]:
    """Points (K, 2) [m] of the landscape in the rectangle from low (2,) to high (2,) [m], and the cell (K, 2) of each.

    One point lies at random in each cell of 1 / density [m^2].
    """
    side = density**-0.5
    (x0, y0), (x1, y1) = np.floor(low / side).astype(int), np.floor(high / side).astype(int)
    x, y = np.arange(x0, x1 + 1), np.arange(y0, y1 + 1)
    cell = np.stack([np.repeat(x, len(y)), np.tile(y, len(x))], -1)
    place = np.stack([hashed(cell, PLACE_X, seed), hashed(cell, PLACE_Y, seed)], -1)
    return (cell + place) * side, cell  # (RAD.26)


def view_corners(pose: NDArray, fov: float, radius: float) -> tuple[NDArray, NDArray]:
    """Lowest and highest x, y (2,) [m] of the sector of a circle that a radar at pose (3,) has in view."""
    at = np.clip(wrap_angle(np.arange(4) * np.pi / 2 - pose[2]), -fov / 2, fov / 2)  # where it bulges, and its ends
    rim = pose[:2] + radius * unit(pose[2] + np.append(at, [-fov / 2, fov / 2]))
    return np.minimum(rim.min(0), pose[:2]), np.maximum(rim.max(0), pose[:2])


def detected(options: Roadside, points: NDArray, pose: NDArray, fov: float, radius: float, rng: Generator) -> NDArray:
    """Rows (D,) of the points (K, 2) [m] in view of a radar at pose (3,), up to a radius [m], that a scan detects."""
    dx, dy = points[:, 0] - pose[0], points[:, 1] - pose[1]
    r = np.hypot(dx, dy)
    near = np.flatnonzero(r <= radius)
    azimuth = wrap_angle(np.arctan2(dy[near], dx[near]) - pose[2])
    reach = options.reach * np.exp(-((azimuth / np.radians(options.beam_deg)) ** 2))
    p = np.where(np.abs(azimuth) <= fov / 2, np.exp(-((r[near] / reach) ** 4)), 0.0)  # (RAD.27)
    return near[rng.random(len(near)) < p]


def rail_crossings(origin: NDArray, points: NDArray, walls: NDArray) -> NDArray:
    """How many of the walls (W, 2, 2) [m] the lines from origin (2,) to points (K, 2) [m] cross, (K,) int."""
    u = (points - origin)[:, None]
    a, b = walls[:, 0] - origin, walls[:, 1] - origin
    apart = (cross(u, a) >= 0) != (cross(u, b) >= 0)  # as (RAD.3): neighbouring walls share the side of their end
    e = b - a
    return (apart & ((cross(e, -a) >= 0) != (cross(e, u - a) >= 0))).sum(-1)


def wall_distance(points: NDArray, walls: NDArray) -> NDArray:
    """Distances (K,) [m] from points (K, 2) [m] to the nearest of walls (W, 2, 2) [m], inf without walls."""
    a, e = walls[:, 0], walls[:, 1] - walls[:, 0]
    w = points[:, None] - a
    t = np.clip((w * e).sum(-1) / np.maximum((e * e).sum(-1), 1e-12), 0.0, 1.0)
    off = w - t[..., None] * e
    return np.hypot(off[..., 0], off[..., 1]).min(-1, initial=np.inf)


def standing_points(
    options: Roadside, ego: NDArray, walls: NDArray, pose: NDArray, fov: float, max_range: float, rng: Generator
) -> NDArray:
    """Points (D, 2) [m] of the landscape that a radar at pose (3,) detects in this scan if no vehicle hides it.

    ego (2,) [m] is a place on the road, walls (W, 2, 2) [m] the rails beside it.
    """
    radius = min(max_range, options.reach * FAINTEST**0.25)
    low, high = view_corners(pose, fov, radius)
    corner = np.minimum(low, ego), np.maximum(high, ego)
    walls = walls[((walls.max(1) >= corner[0]) & (walls.min(1) <= corner[1])).all(-1)]
    found = [np.zeros((0, 2))]
    for beside, density in ((True, options.density), (False, options.on_road)):
        if not density or not len(walls):
            continue
        points, cell = landscape(low, high, density, 2 * options.seed + beside)
        row = detected(options, points, pose, fov, radius, rng)
        row = row[(rail_crossings(ego, points[row], walls) % 2 == 1) == beside]
        if beside:
            lot = hashed(cell[row], LOT, 2 * options.seed + beside)
            row = row[lot < np.exp(-wall_distance(points[row], walls) / options.depth)]  # (RAD.28)
        found.append(points[row])
    return np.concatenate(found)


def roadside_returns(
    options: Roadside, index: int, model: SensorModel, scene: Scene, pose: NDArray, velocity: NDArray,
    elements: Illuminated, rng: Generator,
) -> Returns:  # fmt: skip
    """Noise-free returns of what stands around the road to one radar, the one with this index in its rig.

    pose (3,) and velocity (2,) [m/s] are those of the radar, elements (L,) what its rays reach of vehicles.
    """
    point = standing_points(options, scene.ego.pose[:2], scene.walls, pose, model.fov, model.max_range, rng)
    sight = point - pose[:2]
    r = np.hypot(sight[:, 0], sight[:, 1])
    bearing = np.arctan2(sight[:, 1], sight[:, 0])
    rate = -(np.cos(bearing) * velocity[0] + np.sin(bearing) * velocity[1])  # (RAD.20)
    seen = r < nearest_body(bearing, pose, model.fov, index, elements)
    astray = rng.random(len(r)) < options.share_astray
    off = astray * np.radians(options.astray_deg) * rng.standard_normal(len(r))  # (RAD.29)
    polar = np.stack([r, wrap_angle(bearing - pose[2] + off), rate], -1)[seen]
    return standing(polar, np.full(len(polar), index))


def nearest_body(bearing: NDArray, pose: NDArray, fov: float, index: int, elements: Illuminated) -> NDArray:
    """Range (M,) [m] of the nearest vehicle in the sector of the ray at each bearing [rad], inf for none."""
    own = elements.sensor == index
    if not own.any():
        return np.full(len(bearing), np.inf)
    spacing = (elements.chord[own] / elements.range[own])[0]
    count = round(fov / spacing)
    first = np.full(count, np.inf)
    reached, asked = (
        np.clip(np.floor((wrap_angle(a - pose[2]) / fov + 0.5) * count).astype(int), 0, count - 1)  # (RAD.2)
        for a in (elements.bearing[own], bearing)
    )
    np.minimum.at(first, reached, elements.range[own])
    return first[asked]
