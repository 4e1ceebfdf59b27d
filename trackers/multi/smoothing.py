"""Smoothing of one track of the multi-object tracker over all its scans: docs/methods/smoothing.md."""

from typing import Any, TypeVar

from numpy.typing import ArrayLike

from trackers.filter import Smoothable
from trackers.multi.tracker import MultiObjectTracker
from trackers.size.ends import Ends
from trackers.smoother import smooth_stacked

T = TypeVar("T", bound=tuple)


def may_be_smoothed(tracker: MultiObjectTracker) -> bool:
    """Whether the tracker's filter is `Smoothable`, under the layer of sizes if there is one."""
    return isinstance(_moving(tracker), Smoothable)


def smooth_track(tracker: MultiObjectTracker, states: T, dt: ArrayLike) -> T:
    """Smooth the K states of one track, stacked along the first axis in the order of time, dt (K - 1,) [s] apart.

    Sizes of `Ends` are what they were at each instant.

    Raises:
        TypeError: the filter is not `Smoothable`.

    """
    if isinstance(tracker.layered, Ends):
        inner: Any = states
        return inner._replace(inner=smooth_stacked(_moving(tracker), inner.inner, dt))
    return smooth_stacked(_moving(tracker), states, dt)


def _moving(tracker: MultiObjectTracker) -> Any:
    return tracker.layered.filter if isinstance(tracker.layered, Ends) else tracker.layered
