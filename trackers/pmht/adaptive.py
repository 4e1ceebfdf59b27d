"""pmht-spline-adaptive: pmht-spline that learns class and contour of each object from its detections, on the way.

Symbols and equations: card bspline_pmht, sections 7 and 8, after Yao et al. (2021), whose adaptation is one batch with
a view from all sides. Ours goes on while the loop runs and sees one to three sides.

The rule. Each object keeps its last looks. When they span `span` seconds and hold `least` detections, or the window is
full, its turn may come: the smoothed states (12) take the motion out of the detections (14), which join a pool of the
newest ones of each of the directions that it was seen from. With the next look the pool is compared with the catalogue
of classes. Looks at a part of an object, cut off by the edge of a field of view or hidden by others, count for neither:
half a car looks like a motorcycle. Once `Learner.enough` of its detections are new, looks with a few steps of
expectation maximisation each follow, and in the last the filter takes the new contour over. No more than `at_once`
objects have a turn in one look, first those that have begun, then those that have waited longest; so the cost of a look
is bounded, whatever the number of objects.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trackers.batch import put, select, take
from trackers.estimate import Estimate, check_estimate
from trackers.geometry import to_frame, to_world
from trackers.motion import PHI
from trackers.pmht import pool as pools
from trackers.pmht import window as windows
from trackers.pmht.adaptive_state import AdaptiveState, forgotten, index, plain
from trackers.pmht.filter import TRUCK_ABOVE, SplinePmht
from trackers.pmht.info import SplineInfo
from trackers.pmht.learner import Learner
from trackers.pmht.learning import Contour
from trackers.pmht.motion import predicted
from trackers.pmht.state import LENGTH, moments_of, resized
from trackers.protocols import Note
from trackers.scan import Scan

TOLD = 0.2  # [m] by which a comparison with the classes moves an outline, above which it is told


@dataclass(frozen=True)
class AdaptiveSpline:
    """A `SplinePmht` with a class and a contour of its own for every object."""

    learner: Learner
    window: int = 32  # looks that are kept
    kept: int = 16  # detections of a look that are kept
    span: float = 0.5  # [s] of looks before a turn
    least: int = 25  # detections in them; or the window is full
    at_once: int = 1  # objects that have a turn in one look
    bins: int = 8  # directions to an object
    room: int = 40  # detections of each
    hysteresis: float = 0.3  # [m] of the length at which objects of unknown class change the contour they started from
    out_of_class: float = 3.0  # standard deviations of log length, beyond which a restart makes the class unknown

    def __post_init__(self) -> None:
        if min(self.window, self.kept, self.at_once, self.bins, self.room) < 1:
            raise ValueError(
                "window, kept, at_once, bins and room must be at least 1, got "
                f"{self.window}, {self.kept}, {self.at_once}, {self.bins}, {self.room}"
            )
        limits = (self.span, self.least, self.hysteresis, self.out_of_class)
        if not min(limits) >= 0:
            raise ValueError(
                f"span, least, hysteresis and out_of_class must be at least 0, got {', '.join(map(str, limits))}"
            )

    @property
    def spline(self) -> SplinePmht:
        """The filter that follows the objects."""
        return self.learner.spline

    @property
    def angles(self) -> tuple[int, ...]:
        """As of `SplinePmht`."""
        return self.spline.angles

    @property
    def classes(self) -> tuple[str, ...]:
        """What `Estimate.class_probability` is about."""
        return self.learner.catalogue.names

    # -- the verbs --------------------------------------------------------------------------------------------------

    def init(self, estimate: Estimate) -> AdaptiveState:
        """State from a prior; raises ValueError for a prior that is not finite, positive, definite."""
        check_estimate(estimate)
        m, P = moments_of(estimate)
        kind = self.learner.by_length(m[..., LENGTH])
        p, Sigma, sight = (a[kind] for a in self.learner.offline)
        lead, zero = m.shape[:-1], np.zeros(m.shape[:-1], int)
        return AdaptiveState(
            *(m, P, p, Sigma, sight, kind),
            cross=P,
            window=windows.empty(lead, self.window, self.kept),
            pool=pools.empty(lead, self.bins, self.room),
            draft=Contour(p, Sigma),
            stage=zero,
            fresh=zero,
            probability=self.learner.catalogue.by_size(estimate.size, estimate.size_std),
            whole=np.ones(lead, bool),
        )

    def predict(self, state: AdaptiveState, dt: float) -> AdaptiveState:
        """Time update over dt [s] >= 0; the contour stays."""
        if not dt >= 0:
            raise ValueError(f"dt must be >= 0 s, got {dt}; scans come in the order of time")
        if dt == 0:
            return state
        moved = predicted(state.m, state.P, self.spline.walk, dt)
        cross = state.cross @ np.linalg.solve(state.P, moved.D)
        window = state.window._replace(time=state.window.time + dt)
        return state._replace(m=moved.mean, P=moved.cov, cross=cross, window=window)

    def update(self, state: AdaptiveState, scan: Scan) -> tuple[AdaptiveState, SplineInfo]:
        """Measurement update, then at most `at_once` objects learn; without a detection the state is as it came."""
        own, info = self.spline.update(plain(state), scan)
        some = info.n > 0
        if not some.any():
            return state, info
        seen = self.spline.relative(state.m, scan, scan.xy)
        seen = seen._replace(mask=seen.mask & state.whole[..., None])
        gain = np.linalg.solve(state.P, state.cross.mT).mT
        window = windows.cleared(state.window, info.lost & some)  # the past does not lead there
        window = windows.record(window, own.m, state.m, gain, seen, scan.pose[..., :2], some)
        cross = np.where(some[..., None, None], own.P, state.cross)
        new, notes = self._learn(state._replace(m=own.m, P=own.P, cross=cross, window=window), some)
        return new, info._replace(notes=(*info.notes, *notes))

    def estimate(self, state: AdaptiveState) -> Estimate:
        """Box along the heading, the contour as it is known now, and how probable each class is."""
        return self.spline.estimate(plain(state))._replace(class_probability=state.probability.copy())

    def resize(self, state: AdaptiveState, size: NDArray, size_std: NDArray) -> AdaptiveState:
        """State with another size (..., 2) [m]; one that is now of the other model starts from its contour."""
        m, P = resized(state.m, state.P, size, size_std)
        shrunk = np.ones(m.shape)
        before = state.P.diagonal(axis1=-2, axis2=-1)[..., LENGTH:]
        shrunk[..., LENGTH:] = np.minimum(size_std / np.sqrt(before), 1.0)
        return self._of_its_length(state._replace(m=m, P=P, cross=state.cross * shrunk[..., None, :]))

    def restart(self, state: AdaptiveState, estimate: Estimate) -> AdaptiveState:
        """State that starts again from an estimate; what a class and a contour were learned from goes.

        The contour that was learned stays, unless the new length is none of its class.
        """
        fresh = self.init(estimate)
        new = forgotten(state._replace(m=fresh.m, P=fresh.P, cross=fresh.P), np.ones(state.stage.shape, bool))
        usual, std = self.usual_size(state)
        d = np.abs(np.log(estimate.size / usual) / std)[..., 0]
        return self._of_its_length(select(d > self.out_of_class, fresh, new))

    def attend(self, state: AdaptiveState, where: NDArray) -> AdaptiveState:
        """State that learns from the next update where (...) is true; without this verb it learns from every one."""
        return state._replace(whole=where)

    def usual_size(self, state: AdaptiveState) -> tuple[NDArray, NDArray]:
        """Size (..., 2) [m] that is usual for the classes of objects and std of its logarithms; NaN if unknown."""
        which = state.kind - len(self.spline.models)
        known = (which >= 0)[..., None]
        catalogue = self.learner.catalogue
        return np.where(known, catalogue.size[which], np.nan), np.where(known, catalogue.size_std, np.nan)

    def log_spatial(self, state: AdaptiveState, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""
        return self.spline.log_spatial(plain(state), scan, track, detection)

    def _of_its_length(self, state: AdaptiveState) -> AdaptiveState:
        """Objects of unknown class that have become long, or short, start again from the other contour."""
        if len(self.spline.models) == 1:
            return state
        edge = TRUCK_ABOVE + np.where(state.kind == 0, self.hysteresis, -self.hysteresis)
        unknown = state.kind < len(self.spline.models)
        kind = np.where(unknown, self.learner.by_length(state.m[..., LENGTH] - edge + TRUCK_ABOVE), state.kind)
        changed = kind != state.kind
        return forgotten(self.learner.of_kind(state, kind), changed) if changed.any() else state

    # -- turns ------------------------------------------------------------------------------------------------------

    def _learn(self, state: AdaptiveState, some: NDArray) -> tuple[AdaptiveState, tuple[Note, ...]]:
        """Turns of those that are next, of the objects that have a detection."""
        window, lead = state.window, state.stage.shape
        full = window.looks >= self.window
        ready = (window.time >= self.span) & (window.detections >= np.where(full, 1, self.least))
        waited = np.where(state.stage > 0, np.inf, np.where(ready, window.time, -1.0))
        rank = np.where(some, waited, -1.0).ravel()
        turn = np.argsort(-rank, kind="stable")[: self.at_once]
        turn = turn[rank[turn] >= 0]
        stage = state.stage.ravel()[turn]
        last = stage == self.learner.turns + 1
        notes: list[Note] = []
        for rows, learn, kind in (
            (turn[stage == 0], self.learner.gathered, ""),
            (turn[stage == 1], self.learner.compared_with_classes, "classified"),
            (turn[(stage > 1) & ~last], self.learner.stepped, ""),
            (turn[last], self.learner.adopted, "adapted"),
        ):
            if not len(rows):
                continue
            at = index(rows, lead)
            before = take(state, at)
            after = learn(before)
            state = put(state, at, after)
            if kind:
                notes += self._told(kind, before, after, rows, lead)
        return state, tuple(notes)

    def _told(
        self, kind: str, before: AdaptiveState, after: AdaptiveState, rows: NDArray, lead: tuple[int, ...]
    ) -> list[Note]:
        """A note for each of the objects rows (A,) whose contour or place has changed: contours in its frame of now."""
        rings = [self.learner.outlines_of(s) for s in (before, after)]
        rings[0] = to_frame(after.m[:, : PHI + 1], to_world(before.m[:, : PHI + 1], rings[0]))
        pairs = np.stack(rings, -3)
        notes = []
        jumped = np.abs(rings[1] - rings[0]).max((-1, -2)) > TOLD
        for a in np.flatnonzero(jumped | (before.p != after.p).any((-1, -2))):
            where, contours = np.zeros(lead, bool), np.zeros((*lead, *pairs.shape[1:]))
            at = np.unravel_index(rows[a], lead)
            where[at], contours[at] = True, pairs[a]
            notes.append(
                Note(kind, self._reason(kind, *(take(s, np.array([a])) for s in (before, after))), where, contours)
            )
        return notes

    def _reason(self, kind: str, before: AdaptiveState, after: AdaptiveState) -> str:
        """Why the contour of one object has changed."""
        if kind == "adapted":
            sides = pools.ends_seen(before.pool, before.m, self.learner.seen_from).sum()
            count = before.pool.all.mask.sum()
            return f"contour learned from the newest {count} detections, seen from {sides} of 4 sides"
        p, first = after.probability[0], len(self.spline.models)
        likely = f"{self.classes[int(p.argmax())]} with probability {p.max():.2f}"
        dropped = before.kind[0] >= first > after.kind[0]
        return f"not sure any more, {likely}; contour by the length" if dropped else likely
