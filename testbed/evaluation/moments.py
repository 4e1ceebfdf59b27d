"""The worst moments of a run: when, which object, what happened, and why as far as that can be known.

Worked out after the run from the histories of the `Evaluator` and the kept `Snapshots`. Severity is defined in
docs/methods/metrics.md, "Worst moments".
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from testbed.evaluation.histories import LOST_AFTER, TIME_ROUNDING, History
from testbed.evaluation.metrics import CUTOFF
from testbed.evaluation.reasons import Episode, why_false, why_missing, why_switch, why_wrong
from testbed.evaluation.snapshots import Snapshot, Snapshots
from testbed.evaluation.tracking import Evaluator
from trackers.geometry import wrap_angle

WORST = 10  # moments in the list
MISSING = CUTOFF**2 / 2  # [m^2] price of an object without a track, and of a track without an object, as in GOSPA
AHEAD = 1.0  # [s] that a planner predicts: an error of the velocity counts as the error of place after it
NEAR = 30.0  # [m] an error at this distance from the ego counts half
NOTABLE = 1.0  # [m^2] price above which a track is wrong
JOINED = 0.5  # [s] wrong periods with less between them are one
PARTS = ("position", "size", "heading", "velocity")
WHATS = (*PARTS, "late birth", "never tracked", "gap", "lost", "switch", "false track", "ghost")


class Moment(NamedTuple):
    """One entry of the list."""

    time: float  # [s] when it was worst
    start: float  # [s]
    end: float  # [s]
    tracker: str
    object: int | None  # None for a track without an object
    kind: str  # class of the object, empty without one
    track: int | None  # None where there was none
    what: str  # one of `WHATS`
    text: str  # what happened
    cause: str  # one of `reasons.CAUSES`
    why: str  # the reason in words
    severity: float  # [m^2 s]


def all_moments(evaluators: Mapping[str, Evaluator], snapshots: Snapshots) -> list[Moment]:
    """Every moment of every tracker, that of greatest severity first; evaluators and snapshots are of the same run."""
    found = [moment for name, evaluator in evaluators.items() for moment in moments(name, evaluator, snapshots)]
    return sorted(found, key=lambda m: (-m.severity, m.time, m.tracker, m.object or 0))


def severity_of(found: Sequence[Moment], tracker: str, key: int) -> float:
    """Severity [m^2 s] of all moments of one object and tracker."""
    return round(sum(m.severity for m in found if m.tracker == tracker and m.object == key), 3)


def moment_row(moment: Moment) -> dict[str, float | int | str | None]:
    """One moment as JSON types, with times in ms and severity in thousandths."""
    return {key: round(v, 3) if isinstance(v, float) else v for key, v in moment._asdict().items()}


def moments(name: str, evaluator: Evaluator, snapshots: Snapshots) -> list[Moment]:
    """Every moment of one tracker, object by object, then those of false tracks."""
    frames, time = snapshots.frames, snapshots.time
    if not frames:
        return []
    past = evaluator.histories()
    on = _objects_of(past, time)
    found: list[Moment] = []
    for key, history in past.items():
        place = np.searchsorted(time, history.time - TIME_ROUNDING)  # frame of each scan of the history
        story = _Story(name, key, history, place, frames, on)
        found += [*story.missing(), *story.switches(), *story.wrong()]
    return found + list(_false_tracks(name, frames, time, on, _missing(past, time)))


def nearness(frame: Snapshot, place: NDArray) -> float:
    """Weight of an error at a place (2,) [m]: 1 at the ego, one half at `NEAR`."""
    return NEAR / (NEAR + float(np.hypot(*(place - frame.ego[:2]))))  # (MET.31)


def _objects_of(past: Mapping[int, History], time: NDArray) -> list[dict[int, int]]:
    """Track -> object that it was assigned to, at each frame; uncounted objects included."""
    on: list[dict[int, int]] = [{} for _ in time]
    for key, history in past.items():
        held = history.track >= 0
        place = np.searchsorted(time, history.time[held] - TIME_ROUNDING)
        for k, track in zip(place.tolist(), history.track[held].tolist(), strict=True):
            on[k][track] = key
    return on


def _missing(past: Mapping[int, History], time: NDArray) -> list[set[int]]:
    """Objects that count and have no track, at each frame."""
    missing: list[set[int]] = [set() for _ in time]
    for key, history in past.items():
        for k in np.searchsorted(time, history.time[history.counted & (history.track < 0)] - TIME_ROUNDING).tolist():
            missing[k].add(key)
    return missing


def _runs(where: NDArray) -> list[tuple[int, int]]:
    """First and behind last index of each run of true values in (F,)."""
    edge = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in edge.reshape(-1, 2)]


def _joined(runs: Sequence[tuple[int, int]], time: NDArray) -> list[tuple[int, int]]:
    joined: list[tuple[int, int]] = []
    for a, b in runs:
        if joined and time[a] - time[joined[-1][1] - 1] <= JOINED:
            joined[-1] = (joined[-1][0], b)
        else:
            joined.append((a, b))
    return joined


class _Story:
    """One object over the run, as one tracker held it."""

    def __init__(
        self, tracker: str, key: int, history: History, place: NDArray, frames: Sequence[Snapshot], on: list
    ) -> None:
        self.tracker, self.key = tracker, key
        self.history, self.place = history, place
        self.frames, self.on = frames, on
        time = np.append(history.time, history.time[-1])
        self.lasts = np.diff(time)  # [s] that each scan stands for
        self.kind = frames[place[0]].objects.kind[frames[place[0]].row[key]]

    def missing(self) -> Iterator[Moment]:
        """Periods in which the object counted and had no track."""
        history = self.history
        for a, b in _runs(history.counted & (history.track < 0)):
            held = history.track[:a][history.held[:a]]
            before = int(held[-1]) if len(held) else None
            after = int(history.track[b]) if b < len(history.time) and history.track[b] >= 0 else None
            lasts = float(self.lasts[a:b].sum())
            severity = self._severity(np.full(b - a, MISSING), a, b)
            if before is None:
                what = "never tracked" if after is None and not history.held.any() else "late birth"
                text = f"no track for {lasts:.1f} s" + ("" if after is None else f", then track {after}")
            else:
                what = "lost" if lasts >= LOST_AFTER - TIME_ROUNDING else "gap"
                text = f"without a track for {lasts:.1f} s, was track {before}"
                if after is not None and after != before:
                    text += f", then track {after}"
                    severity += self._switch_severity(b)
            cause, why = why_missing(self._episode(a, b), before)
            yield self._moment(a, a, b, before, what, text, cause, why, severity)

    def switches(self) -> Iterator[Moment]:
        """Scans at which another track follows at once."""
        history = self.history
        changed = history.held[1:] & history.held[:-1] & (np.diff(history.track) != 0)
        for k in (np.flatnonzero(changed) + 1).tolist():
            before, after = int(history.track[k - 1]), int(history.track[k])
            first = int(np.searchsorted(history.time, history.time[k] - LOST_AFTER))
            cause, why = why_switch(self._episode(first, k + 1), before, after)
            text = f"track {before} became track {after}"
            yield self._moment(k, k, k + 1, after, "switch", text, cause, why, self._switch_severity(k))

    def wrong(self) -> Iterator[Moment]:
        """Periods in which the object's track was wrong."""
        held = np.flatnonzero(self.history.held)
        if not len(held):
            return
        parts, notes = self._errors(held)
        price = np.zeros(len(self.history.time))
        price[held] = np.minimum(parts.sum(1), MISSING)  # (MET.30)
        spread = np.zeros((len(price), len(PARTS)))
        spread[held] = parts
        for a, b in _joined(_runs(price > NOTABLE), self.history.time):
            worst = a + int(price[a:b].argmax())
            order = np.argsort(-spread[a:b].sum(0), kind="stable")
            at = int(np.searchsorted(held, worst))
            noted = [notes[at][j] for j in order if spread[worst, j] > NOTABLE or j == order[0]]
            what = PARTS[order[0]]
            track = int(self.history.track[worst])
            age = float(self.history.time[b - 1] - self.history.time[held[self.history.track[held] == track][0]])
            cause, why = why_wrong(self._episode(a, b), what, track, age)
            yield self._moment(worst, a, b, track, what, ", ".join(noted), cause, why, self._severity(price[a:b], a, b))

    def _errors(self, held: NDArray) -> tuple[NDArray, list[list[str]]]:
        """Prices (K, 4) [m^2] of the parts of the error at K scans, and what to say of each."""
        truth, found = [], []
        for k in held.tolist():
            frame = self.frames[self.place[k]]
            row, output = frame.row[self.key], frame.outputs[self.tracker]
            col = int(np.flatnonzero(output.id == self.history.track[k])[0])
            objects = frame.objects
            truth.append([*objects.pose[row], *objects.velocity[row], *objects.size[row]])
            found.append([*output.pose[col], *output.velocity[col], *output.size[col]])
        t, f = np.array(truth), np.array(found)
        error = f - t
        turn = wrap_angle(error[:, 2])
        place, speed = np.hypot(error[:, 0], error[:, 1]), np.hypot(error[:, 3], error[:, 4])
        parts = np.stack(
            [place**2, (error[:, 5:] ** 2).sum(1) / 4, (t[:, 5] * np.sin(turn / 2)) ** 2, (AHEAD * speed) ** 2], 1
        )
        sizes = [_size_text(true, got) for true, got in zip(t[:, 5:], f[:, 5:], strict=True)]
        texts = [
            [f"{p:.1f} m off", size, f"heading off by {abs(np.degrees(h)):.0f} deg", f"velocity off by {v:.1f} m/s"]
            for p, size, h, v in zip(place, sizes, turn, speed, strict=True)
        ]
        return parts, texts

    def _severity(self, price: NDArray, a: int, b: int) -> float:
        """Price (b - a,) [m^2] over the scans from a up to b, nearer ones weighing more: (MET.31)."""
        return float(price @ (self.lasts[a:b] * [self._nearness(k) for k in range(a, b)]))

    def _switch_severity(self, k: int) -> float:
        return MISSING * LOST_AFTER * self._nearness(k)

    def _nearness(self, k: int) -> float:
        frame = self.frames[self.place[k]]
        return nearness(frame, frame.objects.pose[frame.row[self.key], :2])

    def _episode(self, a: int, b: int) -> Episode:
        index = self.place[a:b].tolist()
        return Episode(self.tracker, self.key, [self.frames[k] for k in index], [self.on[k] for k in index])

    def _moment(
        self, k: int, a: int, b: int, track: int | None, what: str, text: str, cause: str, why: str, severity: float
    ) -> Moment:
        time = self.history.time
        end = float(time[min(b, len(time) - 1)])
        own = (self.tracker, self.key, self.kind, track, what, text, cause, why)
        return Moment(float(time[k]), float(time[a]), end, *own, severity)


