"""Smoothing of one track of the multi-object tracker over all its scans: docs/methods/smoothing.md."""

from typing import Any, TypeVar

from numpy.typing import ArrayLike

from trackers.multi.tracker import MultiObjectTracker
from trackers.protocols import Resizable
from trackers.smoother import smooth_stacked

T = TypeVar("T", bound=tuple)


def smooth_track(tracker: MultiObjectTracker, states: T, dt: ArrayLike) -> T:
    """Smooth the K states of one track, stacked along the first axis in the order of time, dt (K - 1,) [s] apart.

    Raises:
        TypeError: the tracker's filter, with its layers, is not `Smoothable`.

    """

    def with_size_prior(state: Any, dt: float) -> Any:
        """The prediction with the size prior, as `MultiObjectTracker.step` has it before the update, (MOT.7)."""
        filter = tracker.layered
        estimate = filter.estimate(state)
        size, size_std = tracker.sizes.relax(estimate.size, estimate.size_std, dt)
        if isinstance(filter, Resizable):
            return filter.resize(state, size, size_std)
        return filter.init(estimate._replace(size=size, size_std=size_std, contour=None))

    return smooth_stacked(tracker.layered, states, dt, with_size_prior)
