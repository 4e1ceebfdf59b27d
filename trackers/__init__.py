"""Extended object trackers; numpy and scipy only. What is named here is loaded when it is first used."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trackers.estimate import Estimate as Estimate
    from trackers.estimate import prior as prior
    from trackers.filter import Filter as Filter
    from trackers.multi.tracker import MultiObjectTracker as MultiObjectTracker
    from trackers.multi.tracks import Event as Event
    from trackers.multi.tracks import StepInfo as StepInfo
    from trackers.multi.tracks import Tracks as Tracks
    from trackers.random_matrix.feldmann import RandomMatrix as RandomMatrix
    from trackers.registry import TRACKERS as TRACKERS
    from trackers.registry import build as build
    from trackers.registry import find as find
    from trackers.scan import Scan as Scan
    from trackers.scan import SensorModel as SensorModel

DEFAULT = "imm-spline"  # the tracker of commands and environments where none is named
__distribution__ = "eot-testbed"  # `testbed` tells by this line that no other package of this name took its place

_HOME = {
    "TRACKERS": "trackers.registry",
    "Estimate": "trackers.estimate",
    "Event": "trackers.multi.tracks",
    "Filter": "trackers.filter",
    "MultiObjectTracker": "trackers.multi.tracker",
    "RandomMatrix": "trackers.random_matrix.feldmann",
    "Scan": "trackers.scan",
    "SensorModel": "trackers.scan",
    "StepInfo": "trackers.multi.tracks",
    "Tracks": "trackers.multi.tracks",
    "build": "trackers.registry",
    "find": "trackers.registry",
    "prior": "trackers.estimate",
}

__all__ = ["DEFAULT", *_HOME]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'trackers' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
