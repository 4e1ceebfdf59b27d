"""Straight lanes from where vehicles drove: the direction of the road, and the lateral place of each lane."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

NEAREST = 2.0  # [m] lanes that lie closer are one
SHARE = 0.01  # of all rows that a lane must have
BIN, BLUR = 0.25, 0.7  # [m] of the histogram of lateral places, and of the Gaussian that smooths it
WIDTHS = (2.5, 4.5)  # [m] least and greatest width of a lane
USUAL = 3.7  # [m] width of a lane that has no neighbour


class Lanes(NamedTuple):
    """Parallel lanes."""

    places: NDArray  # (L,) [m] lateral place of the middle of each, ascending
    width: float  # [m]


def direction(steps: NDArray, like: NDArray) -> float:
    """Direction [rad] of a road from displacements (N, 2) [m] along and against it; `like` (2,) says which way."""
    forward = np.where(steps @ like >= 0, 1.0, -1.0)
    along = (steps * forward[:, None]).sum(0)
    return float(np.arctan2(along[1], along[0]))


def fit(y: NDArray, lane: NDArray) -> Lanes:
    """Lanes from the lateral places (N,) [m] of vehicles that drive one way and their lane numbers (N,), -1 for none.

    With numbers a lane lies at the median of its rows; without, at a peak of the histogram of all rows.
    """
    places = _numbered(y, lane) if (lane >= 0).all() else _peaks(y)
    spacing = np.diff(places)
    width = float(np.clip(np.median(spacing), *WIDTHS)) if len(spacing) else USUAL
    return Lanes(places, width)


def _numbered(y: NDArray, lane: NDArray) -> NDArray:
    numbers, counts = np.unique(lane, return_counts=True)
    kept = numbers[counts >= SHARE * len(y)]
    rows = [y[lane == number] for number in kept]
    order = np.argsort([np.median(r) for r in rows])
    merged: list[NDArray] = []
    for k in order:
        if merged and np.median(rows[k]) - np.median(merged[-1]) < NEAREST:
            merged[-1] = np.concatenate([merged[-1], rows[k]])
        else:
            merged.append(rows[k])
    return np.array([np.median(r) for r in merged])


def _peaks(y: NDArray) -> NDArray:
    edges = np.arange(y.min() - 3 * BLUR, y.max() + 3 * BLUR + BIN, BIN)
    u = np.arange(-3 * BLUR, 3 * BLUR + BIN / 2, BIN)
    middle = (edges[1:] + edges[:-1]) / 2
    density = np.convolve(np.histogram(y, edges)[0], np.exp(-((u / BLUR) ** 2) / 2), "same")
    top = np.flatnonzero((density[1:-1] > density[:-2]) & (density[1:-1] >= density[2:])) + 1
    found: list[float] = []
    for k in top[np.argsort(-density[top], kind="stable")]:
        if density[k] >= SHARE * density[top].sum() and all(abs(middle[k] - other) >= NEAREST for other in found):
            found.append(float(middle[k]))
    places = np.sort(found)
    near = np.abs(y[:, None] - places).argmin(1)
    return np.array([np.median(y[near == k]) for k in range(len(places))])
