"""Detections as plots, one of a vehicle and scan, for filterpy_tracker.py and stonesoup_tracker.py.

What is close together is one plot. Its box is what it spans, at least a car, and begins at the side that the radar
sees. A plot has a place and, of the range rates, the speed over ground along its line of sight. Boxes and courses lie
along the heading of the ego, which is wrong in a bend.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components

from trackers import Scan, StepInfo, Tracks, prior

APART = np.array([4.0, 1.2])  # [m] from a detection to the next of the same vehicle, along and across, and noise
CAR = np.array([4.6, 1.9])  # [m] least length and width
PLACE_STD, RATE_STD = (1.0, 0.5), 0.3  # [m] of a plot along and across, [m/s]
BIRTH_STD = (3.0, 2.0)  # [m/s] of a course along the road, and across


class Plot(NamedTuple):
    """The plot of one vehicle."""

    z: np.ndarray  # (3,) x, y [m], range rate over ground [m/s]
    H: np.ndarray  # (3, 4) z of x, y, vx, vy
    R: np.ndarray  # (3, 3)
    size: np.ndarray  # (2,) [m]
    velocity: np.ndarray  # (2,) [m/s] along the road, as the range rates say
    covariance: np.ndarray  # (4, 4) of a state that begins here
    begins: bool  # a track: two detections or more, of what moves; guard rails stand still


def plots_of(scan: Scan) -> tuple[list[Plot], np.ndarray]:
    """The plots of a scan, and the plot of each of its detections (M,), -1 for none."""
    number, rows = np.full(len(scan.mask), -1), np.flatnonzero(scan.mask & np.isfinite(scan.ground_rate))
    c, s = np.cos(scan.platform[2]), np.sin(scan.platform[2])
    axes = np.array([[c, s], [-s, c]])
    local, rate, sight = (scan.xy - scan.platform[:2])[rows] @ axes.T, scan.ground_rate[rows], scan.sight[rows]
    noise = axes @ scan.position_noise(0.3)[rows] @ axes.T
    std = np.sqrt(np.diagonal(noise, axis1=-2, axis2=-1))
    near = (np.abs(local[:, None] - local) < APART + std[:, None] + std).all(-1)
    count, number[rows] = connected_components(near & (np.abs(rate[:, None] - rate) < 3.0), directed=False)
    groups = (number[rows] == k for k in range(count))
    return [_plot(local[k], rate[k], sight[k], noise[k], axes, scan.platform) for k in groups], number


def _plot(local, rate, sight, noise, axes, ego):
    low, high = local.min(0), local.max(0)
    size = np.maximum(high - low, CAR)
    centre = np.where(low > 0, low + size / 2, np.where(high < 0, high - size / 2, (low + high) / 2))
    u, g = sight.mean(0) / np.linalg.norm(sight.mean(0)), np.median(rate)
    along = u @ axes[0]  # too little of it says nothing about the speed along the road; the ego's is as good as any
    speed, std = (g / along, BIRTH_STD) if abs(along) > 0.3 else (ego[3:5] @ axes[0], (10.0, BIRTH_STD[1]))
    H, R, P = np.eye(3, 4), np.diag([0.0, 0.0, RATE_STD**2]), np.zeros((4, 4))
    H[2] = [0.0, 0.0, *u]
    R[:2, :2] = P[:2, :2] = axes.T @ (np.diag(PLACE_STD) ** 2 + noise.mean(0) / len(noise)) @ axes
    P[2:, 2:] = axes.T @ np.diag(std) ** 2 @ axes
    z, begins = np.array([*(ego[:2] + centre @ axes), g]), abs(g) > 1.0 and len(rate) > 1
    return Plot(z, H, R, size, speed * axes[0], P, begins)


def inside(plot: Plot, mean: np.ndarray, size: np.ndarray) -> bool:
    """Whether a plot lies in the box of one of the tracks (T, 4), grown by 1 m: another part of that vehicle."""
    d, course = plot.z[:2] - mean[:, :2], mean[:, 2:] / np.maximum(np.linalg.norm(mean[:, 2:], axis=1), 0.1)[:, None]
    away = np.abs(np.stack([(d * course).sum(1), d[:, 0] * course[:, 1] - d[:, 1] * course[:, 0]], 1))
    return bool((away < size / 2 + 1.0).all(1).any())


def smoothed(size: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """The size of a track after a plot of it: a side that is seen longer counts more than one seen shorter."""
    return size + np.where(seen > size, 0.3, 0.03) * (seen - size)


def as_tracks(rows: np.ndarray, mean: np.ndarray, cov: np.ndarray, size: np.ndarray, next_id: int) -> Tracks:
    """Tracks of rows (T, 4) of id, existence, hits, age, states (T, 4) of x, y, vx, vy, and sizes (T, 2)."""
    ids, existence, hits, age = rows.T.copy()
    heading = np.arctan2(mean[:, 3], mean[:, 2])
    estimate = prior(np.column_stack([mean[:, :2], heading]), mean[:, 2:], size=size, size_std=(1.0, 0.3))
    estimate = estimate._replace(cov=(cov + cov.mT) / 2)
    return Tracks(ids.astype(int), existence, hits.astype(int), age, existence > 0.5, None, estimate, next_id)


def step_info(ids: np.ndarray, plot: np.ndarray, number: np.ndarray) -> StepInfo:
    """What a step decided: plot (T,) of each track, -1 for none, and of each detection (M,)."""
    owner = np.full(len(number), -1)
    for i, k in zip(ids, plot, strict=True):
        owner[(number == k) & (k >= 0)] = i
    count = (owner == ids[:, None]).sum(1)
    none = np.full(len(ids), np.nan)
    return StepInfo(owner, ids, none, count >= 0, count, 0 * count, none, ())
