"""pmht-spline-adaptive: pmht-spline that learns class and contour of each object from its detections, on the way.

Equations: docs/methods/spline-pmht.md and docs/methods/smoothing.md, after Yao et al. (2021), whose adaptation is one
batch with a view from all sides. Each object keeps its last scans. When they span `span` seconds and hold `least`
detections, or the window is full, its turn may come, in the stages of `Learner`. At most `at_once` objects have a turn
in one update, first those that have begun, then those that have waited longest: so its cost is bounded. Of a scan that
shows a part of an object nothing is kept: half a car looks like a motorcycle.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from trackers import held_gaussian
from trackers.batch import put, select, take
from trackers.estimate import Estimate, check_estimate
from trackers.filter import Gaussian, Note
from trackers.geometry import rotation, to_frame, to_world
from trackers.held_gaussian import LENGTH, prior_moments, resized
from trackers.motion.turn import PHI
from trackers.parameters import check_numbers
from trackers.pmht import pool as pools
from trackers.pmht import window as windows
from trackers.pmht.filter import TRUCK_ABOVE, SplinePmht
from trackers.pmht.joint import SplineInfo
from trackers.pmht.learner import AdaptiveState, Learner, forgotten, index, moved, plain
from trackers.pmht.learning import SplineContour
from trackers.pmht.state import predicted
from trackers.scan import Scan
from trackers.validation import definite, guarded_predict, guarded_update, unguarded

NOTED_ABOVE = 0.2  # [m] that a comparison with the classes has to move an outline to be noted


@dataclass(frozen=True)
class AdaptiveSpline:
    """A `SplinePmht` that learns class and contour of every object."""

    learner: Learner
    window: int = 32  # scans that are kept
    kept: int = 16  # detections of a scan that are kept
    span: float = 0.5  # [s] of scans before a turn
    least: int = 25  # detections before a turn, unless the window is full
    at_once: int = 1  # objects that have a turn in one update
    bins: int = 8  # directions that an object is seen from
    room: int = 40  # detections kept of each direction
    hysteresis: float = 0.3  # [m] about the length that divides the two contours of objects of unknown class
    out_of_class: float = 3.0  # standard deviations of log length beyond which a restart forgets the class

    angles: ClassVar[tuple[int, ...]] = (PHI,)  # of m
    log_size: ClassVar[bool] = False
    gaussian, with_gaussian = held_gaussian.gaussian, held_gaussian.with_gaussian

    def __post_init__(self) -> None:
        check_numbers(self, positive=("window", "kept", "at_once", "bins", "room"))

    @property
    def spline(self) -> SplinePmht:
        """The filter that tracks the objects."""
        return self.learner.spline

    @property
    def size_walk(self) -> float:
        """Random walk [m/sqrt(s)] of length and width."""
        return self.spline.size_walk

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the classes of `Estimate.class_probability`."""
        return self.learner.catalogue.names

    # -- the verbs --------------------------------------------------------------------------------------------------

    def init(self, estimate: Estimate) -> AdaptiveState:
        """State from a prior; raises ValueError for a prior that is not finite, positive, definite."""
        check_estimate(estimate)
        m, P = prior_moments(estimate, estimate.size, estimate.size_std)
        kind = self.spline.by_length(m[..., LENGTH])
        p, Sigma, visible = (a[kind] for a in self.learner.offline)
        lead, zero = m.shape[:-1], np.zeros(m.shape[:-1], int)
        return AdaptiveState(
            *(m, P, p, Sigma, visible, kind),
            cross=P,
            window=windows.empty(lead, self.window, self.kept),
            pool=pools.empty(lead, self.bins, self.room),
            draft=SplineContour(p, Sigma),
            stage=zero,
            fresh=zero,
            probability=self.learner.catalogue.by_size(estimate.size, estimate.size_std),
            complete=np.ones(lead, bool),
        )

    @guarded_predict
    def predict(self, state: AdaptiveState, dt: float) -> AdaptiveState:
        """Time update over dt [s] >= 0; the contour stays."""
        if dt == 0:
            return state
        moved = predicted(state.m, state.P, self.spline.walk, dt)
        cross = state.cross @ np.linalg.solve(state.P, moved.D)  # (SM.9)
        window = state.window._replace(time=state.window.time + dt)
        return state._replace(m=moved.mean, P=moved.cov, cross=cross, window=window)

    @guarded_update
    def update(self, state: AdaptiveState, scan: Scan) -> tuple[AdaptiveState, SplineInfo]:
        """Measurement update, then at most `at_once` objects learn; without a detection the state is as it came."""
        gaussian, info = self.located(state, scan)
        return self.learned(state, gaussian, scan, info)

    def located(self, state: AdaptiveState, scan: Scan) -> tuple[Gaussian, SplineInfo]:
        """Mean and covariance after the scan, without learning."""
        before = plain(state)
        own, info = unguarded(self.spline.update)(before, scan)
        own = definite(own, before)
        return Gaussian(own.m, own.P), info

    def learned(
        self, state: AdaptiveState, gaussian: Gaussian, scan: Scan, info: SplineInfo
    ) -> tuple[AdaptiveState, SplineInfo]:
        """State with the Gaussian after the scan, then at most `at_once` objects learn, which may move them."""
        some = info.n > 0
        if not some.any():
            return state, info
        detections = self.spline.relative(state.m, scan, scan.xy)
        detections = detections._replace(mask=detections.mask & state.complete[..., None])
        gain = np.linalg.solve(state.P, state.cross.mT).mT  # (SM.9)
        window = windows.cleared(state.window, info.lost & some)  # a jump is no motion that could be smoothed over
        window = windows.record(window, gaussian.m, state.m, gain, detections, scan.pose[..., :2], some)
        cross = np.where(some[..., None, None], gaussian.P, state.cross)
        new, notes = self._learn(state._replace(m=gaussian.m, P=gaussian.P, cross=cross, window=window), some)
        return new, info._replace(notes=(*info.notes, *notes))

    def estimate(self, state: AdaptiveState) -> Estimate:
        """Box along the heading, the contour learned so far, and the probabilities of the classes."""
        return self.spline.estimate(plain(state))._replace(class_probability=state.probability.copy())

    def resize(self, state: AdaptiveState, size: NDArray, size_std: NDArray) -> AdaptiveState:
        """State with another size and std (..., 2) [m], also in window and pool; the contour may change with length."""
        m, P = resized(state.m, state.P, size, size_std)
        shrunk = np.ones(m.shape)
        before = state.P.diagonal(axis1=-2, axis2=-1)[..., LENGTH:]
        shrunk[..., LENGTH:] = np.minimum(size_std / np.sqrt(before), 1.0)
        old, window = state.m[..., LENGTH:], state.window
        past, past_pred = window.m.copy(), window.m_pred.copy()
        for states in (past, past_pred):
            states[..., LENGTH:] += (size - old)[..., None, :]
        return self._of_its_length(
            state._replace(
                m=m,
                P=P,
                cross=state.cross * shrunk[..., None, :],
                window=window._replace(m=past, m_pred=past_pred),
                pool=pools.moved(state.pool, np.zeros_like(old), old, size),
            )
        )

    def shift(self, state: AdaptiveState, d: NDArray) -> AdaptiveState:
        """State with d (..., 2) [m] added to the centre, now and, turned with the body, in the window and the pool."""
        m = state.m.copy()
        m[..., :2] += d
        body = (rotation(-m[..., PHI]) @ d[..., None])[..., 0]
        window, size = state.window, m[..., LENGTH:]
        past = {name: moved(getattr(window, name), body[..., None, :]) for name in ("m", "m_pred")}
        return state._replace(m=m, window=window._replace(**past), pool=pools.moved(state.pool, body, size, size))

    def restart(self, state: AdaptiveState, estimate: Estimate) -> AdaptiveState:
        """State that starts again without detections; class and contour stay where the new length fits the class."""
        fresh = self.init(estimate)
        new = forgotten(state._replace(m=fresh.m, P=fresh.P, cross=fresh.P), np.ones(state.stage.shape, bool))
        size, std = self.class_size(state)
        d = np.abs(np.log(estimate.size / size) / std)[..., 0]
        return self._of_its_length(select(d > self.out_of_class, fresh, new))

    def learn_where(self, state: AdaptiveState, where: NDArray) -> AdaptiveState:
        """State that learns from the next update only where (...) is true; it learns from every one by default."""
        return state._replace(complete=where)

    def class_size(self, state: AdaptiveState) -> tuple[NDArray, NDArray]:
        """Mean size (..., 2) [m] of the classes of the objects and std of its logarithms; NaN where not known."""
        which = state.kind - len(self.spline.models)
        known = (which >= 0)[..., None]
        catalogue = self.learner.catalogue
        return np.where(known, catalogue.size[which], np.nan), np.where(known, catalogue.size_std, np.nan)

    def log_spatial(self, state: AdaptiveState, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""
        return self.spline.log_spatial(plain(state), scan, track, detection)

    def _of_its_length(self, state: AdaptiveState) -> AdaptiveState:
        """The state where objects of unknown class that became long, or short, start again from the other contour."""
        if len(self.spline.models) == 1:
            return state
        edge = TRUCK_ABOVE + np.where(state.kind == 0, self.hysteresis, -self.hysteresis)
        unknown = state.kind < len(self.spline.models)
        kind = np.where(unknown, self.spline.by_length(state.m[..., LENGTH] - edge + TRUCK_ABOVE), state.kind)
        changed = kind != state.kind
        return forgotten(self.learner.of_kind(state, kind), changed) if changed.any() else state

    # -- turns ------------------------------------------------------------------------------------------------------

    def _learn(self, state: AdaptiveState, some: NDArray) -> tuple[AdaptiveState, tuple[Note, ...]]:
        """One stage for the objects whose turn it is, among those with a detection, and notes of what changed."""
        window, lead = state.window, state.stage.shape
        full = window.scans >= self.window
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
                notes += self._notes(kind, before, after, rows, lead)
        return state, tuple(notes)

    def _notes(
        self, kind: str, before: AdaptiveState, after: AdaptiveState, rows: NDArray, lead: tuple[int, ...]
    ) -> list[Note]:
        """A note for each of the objects rows (A,) whose contour or place changed; both contours in its new frame."""
        rings = [self.learner.outlines_of(s) for s in (before, after)]
        rings[0] = to_frame(after.m[:, : PHI + 1], to_world(before.m[:, : PHI + 1], rings[0]))
        pairs = np.stack(rings, -3)
        notes = []
        jumped = np.abs(rings[1] - rings[0]).max((-1, -2)) > NOTED_ABOVE
        for a in np.flatnonzero(jumped | (before.p != after.p).any((-1, -2))):
            where, contours = np.zeros(lead, bool), np.zeros((*lead, *pairs.shape[1:]))
            at = np.unravel_index(rows[a], lead)
            where[at], contours[at] = True, pairs[a]
            notes.append(
                Note(kind, self._reason(kind, *(take(s, np.array([a])) for s in (before, after))), where, contours)
            )
        return notes

    def _reason(self, kind: str, before: AdaptiveState, after: AdaptiveState) -> str:
        """Why the contour of one object changed."""
        if kind == "adapted":
            sides = pools.ends_seen(before.pool, before.m, self.learner.seen_from).sum()
            count = before.pool.all.mask.sum()
            return f"contour learned from the newest {count} detections, seen from {sides} of 4 sides"
        p, first = after.probability[0], len(self.spline.models)
        likely = f"{self.classes[int(p.argmax())]} with probability {p.max():.2f}"
        dropped = before.kind[0] >= first > after.kind[0]
        return f"not sure any more, {likely}; contour by the length" if dropped else likely
