"""The compiled form of the rays of a radar and of the points on vehicles, for radars that have no more.

This module does not import numba; see `trackers.compiled`.
"""

from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from sensors.illumination import Beams, Illuminated, elements_of
from sensors.origin import CONTOUR, VOLUME
from sensors.returns import Returns
from sensors.scene import Bodies, Scene


class Fan(NamedTuple):
    """What the compiled functions need to know of S sensors, wherever they are."""

    first: NDArray  # (S,) int, first ray of each
    rays: NDArray  # (S,) int, number of them
    azimuth: NDArray  # (R,) [rad]
    reach: NDArray  # (S,) [m]
    fov: NDArray  # (S,) [rad]
    spacing: NDArray  # (S,) [rad]
    rates: NDArray  # (S, 3) expected detections at 15 m, exponent of their fall, most of them
    figures: NDArray  # (S, 6) the first fields of `reflections.BodyFigures`


class Outlines(NamedTuple):
    """The vertices (E, 2) [m] of B bodies as one list."""

    x: NDArray
    after: NDArray  # (E,) int, the next vertex
    body: NDArray  # (E,) int
    start: NDArray  # (B,) int, first vertex
    size: NDArray  # (B,) int, number of vertices
    owner: NDArray  # (B,) int, row of the objects

    @classmethod
    def of(cls, bodies: Bodies) -> "Outlines":
        """The outlines of at least one body."""
        size = np.array([len(outline) for outline in bodies.outline])
        start = np.cumsum(size) - size
        x = np.concatenate(bodies.outline)
        after = np.arange(1, len(x) + 1)
        after[start + size - 1] = start
        return cls(x, after, np.repeat(np.arange(len(size)), size), start, size, bodies.owner)


class Look(NamedTuple):
    """What S sensors at poses (S, 3) see of N objects."""

    fan: Fan
    pose: NDArray  # (S, 3)
    outlines: Outlines
    range: NDArray  # (R,) [m] first hit of each ray, inf for none
    edge: NDArray  # (R,) int, -1 for none
    share: NDArray  # (S, N) visible share
    expected: NDArray  # (S, N) detections

    def returns(self, scene: Scene, counts: NDArray, velocity: NDArray, rng: Generator) -> Returns:
        """As `reflections.vehicle_returns`, with the same random numbers; velocity (S, 2) [m/s] of the sensors."""
        from sensors.compiled.rays import points_on

        f, o, D = self.fan, self.outlines, int(counts.sum())
        polar, origin = np.empty((D, 3)), np.empty((D, 5), int)
        random, normal = rng.random((5, D)), rng.standard_normal((D, 2))
        pose, moving, yaw = (np.require(a, float, ["C", "W"]) for a in scene.bodies[1:4])
        points_on(counts, random, normal, self.pose, velocity, f.first, f.rays, f.azimuth, f.reach, f.spacing,
                  f.figures, o.x, o.after, o.body, o.start, o.size, o.owner, pose, moving, yaw, self.range, self.edge,
                  polar, origin)  # fmt: skip
        sensor, owner, body, edge, inside = origin.T
        return Returns(polar, sensor, owner, body, edge, np.where(inside, VOLUME, CONTOUR))

    def rail(self, beams: Beams, walls: NDArray) -> Illuminated:
        """The illuminated elements of walls (W, 2, 2) [m], as of `illumination.illuminate`."""
        from sensors.compiled.rays import cast

        f, W = self.fan, len(walls)  # a wall is a body of two edges, there and back
        x, at, two = np.require(walls.reshape(-1, 2), float, ["C", "W"]), np.arange(2 * W), np.full(W, 2)
        r, edge, met = np.empty(self.range.shape), np.empty(self.edge.shape, int), np.empty((len(self.pose), 1))
        cast(self.pose, f.first, f.rays, f.azimuth, f.reach, f.fov, x, at ^ 1, at[::2].copy(), two, np.zeros(W, int),
             r, edge, met)  # fmt: skip
        ray = np.flatnonzero((r <= beams.max_range[beams.sensor]) & (r < self.range))
        return elements_of(beams, ray, r, edge // 2, walls[:, 0], walls[:, 1], np.full(W, -1))


def look(fan: Fan, pose: NDArray, scene: Scene) -> Look | None:
    """All rays cast at the bodies of a scene; None where there is none, or the bodies of an object lie apart."""
    owner = scene.bodies.owner
    if not len(owner) or (owner[1:] < owner[:-1]).any():
        return None
    from sensors.compiled.rays import look_at

    f, o, shape = fan, Outlines.of(scene.bodies), (len(pose), len(scene.objects.id))
    r, edge = np.empty(len(f.azimuth)), np.empty(len(f.azimuth), int)
    share, expected = np.empty(shape), np.empty(shape)
    look_at(pose, f.first, f.rays, f.azimuth, f.reach, f.fov, f.spacing, f.rates, *o, r, edge, share, expected)
    return Look(fan, pose, o, r, edge, share, expected)
