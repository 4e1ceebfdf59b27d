"""Smoothing of one track of the multi-object tracker over all its scans: docs/methods/smoothing.md."""

from dataclasses import replace
from typing import Any, TypeVar

from numpy.typing import ArrayLike

from trackers.composed import Composed
from trackers.filter import SMOOTHED, Abilities
from trackers.multi.tracker import MultiObjectTracker
from trackers.smoother import smooth_stacked

T = TypeVar("T", bound=tuple)


def may_be_smoothed(tracker: MultiObjectTracker) -> bool:
    """Whether the tracker's filter, without its size posterior if it has one, can be smoothed."""
    return Abilities.of(_moving(tracker.filter)).has(*SMOOTHED)


def smooth_track(tracker: MultiObjectTracker, states: T, dt: ArrayLike) -> T:
    """Smooth the K states of one track, stacked along the first axis in the order of time, dt (K - 1,) [s] apart.

    Sizes of a size posterior are what they were at each instant.

    Raises:
        TypeError: the filter cannot be smoothed.

    """
    filter, moving, some = tracker.filter, _moving(tracker.filter), states  # type: Any, Any, Any
    if filter is moving:
        return smooth_stacked(filter, states, dt)
    if isinstance(moving, Composed):
        return smooth_stacked(moving, some._replace(size=None), dt)._replace(size=some.size)
    return some._replace(place=smooth_stacked(moving, some.place, dt))


def _moving(filter: Any) -> Any:
    """The filter without its size posterior."""
    if not isinstance(filter, Composed) or filter.size is None:
        return filter
    return filter.place if filter.motion is None else replace(filter, size=None)
