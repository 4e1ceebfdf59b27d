"""Which side of a box a sensor sees, and where the mean of what it sees lies.

sy > w/2: left side in sight
1 -------- 0
|   c-->   |   sx > l/2: front in sight
2 -------- 3
"""

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import rotation


def visible_offset(pose: NDArray, size: NDArray, sensor: NDArray) -> NDArray:
    """Mean of the visible outline relative to the box centre, (..., 2) [m], world axes.

    pose (..., 3), size (..., 2) [m], sensor (..., 2) [m] position. Each side in sight weighs with its projected
    length; a sensor inside the box sees nothing in particular: zero.
    """
    M = rotation(pose[..., 2])
    s = (M.mT @ (sensor - pose[..., :2])[..., None])[..., 0]
    half = size / 2
    depth = np.abs(s) - half  # > 0: the side of this axis faces the sensor
    in_sight = depth > 0
    side = np.sign(s) * half  # the side's distance along its own axis
    reach = np.hypot(np.maximum(depth, 1e-9), s[..., ::-1])  # from the side's midpoint to the sensor
    weight = np.where(in_sight, size[..., ::-1] * depth / reach, 0.0)
    total = weight.sum(-1, keepdims=True)
    body = weight * side / np.where(total > 0, total, 1.0)
    return (M @ body[..., None])[..., 0]
