"""The state of the multi-object tracker, and its report about one step.

Life cycle of a track: docs/methods/multi-object-tracking.md, section 10.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.batch import concatenate, take
from trackers.estimate import Estimate
from trackers.geometry import dot, perpendicular, unit
from trackers.multi.association import SortedScan
from trackers.multi.beside import NOTHING as NO_DETECTIONS
from trackers.multi.beside import Taken
from trackers.multi.ground import NOTHING, Ground
from trackers.multi.reidentification import LostTracks
from trackers.multi.visibility import Visibility
from trackers.multi.way import Way
from trackers.multi.window import EMPTY, Unexplained

NO_TRACK = -1  # id in an event about a scan
BEHIND, BEFORE = 0, 1  # where there is empty ground at a track
REPORT_ABOVE = 0.5  # existence probability above which a track is output, (MOT.48)
HIDDEN, ASIDE = 0.25, 0.9  # [s] unseen, and [m] of lateral std beside noise, beyond both of which it is not, (MOT.48)


class Event(NamedTuple):
    """One decision about one track, or about a scan."""

    kind: str  # born, confirmed, merged, divided, cut, died, returned, or of a `Note`; of a scan: implausible, crowded
    track: int  # id; NO_TRACK of a scan
    reason: str  # one readable clause
    contours: NDArray | None = None  # (2, C, 2) [m] outlines on the body's axes, before and after a change


class Memory(NamedTuple):
    """What is known beside the tracks; it has no axis T."""

    time: float = 0.0  # [s] since the first scan
    way: Way | None = None  # that of the ego and of the tracks; None: before the first scan, or there is a map
    unexplained: Unexplained = EMPTY  # unexplained detections of the last scans
    out: NDArray | None = None  # (S,) probability that a sensor delivered nothing in the last scan; None before it
    lost: LostTracks | None = None  # confirmed tracks that died; None before the first
    ground: Ground = NOTHING  # what was seen along the long tracks
    taken: Taken = NO_DETECTIONS  # what these took far away
    divided: NDArray = np.zeros((0, 2), int)  # (A, 2) ids of tracks, and at which end there is empty ground
    classes: tuple[str, ...] | None = None  # names of the columns of `Estimate.class_probability`; None: not known


class Tracks(NamedTuple):
    """T tracks as one batch."""

    id: NDArray  # (T,) int, used again only when the vehicle of a dead track returns
    existence: NDArray  # (T,) probability
    hits: NDArray  # (T,) int, scans with a detection
    age: NDArray  # (T,) [s] since birth
    confirmed: NDArray  # (T,) bool, was reported at least once
    state: Any  # the filter's state, leading axis T
    estimate: Estimate  # leading axis T
    next_id: int = 0
    memory: Memory = Memory()
    hidden: NDArray | None = None  # (T,) [s] unseen by all sensors since its last detection; None: not known
    noise: NDArray | None = None  # (T,) [m^2] least across the line of sight, of its last detections; None: not known

    @property
    def divided(self) -> NDArray:
        """Whether there is empty ground behind and before each track, bool (T, 2)."""
        id, end = self.memory.divided.T
        return np.asarray(((self.id[:, None] == id)[..., None] & (end[:, None] == [BEHIND, BEFORE])).any(1))

    @property
    def reported(self) -> "Tracks":
        """The tracks that are output: existence above one half, and a lane to be in."""
        return self.rows((self.existence > REPORT_ABOVE) & ~self.astray)  # (MOT.48)

    @property
    def astray(self) -> NDArray:
        """Mask (T,) of tracks unseen for a while, of which it is not known in which lane they are."""
        if self.hidden is None or self.noise is None:
            return np.zeros(len(self.id), bool)
        n = perpendicular(unit(self.estimate.pose[:, 2]))
        var = dot(n, (self.estimate.cov[:, :2, :2] @ n[..., None])[..., 0])
        return (self.hidden > HIDDEN) & (var > ASIDE**2 + self.noise)  # (MOT.48)

    def rows(self, index: NDArray) -> "Tracks":
        """The tracks at index, (T,) bool or rows; `next_id` and `memory` stay. All of them are these tracks."""
        if index.dtype == bool:
            if index.all():
                return self
            index = np.flatnonzero(index)
        rows = take(self._replace(next_id=None, memory=None), index)  # type: ignore[arg-type]
        return rows._replace(next_id=self.next_id, memory=self.memory)

    def and_born(self, born: "Tracks") -> "Tracks":
        """These tracks and then those born, whose `next_id` and memory stay."""
        mine, theirs = (t._replace(next_id=None, memory=None) for t in (self, born))  # type: ignore[arg-type]
        return concatenate([mine, theirs])._replace(next_id=born.next_id, memory=born.memory)

    def __str__(self) -> str:
        return f"{len(self.id)} tracks, {int((self.existence > REPORT_ABOVE).sum())} reported"


class StepInfo(NamedTuple):
    """What one step decided about T tracks: those of the step before, without births, merging and deaths."""

    owner: NDArray  # (M,) id of the track that owns each detection, -1 for none
    track: NDArray  # (T,) ids of the predicted tracks
    expected: NDArray  # (T,) expected detections of what is certain to be in view, occlusion included
    in_view: NDArray  # (T,) bool, inside some field of view
    detections: NDArray  # (T,) number of detections that the track owns
    log_ratio: NDArray  # (T,) log likelihood ratio of the existence update
    nis: NDArray  # (T,) normalised innovation squared of the centroid, NaN without detection
    events: tuple[Event, ...]
    mode: NDArray | None = None  # (T, K) probabilities of the motion models, where the filter mixes some
    implausible: int = 0  # detections of the scan beyond what radars measure, masked before anything else


class Seen(NamedTuple):
    """A step before the update of its tracks."""

    tracks: Tracks  # predicted, with the existence before the detections
    z: SortedScan
    order: NDArray  # (M,) the rows of the sorted detections in the scan
    owner: NDArray  # (M,) rows of the tracks that own the sorted detections, -1 for none
    view: Visibility
    info: StepInfo


class Rest(NamedTuple):
    """A step after the update of its tracks: what is left of the scan, and which rare things happen."""

    existence: NDArray  # (T,)
    candidate: NDArray  # (M,) bool, detections that may start a track
    window: Unexplained  # of the next step, where no cell is born
    calm: bool  # no cell is born
    dies: bool  # a track dies
    apart: bool  # no two tracks are one vehicle
    long: bool  # a track may be two vehicles
