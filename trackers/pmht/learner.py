"""How the class and the contour of an object are learned from its own detections.

Equations: docs/methods/spline-pmht.md. All functions take and return A objects as rows. Learning has stages, one for
each update of the filter: an object waits (0) until its window is decoupled into its pool; then it is compared with the
classes (1); where enough detections in the pool are new, updates with a few steps of expectation maximisation follow
(2 ... turns), and after the last one the filter takes the new contour (turns + 1).

Sides that were not seen stay: the ellipses weigh by what the sensor of each detection could see, and the stiffness
holds the others where the catalogue has them. A contour that crosses itself is discarded. Moving the model by o (unit
frame) and the centre by -A o predicts the same detections, (PMHT.30), so o is not observable. A convention settles it:
the position is the centre of the box. Along each axis of the body, by the ends that were seen,

- both: the box of the curve is centred;
- one: that end stays where the catalogue's contour has it, because there the filter measures, and the place of the
  other follows from size and catalogue;
- none: the control points do not move on average.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.batch import select
from trackers.geometry import rotation
from trackers.held_gaussian import LENGTH, resized
from trackers.motion.turn import PHI
from trackers.parameters import check_numbers
from trackers.pmht import pool as pools
from trackers.pmht import window as windows
from trackers.pmht.association import RelativeDetections, squares
from trackers.pmht.classes import Catalogue
from trackers.pmht.filter import SplinePmht, typical_visibility
from trackers.pmht.learning import Refine, SplineContour, is_simple
from trackers.pmht.model import DEGREE, curve, outlines
from trackers.pmht.pool import Pool
from trackers.pmht.state import SplineState
from trackers.pmht.visibility import visibility_table
from trackers.pmht.window import Window, cleared

COARSE = 2  # points on the arc of an ellipse for the visibility of a contour that is learned on the way
NO_NOISE = np.array([1.0, 0.0, 1.0])  # of padding: the identity as columns
FINE = 400  # points of the curve whose box is taken


class AdaptiveState(NamedTuple):
    """The state of `SplinePmht`, and what class and contour are learned from."""

    m: NDArray  # (..., 7) px, py [m], phi [rad] unwrapped, v [m/s], omega [rad/s], l, w [m]
    P: NDArray  # (..., 7, 7)
    p: NDArray  # (..., n_c, 2) control points
    Sigma: NDArray  # (..., L, 2, 2)
    visible: NDArray  # (..., A, L)
    kind: NDArray  # (...) int, row of the contour in `Learner.offline` that the object started from
    cross: NDArray  # (..., 7, 7) cross covariance of the last scan in the window and now, (SM.9)
    window: Window
    pool: Pool
    draft: SplineContour  # the contour that is being learned
    stage: NDArray  # (...) int, of learning, see `Learner`
    fresh: NDArray  # (...) int, detections that came into the pool since a contour was learned
    probability: NDArray  # (..., C) of the classes
    complete: NDArray  # (...) bool, the next scan shows the complete object; from parts nothing is learned


def plain(state: AdaptiveState) -> SplineState:
    """The state of `SplinePmht` in it."""
    return SplineState(*state[:5])


def forgotten(state: AdaptiveState, where: NDArray) -> AdaptiveState:
    """The state with nothing to learn from where (...) is true."""
    keep = ~where
    return state._replace(
        window=cleared(state.window, where),
        pool=state.pool._replace(came=state.pool.came * keep[..., None]),
        stage=state.stage * keep,
        fresh=state.fresh * keep,
    )


def index(rows: NDArray, lead: tuple[int, ...]) -> Any:
    """Index of flat rows (A,) into arrays with leading axes; without leading axes the one object gets an axis."""
    return np.unravel_index(rows, lead) if lead else (None,)


@dataclass(frozen=True)
class Learner:
    """Learns classes and contours over the filter `spline`."""

    spline: SplinePmht
    refine: Refine = field(default_factory=Refine)
    catalogue: Catalogue = field(default_factory=Catalogue)
    enough: int = 150  # new detections before a contour is learned
    turns: int = 7  # updates in which class and contour are learned, before the one in which the filter takes it
    seen_from: int = 20  # detections from beyond an end for it to count as seen
    compared: int = 80  # detections at most that are compared with the classes
    sure: float = 0.9  # probability of a class above which the object takes its contour

    def __post_init__(self) -> None:
        check_numbers(self, positive=("enough", "seen_from", "compared"))
        if self.turns < 2 or not 0.5 < self.sure <= 1:
            raise ValueError(
                f"turns must be at least 2 and sure above .5 and up to 1, got {self.turns} and {self.sure}"
            )

    @cached_property
    def offline(self) -> tuple[NDArray, NDArray, NDArray]:
        """Control points, covariances and visibility of the contours to start from: the filter's, then one a class."""
        models, grazing = (*self.spline.models, *self.catalogue.models), self.spline.grazing
        if len({(len(model.spread), len(model.points)) for model in models}) > 1:
            raise ValueError(
                f"model {self.spline.models[0].name!r} must have as many ellipses and control points as the classes "
                f"({len(models[-1].spread)} and {len(models[-1].points)}), got {len(models[0].spread)} and "
                f"{len(models[0].points)}; learn one or the other again"
            )
        return (
            np.stack([model.p for model in models]),
            np.stack([model.Sigma for model in models]),
            np.stack([typical_visibility(model, grazing) for model in models]),
        )

    def gathered(self, state: AdaptiveState) -> AdaptiveState:
        """Stage 0: the detections of the windows go into the pools, and a comparison is next."""
        pool, count = pools.added(state.pool, windows.decouple(state.window))
        return state._replace(
            window=windows.cleared(state.window, np.ones(state.stage.shape, bool)),
            pool=pool,
            fresh=state.fresh + count,
            stage=np.ones(state.stage.shape, int),
        )

    # -- classes ----------------------------------------------------------------------------------------------------

    def compared_with_classes(self, state: AdaptiveState) -> AdaptiveState:
        """Stage 1: class, size and place from comparing the pool with the catalogue; if it is sure, its contour too."""
        fits = self.catalogue.fit(*self._compared(state))
        p = self.catalogue.probability(fits.evidence)
        best = p.argmax(-1)
        sure = (p.max(-1) > self.sure)[:, None]
        rows = np.arange(len(best))
        o = np.where(sure, fits.offset[rows, best], 0.0)
        size = np.where(sure, fits.size[rows, best], state.m[:, LENGTH:])
        now_std = np.sqrt(state.P.diagonal(axis1=-2, axis2=-1)[..., LENGTH:])
        m, P = resized(state.m, state.P, size, np.where(sure, fits.size_std[rows, best], now_std))
        m[..., :2] += (rotation(m[..., PHI]) @ o[..., None])[..., 0]
        now = self._of_class(state, p)
        return now._replace(
            m=m,
            P=P,
            window=windows.cleared(state.window, np.ones(len(m), bool)),
            pool=pools.moved(state.pool, o, state.m[:, LENGTH:], size),
            draft=SplineContour(now.p, now.Sigma),
            stage=np.where(state.fresh >= self.enough, 2, 0),
            probability=p,
        )

    def _compared(self, state: AdaptiveState) -> tuple[RelativeDetections, NDArray, NDArray, NDArray]:
        """Arguments of `Catalogue.fit`: at most `compared` detections, spread evenly over the pool."""
        data, size = state.pool.all, state.m[:, LENGTH:]
        n = data.mask.sum(-1, keepdims=True)
        rank = np.arange(min(data.mask.shape[1], self.compared))
        step = np.maximum(n, self.compared) / self.compared  # all of few, every so many of many
        at = np.minimum((rank * step).astype(int), np.maximum(n - 1, 0))
        pick = np.take_along_axis(np.argsort(~data.mask, -1, kind="stable"), at, -1)
        z, R, sensor = (np.take_along_axis(a, pick[..., None], 1) for a in data[:3])
        mask = rank < n
        R = np.where(mask[..., None], R * squares(size).mT, NO_NOISE)
        z = np.where(mask[..., None], z * size[:, None], 0.0)
        ends = pools.ends_seen(state.pool, state.m, self.seen_from)
        return RelativeDetections(z.mT, R.mT, mask), sensor, size, ends

    def _of_class(self, state: AdaptiveState, p: NDArray) -> AdaptiveState:
        """Objects of a class that is sure take its contour; those whose class is doubtful now, one by length."""
        first = len(self.spline.models)
        own = np.take_along_axis(p, np.maximum(state.kind - first, 0)[:, None], -1)[:, 0]
        doubtful = (state.kind >= first) & (own < 1 - self.sure)
        kind = np.where(doubtful, self.spline.by_length(state.m[:, LENGTH]), state.kind)
        return self.of_kind(state, np.where(p.max(-1) > self.sure, first + p.argmax(-1), kind))

    def of_kind(self, state: AdaptiveState, kind: NDArray) -> AdaptiveState:
        """Objects whose kind (...) has changed start again from the contour of the new one."""
        p, Sigma, visible = (a[kind] for a in self.offline)
        return select(kind != state.kind, state._replace(p=p, Sigma=Sigma, visible=visible, kind=kind), state)

    # -- contours ---------------------------------------------------------------------------------------------------

    def stepped(self, state: AdaptiveState) -> AdaptiveState:
        """Stages 2 to `turns`: some iterations of the expectation maximisation."""
        data, off = state.pool.all, SplineContour(*(a[state.kind] for a in self.offline[:2]))
        L = state.Sigma.shape[-3]
        log_pi: NDArray | float = -np.log(L)
        if self.spline.visibility == "rays":
            log_pi = self.refine.log_weights(state.visible, state.p, L, state.m[..., LENGTH:], data.sensor)
        draft = self.refine.run(state.draft, off, data, log_pi, self.spline.interior)
        return state._replace(draft=draft, stage=state.stage + 1)

    def adopted(self, state: AdaptiveState) -> AdaptiveState:
        """Stage `turns` + 1: the filter takes the contours that were learned, unless they cross themselves."""
        o = self.offset(state)
        p, window = state.draft.p - o[..., None, :], state.window  # (PMHT.31)
        moved = window._replace(m=shifted(window.m, o[..., None, :]), m_pred=shifted(window.m_pred, o[..., None, :]))
        L = state.Sigma.shape[-3]
        done = state._replace(stage=np.zeros_like(state.stage), fresh=np.zeros_like(state.fresh))
        new = done._replace(
            m=shifted(state.m, o),
            p=p,
            Sigma=state.draft.Sigma,
            visible=visibility_table(p, state.m[..., LENGTH:], L, DEGREE, self.spline.grazing, COARSE),
            window=moved,
            pool=pools.moved(state.pool, o * state.m[..., LENGTH:], state.m[..., LENGTH:], state.m[..., LENGTH:]),
        )
        return select(is_simple(state.draft.p), new, done)

    def offset(self, state: AdaptiveState) -> NDArray:
        """Shift (A, 2) of the frame that goes with the draft, in the unit frame."""
        ends = pools.ends_seen(state.pool, state.m, self.seen_from)
        if self.spline.visibility == "none":  # the sensors see all sides
            ends = np.ones_like(ends)
        if self.refine.symmetric:  # the middle is known from either side
            ends[..., 1, :] = True
        return partial_shift(state.draft.p, self.offline[0][state.kind], ends)

    def outlines_of(self, state: AdaptiveState) -> NDArray:
        """Contours (A, C, 2) [m] on the body's axes."""
        return outlines(state.p, state.Sigma, self.spline.outward) * state.m[..., None, LENGTH:]


