"""What vehicles and walls return, in the frames of the sensors; docs/methods/radar.md, sections 5 to 7."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.aspects import Faces, Parameters
from sensors.illumination import Illuminated
from sensors.origin import CONTOUR, VOLUME
from sensors.persistence import centres, choose_parts, cut_at_cells
from sensors.raycast import Edges
from sensors.returns import Returns, standing
from sensors.scattering import Draws, choose_elements, draw_depth, draw_scatter, room_behind, surface_points
from sensors.scene import Scene
from trackers.geometry import compose, point_velocity, rotation, wrap_angle


class Mounted(NamedTuple):
    """S mounted radars at one instant."""

    pose: NDArray  # (S, 3) x, y [m], heading [rad]
    velocity: NDArray  # (S, 2) [m/s]

    @classmethod
    def on(cls, platform: NDArray, mount: NDArray) -> "Mounted":
        """Radars at the places mount (S, 3) of a platform (6,), in the world, as `SensorModel` has them of one."""
        lever = (rotation(platform[2]) @ mount[:, :2, None])[..., 0]
        return cls(compose(platform[:3], mount), point_velocity(platform[3:5], platform[5], lever))  # (RAD.1)


class BodyFigures(NamedTuple):
    """Where on a body S sensors find its returns; the fields are those of `Sensor`."""

    grazing: NDArray  # (S,)
    share_volume: NDArray  # (S,)
    depth_contour: NDArray  # (S,) [m]
    depth_volume: NDArray  # (S,) [m]
    share_scatter: NDArray  # (S,)
    scatter: NDArray  # (S,) [m]
    lifetime: NDArray  # (S,) [s] of scattering centres; 0 where they are drawn anew in each scan
    aspects: Parameters | None  # by name, (S,) or (S, 3); None where all sides are alike


class Points(NamedTuple):
    """D points on or in bodies, seen by one sensor each."""

    xy: NDArray  # (D, 2) [m]
    sight: NDArray  # (D, 2) unit vector towards what was reached first
    inside: NDArray  # (D,) bool: not of the outline
    share_scatter: NDArray  # (D,) probability of a displacement


def vehicle_returns(
    figures: BodyFigures, scene: Scene, elements: Illuminated, edges: Edges, counts: NDArray, at: Mounted,
    rng: np.random.Generator,
) -> Returns:  # fmt: skip
    """Noise-free returns of the objects: on or behind an illuminated element each, with the motion of the body.

    counts (S, N) is how many each sensor has of each object.
    """
    face = None if figures.aspects is None else Faces(figures.aspects, scene.bodies, edges)
    lit, draw = chosen_elements(figures, scene, elements, edges, counts, at, face, rng)
    s, body = lit.sensor, edges.body[lit.segment]
    point = body_points(figures, lit, edges, at, face, draw)
    lever = point.xy - scene.bodies.pose[body, :2]
    moving = point_velocity(scene.bodies.velocity[body], scene.bodies.yaw_rate[body], lever)
    rate = (point.sight * (moving - at.velocity[s])).sum(-1)  # (RAD.17)
    off = draw_scatter(point.share_scatter, figures.scatter[s], draw)
    if draw is not rng:
        off = (rotation(scene.bodies.pose[body, 2]) @ off[..., None])[..., 0]  # a centre turns with its body
    polar = polar_of(at.pose[s], point.xy + off, rate)  # (RAD.18)
    return Returns(polar, s, lit.object, body, edges.edge[lit.segment], np.where(point.inside, VOLUME, CONTOUR))


def chosen_elements(
    figures: BodyFigures, scene: Scene, elements: Illuminated, edges: Edges, counts: NDArray, at: Mounted,
    face: Faces | None, rng: np.random.Generator,
) -> tuple[Illuminated, Draws]:  # fmt: skip
    """The element (D,) of each detection, and what all else about these detections is drawn from."""
    weight = elements.chord * elements.incidence ** -figures.grazing[elements.sensor]  # (RAD.13)
    if face is not None:
        weight = weight * face.weights(elements, at.pose)
    draw: Draws = rng
    if figures.lifetime.any():
        draw = lasting = centres(figures.lifetime, scene, counts, rng)
        elements, weight, cell = cut_at_cells(elements, weight, edges, at.pose)
        pick = choose_parts(lasting, elements, weight, cell, edges, scene.bodies.owner, counts)
    else:
        pick = choose_elements(elements, weight, counts, rng)
    return Illuminated(*(column[pick] for column in elements)), draw


def body_points(
    figures: BodyFigures, lit: Illuminated, edges: Edges, at: Mounted, face: Faces | None, draw: Draws
) -> Points:
    """Where the detections of the elements lit (D,) lie, before any is displaced."""
    s, segment, body, place = lit.sensor, lit.segment, edges.body[lit.segment], at.pose[lit.sensor, :2]
    point = surface_points(place, lit.bearing, lit.chord / lit.range, edges.a[segment], edges.b[segment], draw)
    inside = figures.share_volume[s]
    if face is not None:
        inside = inside * face.left(s, lit.range)
    volume = draw.random(len(s)) < inside
    mean = np.where(volume, figures.depth_volume[s], figures.depth_contour[s])
    depth = draw_depth(mean, room_behind(place, point, body, edges), draw)
    sight = point - place
    u = sight / np.maximum(np.hypot(sight[:, 0], sight[:, 1]), 1e-12)[:, None]
    point = point + depth[:, None] * u  # (RAD.16)
    astray = figures.share_scatter[s]
    if face is not None:
        point, under = face.from_beneath(point, s, body, place, lit.range, draw)
        volume, astray = volume | under, np.where(under, 0.0, astray)
    return Points(point, u, volume, astray)


def wall_returns(
    density: NDArray, falloff: NDArray, walls: NDArray, lit: Illuminated, at: Mounted, rng: np.random.Generator
) -> Returns:
    """Noise-free returns of the illuminated elements of walls (W, 2, 2) [m], which stand still.

    density (S,) [1/m] is that at 15 m, and falloff (S,) the exponent of (15 m / range).
    """
    if not len(lit.sensor):
        return standing(np.zeros((0, 3)), np.zeros(0, int))
    weaker = (15.0 / np.maximum(lit.range, 1.0)) ** falloff[lit.sensor]
    mean = density[lit.sensor] * weaker * lit.chord / lit.incidence
    pick = np.repeat(np.arange(len(mean)), rng.poisson(mean))  # (RAD.20)
    s, wall = lit.sensor[pick], lit.segment[pick]
    spacing = lit.chord[pick] / lit.range[pick]
    point = surface_points(at.pose[s, :2], lit.bearing[pick], spacing, walls[wall, 0], walls[wall, 1], rng)
    sight = point - at.pose[s, :2]
    rate = -(sight * at.velocity[s]).sum(-1) / np.maximum(np.hypot(sight[:, 0], sight[:, 1]), 1e-12)  # (RAD.20)
    return standing(polar_of(at.pose[s], point, rate), s)


def polar_of(pose: NDArray, point: NDArray, rate: NDArray) -> NDArray:
    """Range, azimuth, range rate (M, 3) of world points (M, 2) [m] in the frames of sensors (M, 3)."""
    d = point - pose[:, :2]
    azimuth = wrap_angle(np.arctan2(d[:, 1], d[:, 0]) - pose[:, 2])
    return np.stack([np.hypot(d[:, 0], d[:, 1]), azimuth, rate], -1)  # (RAD.19)
