"""Extended object trackers; numpy and scipy only."""

from trackers.estimate import Estimate, prior
from trackers.multi.tracker import MultiObjectTracker
from trackers.multi.tracks import Event, StepInfo, Tracks
from trackers.protocols import Filter
from trackers.random_matrix.feldmann import RandomMatrix
from trackers.registry import DEFAULT, TRACKERS, build, find
from trackers.scan import Scan, SensorModel

__distribution__ = "eot-testbed"  # `testbed` tells by this line that no other package of this name took its place

__all__ = [
    "DEFAULT",
    "TRACKERS",
    "Estimate",
    "Event",
    "Filter",
    "MultiObjectTracker",
    "RandomMatrix",
    "Scan",
    "SensorModel",
    "StepInfo",
    "Tracks",
    "build",
    "find",
    "prior",
]
