"""Why something went wrong over some scans, as far as the truth, the detections and the tracks say it.

The first cause that fits is named, in the order of `CAUSES`: what the radar could not see comes before what the tracker
made of it.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from testbed.evaluation.snapshots import GHOST, NOTHING, Snapshot, hiding
from trackers.geometry import to_frame

CAUSES = (
    "hidden", "out of view", "merged", "too wrong", "few detections", "one end seen", "new track", "maneuver",
    "track ended", "ghost", "clutter", "fragment", "coasting", "unknown",
)  # fmt: skip
HALF = 0.5  # visible share below which an object is hidden; share of detections that decides
FEW = 2.0  # detections a scan below which there are few
SHARED = 0.2  # share of a track's detections that come from another object
SOON = 2.0  # [s] for which a track is new
CHANGING = 1.5  # [m/s^2] acceleration of a maneuver
ENDS_SEEN = 2

Reason = tuple[str, str]  # cause, words


class Episode(NamedTuple):
    """Some scans of one object and one tracker, in the order of time."""

    tracker: str
    object: int | None  # None for a track without an object
    frames: Sequence[Snapshot]
    on: Sequence[Mapping[int, int]]  # track -> object that it was assigned to, at each scan

    @property
    def key(self) -> int:
        """The object, which must be there."""
        assert self.object is not None
        return self.object

    def column(self, name: str) -> list[Any]:
        """A column of the snapshots for the object, scan by scan."""
        return [getattr(frame, name)[frame.row[self.key]] for frame in self.frames]

    def owned(self) -> Iterator[tuple[Mapping[int, int], int, int, int]]:
        """For each scan and track that got detections: `on`, the track, their source, their number."""
        for frame, on in zip(self.frames, self.on, strict=True):
            for track, source, count in frame.outputs[self.tracker].owned.tolist():
                yield on, track, source, count

    def sources(self, track: int) -> Counter[int]:
        """Number of detections of a track by source."""
        found: Counter[int] = Counter()
        for _, owner, source, count in self.owned():
            found[source] += count if owner == track else 0
        return found


def vehicle(key: int) -> str:
    """Name of an object in texts and in the paths of the log."""
    return f"veh_{key:02d}"


def why_missing(episode: Episode, before: int | None) -> Reason:
    """Why an object has no track; `before` is the track that it had, None before the first."""
    return (
        _unseen(episode)
        or _merged(episode)
        or _covered(episode)
        or _spanned(episode)
        or _few(episode)
        or _ended(episode, before)
        or _in_view(episode)
    )


def why_wrong(episode: Episode, what: str, track: int, age: float) -> Reason:
    """Why the track of an object is wrong in one of `moments.PARTS`; it had held it for `age` [s] at the end."""
    found = _unseen(episode) or _shared(episode, track)
    if found is None and what in ("size", "position"):
        found = _one_end(episode)
    if found is None and age < SOON:
        found = "new track", f"the track has it for {age:.1f} s only"
    found = found or _few(episode)
    if found is None and what != "size":
        found = _maneuver(episode)
    return found or _in_view(episode)


def why_switch(episode: Episode, before: int, after: int) -> Reason:
    """Why another track follows at once; the last scan of the episode is the first of track `after`."""
    earlier = episode.frames[:-1]
    if earlier and after in earlier[-1].outputs[episode.tracker].id:
        return "fragment", f"track {after} was a second track beside it"
    return _unseen(episode) or _ended(episode, before) or _few(episode) or _in_view(episode)


def why_false(episode: Episode, track: int, new: bool) -> tuple[str, str, int | None]:
    """Why a track is on no vehicle, and the object that its detections came from.

    A tracker does not say which detections a track was born of; `new`: the episode begins with its birth.
    """
    sources = episode.sources(track)
    total = sources.total()
    if not total and new:
        return "new track", "just born, too far off any vehicle to be its track", None
    if not total:
        return "coasting", "it has no detections", None
    if sources[GHOST] + sources[NOTHING] > HALF * total:
        if sources[GHOST] > sources[NOTHING]:
            return "ghost", "its detections are mirror images and double bounces", None
        return "clutter", "its detections are clutter and standing returns", None
    key = max((i for i in sources if i >= 0), key=lambda i: sources[i])
    held = sum(key in on.values() for on in episode.on)
    if 2 * held > len(episode.on):
        return "fragment", f"a second track of {vehicle(key)}", key
    return "too wrong", f"on {vehicle(key)}, but too far off to be its track", key


def _mean(episode: Episode, column: str) -> float:
    """Mean over the scans of a column of the snapshots, for the object of the episode."""
    return float(np.mean(episode.column(column)))


def _unseen(episode: Episode) -> Reason | None:
    """Hidden by something for most of the time, or in no field of view."""
    visible = _mean(episode, "visible")
    if visible >= HALF:
        return None
    covers = Counter(hiding(f, episode.key)[0] for f in episode.frames)
    covers.pop(NOTHING, None)
    if covers:
        return "hidden", f"hidden by {vehicle(covers.most_common(1)[0][0])}, {100 * visible:.0f} % visible"
    if _mean(episode, "expected") < FEW / 2:
        return "out of view", "out of the field of view"
    return "hidden", f"{100 * visible:.0f} % visible"


def _merged(episode: Episode) -> Reason | None:
    """Most of the object's detections went to the track of another."""
    total, elsewhere = sum(map(int, episode.column("detections"))), Counter[int]()
    for on, track, source, count in episode.owned():
        if source == episode.object and on.get(track, source) != source:
            elsewhere[on[track]] += count
    if not elsewhere or elsewhere.total() <= HALF * total:
        return None
    other = elsewhere.most_common(1)[0][0]
    return "merged", f"merged with {vehicle(other)}, whose track has {elsewhere.total()} of its {total} detections"


