"""The true origin of each detection: for metrics and logs only, never for a tracker."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

CONTOUR, VOLUME, CLUTTER, STATIC, MIRROR, DOUBLE = range(6)
KINDS = ("contour", "volume", "clutter", "static", "mirror", "double")
GHOSTS = (MIRROR, DOUBLE)


class Origin(NamedTuple):
    """The origin of the M detections of a scan, and what was visible of the N objects of its scene."""

    object: NDArray  # (M,) int, row of `scene.objects`, -1 for clutter, static returns and ghosts
    body: NDArray  # (M,) int, row of `scene.bodies`, -1 likewise
    edge: NDArray  # (M,) int, edge of the body's outline that was hit, -1 likewise
    kind: NDArray  # (M,) int, index into KINDS
    expected: NDArray  # (N,) expected detections of each object over all sensors, occlusion included
    visible: NDArray  # (N,) share of the rays on the object that no other object stops, of the best sensor

    @classmethod
    def empty(cls, objects: int) -> "Origin":
        """That of a scan without a detection, of a scene with so many objects."""
        none = np.zeros(0, int)
        return cls(none, none, none, none, np.zeros(objects), np.zeros(objects))
