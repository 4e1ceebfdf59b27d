"""SizePosterior: a grid Bayes filter of length and width, from where detections lie about the box of another filter.

Equations: docs/methods/size-from-both-ends.md.
"""

from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.geometry import perpendicular, rotation, to_frame, to_world, unit, vector
from trackers.linalg import symmetrize
from trackers.parameters import check_numbers
from trackers.scan import Scan, SensorModel
from trackers.size import spatial
from trackers.size.belief import Belief, posterior
from trackers.size.evidence import SIDE, evidence, facing, open_near_end, with_evidence
from trackers.size.fleet import Fleet, Prior
from trackers.size.grid import LENGTH, WIDTH, Grid
from trackers.size.hidden import Around
from trackers.size.hits import Boxes, Hits, hits_of
from trackers.size.profile import Profiles

STRAIGHT = 0.02  # [1/m] curvature of a path below which the front of two bodies is where the side shows it
SLOWEST, SHARPEST = 2.0, 0.9  # [m/s] and sine of the bend from which on it is not read from the curvature
ROUNDING_ERROR = 0.5  # of what a far end is rounded by, as a share of it
BEND_ERROR = 0.5  # of what stands out, as a share of it
BESIDE = 0.5  # sine of the angle off the axis from which on the far end is seen as it is
STANDS = 1.0  # [m/s] below which a body stands
OUTLINE = 2.5  # pins of the size that the place of the inner filter is uncertain by, as it does not know the outline
TINY = 1e-12  # [m^2]
FAR = 2.5  # lengths from which on both ends are about as near to a sensor
ROLLED_ABOVE = 0.75  # steps of mean offset from which the box is moved instead


class SizeState(NamedTuple):
    """What the detections say of both ends, and what follows from it."""

    anchor: NDArray  # (..., 2) +-1: end (front, rear) and side (left, right) that faces the sensors; 0: none seen yet
    length: NDArray  # (..., K, N) log likelihood of length and offset
    width: NDArray  # (..., K', N')
    belief: Belief
    fully_visible: NDArray  # (...) bool, the next scan shows the complete object
    behind: NDArray  # (..., 2, D) detections along it that were made from behind, older ones forgotten
    bent: NDArray  # (...) detections of it in a bend, older ones forgotten
    aside: NDArray  # (...) detections from beside it, older ones forgotten


class Pin(NamedTuple):
    """The box that the filter of place and motion is to have from now on."""

    size: NDArray  # (..., 2) [m]
    std: NDArray  # (..., 2) [m]
    shift: NDArray  # (..., 2) [m] of its centre


