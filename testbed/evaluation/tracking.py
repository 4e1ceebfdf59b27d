"""One tracker against the truth, frame by frame and over a run: definitions in docs/methods/metrics.md.

An object is counted at a scan when it was expected to give more than half a detection at some scan of the last second.
Crashed objects (their motion is not physical) and static obstacles are never counted. Tracks are assigned to all
objects; pairs with uncounted ones cost nothing and enter no average. Only reported tracks take part.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from itertools import chain, groupby
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sensors.origin import GHOSTS, Origin
from sensors.scene import Objects, Scene
from testbed.evaluation import histories
from testbed.evaluation.histories import History
from testbed.evaluation.metrics import gospa, mean, nees_bounds, rmse
from testbed.evaluation.pair_errors import ERRORS, PairTruth, pair_distances, pair_errors, pair_truth
from testbed.frame import FrameScore
from trackers.batch import concatenate, take
from trackers.estimate import Estimate
from trackers.geometry import to_frame
from trackers.multi.tracks import Tracks

COUNTED_ABOVE = 0.5  # expected detections
COUNTED_FOR = 1.0  # [s] for which an object counts after that
PLAIN_SHARE, PLAIN_COUNT = 0.5, 3.0  # visible share and expected detections of an object in plain view
WAITING = 64  # scans of which the errors of pairs are worked out together
UNCOUNTED_KINDS = ("obstacle",)

Row = dict[str, float | int | str]


class _FrameCounts(NamedTuple):
    """GOSPA and counts of one frame, for the summary."""

    time: float
    gospa: float
    localisation: float
    missed: float
    false: float
    objects: int  # counted
    unassigned: int  # counted without a track
    ghosts: int  # tracks without an object
    tracks: int


UNKNOWN = FrameScore({}, {}, dict.fromkeys([n for n in _FrameCounts._fields if n != "time"] + [*ERRORS], np.nan))
"""The score of a frame of which the truth is not known."""


class Evaluator:
    """Scores of one tracker: call `step` or `keep` once a frame, then the methods that give tables.

    Phases are (name, start [s], end [s]); a scan belongs to a phase when start <= time < end. What is averaged over
    scans leaves out those before `settle` [s], when trackers have just begun; births are of the whole run.
    """

    def __init__(self, tracker: str, phases: Sequence[tuple[str, float, float]] = (), settle: float = 0.0) -> None:
        for name, start, end in phases:
            if not start < end:
                raise ValueError(f"phase {name!r} must end after it starts, got {start} s to {end} s; swap the times")
        self.tracker = tracker
        self.phases, self.settle = tuple(phases), settle
        self._frames: list[_FrameCounts] = []
        self._pair_keys: list[tuple[float, int]] = []  # time, object id of each counted pair
        self._pair_errors: list[NDArray] = []  # (K, len(ERRORS)) of counted pairs, in the order of the scans
        self._waiting: list[tuple[PairTruth, Estimate, NDArray]] = []  # counted pairs without errors as yet
        self._seen: dict[int, float] = {}  # object id -> last time it was expected to be detected
        self._kind: dict[int, str] = {}
        self._rows: dict[int, list[tuple]] = defaultdict(list)  # object id -> rows of its History
        self._object_of: dict[int, int] = {}  # track id -> object it was first assigned to
        self._counted_object_of: dict[int, int] = {}  # track id -> counted object it was last assigned to
        self._jumps: list[tuple[float, int]] = []  # time, track id
        self._reports: dict[int, list[tuple[float, bool]]] = defaultdict(list)  # track id -> time, inside an object
        self._took: dict[int, list[int]] = defaultdict(lambda: [0, 0])  # track id -> detections of objects, of nothing
        self._ghosts: dict[int, int] = defaultdict(int)  # track id -> ghosts among the latter

    def step(
        self, time: float, scene: Scene, origin: Origin, tracks: Tracks, owner: NDArray | None = None
    ) -> FrameScore:
        """Score the tracks after the scan at `time` [s]; `origin` belongs to that scan.

        owner (M,) is the id of the track that owns each detection, as in `StepInfo`; without it `tracks_clutter` and
        `tracks_ghost` are 0.
        """
        frame, row, track, counted, out, distance = self._assign(time, scene, origin, tracks, owner)
        errors = pair_errors(pair_truth(scene.objects, scene.bodies, row), take(out.estimate, track), distance)
        self._work_out()
        self._pair_errors.append(errors[counted[row]])
        held = scene.objects.id[row].tolist()
        return FrameScore(
            pairs=dict(zip(held, out.id[track].tolist(), strict=True)),
            errors={i: dict(zip(ERRORS, e, strict=True)) for i, e in zip(held, errors.tolist(), strict=True)},
            mean=_frame_means(frame, errors[counted[row]]),
            counted=tuple(scene.objects.id[counted].tolist()),
        )

    def keep(self, time: float, scene: Scene, origin: Origin, tracks: Tracks, owner: NDArray | None = None) -> None:
        """As `step`, for a score that is not read: the errors of pairs are computed later, for many scans at once."""
        _, row, track, counted, out, distance = self._assign(time, scene, origin, tracks, owner)
        counts = counted[row]
        truth = pair_truth(scene.objects, scene.bodies, row[counts])
        self._waiting.append((truth, take(out.estimate, track[counts]), distance[counts]))
        if len(self._waiting) >= WAITING:
            self._work_out()

    def _assign(
        self, time: float, scene: Scene, origin: Origin, tracks: Tracks, owner: NDArray | None
    ) -> tuple[_FrameCounts, NDArray, NDArray, NDArray, Tracks, NDArray]:
        """Assign the reported tracks of one scan to the objects, and remember who held what.

        Returns the counts of the scan, rows (K,) of objects and of reported tracks in each pair, the mask (N,) of
        counted objects, the reported tracks, and the distance (K,) [m] of each pair.
        """
        self._check(time, scene, origin)
        if owner is not None:
            for track, real in zip(owner[owner >= 0].tolist(), (origin.object[owner >= 0] >= 0).tolist(), strict=True):
                self._took[track][not real] += 1
            for track in owner[(owner >= 0) & np.isin(origin.kind, GHOSTS)].tolist():
                self._ghosts[track] += 1
        objects, out = scene.objects, tracks._replace(state=None).reported
        countable = _countable(objects)
        counted = self._count(time, objects, origin) & countable
        distance = pair_distances(objects, out.estimate)
        score = gospa(distance, counted)
        rows, columns = score.pairs.T
        held_by = np.full(len(objects.id), -1)
        held_by[rows] = out.id[columns]
        frame = _FrameCounts(
            time, score.total, score.localisation, score.missed, score.false,
            int(counted.sum()), int((counted & (held_by < 0)).sum()), len(out.id) - len(rows), len(out.id),
        )  # fmt: skip
        self._frames.append(frame)
        plain = countable & (origin.visible > PLAIN_SHARE) & (origin.expected > PLAIN_COUNT)  # (MET.18)
        self._remember(time, objects, counted, plain, held_by, out)
        self._pair_keys += [(time, i) for i in objects.id[rows[counted[rows]]].tolist()]
        return frame, rows, columns, counted, out, distance[rows, columns]

    def _work_out(self) -> None:
        """The errors of all pairs that wait, those with contours of one shape together."""
        waiting, self._waiting = self._waiting, []
        for _, group in groupby(waiting, key=lambda pairs: _shape(pairs[1].contour)):
            truths, estimates, distances = zip(*group, strict=True)
            pose, velocity, size = (np.concatenate(column) for column in zip(*(t[:3] for t in truths), strict=True))
            truth = PairTruth(pose, velocity, size, tuple(chain.from_iterable(t.outlines for t in truths)))
            estimate = concatenate([e._replace(class_probability=None) for e in estimates])
            self._pair_errors.append(pair_errors(truth, estimate, np.concatenate(distances)))

    def summary(self) -> Row:
        """All measures of the run in one flat row; NaN where there was nothing to measure."""
        return {"tracker": self.tracker, **self._table(-np.inf, np.inf), **self._acceptance()}

    def phase_rows(self) -> list[Row]:
        """The same per phase; switches, jumps, losses and births belong to the phase in which they happen."""
        return [
            {"tracker": self.tracker, "phase": name, "start": start, "end": end, **self._table(start, end)}
            for name, start, end in self.phases
        ]

    def object_rows(self) -> list[Row]:
        """One row an object: at how many scans it counted, its births, losses, switches and gaps, its mean errors."""
        keys = np.array([key for _, key in self._pair_keys], int)
        errors = self._errors()
        rows: list[Row] = []
        for key, history in self.histories().items():
            row: Row = {"tracker": self.tracker, "object": key, "kind": self._kind[key]}
            row |= {
                "scans_counted": int(history.counted.sum()),
                "scans_missed": int((history.counted & (history.track < 0)).sum()),
                "first_counted": histories.first_counted(history),
                "birth_delay": histories.birth_delay(history),
                "switches": len(histories.switches(history)),
                "lost": len(histories.losses(history)),
                "never": int(histories.never_tracked(history)),
                "plain_view_gap": histories.plain_view_gap(history),
                "uncovered_gap": histories.uncovered_gap(history),
            }
            rows.append(row | _error_table(errors[keys == key]))
        return rows

    def orphan_rows(self) -> list[Row]:
        """Reported tracks that were never assigned to any object: born from clutter, static road, or as a fragment.

        `inside` is the share of their scans with the centre inside an object: near 1 for a fragment of a vehicle.
        `real` is the share of their detections that came from objects, NaN where owners were not given.
        """
        orphans = (track for track in self._reports if track not in self._object_of)
        rows: list[Row] = []
        for track in orphans:
            times, inside = zip(*self._reports[track], strict=True)
            row: Row = {"tracker": self.tracker, "track": track, "first": times[0], "last": times[-1]}
            real, nothing = self._took.get(track, (0, 0))
            row |= {"scans": len(times), "duration": times[-1] - times[0], "inside": mean(inside)}
            rows.append(row | {"real": real / (real + nothing) if real + nothing else np.nan})
        return rows

    def plain_view_gaps(self) -> dict[int, float]:
        """Object id -> longest time [s] in plain view without an assigned track."""
        return {key: histories.plain_view_gap(history) for key, history in self.histories().items()}

    def histories(self) -> dict[int, History]:
        """Object id -> its scans."""
        return {key: History(*map(np.array, zip(*rows, strict=True))) for key, rows in self._rows.items()}

    def _check(self, time: float, scene: Scene, origin: Origin) -> None:
        N = len(scene.objects.id)
        if origin.expected.shape != (N,):
            raise ValueError(
                f"origin.expected must be ({N},), got {origin.expected.shape}; it belongs to another scene"
            )
        if self._frames and time <= self._frames[-1].time:
            last = self._frames[-1].time
            raise ValueError(f"time must grow, got {time} s after {last} s; make a new Evaluator for each run")

    def _count(self, time: float, objects: Objects, origin: Origin) -> NDArray:
        """Mask (N,) of objects that were expected to be detected within the last `COUNTED_FOR`."""
        ids = objects.id.tolist()
        self._seen |= dict.fromkeys(objects.id[origin.expected > COUNTED_ABOVE].tolist(), time)
        oldest = time - COUNTED_FOR - histories.TIME_ROUNDING
        return np.array([self._seen.get(i, -np.inf) >= oldest for i in ids], bool)  # (MET.8)

    def _remember(
        self, time: float, objects: Objects, counted: NDArray, plain: NDArray, owner: NDArray, out: Tracks
    ) -> None:
        local = to_frame(objects.pose, np.broadcast_to(out.estimate.pose[:, :2], (len(objects.id), len(out.id), 2)))
        inside = (np.abs(local) <= objects.size[:, None] / 2).all(-1)  # (N, T)
        flags = zip(counted.tolist(), plain.tolist(), inside.any(1).tolist(), owner.tolist(), strict=True)
        for key, kind, row in zip(objects.id.tolist(), objects.kind, flags, strict=True):
            self._kind[key] = kind
            self._rows[key].append((time, *row))
            is_counted, track = row[0], row[-1]
            if track >= 0:
                self._object_of.setdefault(track, key)
                if is_counted:
                    if self._counted_object_of.setdefault(track, key) != key:
                        self._jumps.append((time, track))
                    self._counted_object_of[track] = key
        for track, within in zip(out.id.tolist(), inside.any(0).tolist(), strict=True):
            self._reports[track].append((time, within))

    def _errors(self) -> NDArray:
        self._work_out()
        return np.concatenate([np.zeros((0, len(ERRORS))), *self._pair_errors])

    def _table(self, start: float, end: float) -> Row:
        """The measures of the scans from start up to end [s]; means only of those that are not before `settle`."""
        settled = max(start, self.settle)
        within = [f for f in self._frames if settled <= f.time < end]
        frames = {name: np.array([getattr(f, name) for f in within], float) for name in _FrameCounts._fields}
        chosen = [settled <= time < end for time, _ in self._pair_keys]
        past = list(self.histories().values())
        births = [histories.birth_delay(h) for h in past if start <= histories.first_counted(h) < end]
        spans = [(h, (start <= h.time) & (h.time < end)) for h in past]  # each object and its scans of the period
        objects = sum(int((h.counted & now).sum()) for h, now in spans)
        unborn = sum(int((histories.unborn(h) & now).sum()) for h, now in spans)
        counted = [h for h, now in spans if (h.counted & now).any()]
        confirmed = [h for h, now in spans if (h.held & now).any()]
        ids = {t for t, seen in self._reports.items() if any(start <= time < end for time, _ in seen)}
        empty = [i for i in ids if self._took.get(i, (0, 0))[1] > self._took.get(i, (0, 0))[0]]
        ghosts = [i for i in empty if 2 * self._ghosts.get(i, 0) > self._took[i][1]]
        table: Row = {"scans": len(within)}
        table |= {name: mean(frames[name]) for name in ("gospa", "localisation", "missed", "false")}
        table |= {
            "missed_percent": 100 * float(frames["unassigned"].sum() / (frames["objects"].sum() or np.nan)),
            "false_per_scan": mean(frames["ghosts"]),
            "objects_per_scan": mean(frames["objects"]),
            "tracks_per_scan": mean(frames["tracks"]),
            "objects_visible": len(counted),
            "objects_confirmed": len(confirmed),
            "tracks_reported": len(ids),
            "tracks_orphan": len(ids - set(self._object_of)),
            "tracks_clutter": len(empty) - len(ghosts),
            "tracks_ghost": len(ghosts),
            "switches": sum(_within(histories.switches(h), start, end) for h in past),
            "jumps": _within(np.array([time for time, _ in self._jumps]), start, end),
            "lost": sum(_within(histories.losses(h), start, end) for h in past),
            "never": sum(histories.never_tracked(h) for h in counted),
            "birth_delay": mean([delay for delay in births if not np.isnan(delay)]),
            "unborn_percent": 100 * unborn / objects if objects else np.nan,
        }
        return table | _error_table(self._errors()[np.array(chosen, bool)])

    def _acceptance(self) -> Row:
        """The longest gaps and the longest orphan of the run [s], over all objects and tracks."""
        past = self.histories().values()
        return {
            "plain_view_gap": max(map(histories.plain_view_gap, past), default=0.0),
            "uncovered_gap": max(map(histories.uncovered_gap, past), default=0.0),
            "orphan_duration": max((float(row["duration"]) for row in self.orphan_rows()), default=0.0),
        }


def _countable(objects: Objects) -> NDArray:
    """Mask (N,) of objects that may count: not crashed, and no static obstacles."""
    return ~objects.crashed & np.array([kind not in UNCOUNTED_KINDS for kind in objects.kind], bool)


def _shape(contour: NDArray | None) -> tuple[int, ...] | None:
    """The shape of one contour of a batch."""
    return None if contour is None else contour.shape[1:]


def _within(times: NDArray, start: float, end: float) -> int:
    return int(((start <= times) & (times < end)).sum())


def _frame_means(frame: _FrameCounts, errors: NDArray) -> dict[str, float]:
    """The `mean` of a `FrameScore`: the counts, and the mean magnitude of each error of (K, len(ERRORS))."""
    parts = {name: float(value) for name, value in frame._asdict().items() if name != "time"}
    means = np.abs(errors).mean(0) if len(errors) else np.full(len(ERRORS), np.nan)
    return parts | dict(zip(ERRORS, means.tolist(), strict=True))


def _error_table(errors: NDArray) -> Row:
    """Averages over pairs (K, len(ERRORS)): means, RMSE, mean absolute sizes, NEES with its chi-square bounds."""
    e = dict(zip(ERRORS, errors.T, strict=True))
    table: Row = {name: mean(e[name]) for name in ("gwd", "gwd2", "box_iou", "contour_iou")}
    table |= {f"rmse_{name}": rmse(e[name]) for name in ("position", "velocity", "heading_deg", "length", "width")}
    table |= {f"abs_{name}": mean(np.abs(e[name])) for name in ("length", "width")}
    low, high = nees_bounds(2, len(errors))
    table |= {name: mean(e[name]) for name in ERRORS if name.startswith("nees_")}
    return table | {"nees_low": low, "nees_high": high, "pairs": len(errors)}


def jsonable(row: Mapping[str, float | int | str]) -> dict[str, float | int | str | None]:
    """The row with None in place of NaN and infinity, which are no JSON."""
    return {key: None if isinstance(v, float) and not np.isfinite(v) else v for key, v in row.items()}
