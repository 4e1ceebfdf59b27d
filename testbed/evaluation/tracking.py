"""One tracker against the truth, frame by frame and over a run: definitions in docs/methods/metrics.md.

An object is counted at a scan when it was expected to give more than half a detection at some scan of the last second.
Crashed objects (their motion is not physical) and static obstacles are never counted. Tracks are assigned to all
objects; pairs with uncounted ones cost nothing and enter no average. Only reported tracks take part.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from itertools import chain, groupby

import numpy as np
from numpy.typing import NDArray

from sensors.origin import GHOSTS, Origin
from sensors.scene import Objects, Scene
from testbed.evaluation import histories
from testbed.evaluation.histories import History
from testbed.evaluation.identities import Meeting, meeting
from testbed.evaluation.metric import METRICS, PAIR, PAIRS, RUN, SCAN, SPAN, Metric, keys, values
from testbed.evaluation.metrics import gospa, mean
from testbed.evaluation.pair_errors import Pairs, PairTruth, pair_distances, pair_truth
from testbed.evaluation.span import Judged, Span, TrackPast
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

ERRORS, SCANS = keys(PAIR), keys(SCAN)  # metrics of a pair, and of a scan
OVER_PAIRS = tuple(m for m in METRICS.values() if m.of == PAIRS or (m.of == PAIR and m.averaged))
OVER_SPAN = tuple(m for m in METRICS.values() if m.of in (SPAN, PAIRS) or m.averaged)

Row = dict[str, float | int | str]

UNKNOWN = FrameScore({}, {}, dict.fromkeys([*SCANS, *ERRORS], np.nan))
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
        self._time: list[float] = []  # of each scan
        self._scans: list[dict[str, float]] = []  # the metrics of each scan
        self._meetings: list[Meeting] = []  # who could belong together at each scan
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
        row, track, counted, out, distance = self._assign(time, scene, origin, tracks, owner)
        truth = pair_truth(scene.objects, scene.bodies, row, scene.ego.pose[:2])
        errors = pair_errors(Pairs(truth, take(out.estimate, track), distance))
        self._work_out()
        self._pair_errors.append(errors[counted[row]])
        held = scene.objects.id[row].tolist()
        return FrameScore(
            pairs=dict(zip(held, out.id[track].tolist(), strict=True)),
            errors={i: dict(zip(ERRORS, e, strict=True)) for i, e in zip(held, errors.tolist(), strict=True)},
            mean=_scan_means(self._scans[-1], errors[counted[row]]),
            counted=tuple(scene.objects.id[counted].tolist()),
        )

    def keep(self, time: float, scene: Scene, origin: Origin, tracks: Tracks, owner: NDArray | None = None) -> None:
        """As `step`, for a score that is not read: the errors of pairs are computed later, for many scans at once."""
        row, track, counted, out, distance = self._assign(time, scene, origin, tracks, owner)
        counts = counted[row]
        truth = pair_truth(scene.objects, scene.bodies, row[counts], scene.ego.pose[:2])
        self._waiting.append((truth, take(out.estimate, track[counts]), distance[counts]))
        if len(self._waiting) >= WAITING:
            self._work_out()

    def _assign(
        self, time: float, scene: Scene, origin: Origin, tracks: Tracks, owner: NDArray | None
    ) -> tuple[NDArray, NDArray, NDArray, Tracks, NDArray]:
        """Assign the reported tracks of one scan to the objects, and remember who held what.

        Returns rows (K,) of objects and of reported tracks in each pair, the mask (N,) of counted objects, the
        reported tracks, and the distance (K,) [m] of each pair.
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
        self._time.append(time)
        self._scans.append(values(SCAN, Judged(score, counted, held_by, out.id)))
        rest = np.delete(np.arange(len(out.id)), columns[~counted[rows]])  # without those on objects that do not count
        self._meetings.append(meeting(objects.id[counted], out.id[rest], distance[counted][:, rest]))
        plain = countable & (origin.visible > PLAIN_SHARE) & (origin.expected > PLAIN_COUNT)  # (MET.18)
        self._remember(time, objects, counted, plain, held_by, out)
        self._pair_keys += [(time, i) for i in objects.id[rows[counted[rows]]].tolist()]
        return rows, columns, counted, out, distance[rows, columns]

    def _work_out(self) -> None:
        """The errors of all pairs that wait, those with contours of one shape together."""
        waiting, self._waiting = self._waiting, []
        for _, group in groupby(waiting, key=lambda pairs: _shape(pairs[1].contour)):
            truths, estimates, distances = zip(*group, strict=True)
            pose, velocity, size, ego = (
                np.concatenate(column) for column in zip(*(t[:4] for t in truths), strict=True)
            )
            truth = PairTruth(pose, velocity, size, ego, tuple(chain.from_iterable(t.outlines for t in truths)))
            estimate = concatenate([e._replace(class_probability=None, edge_std=e.edges) for e in estimates])
            self._pair_errors.append(pair_errors(Pairs(truth, estimate, np.concatenate(distances))))

    def summary(self) -> Row:
        """All measures of the run in one flat row; NaN where there was nothing to measure."""
        span = self._span(-np.inf, np.inf)
        return {"tracker": self.tracker, **_span_row(span), **values(RUN, span)}

    def phase_rows(self) -> list[Row]:
        """The same per phase; switches, jumps, losses and births belong to the phase in which they happen."""
        return [
            {"tracker": self.tracker, "phase": name, "start": start, "end": end, **_span_row(self._span(start, end))}
            for name, start, end in self.phases
        ]

    def object_rows(self) -> list[Row]:
        """One row an object: at how many scans it counted, its births, losses, switches and gaps, its mean errors."""
        objects = np.array([key for _, key in self._pair_keys], int)
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
            own = dict(zip(ERRORS, errors[objects == key].T, strict=True))
            rows.append(row | {m.key: _over_pairs(m, own) for m in OVER_PAIRS})
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

    def histories(self) -> dict[int, History]:
        """Object id -> its scans."""
        return {key: History(*map(np.array, zip(*rows, strict=True))) for key, rows in self._rows.items()}

    def _check(self, time: float, scene: Scene, origin: Origin) -> None:
        N = len(scene.objects.id)
        if origin.expected.shape != (N,):
            raise ValueError(
                f"origin.expected must be ({N},), got {origin.expected.shape}; it belongs to another scene"
            )
        if self._time and time <= self._time[-1]:
            raise ValueError(
                f"time must grow, got {time} s after {self._time[-1]} s; make a new Evaluator for each run"
            )

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

    def _span(self, start: float, end: float) -> Span:
        """The scans from start up to end [s]; errors and scans only of those that are not before `settle`."""
        settled = max(start, self.settle)
        within = [k for k, time in enumerate(self._time) if settled <= time < end]
        chosen = np.array([settled <= time < end for time, _ in self._pair_keys], bool)
        tracks = [i for i, seen in self._reports.items() if any(start <= time < end for time, _ in seen)]
        return Span(
            start,
            end,
            scans={key: np.array([self._scans[k][key] for k in within], float) for key in SCANS},
            errors=dict(zip(ERRORS, self._errors()[chosen].T, strict=True)),
            histories=list(self.histories().values()),
            tracks=[self._past(track) for track in tracks],
            jumps=np.array([time for time, _ in self._jumps]),
            meetings=[self._meetings[k] for k in within],
        )

    def _past(self, track: int) -> TrackPast:
        times = [time for time, _ in self._reports[track]]
        real, nothing = self._took.get(track, (0, 0))
        return TrackPast(track not in self._object_of, times[-1] - times[0], real, nothing, self._ghosts.get(track, 0))