def _covered(episode: Episode) -> Reason | None:
    """A track with its centre on the object, too wrong to be assigned."""
    there: Counter[int] = Counter()
    for frame, on in zip(episode.frames, episode.on, strict=True):
        row, output = frame.row[episode.key], frame.outputs[episode.tracker]
        local = to_frame(frame.objects.pose[row], output.pose[:, :2])
        inside = (np.abs(local) <= frame.objects.size[row] / 2).all(-1)
        there.update(track for track in output.id[inside].tolist() if track not in on)
    if not there or there.most_common(1)[0][1] <= HALF * len(episode.frames):
        return None
    return "too wrong", f"track {there.most_common(1)[0][0]} lies on it, too wrong in size or place to be its track"


def _spanned(episode: Episode) -> Reason | None:
    """A track of no object has most of the object's detections, perhaps with those of another."""
    total, held = sum(map(int, episode.column("detections"))), Counter[tuple[int, int]]()  # held: track, source
    for on, track, source, count in episode.owned():
        held[track, source] += count if track not in on else 0
    track, most = max(((t, n) for (t, i), n in held.items() if i == episode.object), key=lambda p: p[1], default=(0, 0))
    if most <= HALF * total:
        return None
    others = {i: n for (t, i), n in held.items() if t == track and i >= 0 and i != episode.object}
    if others and sum(others.values()) > SHARED * (most + sum(others.values())):
        other = vehicle(max(others, key=lambda i: others[i]))
        return "merged", f"merged with {other}: track {track} has detections of both, and is too wrong for either"
    words = f"track {track} has {most} of its {total} detections, too wrong in size or place to be its track"
    return "too wrong", words


def _few(episode: Episode) -> Reason | None:
    got = _mean(episode, "detections")
    return ("few detections", f"{got:.1f} detections a scan") if got < FEW else None


def _ended(episode: Episode, before: int | None) -> Reason | None:
    """The tracker gave the track up."""
    for frame in episode.frames:
        for track, reason in frame.outputs[episode.tracker].deaths:
            if track == before:
                return "track ended", f"track {track} ended: {reason}"
    return None


def _in_view(episode: Episode) -> Reason:
    return "unknown", f"in view, {_mean(episode, 'detections'):.0f} detections a scan"


def _shared(episode: Episode, track: int) -> Reason | None:
    """The track has detections of something else."""
    sources = episode.sources(track)
    total = sources.total()
    others = {i: n for i, n in sources.items() if i != episode.object}
    if not others or sum(others.values()) <= SHARED * total:
        return None
    most = max(others, key=lambda i: others[i])
    if most >= 0:
        return "merged", f"merged with {vehicle(most)}: {others[most]} of the track's {total} detections are its"
    words = "ghosts" if most == GHOST else "clutter and standing returns"
    return ("ghost" if most == GHOST else "clutter"), f"{others[most]} of the track's {total} detections are {words}"


def _one_end(episode: Episode) -> Reason | None:
    """The radar has hit one end only for most of the time, or none."""
    ends = episode.column("ends")
    if np.median(ends) >= ENDS_SEEN:
        return None
    return "one end seen", "the radar has hit one end only" if max(ends) else "the radar has hit neither end"


def _maneuver(episode: Episode) -> Reason | None:
    """The object itself changes its velocity over the episode faster than tracks follow."""
    time = np.array([f.time for f in episode.frames])
    velocity = np.array([f.objects.velocity[f.row[episode.key]] for f in episode.frames])
    if len(time) < 2:
        return None
    rate = np.diff(velocity, axis=0) / np.diff(time)[:, None]
    size = np.hypot(rate[:, 0], rate[:, 1])
    at = int(size.argmax())
    if np.median(size) < CHANGING and size[at] < 2 * CHANGING:
        return None
    along = float(rate[at] @ velocity[at]) / max(float(np.hypot(*velocity[at])), 1e-9)
    words = "turns" if abs(along) < 0.7 * size[at] else ("brakes" if along < 0 else "speeds up")
    return "maneuver", f"it {words} with {size[at]:.1f} m/s^2"
