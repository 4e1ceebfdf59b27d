"""Radar returns as arrays: resolution cells, measurement noise, false alarms; docs/methods/radar.md, section 8."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.origin import CLUTTER, STATIC
from trackers.geometry import wrap_angle


class Returns(NamedTuple):
    """M returns and their origin."""

    polar: NDArray  # (M, 3) range [m], azimuth [rad], range rate [m/s] in the frame of the sensor
    sensor: NDArray  # (M,) int
    object: NDArray  # (M,) int, -1 for none
    body: NDArray  # (M,) int, -1 for none
    edge: NDArray  # (M,) int, -1 for none
    kind: NDArray  # (M,) int


def join(parts: tuple[Returns, ...]) -> Returns:
    """All returns, sorted by sensor and range, so that their order says nothing of their origin."""
    joined = parts[0]
    if len(parts) > 1:
        joined = Returns(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    return rows(joined, np.lexsort((joined.polar[:, 0], joined.sensor)))


def rows(returns: Returns, index: NDArray) -> Returns:
    """The returns with these rows, int or bool."""
    return Returns(*(column[index] for column in returns))


def standing(polar: NDArray, sensor: NDArray) -> Returns:
    """Returns (M,) of what stands still and is no object."""
    none = np.full(len(sensor), -1)
    return Returns(polar, sensor, none, none, none, np.full(len(sensor), STATIC))


def merge_cells(returns: Returns, cell: NDArray) -> tuple[Returns, NDArray]:
    """Merge the returns of one sensor that fall into one resolution cell.

    cell (M, 3) is its size in range [m], azimuth [rad], range rate [m/s]. A size of zero or infinity does not separate
    returns; those of a sensor with no positive finite size are not merged at all. The merged return lies at the mean of
    its parts and keeps the origin of the first one. Returned is also of how many (M',) each is, which is its power.
    """
    splits = (cell > 0) & np.isfinite(cell)
    if not splits.any():
        return returns, np.ones(len(cell))
    bins = np.where(splits, np.floor(returns.polar / np.where(splits, cell, 1.0)), 0.0)  # (RAD.21)
    alone = np.where(splits.any(-1), -1, np.arange(len(cell)))
    key = np.column_stack([returns.sensor, alone, bins])
    _, first, group, size = np.unique(key, axis=0, return_index=True, return_inverse=True, return_counts=True)
    total = np.zeros((len(first), 3))
    np.add.at(total, group.ravel(), returns.polar)
    return rows(returns, first)._replace(polar=total / size[:, None]), size


def add_noise(polar: NDArray, sigma: NDArray, rng: np.random.Generator) -> NDArray:
    """Measured range, azimuth, rate (M, 3) of true ones (M, 3), with noise of std sigma (M, 3); no range below 0."""
    r, azimuth, rate = (polar + sigma * rng.standard_normal(polar.shape)).T  # (RAD.22)
    measured = np.empty(polar.shape)
    measured[:, 0], measured[:, 1], measured[:, 2] = np.maximum(r, 0.0), wrap_angle(azimuth), rate
    return measured


def fold_rates(polar: NDArray, limit: NDArray) -> NDArray:
    """Polar (M, 3) with range rates within +- limit (M,) [m/s], from where they come back at the other end."""
    beyond = np.abs(polar[:, 2]) > limit
    if not beyond.any():
        return polar
    folded = polar.copy()
    folded[beyond, 2] = (polar[beyond, 2] + limit[beyond]) % (2 * limit[beyond]) - limit[beyond]  # (RAD.43)
    return folded


def false_alarms(
    mean: NDArray, max_range: NDArray, fov: NDArray, max_rate: NDArray, rng: np.random.Generator
) -> Returns:
    """Poisson false alarms of S sensors, mean (S,) a scan, uniform over the area in view and the range rates."""
    sensor = np.repeat(np.arange(len(mean)), rng.poisson(mean))
    x = rng.random((3, len(sensor)))
    r = max_range[sensor] * np.sqrt(x[0])  # (RAD.23)
    polar = np.stack([r, fov[sensor] * (x[1] - 0.5), max_rate[sensor] * (2 * x[2] - 1)], -1)
    none = np.full(len(sensor), -1)
    return Returns(polar, sensor, none, none, none, np.full(len(sensor), CLUTTER))