def _countable(objects: Objects) -> NDArray:
    """Mask (N,) of objects that may count: not crashed, and no static obstacles."""
    return ~objects.crashed & np.array([kind not in UNCOUNTED_KINDS for kind in objects.kind], bool)


def _shape(contour: NDArray | None) -> tuple[int, ...] | None:
    return None if contour is None else contour.shape[1:]


def pair_errors(pairs: Pairs) -> NDArray:
    """Errors (K, len(ERRORS)) of K pairs."""
    if not len(pairs.distance):
        return np.zeros((0, len(ERRORS)))
    return np.array([METRICS[key].compute(pairs) for key in ERRORS]).T


def _scan_means(scan: Mapping[str, float], errors: NDArray) -> dict[str, float]:
    """The `mean` of a `FrameScore`: metrics of the scan, and the mean magnitude of each error of (K, len(ERRORS))."""
    count = (~np.isnan(errors)).sum(0)  # of a track without covariances some are not known
    means = np.abs(np.nan_to_num(errors)).sum(0) / np.where(count, count, np.nan)
    return {key: float(value) for key, value in scan.items()} | dict(zip(ERRORS, means.tolist(), strict=True))


def _span_row(span: Span) -> Row:
    """Metrics of a run or a phase, and the means of those of its scans and pairs, in the order of the table."""
    row: Row = {}
    for metric in OVER_SPAN:
        if metric.of == SPAN:
            row[metric.key] = metric.compute(span)
        else:
            row[metric.key] = mean(span.scans[metric.key]) if metric.of == SCAN else _over_pairs(metric, span.errors)
    return row


def _over_pairs(metric: Metric, errors: Mapping[str, NDArray]) -> float:
    """A metric of many pairs, or the mean of one of a pair where it is known; errors (K,) by key."""
    if metric.of == PAIRS:
        return metric.compute(errors)
    return mean(errors[metric.key][~np.isnan(errors[metric.key])])


def jsonable(row: Mapping[str, float | int | str]) -> dict[str, float | int | str | None]:
    """The row with None in place of NaN and infinity, which are no JSON."""
    return {key: None if isinstance(v, float) and not np.isfinite(v) else v for key, v in row.items()}
