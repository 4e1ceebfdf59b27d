"""The ideal tracker: the truth of every object of which some part was visible within the last seconds.

docs/methods/regret.md, section 2. It is generous: an object is known once any part of it is visible, detected or not.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.origin import Origin
from sensors.scene import Scene
from testbed.environment.perception import truth_info, truth_tracks
from trackers.multi.road import RoadMap
from trackers.multi.tracks import StepInfo, Tracks
from trackers.scan import Scan

ROUNDING = 1e-9  # [s] of times that are sums of frames


class LastSeen(NamedTuple):
    """When each of N objects was visible the last time."""

    id: NDArray  # (N,) int
    time: NDArray  # (N,) [s]


@dataclass(frozen=True)
class InView:
    """Tracks without error of all objects that were visible within the last `hold` seconds; ids are those of the scene.

    Source of tracks for `testbed.environment.perception.Perception`.
    """

    hold: float = 2.0  # [s]

    def start_on(self, road: RoadMap) -> LastSeen:
        """Nothing was seen yet; the road is not used."""
        return LastSeen(np.zeros(0, int), np.zeros(0))

    def step_on_truth(
        self, state: LastSeen, scan: Scan, scene: Scene, origin: Origin
    ) -> tuple[LastSeen, Tracks, StepInfo]:
        """The tracks of a scene; `origin.visible` says what is visible, the scan is not used."""
        known = dict(zip(state.id.tolist(), state.time.tolist(), strict=True))
        ids = scene.objects.id
        known |= dict.fromkeys(ids[origin.visible > 0].tolist(), scene.time)
        state = LastSeen(np.array(list(known), int), np.array(list(known.values()), float))
        last = np.array([known.get(i, -np.inf) for i in ids.tolist()])
        held = scene.time - last <= self.hold + ROUNDING  # (RGT.1)
        return state, truth_tracks(scene).rows(held), truth_info(scene, origin)
