"""From tracks and scans to the arrays of `trackers.compiled.ground`, and back."""

import numpy as np
from numpy.typing import NDArray

from trackers.compiled import kernels
from trackers.estimate import Estimate
from trackers.multi.visibility import SensorArray


def compiled_observe(
    e: Estimate, shift: NDArray, d: NDArray, estimate: Estimate, looks: NDArray, along: tuple[NDArray, ...],
    sensor: NDArray, poses: NDArray, sensors: SensorArray, independent: float,
) -> tuple[NDArray, NDArray] | None:  # fmt: skip
    """What a scan adds to seen and expected (D, CELLS) of tracks d (D,), whose estimates are e; None: do it in numpy.

    looks (S, D) bool says which sensor at poses (S, 3) sees which, along and sensor (M,) are the detections.
    """
    ground = kernels("ground")
    if ground is None:
        return None
    detections = ground.Along(*map(np.ascontiguousarray, (*along, sensor)))
    mounted = ground.Sensors(np.ascontiguousarray(poses), sensors.fov, sensors.max_range)
    boxes = (np.ascontiguousarray(a) for a in (e.pose, e.size, shift[:, 0], d, estimate.pose, estimate.size, looks))
    found: tuple[NDArray, NDArray] = ground.observe(*boxes, detections, mounted, float(independent))
    return found
