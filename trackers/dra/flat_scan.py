"""Detections of many objects as the update needs them: one row an object, sorted, with their sensors in groups.

The moments of the measurement depend on where the sensor is, how it moves, its noise, and whether it measured a range
rate, but not on the detection. So detections that share these are a group, and the moments are worked out once a group.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import unit
from trackers.linalg import outer
from trackers.scan import Scan


class FlatScan(NamedTuple):
    """M detections of B objects in up to S groups; objects with more detections come first."""

    z: NDArray  # (B, M, 3) range [m], range rate [m/s], azimuth [rad]; 0 for padding and rates not measured
    xy: NDArray  # (B, M, 2) [m]
    R_xy: NDArray  # (B, M, 2, 2) [m^2] covariance of xy
    n: NDArray  # (B,) > 0, falling; detections come before padding
    group: NDArray  # (B, M) int < S
    pose: NDArray  # (B, S, 3) of the sensor [m, m, rad]
    velocity: NDArray  # (B, S, 2) of the sensor [m/s]
    R: NDArray  # (B, S, 3) variances of range, range rate, azimuth; 1 for a rate that is not measured
    measured: NDArray  # (B, S) bool, whether the detections have a range rate


def flatten(scan: Scan, noise: tuple[float, float, float]) -> tuple[NDArray, FlatScan]:
    """Indices (B,) of the objects with detections among all, in flat order, and their detections.

    noise is the std of range [m], azimuth [rad] and range rate [m/s] where the scan does not state it. Detections are
    sorted, so that forms of the update that depend on their order do not depend on the scan's.
    """
    mask = scan.mask.reshape(-1, scan.mask.shape[-1])
    n = mask.sum(-1)
    hit = np.argsort(-n, kind="stable")[: (n > 0).sum()]
    M = int(n.max(initial=0))
    data = np.empty((*scan.mask.shape, 11))
    data[..., :3], data[..., 3:6] = scan.polar, scan.pose
    data[..., 6:8], data[..., 8:] = scan.velocity, scan.noise
    data = np.where(mask[hit][..., None], data.reshape(*mask.shape, 11)[hit], np.inf)
    order = np.lexsort((data[..., 2], data[..., 1], data[..., 0]), axis=-1)[:, :M]
    data = data[np.arange(len(data))[:, None], order]
    real = np.arange(M) < n[hit][:, None]
    data = np.where(real[..., None], data, data[:, :1])
    return hit, _grouped(data, n[hit], noise)


def _grouped(data: NDArray, n: NDArray, noise: tuple[float, float, float]) -> FlatScan:
    """From sorted rows (B, M, 11) of range, azimuth, rate, pose, velocity, noise; padding repeats the first."""
    polar, pose, velocity = data[..., :3], data[..., 3:6], data[..., 6:8]
    std = np.where(np.isnan(data[..., 8:]), noise, data[..., 8:])
    measured = np.isfinite(polar[..., 2])
    group, first = _distinct(np.concatenate([pose, velocity, std, measured[..., None]], -1))

    def of_group(field: NDArray) -> NDArray:
        return field[np.arange(len(field))[:, None], first]

    z = np.stack([polar[..., 0], np.where(measured, polar[..., 2], 0.0), polar[..., 1]], -1)
    R = of_group(std)[..., [0, 2, 1]] ** 2
    has_rate = of_group(measured)
    R[..., 1] = np.where(has_rate, R[..., 1], 1.0)
    xy, R_xy = _positions(polar, pose, std)
    return FlatScan(z, xy, R_xy, n, group, of_group(pose), of_group(velocity), R, has_rate)


def _positions(polar: NDArray, pose: NDArray, std: NDArray) -> tuple[NDArray, NDArray]:
    """Detections (B, M, 2) [m] in the tracking frame, and their covariances (B, M, 2, 2) [m^2]."""
    sight = unit(polar[..., 1] + pose[..., 2])
    along = std[..., 0] ** 2
    across = (polar[..., 0] * std[..., 1]) ** 2
    R = (along - across)[..., None, None] * outer(sight)
    R[..., 0, 0] += across
    R[..., 1, 1] += across
    return pose[..., :2] + polar[..., :1] * sight, R


def _distinct(rows: NDArray) -> tuple[NDArray, NDArray]:
    """Which of the distinct rows (B, M) of its object each row (B, M, F) is, and where (B, S) each first stands."""
    if (rows == rows[:, :1]).all():
        return np.zeros(rows.shape[:2], int), np.zeros((len(rows), 1), int)
    _, name = np.unique(rows.reshape(-1, rows.shape[-1]), axis=0, return_inverse=True)
    name = name.reshape(rows.shape[:2])
    order = np.argsort(name, axis=-1, kind="stable")
    ordered = np.take_along_axis(name, order, -1)
    begins = np.diff(ordered, axis=-1, prepend=-1) != 0
    number = np.cumsum(begins, -1) - 1
    group, first = np.zeros_like(name), np.zeros((len(name), int(number.max()) + 1), int)
    np.put_along_axis(group, order, number, -1)
    which = np.nonzero(begins)
    first[which[0], number[which]] = order[which]
    return group, first
