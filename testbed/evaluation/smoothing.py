"""What the trackers thought, kept until a run has ended and the smoother says what they would have thought then.

Reviewers see it beside the tracks. Learning does not need it: the sampler, the real extract and the logs of runs know
the true boxes of their detections. For recordings without them `trackers.smoother.smooth` gives the pose and size of
each detection's vehicle, which `learn-htg` takes as an .npz of one's own.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from testbed.log.record import SmoothedTrack, SmoothedTracks
from trackers.batch import concatenate, take
from trackers.gaussian_part import has_gaussian
from trackers.multi.smoothing import smooth_track
from trackers.multi.tracker import MultiObjectTracker
from trackers.multi.tracks import Tracks

LOOKS = 1000  # kept at most, some 10 to 100 MB in dense traffic; a longer run is smoothed in pieces
TICK = 9  # decimals of a time [s]: differences of times that mean the same shall be the same


class Memory:
    """States of the reported tracks of one tracker, look by look."""

    def __init__(self, tracker: MultiObjectTracker) -> None:
        self.tracker = tracker
        self._steps: list[int] = []
        self._times: list[float] = []
        self._kept: list[tuple[NDArray, Any]] = []  # ids and states of each look

    @property
    def full(self) -> bool:
        """Whether it is time to smooth what is kept."""
        return len(self._steps) >= LOOKS

    def keep(self, step: int, time: float, tracks: Tracks) -> None:
        """Take in one look at time [s]; states are never changed in place, so they are not copied."""
        self._steps.append(step)
        self._times.append(time)
        reported = tracks.reported
        self._kept.append((reported.id, reported.state))

    def smoothed(self) -> SmoothedTracks:
        """The tracks over the looks that were kept, which are forgotten."""
        step, time, kept = np.array(self._steps, int), np.array(self._times, float), self._kept
        self._steps, self._times, self._kept = [], [], []
        if not kept or not has_gaussian(kept[0][1]):
            return SmoothedTracks(step, time, ())
        look = np.repeat(np.arange(len(kept)), [len(ids) for ids, _ in kept])
        number, states = np.concatenate([ids for ids, _ in kept]), concatenate([state for _, state in kept])
        rows = [np.flatnonzero(number == i) for i in np.unique(number)]
        tracks, failed = [], []
        for r in rows:
            try:
                tracks.append(self._one(int(number[r[0]]), look[r], time, take(states, r)))
            except np.linalg.LinAlgError:  # of a filter that lost its way; the run and its log are none the worse
                failed.append(int(number[r[0]]))
        return SmoothedTracks(step, time, tuple(tracks), tuple(failed))

    def _one(self, number: int, look: NDArray, time: NDArray, states: tuple) -> SmoothedTrack:
        dt = np.round(np.diff(time[look]), TICK)
        estimate = self.tracker.filter.estimate(smooth_track(self.tracker, states, dt))
        return SmoothedTrack(number, look, estimate.pose, estimate.size)
