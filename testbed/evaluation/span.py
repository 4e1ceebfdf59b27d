"""What metrics of scans, runs and phases are computed from: one judged scan, a stretch of the histories of a run."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

from numpy.typing import NDArray

from testbed.evaluation.histories import History, first_counted
from testbed.evaluation.identities import Meeting, clear
from testbed.evaluation.metrics import Gospa


class Judged(NamedTuple):
    """N objects and T reported tracks of one scan, and which belong together."""

    gospa: Gospa
    counted: NDArray  # (N,) bool
    holder: NDArray  # (N,) id of the track of each object, -1 for none
    track: NDArray  # (T,) ids of the tracks


class TrackPast(NamedTuple):
    """What became of one reported track in the whole run."""

    orphan: bool  # it never belonged to an object
    duration: float  # [s] from its first report to its last
    real: int  # detections that came from objects
    nothing: int  # detections that came from none
    ghosts: int  # of these, ghosts

    @property
    def empty(self) -> bool:
        """Whether most of its detections came from no object."""
        return self.nothing > self.real

    @property
    def ghostly(self) -> bool:
        """Whether most of those were ghosts."""
        return 2 * self.ghosts > self.nothing


class Span:
    """The scans of a run, or of a phase of it, from `start` up to `end` [s].

    Scans and errors are those that count after settling; objects and tracks those of the whole span.
    """

    def __init__(
        self,
        start: float,
        end: float,
        scans: Mapping[str, NDArray],
        errors: Mapping[str, NDArray],
        histories: Sequence[History],
        tracks: Sequence[TrackPast],
        jumps: NDArray,
        meetings: Sequence[Meeting],
    ) -> None:
        self.start, self.end = start, end
        self.scans = scans  # metric of a scan -> values (F,)
        self.errors = errors  # metric of a pair -> values (K,)
        self.objects = [(h, (start <= h.time) & (h.time < end)) for h in histories]  # with the mask (F,) of its scans
        self.tracks = tracks  # that were reported in the span
        self.jumps = jumps  # times [s] at which a track changed its object
        self.meetings = meetings  # objects and tracks of each scan

    def within(self, times: NDArray) -> int:
        """How many of some times [s] lie in the span."""
        return int(((self.start <= times) & (times < self.end)).sum())

    @cached_property
    def counted(self) -> list[History]:
        """The objects that counted at some scan."""
        return [h for h, now in self.objects if (h.counted & now).any()]

    @cached_property
    def clear(self) -> dict[str, float]:
        """`mota` and `idf1`, which have their matching in common."""
        return clear(self.meetings)

    @property
    def first_seen(self) -> list[History]:
        """The objects that counted for the first time in the span."""
        return [h for h, _ in self.objects if self.start <= first_counted(h) < self.end]

    def objects_at(self, which: Sequence[NDArray]) -> int:
        """How many scans of objects lie in the span and under masks (F,), one for each object."""
        return sum(int((mask & now).sum()) for mask, (_, now) in zip(which, self.objects, strict=True))
