"""Where each detection really came from: for metrics and logs only, never for a tracker."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

CONTOUR, VOLUME, CLUTTER, STATIC = range(4)
KINDS = ("contour", "volume", "clutter", "static")


class Origin(NamedTuple):
    """Truth about the M detections of a scan and the N objects of its scene."""

    object: NDArray  # (M,) int, row of `scene.objects`, -1 for clutter and static returns
    body: NDArray  # (M,) int, row of `scene.bodies`, -1 likewise
    edge: NDArray  # (M,) int, edge of the body's outline that was hit, -1 likewise
    kind: NDArray  # (M,) int, index into KINDS
    expected: NDArray  # (N,) expected detections of each object over all sensors, occlusion included
    visible: NDArray  # (N,) share of the outline facing the sensors that is not hidden by others, best sensor

    @classmethod
    def empty(cls, objects: int) -> "Origin":
        """No detection of a scene with so many objects."""
        none = np.zeros(0, int)
        return cls(none, none, none, none, np.zeros(objects), np.zeros(objects))
