"""Estimates beside the objects they may belong to: distances of all pairs, errors of the assigned ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from sensors.scene import Bodies, Objects
from testbed.evaluation.metrics import CUTOFF, areas, box_areas, gwd, nees, ragged_areas, region_iou
from trackers.estimate import Estimate
from trackers.geometry import dot, unit, wrap_angle


class PairTruth(NamedTuple):
    """The true side of K pairs."""

    pose: NDArray  # (K, 3) centre x, y [m], heading [rad]
    velocity: NDArray  # (K, 2) [m/s]
    size: NDArray  # (K, 2) length, width [m]
    ego: NDArray  # (K, 2) place of the ego [m]
    outlines: tuple[tuple[NDArray, ...], ...]  # K times those of all bodies, (C, 2) [m]


def pair_truth(objects: Objects, bodies: Bodies, rows: NDArray, ego: NDArray) -> PairTruth:
    """The objects in `rows` (K,), seen by an ego at (2,) [m]."""
    parts: dict[int, list[NDArray]] = {row: [] for row in rows.tolist()}
    for owner, outline in zip(bodies.owner.tolist(), bodies.outline, strict=True):
        if owner in parts:
            parts[owner].append(outline)
    pose, velocity, size = objects.pose[rows], objects.velocity[rows], objects.size[rows]
    return PairTruth(pose, velocity, size, np.tile(ego, (len(rows), 1)), tuple(map(tuple, parts.values())))


def truth_areas(outlines: Sequence[Sequence[NDArray]]) -> NDArray:
    """Areas (K,) inside the outlines of all bodies of each object: a truck and its trailer are one area."""
    inside = iter(ragged_areas([outline for bodies in outlines for outline in bodies]))
    found = [[next(inside) for _ in bodies] for bodies in outlines]
    return np.array([areas[0] if len(areas) == 1 else shapely.union_all(areas) for areas in found], object)


def box_edges(pose: NDArray, size: NDArray) -> tuple[NDArray, NDArray]:
    """Unit normals outwards and middles (K, 4, 2) [m] of front, rear, left and right edge of boxes."""
    out = unit(pose[:, 2:] + np.array([0.0, np.pi, np.pi / 2, -np.pi / 2]))
    return out, pose[:, None, :2] + out * size.repeat(2, -1)[..., None] / 2


def pair_distances(objects: Objects, estimate: Estimate) -> NDArray:
    """Distances (N, T) [m] of objects and estimates: `gwd`, or that of the centres where those alone reach the cut-off.

    The distance of the centres is a lower bound of `gwd`, so no pair below the cut-off is missed.
    """
    offset = objects.pose[:, None, :2] - estimate.pose[:, :2]
    distance = np.hypot(offset[..., 0], offset[..., 1])  # (MET.9)
    row, column = np.nonzero(distance < CUTOFF)
    distance[row, column] = gwd(objects.pose[row], objects.size[row], estimate.pose[column], estimate.size[column])
    return distance


@dataclass
class Pairs:
    """K estimates and the objects that they belong to; what several metrics need is worked out once."""

    truth: PairTruth
    estimate: Estimate
    distance: NDArray  # (K,) [m] `gwd`

    @cached_property
    def error(self) -> NDArray:
        """Errors of centre and velocity (K, 2, 2) [m], [m/s], estimate minus truth."""
        estimate, truth = self.estimate, self.truth
        return np.stack([estimate.pose[:, :2] - truth.pose[:, :2], estimate.velocity - truth.velocity], 1)

    @cached_property
    def lengths(self) -> NDArray:
        """Lengths of these errors (2, K)."""
        return np.hypot(self.error[..., 0], self.error[..., 1]).T

    @cached_property
    def turn(self) -> NDArray:
        """Error of the heading (K,) [rad], estimate minus truth."""
        return wrap_angle(self.estimate.pose[:, 2] - self.truth.pose[:, 2])

    @property
    def growth(self) -> NDArray:
        """Errors of length and width (K, 2) [m], estimate minus truth."""
        return self.estimate.size - self.truth.size

    @cached_property
    def near_edge(self) -> NDArray:
        """Error of the edge that faces the ego, outwards, and its standard deviation by the estimate (2, K) [m]."""
        estimate, truth, k = self.estimate, self.truth, np.arange(len(self.distance))
        (out, middle), (found_out, found) = box_edges(truth.pose, truth.size), box_edges(estimate.pose, estimate.size)
        facing = dot(truth.ego[:, None] - middle, out).argmax(-1)
        normal = out[k, facing]
        same = dot(found_out, normal[:, None]).argmax(-1)  # where the heading is reversed, the rear for the front
        error = dot(found[k, same] - middle[k, facing], normal)  # (MET.39)
        return np.stack([error, estimate.edges[k, same]])

    @cached_property
    def iou(self) -> NDArray:
        """Intersection over union (2, K) of the boxes, and of the contours or the box without one."""
        estimate, truth = self.estimate, self.truth
        box, true_box = box_areas(np.stack([estimate.pose, truth.pose]), np.stack([estimate.size, truth.size]))
        contour = box if estimate.contour is None else areas(estimate.contour)
        return region_iou(np.stack([box, contour]), np.stack([true_box, truth_areas(truth.outlines)]))

    @cached_property
    def nees(self) -> NDArray:
        """Normalised errors squared (K, 2) of centre and velocity, NaN where no covariance is given."""
        cov = np.stack([self.estimate.cov[:, :2, :2], self.estimate.cov[:, 2:, 2:]], 1)
        known = np.isfinite(cov).all((-2, -1))
        found = np.full(known.shape, np.nan)
        found[known] = nees(self.error[known], cov[known])
        return found
