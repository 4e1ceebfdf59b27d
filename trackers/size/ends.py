"""Ends: a filter around a filter. The inner one has motion and place, this one the size, which it pins there.

Equations: docs/methods/size-from-both-ends.md.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.batch import Memoised, select
from trackers.estimate import Estimate
from trackers.filter import Attentive, Filter, Resizable, Restartable, Shiftable
from trackers.geometry import rotation, to_frame, to_world
from trackers.linalg import symmetrize
from trackers.parameters import check_numbers
from trackers.scan import Scan, SensorModel
from trackers.size.belief import Belief, posterior
from trackers.size.evidence import evidence, facing
from trackers.size.fleet import Fleet, Prior
from trackers.size.grid import LENGTH, WIDTH, Grid
from trackers.size.hidden import Around
from trackers.size.hits import Boxes, hits_of
from trackers.size.profile import Profiles
from trackers.size.spatial import log_spatial
from trackers.validation import guarded_predict, guarded_update

ABEAM = np.sin(np.radians(10.0))  # a line of sight further off the axis meets sides behind the front of a load
ROLLED_ABOVE = 0.75  # steps of mean offset from which the box is moved instead


class EndsState(NamedTuple):
    """The state of the inner filter, and what the detections say of both ends."""

    inner: Any
    anchor: NDArray  # (..., 2) +-1: end (front, rear) and side (left, right) that faces the sensors; 0: none seen yet
    length: NDArray  # (..., K, N) log likelihood of length and offset
    width: NDArray  # (..., K', N')
    belief: Belief
    whole: NDArray  # (...) bool, the next scan shows the complete object
    abeam: NDArray  # (...) number of detections from another side than the front and the rear, older ones forgotten


@dataclass(frozen=True)
class Ends:
    """A grid Bayes filter of length and width around `filter`."""

    filter: Filter
    sensors: tuple[SensorModel, ...] = (SensorModel(max_range=np.inf, fov=2 * np.pi),)
    fleet: Fleet = field(default_factory=Fleet)
    length: Grid = LENGTH
    width: Grid = WIDTH
    outliers: float = 0.04  # eps, share of detections of neighbours and clutter
    independent: int = 6  # n_eff: a scan with more detections counts as so many
    memory: float = 10.0  # [s]
    offset_tau: float = 2.0  # [s] time constant of the offset
    lost_rate: float = 1.5e-3  # [1/s] at which a box is misplaced
    pin: float = 0.03  # standard deviation of the size in the inner filter, as a share of it
    least_pin: float = 0.02  # [m]
    part_weight: float = 0.3  # of scans that show a part of the width
    enough_abeam: float = 5.0  # detections from beside an object after which they show all of its length
    impossible: float = 1e-3  # probability of a greater size above which the gates reach so far
    sigma: float = 0.2  # [m] noise of detections whose scan does not state it

    def __post_init__(self) -> None:
        check_numbers(
            self, positive=("outliers", "independent", "memory", "offset_tau", "least_pin", "impossible", "sigma")
        )

    @cached_property
    def grids(self) -> tuple[Grid, Grid]:
        """Those of length and width."""
        return self.length, self.width

    @cached_property
    def profiles(self) -> Profiles:
        """The data sheets of the sensors as arrays."""
        return Profiles.of(self.sensors)

    @cached_property
    def attentive(self) -> Attentive | None:
        """The inner filter if it needs to know which scans show an object completely; `isinstance` is slow."""
        return self.filter if isinstance(self.filter, Attentive) else None

    @cached_property
    def movable(self) -> Any:
        """The inner filter if its objects can be resized and shifted, else None."""
        return self.filter if isinstance(self.filter, Resizable) and isinstance(self.filter, Shiftable) else None

    @cached_property
    def prior(self) -> Prior:
        """The fleet on the grids."""
        return Prior.of(self.fleet, self.length.sizes, self.width.sizes)

    @cached_property
    def box(self) -> Memoised[[Any], Estimate]:
        """The estimate of the inner filter's state."""
        return Memoised(self.filter.estimate)

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the classes of `Estimate.class_probability`."""
        return self.fleet.names

    def init(self, estimate: Estimate) -> EndsState:
        """State from a prior, whose size is only the first pin: the fleet is the prior of the size."""
        inner = self.filter.init(self._pinned(estimate))
        lead = estimate.pose.shape[:-1]
        length, width = self.length.born(lead), self.width.born(lead)
        anchor, abeam = np.zeros((*lead, 2)), np.zeros(lead)
        belief = self._belief(np.exp(length), np.exp(width), anchor, abeam)
        return EndsState(inner, anchor, length, width, belief, np.ones(lead, bool), abeam)

    @guarded_predict
    def predict(self, state: EndsState, dt: float) -> EndsState:
        """Time update over dt [s] >= 0: detections are forgotten, the offset spreads."""
        inner = self.filter.predict(state.inner, dt)
        if dt == 0:
            return state._replace(inner=inner)
        p, q = (
            grid.predicted(A, dt, self.memory, self.offset_tau, self.lost_rate)
            for grid, A in zip(self.grids, (state.length, state.width), strict=True)
        )
        abeam = np.exp(-dt / self.memory) * state.abeam
        belief = self._belief(p, q, state.anchor, abeam)
        return EndsState(inner, state.anchor, np.log(p), np.log(q), belief, state.whole, abeam)

    def learn_where(self, state: EndsState, where: NDArray) -> EndsState:
        """State whose next scan shows the complete objects where (...) is true; by default it shows all of them so."""
        inner = state.inner
        if self.attentive is not None:
            inner = self.attentive.learn_where(inner, where)
        return state._replace(inner=inner, whole=where)

    @guarded_update
    def update(self, state: EndsState, scan: Scan) -> tuple[EndsState, Any]:
        """Measurement update; without a detection the state is returned as it came. The information is the filter's."""
        return self._updated(state, scan, None)

    @guarded_update
    def update_among(self, state: EndsState, scan: Scan, every: Scan, owner: NDArray) -> tuple[EndsState, Any]:
        """The update of objects (T,) by their detections in the scan `every` (M,), whose others hide parts of them.

        owner (M,) is the row of each detection's object, -1 for none.
        """
        return self._updated(state, scan, Around(every, owner))

    def _updated(self, state: EndsState, scan: Scan, around: Around | None) -> tuple[EndsState, Any]:
        before = self.box(state.inner).pose[..., 2]
        inner, info = self.filter.update(state.inner, scan)
        some = np.asarray(scan.mask.any(-1))
        if not some.any():
            return state, info
        box = self.box(inner)
        turned = np.cos(box.pose[..., 2] - before) < 0  # front and rear changed places
        anchor = np.where(turned[..., None], -state.anchor, state.anchor)
        new = self._look(state._replace(inner=inner), box, anchor, scan, around)  # rows without a detection stay
        return (new if some.all() else new._replace(inner=select(some, new.inner, state.inner))), info

    def estimate(self, state: EndsState) -> Estimate:
        """The inner filter's, with size, class, and the place of the centre between both ends."""
        box, b = self.box(state.inner), state.belief
        placed = self._placed(state, box, b.size, b.centre_var)
        contour = box.contour
        if contour is not None:
            scale = (b.size / box.size)[..., None, :]
            contour = to_world(placed.pose, to_frame(box.pose, contour) * scale)
        return placed._replace(size_std=np.sqrt(b.size_var), contour=contour, class_probability=b.kind.copy())

    def reach(self, state: EndsState) -> Estimate:
        """The estimate with the greatest length and width that are possible, for gates; its `size_std` is 0."""
        box, b = self.box(state.inner), state.belief
        size = np.stack(
            [
                grid.sizes[(p.cumsum(-1) < 1 - self.impossible).sum(-1).clip(max=len(grid.sizes) - 1)]  # (ENDS.28)
                for grid, p in zip(self.grids, (b.length, b.width), strict=True)
            ],
            -1,
        )
        return self._placed(state, box, size, b.offset_var)._replace(size_std=np.zeros(size.shape), contour=None)

    def _placed(self, state: EndsState, box: Estimate, size: NDArray, var: NDArray) -> Estimate:
        """The box with another size (..., 2) [m] and the same anchor ends; var (..., 2) [m^2] is added to its axes."""
        M = rotation(box.pose[..., 2])
        body = state.anchor * (state.belief.offset + (box.size - size) / 2)  # (ENDS.21)
        pose, cov = box.pose.copy(), box.cov.copy()
        pose[..., :2] += (M @ body[..., None])[..., 0]  # (ENDS.21)
        cov[..., :2, :2] += symmetrize((M * var[..., None, :]) @ M.mT)  # (ENDS.20)
        return box._replace(pose=pose, cov=cov, size=size.copy())

    def log_spatial(self, state: EndsState, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""
        box = self.box(state.inner)
        boxes = Boxes(box.pose, box.size, state.anchor)
        hits = hits_of(scan, (detection,), track, box.pose, self.profiles, self.sigma)
        M = rotation(box.pose[:, 2])
        place = (M.mT @ box.cov[:, :2, :2] @ M).diagonal(axis1=-2, axis2=-1)
        return log_spatial(self.grids, hits, boxes, state.belief, place)

    def restart(self, state: EndsState, estimate: Estimate) -> EndsState:
        """State that starts again from an estimate, as of the union of two tracks; the width seen so far stays."""
        inner = self._restarted(state.inner, estimate)
        l = estimate.size[..., :1]
        std = np.maximum(0.15 * l, 0.3)
        length = self.length.restarted(-0.5 * ((self.length.sizes - l) / std) ** 2)  # (ENDS.24)
        top = state.width.max((-2, -1), keepdims=True)
        of_width = np.exp(state.width - top).sum(-1)
        width = self.width.restarted(np.log(np.maximum(of_width, 1e-300)))  # (ENDS.24)
        width = width - width.max((-2, -1), keepdims=True)
        length = length - length.max((-2, -1), keepdims=True)
        abeam = np.maximum(state.abeam, 2 * self.enough_abeam)  # the length is that of complete bodies
        belief = self._belief(np.exp(length), np.exp(width), state.anchor, abeam)
        return EndsState(inner, state.anchor, length, width, belief, state.whole, abeam)

    def _belief(self, length: NDArray, width: NDArray, anchor: NDArray, abeam: NDArray) -> Belief:
        behind = np.where(anchor[..., 0] < 0, np.exp(-abeam / self.enough_abeam), 0.0)  # (ENDS.34)
        return posterior(self.grids, self.prior, length, width, behind)

    def _pin_std(self, size: NDArray) -> NDArray:
        return np.maximum(self.pin * size, self.least_pin)

    def _pinned(self, estimate: Estimate) -> Estimate:
        return estimate._replace(size_std=self._pin_std(estimate.size), contour=None, class_probability=None)

    def _restarted(self, inner: Any, estimate: Estimate) -> Any:
        """The inner filter's state, started again from an estimate."""
        if isinstance(self.filter, Restartable):
            return self.filter.restart(inner, self._pinned(estimate))
        return self.filter.init(self._pinned(estimate))

    def _look(self, state: EndsState, box: Estimate, anchor: NDArray, scan: Scan, around: Around | None) -> EndsState:
        """Grids with the detections of a scan, and the inner filter pinned again, for the objects with detections."""
        lead = scan.mask.shape[:-1]
        index = np.nonzero(scan.mask)
        every = np.ravel_multi_index(index[:-1], lead) if lead else np.zeros(len(index[0]), int)
        rows, start, row = np.unique(every, return_index=True, return_inverse=True)  # H objects with detections
        axes = len(lead)
        pose, size, anchor, length, width, whole, abeam = (
            flat(a, axes)[rows]
            for a in (box.pose, box.size, anchor, state.length, state.width, state.whole, state.abeam)
        )
        hits = hits_of(scan, index, row, pose, self.profiles, self.sigma)
        place = np.add.reduceat(hits.place, start, axis=0) / np.diff(start, append=len(row))[:, None]
        faced = facing(anchor, size, place)
        for axis, A in enumerate((length, width)):
            other = (faced * anchor)[:, axis] < 0
            if other.any():
                A[other] = self.grids[axis].flipped(A[other], size[other, axis])
        boxes = Boxes(pose, size, faced)
        if around is not None:
            around = around.among(rows)
        more = evidence(
            self.grids, hits, boxes, start, whole, self.outliers, self.independent, self.part_weight, around
        )
        length, width = (A - A.max((-2, -1), keepdims=True) for A in (length + more[0], width + more[1]))
        abeam = abeam + np.add.reduceat((np.abs(hits.sight[:, 1]) > ABEAM).astype(float), start)
        belief = self._belief(np.exp(length), np.exp(width), faced, abeam)
        step = np.array([grid.step for grid in self.grids])
        steps = np.where(np.abs(belief.offset) > ROLLED_ABOVE * step, np.round(belief.offset / step), 0.0)
        length, width = (
            grid.rolled(A, steps[:, axis].astype(int))
            for axis, (grid, A) in enumerate(zip(self.grids, (length, width), strict=True))
        )
        belief = belief._replace(offset=belief.offset - steps * step)  # (ENDS.22)
        body = faced * ((size - belief.size) / 2 + steps * step)  # (ENDS.22)
        fields = zip(state.belief, belief, strict=True)
        return EndsState(
            inner=self._moved(state.inner, box, rows, belief.size, body),
            anchor=written(state.anchor, rows, faced, axes),
            length=written(state.length, rows, length, axes),
            width=written(state.width, rows, width, axes),
            belief=Belief(*(written(old, rows, new, axes) for old, new in fields)),
            whole=state.whole,
            abeam=written(state.abeam, rows, abeam, axes),
        )

    def _moved(self, inner: Any, box: Estimate, rows: NDArray, size: NDArray, body: NDArray) -> Any:
        """The inner state with the objects rows (H,) of another size (H, 2) [m] and shifted by body (H, 2) [m]."""
        axes = box.pose.ndim - 1
        size = written(box.size, rows, size, axes)
        body = written(np.zeros(box.size.shape), rows, body, axes)
        d = (rotation(box.pose[..., 2]) @ body[..., None])[..., 0]
        std = self._pin_std(size)
        if self.movable is not None:
            return self.movable.shift(self.movable.resize(inner, size, std), d)
        pose = np.concatenate([box.pose[..., :2] + d, box.pose[..., 2:]], -1)
        return self._restarted(inner, box._replace(pose=pose, size=size))


def flat(a: NDArray, axes: int) -> NDArray:
    """A field with its leading axes, so many, as one."""
    return a.reshape(-1, *a.shape[axes:])


def written(old: NDArray, rows: NDArray, new: NDArray, axes: int) -> NDArray:
    """A copy of a field with so many leading axes, rows (H,) of them replaced."""
    copy = np.array(old)
    flat(copy, axes)[rows] = new
    return copy
