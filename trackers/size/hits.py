"""Detections of all objects as one flat list, in the axes of their boxes.

Equations: docs/methods/size-from-both-ends.md, section 2.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import rotation, unit
from trackers.scan import Scan
from trackers.size.likelihood import Depths
from trackers.size.profile import Profiles
from trackers.size.visible import Room

LEAST_SLOPE = 0.1  # of a line of sight along an axis: a face at grazing incidence is not seen


class Boxes(NamedTuple):
    """H boxes and the ends from which their sizes are counted."""

    pose: NDArray  # (H, 3) centre x, y [m], heading [rad]
    size: NDArray  # (H, 2) [m]
    anchor: NDArray  # (H, 2) +-1: front or rear, left or right


class Hits(NamedTuple):
    """G detections, those of one object beside each other."""

    row: NDArray  # (G,) box of each
    xy: NDArray  # (G, 2) [m] in the axes of the box
    sight: NDArray  # (G, 2) unit line of sight in these axes
    place: NDArray  # (G, 2) [m] of the sensor in these axes
    pose: NDArray  # (G, 3) of the sensor in the world
    sigma: NDArray  # (G, 2) [m] noise along the axes, roughness of the surface included
    polar: NDArray  # (G, 2) [m] range, and noise across the line of sight
    which: NDArray  # (G,) int, sensor
    sensor: Profiles  # (G,)


def hits_of(
    scan: Scan, index: tuple[NDArray, ...], row: NDArray, pose: NDArray, profiles: Profiles, sigma: float
) -> Hits:
    """The detections at index of a scan, in the axes of the boxes pose (H, 3) that row (G,) names.

    Noise that is not stated is sigma [m].
    """
    shape = scan.mask.shape
    polar, mount, noise = (widened(a, (*shape, 3))[index] for a in (scan.polar, scan.pose, scan.noise))
    which = widened(scan.sensor, shape)[index]
    sensor = profiles.at(which)
    u = unit(polar[:, 1] + mount[:, 2])
    into = rotation(-pose[row, 2])

    def turned(v: NDArray) -> NDArray:
        return (into @ v[..., None])[..., 0]

    sight = turned(u)
    place = turned(mount[:, :2] - pose[row, :2])
    along = np.where(np.isnan(noise[:, 0]), sigma, noise[:, 0])
    across = np.where(np.isnan(noise[:, 1]), sigma, polar[:, 0] * noise[:, 1])
    var = (along[:, None] * sight) ** 2 + (across[:, None] * sight[:, ::-1]) ** 2  # (ENDS.6)
    std = np.sqrt(var + sensor.surface_std[:, None] ** 2)  # (ENDS.6)
    return Hits(
        row, place + polar[:, :1] * sight, sight, place, mount, std, np.stack([polar[:, 0], across], -1), which, sensor
    )


def views(hits: Hits, boxes: Boxes) -> NDArray:
    """Fields of view (G,) [rad], wider by as much as the noise of the detections hides where their bodies end."""
    r, noise = hits.polar.T
    half = 0.5 * (np.abs(hits.sight[:, ::-1]) * boxes.size[hits.row]).sum(-1)
    hides = noise**2 / np.maximum(noise**2 + half**2 / 3, 1e-9)
    return hits.sensor.fov + 2 * noise / np.maximum(r, 1e-9) * hides  # (ENDS.49)


class Lit(NamedTuple):
    """What of a body faces the sensor of each of G detections."""

    end: NDArray  # (G, 2) of each axis, +1 the anchor, -1 the other, 0 none
    shown: NDArray  # (G, 2) [m] its weight


def widened(a: NDArray, shape: tuple[int, ...]) -> NDArray:
    """The array with a shape that it broadcasts to; most have it, and `np.broadcast_to` is slow to find out."""
    return a if a.shape == shape else np.broadcast_to(a, shape)


def lit(hits: Hits, boxes: Boxes) -> Lit:
    """The ends that face the sensors, and their weights."""
    size, anchor = boxes.size[hits.row], boxes.anchor[hits.row]
    beyond = anchor * hits.place
    end = (beyond > size / 2).astype(int) - (beyond < -size / 2)
    shown = np.abs(hits.sight) ** (1 - hits.sensor.grazing[:, None]) * size[:, ::-1]
    return Lit(end, np.where(end != 0, shown, 0.0))  # (ENDS.4)


def faces(hits: Hits, shown: NDArray) -> tuple[NDArray, NDArray]:
    """Probabilities (G, 2) of each detection to be on the end or side that faces its sensor, and to be behind it."""
    total = shown.sum(-1, keepdims=True)
    share = shown / np.where(total > 0, total, 1.0)  # eta and 1 - eta, (ENDS.4)
    inside = hits.sensor.inside[:, None]
    return (1 - inside) * share, inside * share


def depths(hits: Hits, boxes: Boxes, facing: Lit, rooms: list[list[Room]]) -> list[Depths]:
    """The detections along the length and along the width, with the rooms of each."""
    end, shown = facing.end, facing.shown.copy()
    for axis, some in enumerate(rooms):
        for one in some:  # the cells along one axis lie on the face that belongs to the other
            shown[one.rows, 1 - axis] *= one.share  # (ENDS.4)
    face, entered = faces(hits, shown)
    inside, behind = (of(hits.sensor, hits.sight) for of in (inside_depth, face_depth))
    half, anchor = boxes.size[hits.row] / 2, boxes.anchor[hits.row]
    d = half - anchor * hits.xy  # (ENDS.2)
    through = np.zeros(face.shape)
    for axis, some in enumerate(rooms):
        for one in some:
            g = one.rows[one.shaded & np.isinf(inside[one.rows, axis])]
            through[g, axis] = entered[g, axis] / (1 - face[g, axis])  # (ENDS.51)
    return [
        Depths(
            d[:, axis],
            hits.sigma[:, axis],
            face[:, axis],
            end[:, axis] < 0,
            entered[:, axis],
            inside[:, axis],
            through[:, axis],
            rooms[axis],
            hits.sensor.least_room[:, axis],
            behind[:, axis],
            hits.sensor.rounding[:, axis],
        )
        for axis in range(2)
    ]


def face_depth(sensor: Profiles, sight: NDArray) -> NDArray:
    """Mean depth behind a face and its spread (G, 2, 2) [m], of both axes, at lines of sight (G, 2) in these axes."""
    return sensor.depth[:, None] * (np.abs(sight) ** sensor.slant[:, None])[..., None]  # (ENDS.52)


def inside_depth(sensor: Profiles, sight: NDArray) -> NDArray:
    """The same (G, 2) [m] of detections from inside, inf where they are even over the body."""
    return sensor.inside_depth[:, None] * np.maximum(np.abs(sight), LEAST_SLOPE)  # (ENDS.31)
