"""Radar returns as arrays: cells that merge them, noise upon them, false alarms beside them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.origin import CLUTTER
from trackers.geometry import wrap_angle


class Returns(NamedTuple):
    """M returns and where they came from."""

    polar: NDArray  # (M, 3) range [m], azimuth [rad], range rate [m/s] in the frame of the sensor
    sensor: NDArray  # (M,) int
    object: NDArray  # (M,) int, -1 for none
    body: NDArray  # (M,) int, -1 for none
    edge: NDArray  # (M,) int, -1 for none
    kind: NDArray  # (M,) int


def join(parts: tuple[Returns, ...]) -> Returns:
    """All returns, ordered by sensor and then range: the order tells nothing of their origin."""
    joined = Returns(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    return rows(joined, np.lexsort((joined.polar[:, 0], joined.sensor)))


def rows(returns: Returns, index: NDArray) -> Returns:
    """Some of the returns."""
    return Returns(*(column[index] for column in returns))


def merge_cells(returns: Returns, cell: NDArray) -> Returns:
    """Merge the returns of one sensor that fall into one resolution cell.

    cell (M, 3) range [m], azimuth [rad], range rate [m/s]. A size of zero or infinity does not tell returns apart;
    returns of a sensor with no positive finite size are not merged at all. The merged return lies at the mean of its
    parts and keeps the origin of the first one.
    """
    splits = (cell > 0) & np.isfinite(cell)
    if not splits.any():
        return returns
    bins = np.where(splits, np.floor(returns.polar / np.where(splits, cell, 1.0)), 0.0)
    alone = np.where(splits.any(-1), -1, np.arange(len(cell)))
    key = np.column_stack([returns.sensor, alone, bins])
    _, first, group, size = np.unique(key, axis=0, return_index=True, return_inverse=True, return_counts=True)
    total = np.zeros((len(first), 3))
    np.add.at(total, group.ravel(), returns.polar)
    return rows(returns, first)._replace(polar=total / size[:, None])


def add_noise(polar: NDArray, sigma: NDArray, rng: np.random.Generator) -> NDArray:
    """Measured from true polar (M, 3), with standard deviations sigma (M, 3); no range is negative."""
    r, azimuth, rate = (polar + sigma * rng.standard_normal(polar.shape)).T
    return np.stack([np.maximum(r, 0.0), wrap_angle(azimuth), rate], -1)


def false_alarms(
    mean: NDArray, max_range: NDArray, fov: NDArray, max_rate: NDArray, rng: np.random.Generator
) -> Returns:
    """Poisson false alarms of S sensors, mean (S,) a scan, uniform over the area in view and the Doppler span."""
    sensor = np.repeat(np.arange(len(mean)), rng.poisson(mean))
    x = rng.random((3, len(sensor)))
    polar = np.stack(
        [
            max_range[sensor] * np.sqrt(x[0]),
            fov[sensor] * (x[1] - 0.5),
            max_rate[sensor] * (2 * x[2] - 1),
        ],
        -1,
    )
    none = np.full(len(sensor), -1)
    return Returns(polar, sensor, none, none, none, np.full(len(sensor), CLUTTER))