def frame_shift(p: NDArray) -> NDArray:
    """Centre (..., 2) of the box around the curve of control points p (..., n_c, 2), in the unit frame."""
    ring = curve(p, FINE)
    return (ring.max(-2) + ring.min(-2)) / 2  # (PMHT.31)


def partial_shift(p: NDArray, off: NDArray, ends: NDArray) -> NDArray:
    """Shift (..., 2) of the frame of the contour p where not all sides were seen, (PMHT.37).

    off (..., n_c, 2) are the control points of the catalogue; ends (..., 2, 2) bool: rear and front, right and left.
    """
    ring, was = curve(p, FINE), curve(off, FINE)
    low, high = ring.min(-2) - was.min(-2), ring.max(-2) - was.max(-2)
    both, rear, front = ends.all(-1), ends[..., 0], ends[..., 1]
    one = np.where(rear, low, np.where(front, high, (p - off).mean(-2)))  # (PMHT.37)
    return np.where(both, frame_shift(p), one)


def shifted(m: NDArray, o: NDArray) -> NDArray:
    """States m (..., 7) whose model has been moved by -o (..., 2) in the unit frame."""
    return moved(m, m[..., LENGTH:] * o)  # (PMHT.31)


def moved(m: NDArray, body: NDArray) -> NDArray:
    """States m (..., 7) with body (..., 2) [m], in the axes of each, added to the centre."""
    m = m.copy()
    m[..., :2] += (rotation(m[..., PHI]) @ body[..., None])[..., 0]
    return m
