"""Risk in the straight corridor ahead of the ego, from boxes alone, for the evaluation and the reward "drive".

Equations: docs/methods/metrics.md.
"""

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import to_frame

NEAR = 3.0  # [s] below this, a time to collision is a risk
ROUNDING = 1e-6  # [m/s] of a closing speed; a gap of a kilometre lasts thirty years
NEXT = [1, 2, 3, 0]  # corner after each of a box
UNIT_SPEED, UNIT_BRAKING = 30.0, 8.0  # [m/s], [m/s^2] that are worth 1 s, and cost 0.5 s, of the drive value a second


def gap_ahead(pose: NDArray, size: NDArray, corners: NDArray) -> NDArray:
    """Gaps (B,) [m] from the front bumper of the ego to what of each box reaches into the corridor ahead, inf for none.

    The corridor is as wide as the ego and straight. 0 for a box that reaches across the front bumper.

    Args:
        pose: of the ego's centre (3,) x, y [m], heading [rad].
        size: of the ego (2,) length, width [m].
        corners: of the boxes (B, 4, 2) [m], in the order around each.
    """
    front, half = size / 2
    local = to_frame(pose, corners)
    x, y = local[..., 0], local[..., 1]  # (B, 4), each the start of an edge
    dx, dy = x[..., NEXT] - x, y[..., NEXT] - y
    with np.errstate(divide="ignore", invalid="ignore"):
        right, left = (-half - y) / dy, (half - y) / dy  # where along each edge the sides of the corridor are, (B, 4)
    level = dy == 0
    enters = np.where(level, 0.0, np.minimum(right, left).clip(0.0, 1.0))
    leaves = np.where(level, 1.0, np.maximum(right, left).clip(0.0, 1.0))
    inside = np.where(level, np.abs(y) < half, leaves > enters)
    first, last = x + enters * dx, x + leaves * dx
    nearest = np.where(inside, np.minimum(first, last), np.inf).min(-1)
    farthest = np.where(inside, np.maximum(first, last), -np.inf).max(-1)
    return np.where(farthest > front, np.maximum(nearest - front, 0.0), np.inf)


def time_to_collision(gap: NDArray, closing: NDArray) -> NDArray:
    """Gaps [m] over closing speeds [m/s], (...) [s], inf where they open or close by rounding alone."""
    return np.divide(gap, closing, out=np.full(np.shape(gap), np.inf), where=closing > ROUNDING)  # (MET.21)


def drive_value(speed: NDArray, ttc: NDArray, braking: NDArray) -> NDArray:
    """Rate (...) of the drive value: speed, less the prices of a short time to collision and of braking; all (...).

    `speed` [m/s], `ttc` [s], `braking` [m/s^2], 0 where the ego does not brake.
    """
    risk = np.maximum(0.0, 1 - ttc / NEAR) ** 2
    return speed / UNIT_SPEED - 2 * risk - 0.5 * (braking / UNIT_BRAKING) ** 2  # (MET.28)
