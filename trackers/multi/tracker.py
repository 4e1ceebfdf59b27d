"""The multi-object tracker: many objects over any single-object filter, all tracks in one batch.

Order of a step and equations: docs/methods/multi-object-tracking.md. The tracker holds parameters only; its state is
`Tracks`, which `step` takes and returns.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trackers.batch import concatenate, keep, put, select, take
from trackers.compiled import available
from trackers.estimate import Estimate, prior
from trackers.filter import Abilities, Filter, Note
from trackers.linalg import largest_eigenvalue
from trackers.multi.association import Association, Claims, SortedScan, gather, least, shares
from trackers.multi.beside import NOTHING as NO_DETECTIONS
from trackers.multi.beside import BesideTest, owners
from trackers.multi.exclusion import Exclusion
from trackers.multi.existence import Existence
from trackers.multi.folding import unfolded
from trackers.multi.ground import NOTHING, GroundTest
from trackers.multi.initiation import Births, Initiation
from trackers.multi.leftovers import Suppression
from trackers.multi.neighbours import InFile, Neighbours
from trackers.multi.outage import SensorOutage, without
from trackers.multi.partial import as_if_whole, shade_of
from trackers.multi.reidentification import LostTracks, Reidentification
from trackers.multi.road import Bend, Bends, RoadMap
from trackers.multi.silence import Silence
from trackers.multi.tracks import BEFORE, BEHIND, NO_TRACK, REPORT_ABOVE, Event, Memory, Rest, Seen, StepInfo, Tracks
from trackers.multi.visibility import SensorArray, Visibility, predict_visibility
from trackers.multi.way import Way
from trackers.multi.window import Unexplained
from trackers.parameters import check_numbers
from trackers.scan import Scan, SensorModel
from trackers.validation import MAX_SPEED, Admitted, admit, check_step, guarded


@dataclass(frozen=True)
class MultiObjectTracker:
    """Tracks all vehicles in view of the sensors, over any single-object filter."""

    filter: Filter
    sensors: tuple[SensorModel, ...]
    association: Association = field(default_factory=Association)
    existence: Existence = field(default_factory=Existence)
    outage: SensorOutage = field(default_factory=SensorOutage)
    suppression: Suppression = field(default_factory=Suppression)
    initiation: Initiation = field(default_factory=Initiation)
    reidentification: Reidentification = field(default_factory=Reidentification)
    exclusion: Exclusion = field(default_factory=Exclusion)
    prune_below: float = 0.02  # existence below which a track dies
    prune_position_std: float = 5.0  # [m] above which it dies
    most_detections: int = 16  # of a scan, for the update of one track: those of one vehicle are not independent
    occlude_above: float = 0.6  # existence of a track that may hide others
    occlude_hits: int = 4  # and its hits, to be exceeded
    rate_factor: float = 0.8  # of the data sheets' expected counts
    edge_sigmas: float = 0.0  # of the place of a track: what is so near to the edge of a view is not sure to be in it
    as_whole: bool = False  # what others hide in part is taken for whole: detections are turned, sides may be longer
    complete_above: float = 0.75  # visible share of an object's span from which an update teaches its class
    road: RoadMap | None = None  # map of the lanes; without it no standing vehicle is born
    silence: Silence | None = field(default_factory=Silence)  # of radars about lengths; None: says nothing
    neighbours: Neighbours | None = field(default_factory=Neighbours)  # bound lengths; None: they do not
    ground: GroundTest | None = None  # divides long tracks over empty ground; None: they stay one

    def __post_init__(self) -> None:
        check_numbers(self, positive=("most_detections",), unlimited=("prune_position_std",))
        if not self.sensors:
            raise ValueError("sensors must name at least one SensorModel; take them from Radar.models")
        least = self.initiation.least_existence
        if least <= self.prune_below:
            raise ValueError(
                f"prune_below {self.prune_below} must be under the least existence at birth, {least}, or births are "
                "removed in silence"
            )
        if self.can.on_sensors is not None:
            object.__setattr__(self, "filter", self.can.on_sensors(self.sensors))
            del self.__dict__["can"]

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_compiled"}  # copies find their own

    @cached_property
    def can(self) -> Abilities:
        """What the filter offers beyond the four methods."""
        return Abilities.of(self.filter)

    @cached_property
    def _compiled(self) -> Any:
        """The compiled form of what is done around the filter; None where it is not there, or parts are others."""
        from trackers.compiled.multi import Life

        return Life.of(self)

    @cached_property
    def sensor_array(self) -> SensorArray:
        """The data sheets as arrays."""
        return SensorArray.of(self.sensors)

    @cached_property
    def _bends(self) -> Bends | None:
        """How the lanes bend; None where none does, or the filter does not ask for it."""
        return None if self.can.on_lanes is None else Bends.of(self.road)

    @cached_property
    def _fold(self) -> NDArray | None:
        """Range rates (S,) [m/s] beyond which those of the sensors fold; None where none does."""
        fold = np.array([s.fold_rate for s in self.sensors])
        return fold if np.isfinite(fold).any() else None

    def start(self) -> Tracks:
        """The state before the first scan: no track."""
        estimate = prior(np.zeros((0, 3)))
        none = np.zeros(0)
        return Tracks(
            none.astype(int), none, none.astype(int), none, none.astype(bool), self.filter.init(estimate), estimate,
            memory=Memory(classes=self.can.classes), hidden=none, noise=none,
        )  # fmt: skip

    def step(self, tracks: Tracks, scan: Scan, dt: float) -> tuple[Tracks, StepInfo]:
        """Tracks after one scan (M,) of all sensors, dt [s] after the scan before, and what was decided.

        Raises:
            ValueError: a scan of wrong shape, not finite, or of sensors that the tracker does not have; a time step
                that is not finite, negative or longer than a minute. The error names the field.

        """
        check_step(dt)
        life = self._compiled if len(tracks.id) and available() else None
        scan, implausible = (scan, 0) if life is not None and life.plausible(scan) else self._admit(scan)
        if self.road is None:
            tracks = tracks._replace(memory=tracks.memory._replace(way=self._way(tracks, scan.platform)))
        tracks = self._predict(tracks, dt, life)
        if self._fold is not None:
            scan = unfolded(scan, tracks, self.association, self.sensor_array, self._fold)
        seen = self._without_strays(self._seen(tracks, scan, dt) if life is None else life.seen(tracks, scan, dt))
        updated, info = self._update(seen, life, dt)
        rest = None if life is None else life.rest(seen, updated, dt)
        existence = self.existence.update(seen.tracks.existence, info.log_ratio) if rest is None else rest.existence
        updated, rare = self._conclude(updated._replace(existence=existence), seen, rest, dt)
        owner = np.full(scan.mask.shape[-1], -1)
        owner[seen.order] = np.where(seen.owner >= 0, tracks.id[seen.owner], -1) if len(tracks.id) else -1
        fresh = (updated.existence > REPORT_ABOVE) & ~updated.confirmed
        events = [*events_of_scan(int(implausible)), *info.events, *rare]
        events += [
            Event("confirmed", int(i), f"existence {q:.2f}")
            for i, q in zip(updated.id[fresh], updated.existence[fresh])
        ]
        tracks_new = updated._replace(confirmed=updated.confirmed | fresh)
        return tracks_new, info._replace(owner=owner, events=tuple(events), implausible=int(implausible))

    def _way(self, tracks: Tracks, platform: NDArray) -> Way:
        """The road as the ego drives it to this platform (6,), and the tracks that were reported."""
        before = tracks.memory.way or Way.of(platform)
        return before.followed(platform, take(tracks.estimate, np.flatnonzero(tracks.confirmed)))

    def _bend(self, way: Way | None, beside: float = 0.0) -> Bend | None:
        """How the lanes bend, those of the map up to beside [m] from them; None: they do not, or nobody asks for it."""
        if self.can.on_lanes is None:
            return None
        if self.road is None:
            return None if way is None else way.curvature
        return None if self._bends is None else partial(self._bends.at, beside=beside)

    def _predict(self, tracks: Tracks, dt: float, life: Any = None) -> Tracks:
        before, bend = tracks.state, self._bend(tracks.memory.way)
        if bend is not None and self.can.on_lanes is not None:
            before = self.can.on_lanes(before, bend(tracks.estimate.pose))  # (MODE.34)
        state = None if life is None else life.predict(before, dt)
        state = self.filter.predict(before, dt) if state is None else state
        return tracks._replace(state=state, estimate=self.filter.estimate(state), age=tracks.age + dt)

    def _update(self, seen: Seen, life: Any, dt: float) -> tuple[Tracks, StepInfo]:
        """The tracks after their detections, with the existence before them, and the report."""
        tracks, z, _, owner, view, info = seen
        state, some = tracks.state, info.detections > 0
        lost = some & view.end_hidden
        if self.can.loosen is not None and lost.any():
            state = self.can.loosen(state, lost)
        state = self._quieted(state, seen, some)
        seen = seen._replace(tracks=tracks._replace(state=state))
        if some.any():
            hides = self._hides(tracks) if self.as_whole else None
            found = None if life is None else life.update(seen, hides)
            if found is None:
                turned, around = z, [z.scan, owner]
                if hides is not None:
                    shade = shade_of(tracks.estimate, hides, self.sensor_array, z.scan.platform)
                    turned = as_if_whole(z, owner, tracks.estimate, shade, view.share, self.sensor_array)
                    around.append(shade)
                if self.can.learn_where is not None:
                    state = self.can.learn_where(state, view.complete > self.complete_above)
                share = gather(turned, shares(owner, len(tracks.id), self.most_detections))
                among = self.can.update_among
                found = guarded(among, state, share, *around) if among else guarded(self.filter.update, state, share)
            state, info = found[0], reported(info, found[1])
        hidden, noise = tracks.hidden, tracks.noise
        if hidden is not None and noise is not None:
            works = np.any(np.asarray(tracks.memory.out) < 0.5)
            unseen = view.hidden | (view.certain.max(0) == 0)
            hidden = np.where(some, 0.0, hidden + dt * (unseen & works))
            noise = np.where(some, least(z.var_across, owner, len(some)), noise)
        hits = tracks.hits + some  # (MOT.26)
        estimate = self.filter.estimate(state)
        return tracks._replace(state=state, estimate=estimate, hits=hits, hidden=hidden, noise=noise), info

    def _quieted(self, state: Any, seen: Seen, some: NDArray) -> Any:
        """The state after what silent sensors and neighbours say of tracks with detections, some (T,) bool."""
        tracks, out, can, silence = seen.tracks, np.asarray(seen.tracks.memory.out), self.can, self.silence
        if can.quiet is None or can.reach is None:
            return state
        estimate, none, neighbours = tracks.estimate, np.zeros(0, int), self.neighbours
        rows = silence.asked(estimate, some, seen.z, seen.owner, out, self.sensor_array) if silence else none
        asked = neighbours.asked(estimate, some, tracks.age, tracks.divided) if neighbours else InFile(none, none)
        if not len(rows) and not len(asked.rows):
            return state
        longest = can.reach(tracks.state)
        said = (
            silence.quiet(
                rows, take(longest, rows), estimate, self._hides(tracks), seen.z, seen.owner, out, self.sensor_array,
                self.rate_factor,
            )
            if silence and len(rows)
            else None,
            neighbours.bound(asked, take(longest, asked.rows), estimate) if neighbours and len(asked.rows) else None,
        )  # fmt: skip
        for quiet in said:
            state = state if quiet is None else can.quiet(state, *quiet)
        return state

    def _hides(self, tracks: Tracks) -> NDArray:
        """Which tracks (T,) bool are sure enough to hide others."""
        return (tracks.existence > self.occlude_above) & (tracks.hits > self.occlude_hits)

    def _conclude(self, tracks: Tracks, seen: Seen, rest: Rest | None, dt: float) -> tuple[Tracks, list[Event]]:
        """The tracks after what is rare: division, death, birth and union; `rest` says what of it may happen now."""
        z = seen.z
        tracks, divided = self._divide(tracks, seen, dt) if rest is None or rest.long else self._forgot(tracks)
        rest = None if divided else rest
        candidate = (
            self.suppression.candidates(z, seen.owner, tracks.estimate, tracks.existence)
            if rest is None
            else rest.candidate
        )
        tracks, died = self._prune(tracks) if rest is None or rest.dies else (tracks, [])
        if rest is not None and rest.calm and not died:
            tracks, born = self._waited(tracks, rest.window, dt), list[Event]()
            if rest.apart:
                return tracks, []
        else:
            tracks, born = self._initiate(tracks, z, candidate, dt)
        tracks, merged = self._exclude(tracks)
        return tracks, [*divided, *died, *born, *merged]

    def _seen(self, tracks: Tracks, scan: Scan, dt: float) -> Seen:
        """The claims of predicted tracks, whose existence is that before dt [s]."""
        z, order = self.association.prepare(scan, self.sensor_array, self.road)
        view, out = self._view(tracks, scan)
        visible = view.share.max(0, initial=0.0) > 0
        alive = self.existence.survive(tracks.existence, visible, view.in_view, view.hidden, dt)
        tracks = tracks._replace(existence=alive, memory=tracks.memory._replace(out=out))
        gate = tracks.estimate if self.can.reach is None else self.can.reach(tracks.state)
        claims = self.association.claim(
            self.can.log_spatial,
            tracks.state,
            gate,
            tracks.existence,
            view.expected,
            z,
            self.sensor_array.clutter,
            tracks.hidden,
        )
        z = z._replace(clutter=claims.clutter)
        return Seen(tracks, z, order, claims.owner, view, self._weigh(tracks, view, claims))

    def _without_strays(self, seen: Seen) -> Seen:
        """The same without claims of single detections far outside the boxes of tracks that are not new."""
        tracks, info = seen.tracks, seen.info
        stray = self.association.strays(tracks.estimate, tracks.age, info.detections, seen.z, seen.owner)
        if not stray.any():
            return seen
        detections, log_ratio = info.detections.copy(), info.log_ratio.copy()
        rows = seen.owner[stray]
        detections[rows] = 0
        log_ratio[rows] = self.existence.log_ratio(detections[rows], info.expected[rows], np.zeros(len(rows)))
        owner = np.where(stray, -1, seen.owner)
        return seen._replace(owner=owner, info=info._replace(detections=detections, log_ratio=log_ratio))

    def _admit(self, scan: Scan) -> Admitted:
        """The scan without implausible detections; raises ValueError for one of no use."""
        admitted = admit(scan, ())
        S = len(self.sensors)
        if scan.delivered is not None and scan.delivered.shape != (S,):
            raise ValueError(
                f"scan.delivered must be bool ({S},), one for each sensor of the tracker, got {scan.delivered!r}"
            )
        if scan.sensor.size and not (scan.sensor.min() >= 0 and scan.sensor.max() < len(self.sensors)):
            raise ValueError(
                f"scan.sensor must index the tracker's {len(self.sensors)} sensors, got up to {scan.sensor.max()}; "
                "build the tracker with the models of the radar that made the scan"
            )
        return admitted

    def _view(self, tracks: Tracks, scan: Scan) -> tuple[Visibility, NDArray]:
        """What the sensors should see of the predicted tracks, and the probability (S,) that each delivers nothing."""
        view = predict_visibility(
            tracks.estimate, self._hides(tracks), self.sensor_array, scan.platform, self.rate_factor, self.edge_sigmas
        )
        if scan.delivered is not None:
            out = 1.0 - scan.delivered
        else:
            sensor = (scan.sensor + np.zeros(len(scan.mask), int))[scan.mask]
            heard = np.bincount(sensor, minlength=len(self.sensors)) > 0
            before = np.zeros(len(self.sensors)) if tracks.memory.out is None else tracks.memory.out
            clutter = self.sensor_array.clutter
            out = self.outage.probability(before, heard, view.expected, tracks.existence, clutter)
        return without(view, out), out

    def _waited(self, tracks: Tracks, window: Unexplained, dt: float) -> Tracks:
        """The tracks after a scan in which none is born."""
        memory, time = tracks.memory, tracks.memory.time + dt
        lost = None if memory.lost is None else self.reidentification.predict(memory.lost, dt, self.road)
        return tracks._replace(memory=memory._replace(time=time, unexplained=window, lost=lost))

    def _begun(self, state: object, z: SortedScan, owner: NDArray, tracks: int) -> tuple[object, Any]:
        """The state of so many new tracks after their first detections, of owners (M,), and the information."""
        return guarded(self.filter.update, state, gather(z, shares(owner, tracks, self.most_detections)))

    def _restart(self, state: object, estimate: Estimate) -> object:
        """State that starts again from an estimate."""
        return self.filter.init(estimate) if self.can.restart is None else self.can.restart(state, estimate)

    def _weigh(self, tracks: Tracks, view: Visibility, claims: Claims) -> StepInfo:
        """What the detections say of the existence of the tracks, before their update."""
        T = len(tracks.id)
        n = np.bincount(claims.owner[claims.owner >= 0], minlength=T)
        own = claims.owner[claims.detection] == claims.track
        log_gain = np.minimum(np.log1p(claims.gain[own]), self.existence.pair_cap)  # (MOT.24)
        evidence = np.bincount(claims.track[own], weights=log_gain, minlength=T)
        Gam = (view.expected * view.certain).sum(0)
        log_ratio = self.existence.log_ratio(n, Gam, evidence)
        return StepInfo(np.zeros(0, int), tracks.id, Gam, view.in_view, n, log_ratio, np.full(T, np.nan), ())

    def _initiate(self, tracks: Tracks, z: SortedScan, candidate: NDArray, dt: float) -> tuple[Tracks, list[Event]]:
        """The tracks and those born of the candidates (M,) bool and of the window, which goes on."""
        memory = tracks.memory
        points = self.initiation.window.predict(memory.unexplained, dt)
        points = keep(points, self.suppression.unexplained(points, tracks.estimate, tracks.existence))
        births = self.initiation.births(
            z, candidate, points, self.sensor_array.clutter, memory.time + dt, dt, self.road,
            self._bend(memory.way, self.initiation.window.beside_lane), memory.way,
        )  # fmt: skip
        tracks = self._waited(tracks, births.unexplained, dt)
        events = []
        if births.crowd:
            reason = f"{births.crowd} unexplained detections; births need three of one scan"
            events.append(Event("crowded", NO_TRACK, reason))
        if not len(births.existence):
            return tracks, events
        tracks, born = self._create_tracks(tracks, z, births)
        return tracks, [*events, *born]

    def _create_tracks(self, tracks: Tracks, z: SortedScan, births: Births) -> tuple[Tracks, list[Event]]:
        """The tracks and those born, updated with their detections of this scan; a lost vehicle gets its id back."""
        B, memory, lost = len(births.existence), tracks.memory, self._lost(tracks)
        state, hits, returned = self.filter.init(births.estimate), births.hits, np.zeros(B, bool)
        id = tracks.next_id + np.arange(B)
        if lost is not None and len(lost.id):
            row = self.reidentification.match(lost, births.estimate, births.length)
            returned = row >= 0
            old = take(lost, np.maximum(row, 0))
            known = self.initiation.sized(births, old.estimate.size, old.estimate.size_std)
            state = select(returned, self._restart(old.state, known), state)
            hits = hits + np.where(returned, old.hits, 0)
            id = np.where(returned, old.id, tracks.next_id + np.cumsum(~returned) - 1)
            tracks = tracks.rows(~np.isin(tracks.id, id))
            if memory.lost is not None:
                memory = memory._replace(lost=keep(memory.lost, ~np.isin(memory.lost.id, id)))
        state, info = self._begun(state, z, births.owner, B)
        estimate = self.filter.estimate(state)
        born = Tracks(
            id=id,
            existence=births.existence,
            hits=hits,
            age=np.zeros(B),
            confirmed=returned,
            state=state,
            estimate=estimate,
            next_id=tracks.next_id + int((~returned).sum()),
            memory=memory,
            hidden=None if tracks.hidden is None else np.zeros(B),
            noise=None if tracks.noise is None else least(z.var_across, births.owner, B),
        )
        events = [
            Event("returned", int(i), "where the lost vehicle should be by now")
            if back
            else Event("born", int(i), f"{n} detections that no track explains")
            for i, n, back in zip(id, births.detections, returned, strict=True)
        ]
        events += [event for note in getattr(info, "notes", ()) for event in events_of(note, id)]
        moving = (np.abs(estimate.velocity) <= MAX_SPEED).all(-1)  # noise that is claimed to be nothing makes any speed
        if not moving.all():
            born, events = born.rows(moving), [e for e in events if e.track in id[moving]]
        return tracks.and_born(born), events

    def _forgot(self, tracks: Tracks) -> tuple[Tracks, list[Event]]:
        """The tracks where none is long: nothing is remembered of the ground under them, nor of what they took."""
        memory = tracks.memory
        if not len(memory.ground.id) and not len(memory.taken.id):
            return tracks, []
        return tracks._replace(memory=memory._replace(ground=NOTHING, taken=NO_DETECTIONS)), []

    def _divide(self, tracks: Tracks, seen: Seen, dt: float) -> tuple[Tracks, list[Event]]:
        """The tracks after those that are two vehicles became two: the rear part keeps the id."""
        if not self.ground:  # None, or off in the name of a tracker
            return tracks, []
        d = self.ground.examined(tracks.estimate, tracks.existence)
        if not len(d):
            return self._forgot(tracks)
        tracks, in_file = self._divide_in_file(self.ground, tracks, d, seen, dt)
        tracks, beside = self._divide_beside(self.ground.lanes, tracks, d, seen, dt)
        return tracks, [*in_file, *beside]

    def _divide_in_file(
        self, test: GroundTest, tracks: Tracks, d: NDArray, seen: Seen, dt: float
    ) -> tuple[Tracks, list[Event]]:
        """The tracks after those with empty ground in them became two, of the long ones with rows d (D,)."""
        long = take(tracks.estimate, d)
        ground = test.predict(tracks.memory.ground, tracks.id[d], long, dt)
        ground = test.observe(ground, d, long, tracks.estimate, seen.view, seen.z, self.sensor_array)
        split = test.split(ground, long)
        platform, memory = seen.z.scan.platform, tracks.memory._replace(ground=ground)
        asked = ~seen.view.end_hidden[d] & ~split.where & (tracks.age[d] > test.settled)
        empty, shorter = test.cut(ground, long, asked, self.sensor_array, platform)
        tracks, events = self._cut(tracks._replace(memory=memory), d[empty], shorter)
        if not split.where.any():
            return tracks, events
        under, split, d = keep(ground, split.where), take(split, split.where), d[split.where]
        old, new_id = tracks.rows(d), tracks.next_id + np.arange(len(d))
        memory = memory._replace(ground=concatenate([ground, under._replace(id=new_id)]))
        boxes = test.pieces(under, split, old.estimate, self.sensor_array, platform)
        rear, front = (self._restart(old.state, box) for box in boxes)
        part = dict(zip(old.id.tolist(), new_id.tolist(), strict=True))  # front parts: what was before the whole is so
        ends = {(part.get(i, i) if end == BEFORE else i, end) for i, end in memory.divided.tolist() if i in tracks.id}
        ends |= {(i, BEFORE) for i in part} | {(i, BEHIND) for i in part.values()}
        memory = memory._replace(divided=np.array(sorted(ends)))
        gaps = split.front[:, 0] - split.rear[:, 1]
        tracks, divided = self._two(tracks, d, rear, front, memory, [f"{g:.1f} m of empty ground in it" for g in gaps])
        return tracks, [*events, *divided]

    def _cut(self, tracks: Tracks, d: NDArray, shorter: Estimate) -> tuple[Tracks, list[Event]]:
        """The tracks with those of rows d (C,) started again from shorter boxes (C,), and the events."""
        if not len(d):
            return tracks, []
        state = put(tracks.state, d, self._restart(take(tracks.state, d), shorter))
        less = tracks.estimate.size[d, 0] - shorter.size[:, 0]
        events = [
            Event("cut", int(i), f"{m:.1f} m at its near end were never hit")
            for i, m in zip(tracks.id[d], less, strict=True)
        ]
        return tracks._replace(state=state, estimate=self.filter.estimate(state)), events

    def _divide_beside(
        self, test: BesideTest, tracks: Tracks, d: NDArray, seen: Seen, dt: float
    ) -> tuple[Tracks, list[Event]]:
        """The tracks after those that took detections of two lanes became two, of the long ones with rows d (D,)."""
        memory, M = tracks.memory, len(seen.z.rate)
        taken = test.observe(memory.taken, d, tracks.id, seen.z, seen.owner, dt)
        bend = self._bend(memory.way) if len(taken.id) else None
        curvature = 0.0 if bend is None else bend(tracks.estimate.pose[d])
        pairs = test.pairs(taken, tracks.id[d], tracks.estimate.velocity[d], curvature)
        if not pairs:
            return tracks._replace(memory=memory._replace(taken=taken)), []
        d = d[[pair.track for pair in pairs]]
        id = tracks.id[d]
        ground = keep(memory.ground, ~np.isin(memory.ground.id, id))
        memory = memory._replace(taken=keep(taken, ~np.isin(taken.id, id)), ground=ground)
        whole = take(tracks.estimate, d)._replace(velocity=np.array([pair.velocity for pair in pairs]))
        rear, front = (
            self._begun(self.filter.init(self.initiation.parted(whole, own)), seen.z, owners(own, M), len(d))[0]
            for own in zip(*(pair.parts for pair in pairs), strict=True)
        )
        why = [f"detections of lanes {abs(pair.across):.1f} m apart" for pair in pairs]
        return self._two(tracks, d, rear, front, memory, why)

    def _two(
        self, tracks: Tracks, d: NDArray, rear: object, front: object, memory: Memory, why: Sequence[str]
    ) -> tuple[Tracks, list[Event]]:
        """The tracks with those of rows d (D,) as two of these states (D,) each, and the events with the reasons."""
        old, new_id = tracks.rows(d), tracks.next_id + np.arange(len(d))
        born = old._replace(
            id=new_id,
            age=np.zeros(len(d)),
            state=front,
            estimate=self.filter.estimate(front),
            next_id=tracks.next_id + len(d),
            memory=memory,
        )
        state = put(tracks.state, d, rear)
        events = [
            Event("divided", int(i), f"{reason}; the front part is track {n}")
            for i, n, reason in zip(old.id, new_id, why, strict=True)
        ]
        return tracks._replace(state=state, estimate=self.filter.estimate(state)).and_born(born), events

    def _lost(self, tracks: Tracks) -> LostTracks | None:
        """The vehicles that a birth may be: those of dead tracks, and of tracks that are unseen for long."""
        lost, hidden = tracks.memory.lost, tracks.hidden
        if hidden is None:
            return lost
        away = np.flatnonzero(tracks.confirmed & (hidden > self.reidentification.hidden))
        if not len(away):
            return lost
        found = LostTracks(tracks.id, tracks.hits, hidden, tracks.estimate, tracks.state)
        return self.reidentification.remember(lost, take(found, away))

    def _exclude(self, tracks: Tracks) -> tuple[Tracks, list[Event]]:
        score = tracks.existence * np.minimum(tracks.hits, 50)
        two = self.ground.two if self.ground else None
        result = self.exclusion.apply(tracks.estimate, score, tracks.divided, two, self.can.reach is not None)
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
        dead = take(tracks._replace(next_id=None, memory=None), (unsure | vague) & tracks.confirmed)  # type: ignore[arg-type]
        died = LostTracks(dead.id, dead.hits, np.zeros(len(dead.id)), dead.estimate, dead.state)
        memory = tracks.memory._replace(lost=self.reidentification.remember(tracks.memory.lost, died))
        return tracks.rows(~(unsure | vague))._replace(memory=memory), events


def events_of_scan(implausible: int) -> list[Event]:
    """The event about the detections of a scan that were masked."""
    if not implausible:
        return []
    return [Event("implausible", NO_TRACK, f"{implausible} detections beyond what radars measure left out")]


def reported(info: StepInfo, found: Any) -> StepInfo:
    """The report with the information of the filter's update."""
    events = tuple(event for note in getattr(found, "notes", ()) for event in events_of(note, info.track))
    return info._replace(nis=found.nis, mode=getattr(found, "mode", None), events=events)


def events_of(note: Note, ids: NDArray) -> list[Event]:
    """A filter's note about its T objects as events of the tracks with these ids (T,)."""
    rows = np.flatnonzero(note.where)
    contours = [None] * len(rows) if note.contours is None else note.contours[rows]
    return [Event(note.kind, int(i), note.reason, c) for i, c in zip(ids[rows], contours, strict=True)]
