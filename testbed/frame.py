"""What one simulated frame hands to everybody who watches a run."""

from collections.abc import Callable, Mapping
from typing import Any

from numpy.typing import NDArray

from sensors.origin import Origin
from sensors.scene import Scene
from trackers.multi.tracks import StepInfo, Tracks
from trackers.scan import Scan

TRUTH = "truth"  # name of the tracker whose tracks are the scene itself

Outputs = Mapping[str, tuple[Tracks, StepInfo]]
Observer = Callable[[int, float, Scene, Scan, Origin, Outputs, str, NDArray], Any]