@dataclass(frozen=True)
class SizePosterior:
    """How detections are read; without `sensors` of its own, by the default data sheet."""

    sensors: tuple[SensorModel, ...] = (SensorModel(max_range=np.inf, fov=2 * np.pi),)
    fleet: Fleet = field(default_factory=Fleet)
    length: Grid = LENGTH
    width: Grid = WIDTH
    outliers: float = 0.015  # eps, share of detections of neighbours and clutter
    independent: int = 6  # n_eff: a scan with more detections counts as so many
    standing: int = 2  # the same of a body that stands, whose places are hit again
    offset_share: float = 0.5  # of the detections beside its ends that count at least for the offset
    unseen_share: float = 0.1  # by which a scan with the anchor end of the length out of view loosens its offset
    hidden_share: float = 0.2  # the same of a scan in which others hide that end
    open_above: float = 0.4  # [m] standard deviation of a length that is counted from the end in view; inf: never
    memory: float = 10.0  # [s]
    offset_tau: float = 2.0  # [s] time constant of the offset
    lost_rate: float = 1.5e-3  # [1/s] at which a box is misplaced
    pin: float = 0.03  # standard deviation of the size in the filter of the place, as a share of it
    least_pin: float = 0.02  # [m]
    face_std: float = 0.03  # [m] how well it is known where in a face its detections are
    once: bool = False  # of the covariance of the place only what is beyond offsets and outlines counts for the centre
    centre_std: float = 0.1  # [m] of the centre then, however much was seen of both ends: outlines differ
    part_weight: float = 0.3  # of scans that show a part of the width
    enough_bent: float = 5.0  # detections of a body in a bend after which it is taken for bent
    enough_aside: float = 5.0  # detections from beside it after which its far end is seen as it is
    impossible: float = 1e-3  # probability of a greater size above which the gates reach so far
    sigma: float = 0.2  # [m] noise of detections whose scan does not state it

    def __post_init__(self) -> None:
        positive = ("outliers", "independent", "standing", "memory", "offset_tau", "least_pin", "impossible", "sigma")
        check_numbers(self, positive=positive, unlimited=("open_above",))

    def __getstate__(self) -> dict[str, Any]:
        return {
            one.name: getattr(self, one.name) for one in fields(self)
        }  # copies work out the fleet on the grids anew

    @cached_property
    def grids(self) -> tuple[Grid, Grid]:
        """Those of length and width."""
        return self.length, self.width

    @cached_property
    def profiles(self) -> Profiles:
        """The data sheets of the sensors as arrays."""
        return Profiles.of(self.sensors)

    @cached_property
    def prior(self) -> Prior:
        """The fleet on the grids."""
        return Prior.of(self.fleet, self.length.sizes, self.width.sizes)

    def born(self, lead: tuple[int, ...]) -> SizeState:
        """The state of new objects with these leading axes: the fleet is the prior of their size."""
        length, width = self.length.born(lead), self.width.born(lead)
        behind, none = np.zeros((*lead, 2, self.length.depths)), np.zeros(lead)
        belief = self.belief(np.exp(length), np.exp(width), behind, none)
        return SizeState(np.zeros((*lead, 2)), length, width, belief, np.ones(lead, bool), behind, none, none)

    def predicted(self, state: SizeState, dt: float) -> SizeState:
        """The state after dt > 0 [s]: detections are forgotten, the offset spreads."""
        p, q = (
            grid.predicted(A, dt, self.memory, self.offset_tau, self.lost_rate)
            for grid, A in zip(self.grids, (state.length, state.width), strict=True)
        )
        behind, bent, aside = (np.exp(-dt / self.memory) * a for a in state[-3:])
        belief = self.belief(p, q, behind, bent)
        return SizeState(state.anchor, np.log(p), np.log(q), belief, state.fully_visible, behind, bent, aside)

    def corrected(
        self, state: SizeState, before: NDArray, box: Estimate, scan: Scan, around: Around | None
    ) -> tuple[SizeState, Pin]:
        """Grids with the detections of a scan, some at least, for the objects with detections; and the new box.

        `box` is that after the scan, before (..., 3) the pose before it, `around` the complete scan, whose other
        detections hide parts of the objects, None where it is not known.
        """
        if scan.sensor.max(initial=0) >= len(self.sensors):
            raise ValueError(
                f"scan.sensor must index the {len(self.sensors)} data sheets by which sizes are read, got up to "
                f"{scan.sensor.max()}; give the filter those of the radar by on(radar.models)"
            )
        lead = scan.mask.shape[:-1]
        index = np.nonzero(scan.mask)
        every = np.ravel_multi_index(index[:-1], lead) if lead else np.zeros(len(index[0]), int)
        rows, start, row = np.unique(every, return_index=True, return_inverse=True)  # H objects with detections
        axes = len(lead)
        turned = np.cos(box.pose[..., 2] - before[..., 2]) < 0  # front and rear changed places
        facing_before = np.where(turned[..., None], -state.anchor, state.anchor)
        behind = np.where(turned[..., None, None], 0.0, state.behind)
        pose, was, size, anchor, length, width, fully_visible, behind, bent, aside = (
            flat(a, axes)[rows]
            for a in (
                box.pose,
                before,
                box.size,
                facing_before,
                state.length,
                state.width,
                state.fully_visible,
                behind,
                state.bent,
                state.aside,
            )
        )
        hits = hits_of(scan, index, row, pose, self.profiles, self.sigma)
        back = self._back(hits, start, to_frame(pose, was[:, None, :2])[:, 0])
        hits = hits._replace(xy=hits.xy - back[row], place=hits.place - back[row])
        pose = np.concatenate([to_world(pose, back[:, None])[:, 0], pose[:, 2:]], -1)
        place = np.add.reduceat(hits.place, start, axis=0) / np.diff(start, append=len(row))[:, None]
        faced = facing(anchor, size, place)
        unsure = flat(state.belief.size_var, axes)[rows, 0] > self.open_above**2
        unsure &= np.abs(place[:, 0]) > FAR * size[:, 0]
        if unsure.any():
            faced[unsure & open_near_end(hits, Boxes(pose, size, faced), start), 0] *= -1  # (ENDS.43)
        for axis, A in enumerate((length, width)):
            other = (faced * anchor)[:, axis] < 0
            if other.any():
                A[other] = self.grids[axis].flipped(A[other], size[other, axis])
        boxes = Boxes(pose, size, faced)
        if around is not None:
            around = around.among(rows)
        stands = flat(np.hypot(*np.moveaxis(box.velocity, -1, 0)), axes)[rows] < STANDS
        independent = np.where(stands, self.standing, self.independent)  # (ENDS.9)
        said = evidence(
            self.grids, hits, boxes, start, fully_visible, self.outliers, independent, self.part_weight,
            self.offset_share, around,
        )  # fmt: skip
        length = self.length.loosened(length, self.unseen_share * said.unseen)  # (ENDS.42)
        length, width = (with_evidence(*x) for x in zip((length, width), said[:2], said.sharper.T, strict=True))
        beside = np.add.reduceat((np.abs(hits.sight[:, 1]) > SIDE).astype(float), start)
        straight = np.abs(flat(_curvature(box), axes)[rows]) < STRAIGHT
        n = np.diff(start, append=len(row))
        bent = np.where(straight, np.maximum(bent - beside, 0.0), bent + n)  # (ENDS.34)
        behind = behind + said.behind  # (ENDS.45)
        aside = aside + np.add.reduceat((np.abs(hits.sight[:, 1]) > BESIDE).astype(float), start)
        belief = self.belief(np.exp(length), np.exp(width), behind, bent)
        step = np.array([grid.step for grid in self.grids])
        steps = np.where(np.abs(belief.offset) > ROLLED_ABOVE * step, np.round(belief.offset / step), 0.0)
        length, width = (
            grid.rolled(A, steps[:, axis].astype(int))
            for axis, (grid, A) in enumerate(zip(self.grids, (length, width), strict=True))
        )
        belief = belief._replace(offset=belief.offset - steps * step)  # (ENDS.22)
        body = faced * ((size - belief.size) / 2 + steps * step)  # (ENDS.22)
        new = SizeState(
            anchor=written(state.anchor, rows, faced, axes),
            length=written(state.length, rows, length, axes),
            width=written(state.width, rows, width, axes),
            belief=Belief(*(written(old, rows, b, axes) for old, b in zip(state.belief, belief, strict=True))),
            fully_visible=state.fully_visible,
            behind=written(state.behind, rows, behind, axes),
            bent=written(state.bent, rows, bent, axes),
            aside=written(state.aside, rows, aside, axes),
        )
        size = written(box.size, rows, belief.size, axes)
        body = written(np.zeros(box.size.shape), rows, body, axes)
        d = (rotation(box.pose[..., 2]) @ body[..., None])[..., 0]
        return new, Pin(size, self.pin_std(size), d)

    def _back(self, hits: Hits, start: NDArray, body: NDArray) -> NDArray:
        """By how much (H, 2) [m] boxes are moved back before a scan is read in them, along their axes.

        body (H, 2) [m] is the place before the scan in the box after it, which has followed the noise of the same
        detections: among them it would seem too small.
        """
        n = np.diff(start, append=len(hits.row))[:, None]
        noise = hits.sigma**2 - hits.sensor.surface_std[:, None] ** 2
        followed = np.sqrt(np.add.reduceat(np.maximum(noise, 0.0), start)) / n
        reach = np.minimum(followed, [grid.offset_std for grid in self.grids])
        return np.clip(body, -reach, reach)  # (ENDS.38)

    def loosened(self, state: SizeState, where: NDArray) -> SizeState:
        """The state before a scan in which others hide the near end of the objects where (...) is true."""
        axes = where.ndim
        share = self.hidden_share * where.reshape(-1)
        length = self.length.loosened(flat(state.length, axes), share)  # (ENDS.42)
        return state._replace(length=length.reshape(state.length.shape))

    def quieted(self, state: SizeState, rows: NDArray, length: NDArray, log_p: NDArray) -> SizeState:
        """The state after silence of log probability log_p (R, C), were the length of rows (R,) length (R, C) [m]."""
        A = state.length.copy()
        for t, L, q in zip(rows, length, log_p, strict=True):
            A[t] += np.interp(self.length.sizes, L, q)[:, None]  # (ENDS.44)
        return state._replace(length=A)

    def restarted(self, state: SizeState, size: NDArray, size_std: NDArray) -> SizeState:
        """The state of objects that start again with a size (..., 2) [m] and its std; the width seen so far stays."""
        l = size[..., :1]
        std = np.maximum(np.maximum(0.15 * l, 0.3), size_std[..., :1])
        length = self.length.restarted(-0.5 * ((self.length.sizes - l) / std) ** 2)  # (ENDS.24)
        top = state.width.max((-2, -1), keepdims=True)
        of_width = np.exp(state.width - top).sum(-1)
        width = self.width.restarted(np.log(np.maximum(of_width, 1e-300)))  # (ENDS.24)
        width = width - width.max((-2, -1), keepdims=True)
        length = length - length.max((-2, -1), keepdims=True)
        behind, bent = np.zeros(state.behind.shape), np.zeros(state.bent.shape)  # the length is that of complete bodies
        belief = self.belief(np.exp(length), np.exp(width), behind, bent)
        return SizeState(state.anchor, length, width, belief, state.fully_visible, behind, bent, state.aside)

    def estimate(self, state: SizeState, box: Estimate) -> Estimate:
        """The box with size, class, and the place of the centre between both ends, and how well each edge is known."""
        b = state.belief
        inset, square = np.moveaxis(b.kind @ self.prior.insets, -1, 0)  # (ENDS.35)
        out, out_var = (vector(x, np.zeros(x.shape)) for x in (inset, square - inset**2))
        more, more_var = self._rounded(state)
        size = b.size + more
        place, var = _along_axes(box), b.centre_var + out_var + more_var / 4
        excess = self._excess(place, box.size)
        if self.once:
            box, var = _scaled(box, np.sqrt(excess / np.maximum(place, TINY))), var + self.centre_std**2  # (ENDS.20)
        placed = _placed(state, box, size, var, out)
        contour = box.contour
        if contour is not None:
            scale = (size / box.size)[..., None, :]
            contour = to_world(placed.pose, to_frame(box.pose, contour) * scale)
        kind, edge_std = b.kind.copy(), self._edge_std(state, excess, out_var, more_var)
        whole = placed._replace(
            size_std=np.sqrt(b.size_var + more_var), contour=contour, class_probability=kind, edge_std=edge_std
        )
        return _widened(whole, *self._bend(whole))

    def _rounded(self, state: SizeState) -> tuple[NDArray, NDArray]:
        """How much (..., 2) [m] the body reaches beyond the detections at its far end, and the variance."""
        b, (front, rear, var) = state.belief, self.prior.roundings
        known = np.maximum(1 - b.size_var[..., :1] / var, 0.0)
        by_class = known * np.where(state.anchor[..., :1] < 0, front, rear)
        by_class = by_class * np.exp(-state.aside / self.enough_aside)[..., None] * (state.anchor[..., :1] != 0)
        mean, square = (np.sum(b.kind * x, -1) for x in (by_class, by_class**2))  # (ENDS.48)
        rest = square - mean**2 + (ROUNDING_ERROR * mean) ** 2
        return vector(mean, np.zeros(mean.shape)), vector(rest, np.zeros(mean.shape))

    def _excess(self, place: NDArray, size: NDArray) -> NDArray:
        """What of the variances place (..., 2) [m^2] along the axes of a box the grids do not know."""
        known = np.array([grid.offset_std for grid in self.grids]) ** 2 + (OUTLINE * self.pin_std(size)) ** 2
        return np.maximum(place - known, 0.0)  # (ENDS.36)

    def _edge_std(self, state: SizeState, excess: NDArray, out_var: NDArray, more_var: NDArray) -> NDArray:
        """Standard deviations (..., 4) [m] of the edges, by the grids, which know them better than the box alone."""
        b = state.belief
        more = out_var + self.face_std**2 + excess  # (ENDS.36)
        near = b.offset_var + more  # (ENDS.36)
        far = 2 * b.centre_var - b.offset_var + b.size_var / 2 + more_var + more  # (ENDS.37)
        front, rear = (np.where(state.anchor * end > 0, near, far) for end in (1, -1))
        return np.sqrt(np.stack([front, rear], -1).reshape(*front.shape[:-1], 4))

    def _bend(self, box: Estimate) -> tuple[NDArray, NDArray]:
        """How far (...) [m] a front body stands out beside that behind it, to the left positive, and the variance."""
        axle, front = self.prior.hinges
        curvature = _curvature(box)
        sine = np.clip(axle * curvature[..., None], -SHARPEST, SHARPEST)  # (ENDS.40)
        out = front * np.abs(sine) - box.size[..., 1:] / 2 * (1 - np.sqrt(1 - sine**2))  # (ENDS.40)
        turn = axle * (box.yaw_rate_std / _speed(box))[..., None]  # (ENDS.41)
        mean, square = (np.sum(box.class_probability * x, -1) for x in (out, out**2 + (front * turn) ** 2))
        return np.sign(curvature) * mean, square - mean**2 + (BEND_ERROR * mean) ** 2

    def reach(self, state: SizeState, box: Estimate) -> Estimate:
        """The box with the greatest length and width that are possible, for gates; its `size_std` is 0."""
        b = state.belief
        size = np.stack(
            [
                grid.sizes[(p.cumsum(-1) < 1 - self.impossible).sum(-1).clip(max=len(grid.sizes) - 1)]  # (ENDS.28)
                for grid, p in zip(self.grids, (b.length, b.width), strict=True)
            ],
            -1,
        )
        return _placed(state, box, size, b.offset_var)._replace(size_std=np.zeros(size.shape), contour=None)

    def log_spatial(self, state: SizeState, box: Estimate, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""
        boxes = Boxes(box.pose, box.size, state.anchor)
        hits = hits_of(scan, (detection,), track, box.pose, self.profiles, self.sigma)
        M = rotation(box.pose[:, 2])
        place = (M.mT @ box.cov[:, :2, :2] @ M).diagonal(axis1=-2, axis2=-1)
        return spatial.log_spatial(self.grids, hits, boxes, state.belief, place)

    def belief(self, length: NDArray, width: NDArray, behind: NDArray, bent: NDArray) -> Belief:
        """What likelihoods length (..., K, N) and width (..., K', N') say with the fleet; others as in the state."""
        bends = 1 - np.exp(-bent / self.enough_bent)  # (ENDS.34)
        return posterior(self.grids, self.prior, length, width, behind, bends)

    def pin_std(self, size: NDArray) -> NDArray:
        """Standard deviation (..., 2) [m] of a size (..., 2) [m] in the filter of the place."""
        return np.maximum(self.pin * size, self.least_pin)

    def pinned(self, estimate: Estimate) -> Estimate:
        """The estimate that a filter of the place starts from."""
        return estimate._replace(size_std=self.pin_std(estimate.size), contour=None, class_probability=None)


def _curvature(box: Estimate) -> NDArray:
    """Curvature (...) [1/m] of the path, positive to the left, as far as it is certain."""
    turning = np.sign(box.yaw_rate) * np.maximum(np.abs(box.yaw_rate) - box.yaw_rate_std, 0.0)
    return turning / _speed(box)


def _speed(box: Estimate) -> NDArray:
    return np.maximum(np.hypot(*np.moveaxis(box.velocity, -1, 0)), SLOWEST)


def _along_axes(box: Estimate) -> NDArray:
    """Variances (..., 2) [m^2] of the place along the axes of the box."""
    M = rotation(box.pose[..., 2])
    return np.asarray(np.sum(M * (box.cov[..., :2, :2] @ M), -2))


def _scaled(box: Estimate, factor: NDArray) -> Estimate:
    """The box with the errors of its place times factor (..., 2) along its axes."""
    M, cov = rotation(box.pose[..., 2]), box.cov.copy()
    S = (M * factor[..., None, :]) @ M.mT
    cov[..., :2, :] = S @ cov[..., :2, :]
    cov[..., :2] = cov[..., :2] @ S.mT
    return box._replace(cov=symmetrize(cov))


def _placed(state: SizeState, box: Estimate, size: NDArray, var: NDArray, out: NDArray | float = 0.0) -> Estimate:
    """The box with another size (..., 2) [m], its anchor ends moved out; var (..., 2) [m^2] is added to its axes."""
    M = rotation(box.pose[..., 2])
    body = state.anchor * (state.belief.offset + out + (box.size - size) / 2)  # (ENDS.21)
    pose, cov = box.pose.copy(), box.cov.copy()
    pose[..., :2] += (M @ body[..., None])[..., 0]  # (ENDS.21)
    cov[..., :2, :2] += symmetrize((M * var[..., None, :]) @ M.mT)  # (ENDS.20)
    return box._replace(pose=pose, cov=cov, size=size.copy())


def _widened(box: Estimate, out: NDArray, var: NDArray) -> Estimate:
    """The box with out (...) [m] more on its left where that is positive, else on its right, of variance var (...)."""
    if not (out.any() or var.any()):
        return box
    left, pose, cov = perpendicular(unit(box.pose[..., 2])), box.pose.copy(), box.cov.copy()
    pose[..., :2] += out[..., None] / 2 * left
    cov[..., :2, :2] += symmetrize((var / 4)[..., None, None] * left[..., None] * left[..., None, :])
    size, size_std, edge_std = box.size.copy(), box.size_std.copy(), box.edges.copy()
    size[..., 1] += np.abs(out)
    size_std[..., 1] = np.hypot(size_std[..., 1], np.sqrt(var))
    edge = np.where(out > 0, 2, 3)[..., None]
    side = np.sqrt(np.take_along_axis(edge_std, edge, -1) ** 2 + var[..., None])
    np.put_along_axis(edge_std, edge, side, -1)
    return box._replace(pose=pose, cov=cov, size=size, size_std=size_std, edge_std=edge_std)  # (ENDS.41)


def flat(a: NDArray, axes: int) -> NDArray:
    """A field with its leading axes, so many, as one."""
    return a.reshape(-1, *a.shape[axes:])


def written(old: NDArray, rows: NDArray, new: NDArray, axes: int) -> NDArray:
    """A copy of a field with so many leading axes, rows (H,) of them replaced."""
    copy = np.array(old)
    flat(copy, axes)[rows] = new
    return copy
