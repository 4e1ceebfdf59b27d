"""The sides of a box that are visible to a sensor, and the mean of their outline.

sy > w/2: left side visible
1 -------- 0
|   c-->   |   sx > l/2: front visible
2 -------- 3

Equations: docs/methods/random-matrices.md.
"""

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import rotation


def visible_offset(pose: NDArray, size: NDArray, sensor: NDArray) -> NDArray:
    """Mean of the visible outline relative to the box centre, (..., 2) [m], world axes.

    pose (..., 3), size (..., 2) [m], sensor (..., 2) [m] position. Each visible side weighs with its projected length;
    for a sensor inside the box the offset is zero.
    """
    M = rotation(pose[..., 2])
    s = (M.mT @ (sensor - pose[..., :2])[..., None])[..., 0]
    half = size / 2
    depth = np.abs(s) - half  # > 0: the side of this axis faces the sensor
    visible = depth > 0
    side = np.sign(s) * half  # the side's distance along its own axis
    reach = np.hypot(np.maximum(depth, 1e-9), s[..., ::-1])  # from the side's midpoint to the sensor
    weight = np.where(visible, size[..., ::-1] * depth / reach, 0.0)  # (RM.16)
    total = weight.sum(-1, keepdims=True)
    body = weight * side / np.where(total > 0, total, 1.0)
    return (M @ body[..., None])[..., 0]  # (RM.16)
