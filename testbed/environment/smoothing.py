"""Smoothed tracks for the log: states are kept while a run goes on, and smoothed over all its detections at the end.

Learning does not need them: the sampler, the real extract and the logs of runs have the true boxes of their detections.
For recordings without truth, `trackers.smoother.smooth` gives the pose and size of each detection's vehicle, which
`learn-htg` reads from an .npz file.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from testbed.log.record import SmoothedTrack, SmoothedTracks
from trackers.batch import concatenate, take
from trackers.multi.smoothing import may_be_smoothed, smooth_track
from trackers.multi.tracker import MultiObjectTracker
from trackers.multi.tracks import Tracks

FRAMES = 1000  # kept at most, some 10 to 100 MB in dense traffic; a longer run is smoothed in pieces
DECIMALS = 9  # of a time step [s]; equal steps stay equal despite rounding


class StateHistory:
    """States of the reported tracks of one tracker, frame by frame."""

    def __init__(self, tracker: MultiObjectTracker) -> None:
        self.tracker = tracker
        self._steps: list[int] = []
        self._times: list[float] = []
        self._kept: list[tuple[NDArray, Any]] = []  # ids and states of each frame

    @property
    def full(self) -> bool:
        """Whether `FRAMES` frames are kept, which have to be smoothed now."""
        return len(self._steps) >= FRAMES

    def keep(self, step: int, time: float, tracks: Tracks) -> None:
        """Keep one frame at time [s]; states are never changed in place, so they are not copied."""
        self._steps.append(step)
        self._times.append(time)
        reported = tracks.reported
        self._kept.append((reported.id, reported.state))

    def smoothed(self) -> SmoothedTracks:
        """The smoothed tracks over the frames kept so far; these are dropped."""
        step, time, kept = np.array(self._steps, int), np.array(self._times, float), self._kept
        self._steps, self._times, self._kept = [], [], []
        if not kept or not may_be_smoothed(self.tracker):
            return SmoothedTracks(step, time, ())
        frame = np.repeat(np.arange(len(kept)), [len(ids) for ids, _ in kept])
        number, states = np.concatenate([ids for ids, _ in kept]), concatenate([state for _, state in kept])
        rows = [np.flatnonzero(number == i) for i in np.unique(number)]
        tracks, failed = [], []
        for r in rows:
            try:
                tracks.append(self._one(int(number[r[0]]), frame[r], time, take(states, r)))
            except (np.linalg.LinAlgError, ValueError):  # it diverged, or its filter refuses the state
                failed.append(int(number[r[0]]))
        return SmoothedTracks(step, time, tuple(tracks), tuple(failed))

    def _one(self, number: int, frame: NDArray, time: NDArray, states: tuple) -> SmoothedTrack:
        dt = np.round(np.diff(time[frame]), DECIMALS)
        estimate = self.tracker.filter.estimate(smooth_track(self.tracker, states, dt))
        return SmoothedTrack(number, frame, estimate.pose, estimate.size)