def _size_text(true: NDArray, found: NDArray) -> str:
    side = int(np.abs(found - true).argmax())
    return f"{found[side]:.1f} m {('long', 'wide')[side]} instead of {true[side]:.1f} m"


def _false_tracks(
    name: str, frames: Sequence[Snapshot], time: NDArray, on: Sequence[dict[int, int]], missing: Sequence[set[int]]
) -> Iterator[Moment]:
    """Periods in which a reported track belonged to no object, but those of an object that was without a track."""
    alone: dict[int, list[int]] = {}
    first: dict[int, int] = {}  # track -> frame of its first appearance
    for k, frame in enumerate(frames):
        for track in frame.outputs[name].id.tolist():
            first.setdefault(track, k)
            if track not in on[k]:
                alone.setdefault(track, []).append(k)
    lasts = np.diff(np.append(time, time[-1]))
    for track, places in alone.items():
        where = np.zeros(len(time), bool)
        where[places] = True
        for a, b in _joined(_runs(where), time):
            index = [k for k in range(a, b) if where[k]]
            episode = Episode(name, None, [frames[k] for k in index], [on[k] for k in index])
            cause, why, source = why_false(episode, track, first[track] == a and len(index) == 1)
            if 2 * sum(source in missing[k] for k in index) > len(index):
                continue  # the entry of that object says that this track lies on it
            severity = sum(MISSING * lasts[k] * _track_nearness(frames[k], name, track) for k in index)
            what = "ghost" if cause == "ghost" else "false track"
            start, end = float(time[a]), float(time[min(b, len(time) - 1)])
            text = f"track {track} is on no vehicle for {end - start:.1f} s"
            yield Moment(start, start, end, name, None, "", track, what, text, cause, why, float(severity))


def _track_nearness(frame: Snapshot, tracker: str, track: int) -> float:
    output = frame.outputs[tracker]
    return nearness(frame, output.pose[np.flatnonzero(output.id == track)[0], :2])
