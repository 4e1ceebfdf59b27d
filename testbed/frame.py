"""One simulated frame with a scan: the record that observers, the log, replays and studies get."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from numpy.typing import NDArray

from sensors.origin import Origin
from sensors.scene import Scene
from trackers.multi.tracks import StepInfo, Tracks
from trackers.scan import Scan

TRUTH = "truth"  # name of the tracker whose tracks are the scene itself


class Frame(NamedTuple):
    """What was there, what the radar measured, and what every tracker made of it.

    Nothing in it is changed later, so an observer may keep it without a copy.
    """

    step: int  # simulated frames since the reset
    scene: Scene  # the truth; its `dt` is the time since the scan before
    scan: Scan
    origin: Origin  # of each detection; for metrics and logs only
    outputs: Mapping[str, tuple[Tracks, StepInfo]]  # by name of the tracker; the planner uses the first
    action: str  # the planner's last choice in words, "reset" before the first
    plan: NDArray  # (P, 2) [m] where the planner means to go, world frame

    @property
    def time(self) -> float:
        """Simulated time [s] since the reset."""
        return self.scene.time


class FrameScore(NamedTuple):
    """The tracks of one tracker at one frame, compared with the truth."""

    pairs: dict[int, int]  # object id -> id of the track assigned to it, uncounted objects included
    errors: dict[int, dict[str, float]]  # object id -> name of the error -> value, for every pair
    mean: dict[str, float]  # GOSPA and its parts, numbers of objects and tracks, mean magnitudes over counted pairs
    counted: tuple[int, ...] = ()  # ids of the objects that count at this frame


Observer = Callable[[Frame], Any]
