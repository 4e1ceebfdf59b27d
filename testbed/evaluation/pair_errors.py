"""Estimates beside the objects they may belong to: distances of all pairs, errors of the assigned ones."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from sensors.scene import Bodies, Objects
from testbed.evaluation.metrics import CUTOFF, areas, box_areas, gwd, nees, ragged_areas, region_iou
from trackers.estimate import Estimate
from trackers.geometry import wrap_angle

# Errors of a pair: distances [m], [m^2], [m/s]; heading_deg, length and width are signed, estimate minus truth.
ERRORS = (
    "gwd", "gwd2", "position", "velocity", "heading_deg", "length", "width",
    "box_iou", "contour_iou", "nees_position", "nees_velocity", "nees_heading", "nees_length", "nees_width",
)  # fmt: skip


class PairTruth(NamedTuple):
    """The true side of K pairs."""

    pose: NDArray  # (K, 3) centre x, y [m], heading [rad]
    velocity: NDArray  # (K, 2) [m/s]
    size: NDArray  # (K, 2) length, width [m]
    outlines: tuple[tuple[NDArray, ...], ...]  # K times those of all bodies, (C, 2) [m]


def pair_truth(objects: Objects, bodies: Bodies, rows: NDArray) -> PairTruth:
    """The objects in `rows` (K,)."""
    parts: dict[int, list[NDArray]] = {row: [] for row in rows.tolist()}
    for owner, outline in zip(bodies.owner.tolist(), bodies.outline, strict=True):
        if owner in parts:
            parts[owner].append(outline)
    return PairTruth(objects.pose[rows], objects.velocity[rows], objects.size[rows], tuple(map(tuple, parts.values())))


def truth_areas(outlines: Sequence[Sequence[NDArray]]) -> NDArray:
    """Areas (K,) inside the outlines of all bodies of each object: a truck and its trailer are one area."""
    inside = iter(ragged_areas([outline for bodies in outlines for outline in bodies]))
    found = [[next(inside) for _ in bodies] for bodies in outlines]
    return np.array([areas[0] if len(areas) == 1 else shapely.union_all(areas) for areas in found], object)


def pair_distances(objects: Objects, estimate: Estimate) -> NDArray:
    """Distances (N, T) [m] of objects and estimates: `gwd`, or that of the centres where those alone reach the cut-off.

    The distance of the centres is a lower bound of `gwd`, so no pair below the cut-off is missed.
    """
    offset = objects.pose[:, None, :2] - estimate.pose[:, :2]
    distance = np.hypot(offset[..., 0], offset[..., 1])  # (MET.9)
    row, column = np.nonzero(distance < CUTOFF)
    distance[row, column] = gwd(objects.pose[row], objects.size[row], estimate.pose[column], estimate.size[column])
    return distance


def pair_errors(truth: PairTruth, estimate: Estimate, distance: NDArray) -> NDArray:
    """Errors (K, len(ERRORS)) of K estimates of the objects that they belong to, at `gwd` distance (K,) [m]."""
    if not len(distance):
        return np.zeros((0, len(ERRORS)))
    pose, size, cov = truth.pose, truth.size, estimate.cov
    error = np.stack([estimate.pose[:, :2] - pose[:, :2], estimate.velocity - truth.velocity], 1)  # (K, 2, 2)
    turn, growth = wrap_angle(estimate.pose[:, 2] - pose[:, 2]), estimate.size - size
    box, true_box = box_areas(np.stack([estimate.pose, pose]), np.stack([estimate.size, size]))
    contour = box if estimate.contour is None else areas(estimate.contour)
    columns = (
        distance,
        distance**2,
        *np.hypot(error[..., 0], error[..., 1]).T,
        np.degrees(turn),
        *growth.T,
        *region_iou(np.stack([box, contour]), np.stack([true_box, truth_areas(truth.outlines)])),
        *nees(error, np.stack([cov[:, :2, :2], cov[:, 2:, 2:]], 1)).T,
        (turn / estimate.heading_std) ** 2,  # (MET.11) of a scalar
        *((growth / estimate.size_std) ** 2).T,  # (MET.11) of scalars
    )
    return np.array(columns).T
