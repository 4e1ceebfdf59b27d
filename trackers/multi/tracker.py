"""The multi-object tracker: many objects over any single-object filter, all tracks in one batch.

Order of a step and equations: docs/methods/multi-object-tracking.md. The tracker holds parameters only; its state is
`Tracks`, which `step` takes and returns.
"""

import warnings
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from trackers.admission import Admitted, admit, check_step
from trackers.batch import concatenate, select
from trackers.estimate import Estimate, prior
from trackers.linalg import largest_eigenvalue
from trackers.multi.association import Association, Claims, SortedScan, gather, shares
from trackers.multi.exclusion import Exclusion
from trackers.multi.existence import Existence
from trackers.multi.initiation import Initiation
from trackers.multi.road import RoadMap
from trackers.multi.sizes import SizePrior, stretch
from trackers.multi.tracks import NO_TRACK, REPORT_ABOVE, Event, StepInfo, Tracks
from trackers.multi.visibility import SensorArray, Visibility, predict_visibility
from trackers.parameters import check_numbers
from trackers.protocols import Classifying, Filter, Note, Resizable, Restartable, SpatialModel
from trackers.scan import Scan, SensorModel

OVERLOAD = "a scan has too many unexplained detections for births; StepInfo.overload counts them"


@dataclass(frozen=True)
class MultiObjectTracker:
    """Tracks all vehicles in view of the sensors, over any single-object filter."""

    filter: Filter
    sensors: tuple[SensorModel, ...]
    association: Association = field(default_factory=Association)
    existence: Existence = field(default_factory=Existence)
    initiation: Initiation = field(default_factory=Initiation)
    exclusion: Exclusion = field(default_factory=Exclusion)
    sizes: SizePrior = field(default_factory=SizePrior)
    prune_below: float = 0.02  # existence below which a track dies
    prune_position_std: float = 5.0  # [m] above which it dies
    most_detections: int = 16  # of a scan, for the update of one track: those of one vehicle are not independent
    occlude_above: float = 0.6  # existence of a track that may hide others
    occlude_hits: int = 4  # and its hits, to be exceeded
    rate_factor: float = 0.8  # of the data sheets' expected counts
    complete_above: float = 0.75  # visible share of an object's span from which an update teaches its class
    growth_std: float = 0.2  # std of log length of a track with detections just beyond its ends
    road: RoadMap | None = None  # map of the lanes; without it no standing vehicle is born

    def __post_init__(self) -> None:
        check_numbers(self, positive=("most_detections", "growth_std"), unlimited=("prune_position_std",))
        if not self.sensors:
            raise ValueError("sensors must name at least one SensorModel; take them from Radar.models")
        if self.initiation.fast_existence[0] <= self.prune_below:
            raise ValueError(
                f"prune_below {self.prune_below} must be under the existence at birth, "
                f"{self.initiation.fast_existence[0]}, or every birth is removed in silence"
            )

    @cached_property
    def sensor_array(self) -> SensorArray:
        """The data sheets as arrays."""
        return SensorArray.of(self.sensors)

    @cached_property
    def resizable(self) -> Resizable | None:
        """The filter if it has `resize`, else None; cached, because `isinstance` of a protocol is slow."""
        return self.filter if isinstance(self.filter, Resizable) else None

    @cached_property
    def restartable(self) -> Restartable | None:
        """The filter if it has `restart`, else None."""
        return self.filter if isinstance(self.filter, Restartable) else None

    @cached_property
    def classifying(self) -> Classifying | None:
        """The filter if it classifies its objects, else None."""
        return self.filter if isinstance(self.filter, Classifying) else None

    @cached_property
    def spatial(self) -> SpatialModel | None:
        """The filter if it has its own density of detections over the body, else None."""
        return self.filter if isinstance(self.filter, SpatialModel) else None

    def start(self) -> Tracks:
        """The state before the first scan: no track."""
        estimate = prior(np.zeros((0, 3)))
        none = np.zeros(0)
        return Tracks(
            none.astype(int), none, none.astype(int), none, none.astype(bool), self.filter.init(estimate), estimate
        )

    def step(self, tracks: Tracks, scan: Scan, dt: float) -> tuple[Tracks, StepInfo]:
        """Tracks after one scan (M,) of all sensors, dt [s] after the scan before, and what was decided.

        Raises:
            ValueError: a scan of wrong shape, not finite, or of sensors that the tracker does not have; a time step
                that is not finite, negative or longer than a minute. The error names the field.

        """
        scan, implausible = self._admit(scan, dt)
        z, order = self.association.prepare(scan, self.sensor_array)
        tracks = self._predict(tracks, dt)
        occluder = (tracks.existence > self.occlude_above) & (tracks.hits > self.occlude_hits)
        view = predict_visibility(tracks.estimate, occluder, self.sensor_array, scan.platform, self.rate_factor)
        visible = view.share.max(0, initial=0.0) > 0
        tracks = tracks._replace(existence=self.existence.survive(tracks.existence, visible, view.in_view, dt))
        claims = self.association.claim(self.spatial, tracks.state, tracks.estimate, tracks.existence, view.expected, z)
        updated, info = self._update(tracks, view, claims, z)
        leftovers = self.initiation.leftovers(z, claims.owner, updated.estimate, updated.existence, self.road)
        updated = self._grow(updated, leftovers.reach)
        owner = np.full(scan.mask.shape[-1], -1)
        owner[order] = np.where(claims.owner >= 0, tracks.id[claims.owner], -1) if len(tracks.id) else -1
        updated, born = self._initiate(updated, z, leftovers.candidate)
        updated, merged = self._exclude(updated)
        updated, died = self._prune(updated)
        fresh = (updated.existence > REPORT_ABOVE) & ~updated.confirmed
        overload = self.initiation.overload(leftovers.candidate)
        events = [*events_of_scan(int(implausible), overload), *info.events, *born, *merged, *died]
        events += [
            Event("confirmed", int(i), f"existence {q:.2f}")
            for i, q in zip(updated.id[fresh], updated.existence[fresh])
        ]
        tracks_new = updated._replace(confirmed=updated.confirmed | fresh)
        return tracks_new, info._replace(
            owner=owner, events=tuple(events), implausible=int(implausible), overload=overload
        )

    def _admit(self, scan: Scan, dt: float) -> Admitted:
        """The scan without implausible detections; raises ValueError for one, or a time step, of no use."""
        check_step(dt)
        admitted = admit(scan, ())
        if scan.sensor.size and not (scan.sensor.min() >= 0 and scan.sensor.max() < len(self.sensors)):
            raise ValueError(
                f"scan.sensor must index the tracker's {len(self.sensors)} sensors, got up to {scan.sensor.max()}; "
                "build the tracker with the models of the radar that made the scan"
            )
        return admitted

    def _predict(self, tracks: Tracks, dt: float) -> Tracks:
        state = self.filter.predict(tracks.state, dt)
        estimate = self.filter.estimate(state)
        usual = None if self.classifying is None else self.classifying.class_size(state)
        size, size_std = self.sizes.relax(estimate.size, estimate.size_std, dt, usual)
        state = self._resize(state, size, size_std)
        return tracks._replace(state=state, estimate=self.filter.estimate(state), age=tracks.age + dt)

    def _resize(self, state: object, size: NDArray, size_std: NDArray) -> object:
        """State with another size and std (T, 2) [m]; a filter without `resize` starts again from its own estimate."""
        if self.resizable is not None:
            return self.resizable.resize(state, size, size_std)
        return self._restart(state, self.filter.estimate(state)._replace(size=size, size_std=size_std, contour=None))

    def _restart(self, state: object, estimate: Estimate) -> object:
        """State that starts again from an estimate."""
        if self.restartable is not None:
            return self.restartable.restart(state, estimate)
        return self.filter.init(estimate)

    def _update(self, tracks: Tracks, view: Visibility, claims: Claims, z: SortedScan) -> tuple[Tracks, StepInfo]:
        T = len(tracks.id)
        n = np.bincount(claims.owner[claims.owner >= 0], minlength=T)
        own = claims.owner[claims.detection] == claims.track
        log_gain = np.minimum(np.log1p(claims.gain[own]), self.existence.pair_cap)  # (MOT.24)
        evidence = np.bincount(claims.track[own], weights=log_gain, minlength=T)
        Gam = view.expected.sum(0)
        log_ratio = self.existence.log_ratio(n, Gam, evidence)
        state, nis, mode = tracks.state, np.full(T, np.nan), None
        notes: tuple[Note, ...] = ()
        if n.any():
            share = gather(z, shares(claims.owner, T, self.most_detections))
            if self.classifying is not None:
                state = self.classifying.learn_where(state, view.complete > self.complete_above)
            state, info = self.filter.update(state, share)
            nis, mode, notes = info.nis, getattr(info, "mode", None), getattr(info, "notes", ())
        updated = tracks._replace(
            state=state,
            estimate=self.filter.estimate(state),
            existence=self.existence.update(tracks.existence, log_ratio),
            hits=tracks.hits + (n > 0),  # (MOT.26)
        )
        events = tuple(event for note in notes for event in events_of(note, tracks.id))
        return updated, StepInfo(np.zeros(0, int), tracks.id, Gam, view.in_view, n, log_ratio, nis, events, mode)

    def _grow(self, tracks: Tracks, reach: NDArray) -> Tracks:
        """Let tracks become longer over the detections just beyond their ends; reach (T, 2) [m] ahead and behind.

        A random matrix grows over them with the next scan once its length is uncertain. A filter with a density of
        detections over the body would not: its box is stretched, and the next scans decide whether that holds.
        """
        grows = np.asarray(reach.any(1))
        if not grows.any():
            return tracks
        if self.spatial is not None:
            longer = self._restart(tracks.state, stretch(tracks.estimate, reach, self.growth_std))
        else:
            size, size_std = tracks.estimate.size, tracks.estimate.size_std.copy()
            size_std[:, 0] = np.maximum(size_std[:, 0], self.growth_std * size[:, 0])
            longer = self._resize(tracks.state, size, size_std)
        state = select(grows, longer, tracks.state)
        return tracks._replace(state=state, estimate=self.filter.estimate(state))

    def _initiate(self, tracks: Tracks, z: SortedScan, candidate: NDArray) -> tuple[Tracks, list[Event]]:
        births = self.initiation.births(z, candidate, self.road)
        if births is None:
            return tracks, []
        B = len(births.existence)
        index = shares(births.owner, B, self.most_detections)
        state, info = self.filter.update(self.filter.init(births.estimate), gather(z, index))
        born = Tracks(
            id=tracks.next_id + np.arange(B),
            existence=births.existence,
            hits=np.ones(B, int),
            age=np.zeros(B),
            confirmed=np.zeros(B, bool),
            state=state,
            estimate=self.filter.estimate(state),
        )
        count = np.bincount(births.owner[births.owner >= 0], minlength=B)
        events = [Event("born", int(i), f"{n} detections that no track explains") for i, n in zip(born.id, count)]
        events += [event for note in getattr(info, "notes", ()) for event in events_of(note, born.id)]
        joined = concatenate([tracks._replace(next_id=None), born._replace(next_id=None)])  # type: ignore[arg-type]
        return joined._replace(next_id=tracks.next_id + B), events

    def _exclude(self, tracks: Tracks) -> tuple[Tracks, list[Event]]:
        score = tracks.existence * np.minimum(tracks.hits, 50)
        result = self.exclusion.apply(tracks.estimate, score)
        if result.keep.all():
            return tracks, []
        state = tracks.state
        if result.joined.any():
            state = select(result.joined, self._restart(state, result.estimate), state)
        events = [
            Event("merged", int(tracks.id[t]), f"same vehicle as track {tracks.id[result.into[t]]}")
            for t in np.flatnonzero(~result.keep)
        ]
        tracks = tracks._replace(state=state, estimate=self.filter.estimate(state))
        return tracks.rows(result.keep), events

    def _prune(self, tracks: Tracks) -> tuple[Tracks, list[Event]]:
        unsure = tracks.existence < self.prune_below  # (MOT.47)
        vague = largest_eigenvalue(tracks.estimate.cov[:, :2, :2]) > self.prune_position_std**2  # (MOT.47)
        if not (unsure | vague).any():
            return tracks, []
        events = [
            Event("died", int(tracks.id[t]), "position too uncertain" if vague[t] else "nothing seen of it any more")
            for t in np.flatnonzero(unsure | vague)
        ]
        return tracks.rows(~(unsure | vague)), events


def events_of_scan(implausible: int, overload: int) -> list[Event]:
    """Events about the detections of a scan that were masked, and about those that are too many for births."""
    events = []
    if implausible:
        events.append(Event("implausible", NO_TRACK, f"{implausible} detections beyond what radars measure left out"))
    if overload:
        events.append(Event("overload", NO_TRACK, f"nothing is born from {overload} unexplained detections"))
        warnings.warn(OVERLOAD, RuntimeWarning, stacklevel=3)
    return events


def events_of(note: Note, ids: NDArray) -> list[Event]:
    """A filter's note about its T objects as events of the tracks with these ids (T,)."""
    rows = np.flatnonzero(note.where)
    contours = [None] * len(rows) if note.contours is None else note.contours[rows]
    return [Event(note.kind, int(i), note.reason, c) for i, c in zip(ids[rows], contours, strict=True)]
