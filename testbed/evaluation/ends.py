"""Which ends of each object the radar has hit so far: what a length can be estimated from."""

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from sensors.origin import Origin
from sensors.scene import Objects
from trackers.geometry import to_frame

SHARE, SLACK = 0.06, 0.2  # of the length, and [m]: so near to an end a detection is one of that end
HITS = 3  # detections that an end must have had


class Ends:
    """Detections of the front and of the rear of each object over a run; call it once a frame."""

    def __init__(self) -> None:
        self._hits: dict[int, NDArray] = defaultdict(lambda: np.zeros(2, int))

    def step(self, objects: Objects, origin: Origin, xy: NDArray) -> NDArray:
        """Number (N,) of ends of each object, 0 to 2, that were hit by now; detections xy (M, 2) [m] of this scan."""
        real = np.flatnonzero(origin.object >= 0)
        owner = origin.object[real]
        along = to_frame(objects.pose[owner], xy[real][:, None])[:, 0, 0]
        inner = (0.5 - SHARE) * objects.size[owner, 0] - SLACK
        for end, near in enumerate((along > inner, along < -inner)):
            for n in owner[near].tolist():
                self._hits[int(objects.id[n])][end] += 1
        return np.array([(self._hits[i] >= HITS).sum() for i in objects.id.tolist()], int)  # (MET.24)
