"""Courses from recorded places: local quadratics through noisy positions, headings that do not jitter.

A place becomes the value of the quadratic that fits best to its neighbours (Savitzky and Golay, 1964), the velocity the
derivative of the smoothed places.
"""

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import unit

SLOW = 2.0  # [m/s] below which a heading is that of the last and next faster moment


def smoothed(values: NDArray, half: int) -> NDArray:
    """Values (K, D) of equal spacing, each replaced by the local quadratic over `half` rows on either side.

    Near the ends, and in rows fewer than a window, the quadratic of the nearest whole window counts.
    """
    rows = len(values)
    half = min(half, (rows - 1) // 2)
    if half < 2:
        return values.copy()
    u = np.arange(-half, half + 1) / half
    powers = np.vander(u, 3, increasing=True)  # (W, 3)
    fit = np.linalg.pinv(powers)  # (3, W) coefficients of the quadratic about the middle
    windows = np.lib.stride_tricks.sliding_window_view(values, 2 * half + 1, axis=0)  # (K - W + 1, D, W)
    middle = windows @ fit[0]
    first, last = powers[:half] @ fit @ values[: 2 * half + 1], powers[half + 1 :] @ fit @ values[-2 * half - 1 :]
    return np.vstack([first, middle, last])


def course(
    time: NDArray, xy: NDArray, heading: NDArray | None, window: float, along: float, front: float = 0.0
) -> NDArray:
    """Table (K', 7) of `CourseTable` through places (K, 2) [m] at times (K,) [s], which grow.

    Args:
        time: of the rows; the table has their median spacing.
        xy: of the centre, or of the point `front` [m] ahead of it.
        heading: recorded (K,) [rad], or None for that of the smoothed motion.
        window: [s] of the quadratics; 0 takes the places as they are.
        along: direction [rad] of a vehicle that never moves.
        front: see `xy`.
    """
    step = float(np.median(np.diff(time)))
    rows = max(2, round((time[-1] - time[0]) / step) + 1)
    t = np.linspace(time[0], time[-1], rows)
    step, half = (t[-1] - t[0]) / (rows - 1), round(window / 2 / step)
    place = smoothed(np.column_stack([np.interp(t, time, axis) for axis in xy.T]), half)
    if heading is None:
        turned = heading_of(np.gradient(place, step, axis=0), along)
    else:
        turned = np.interp(t, time, np.unwrap(heading))
    turned = smoothed(turned[:, None], half)[:, 0]
    place -= front * unit(turned)
    velocity = np.gradient(place, step, axis=0)
    return np.column_stack([t, place, turned, velocity, np.gradient(turned, step)])


def heading_of(velocity: NDArray, along: float) -> NDArray:
    """Headings (K,) [rad] of velocities (K, 2) [m/s]: their direction, interpolated where they are below `SLOW`."""
    fast = np.flatnonzero(np.hypot(*velocity.T) >= SLOW)
    if not len(fast):
        return np.full(len(velocity), along)
    return np.interp(np.arange(len(velocity)), fast, np.unwrap(np.arctan2(velocity[fast, 1], velocity[fast, 0])))
