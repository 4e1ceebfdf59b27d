"""What a multi-object tracker carries from step to step, and what it tells about a step."""

from typing import Any, NamedTuple

from numpy.typing import NDArray

from trackers.batch import take
from trackers.estimate import Estimate

REPORT_ABOVE = 0.5  # existence probability above which a track is output, card multi_object step 13


class Event(NamedTuple):
    """One decision of the tracker, in words and in numbers."""

    kind: str  # born, confirmed, merged, died, or what a filter has to tell
    track: int  # id of the track it is about
    reason: str  # one readable clause
    contours: NDArray | None = None  # (2, C, 2) [m] outlines on the body's axes, before and after a change


class Tracks(NamedTuple):
    """T tracks as one batch."""

    id: NDArray  # (T,) int, never reused
    existence: NDArray  # (T,) probability
    hits: NDArray  # (T,) int, scans with a detection
    age: NDArray  # (T,) [s] since birth
    confirmed: NDArray  # (T,) bool, was reported at least once
    state: Any  # the filter's state, leading axis T
    estimate: Estimate  # leading axis T
    next_id: int = 0

    @property
    def reported(self) -> "Tracks":
        """The tracks that a user should see: existence above one half."""
        return self.rows(self.existence > REPORT_ABOVE)

    def rows(self, index: NDArray) -> "Tracks":
        """Some of the tracks; ids keep counting."""
        return take(self._replace(next_id=None), index)._replace(next_id=self.next_id)  # type: ignore[arg-type]

    def __str__(self) -> str:
        return f"{len(self.id)} tracks, {int((self.existence > REPORT_ABOVE).sum())} reported"


class StepInfo(NamedTuple):
    """What one step decided; rows of tracks are those after prediction, before births and deaths."""

    owner: NDArray  # (M,) id of the track that took each detection, -1 for none
    track: NDArray  # (T,) ids of the predicted tracks
    expected: NDArray  # (T,) expected detections, predicted occlusion included
    in_view: NDArray  # (T,) bool, inside some field of view
    detections: NDArray  # (T,) how many detections the track took
    log_ratio: NDArray  # (T,) log likelihood ratio of the existence update
    nis: NDArray  # (T,) normalised innovation squared of the centroid, NaN without detection
    events: tuple[Event, ...]
    mode: NDArray | None = None  # (T, K) probabilities of the motion models, where the filter mixes some
