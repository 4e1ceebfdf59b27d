"""pmht-spline: the coordinated-turn UKF on ellipses chained by a B-spline, with PMHT association.

Equations: docs/methods/spline-pmht.md, symbols after Yao et al. (2021). Detections of one scan are shared out among the
ellipses by their probabilities; the synthetic detection of each ellipse then corrects pose, motion and size together.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from trackers import held_gaussian
from trackers.batch import Memoised, select
from trackers.estimate import Estimate, check_estimate
from trackers.geometry import rotation
from trackers.held_gaussian import LENGTH, prior_moments, resized
from trackers.linalg import outer
from trackers.motion.turn import PHI
from trackers.parameters import check_numbers
from trackers.pmht import joint
from trackers.pmht.association import (
    RelativeDetections,
    UnitEllipses,
    columns,
    interior_density,
    log_density,
    place,
    polar_noise,
    responsibilities,
    synthesise,
    unit_ellipses,
)
from trackers.pmht.joint import EllipseUpdate, SplineInfo, innovation, nothing, predict_ellipses
from trackers.pmht.model import DEGREE, SplineModel, chain, outlines, resolve
from trackers.pmht.state import LEAST_SIZE, SplineState, Walk, estimate_of, predicted
from trackers.pmht.visibility import View, directions, visibility_table, weights
from trackers.range_rate import RangeRates
from trackers.scan import Scan, SensorModel
from trackers.validation import guarded_predict, guarded_update

VISIBILITIES = ("rays", "none")
FORMS = ("joint",)
LEAST_DENSITY = 1e-300
IDENTITY = np.array([[1.0], [0.0], [1.0]])  # as columns
TRUCK_ABOVE = 6.5  # [m] length above which a filter of two models takes the second


@dataclass(frozen=True)
class SplinePmht:
    """Defaults suit the experiment of Yao et al. (2021); those for radar on the road are in `trackers.registry`."""

    model: str | SplineModel | tuple[SplineModel, ...]
    visibility: str = "rays"  # weights of the ellipses by what each sensor can see, or "none": equal, as in the paper
    form: str | EllipseUpdate = "joint"  # all ellipses at once, or one's own
    iterations: int = 3  # of association and update
    doubt: float = 0.0  # share of the information that is missing for unknown ellipses, (PMHT.39); 0: as in the paper
    walk: Walk = field(default_factory=Walk)
    rates: RangeRates = field(default_factory=RangeRates)
    sigma: float = 0.2  # [m] noise where a scan does not state it
    widened: float = 1.0  # factor of Sigma_l in the association, (PMHT.8); the paper prints 4, which is less accurate
    eps: float = 1e-8  # [1/m^2] density of false alarms over the expected detections of an object
    unseen: float = 0.02  # share of detections from ellipses out of sight, because no contour is exact, (PMHT.22)
    grazing: float = 0.5  # (PMHT.21)
    lost_below: float = 0.5  # explained share of a scan below which the association is lost, (PMHT.17)
    inflation: float = 9.0  # factor of the ellipses' covariances in the scan after that, (PMHT.18)
    outward: float = 0.0  # standard deviations of the ellipses that the drawn contour lies outside the curve
    position_std: tuple[float, float] = (0.0, 0.0)  # shares of length and width added to the std of the place
    sensors: tuple[SensorModel, ...] = ()  # data sheets, in the order of `Scan.sensor`; none: they see everywhere

    angles: ClassVar[tuple[int, ...]] = (PHI,)  # of m; unwrapped, but a heading starts anew where a track does
    log_size: ClassVar[bool] = False  # sizes are metres
    gaussian, with_gaussian, shift = held_gaussian.gaussian, held_gaussian.with_gaussian, held_gaussian.shift

    def __post_init__(self) -> None:
        if self.visibility not in VISIBILITIES:
            raise ValueError(f"visibility must be one of {', '.join(VISIBILITIES)}, got {self.visibility!r}")
        if isinstance(self.form, str) and self.form not in FORMS:
            raise ValueError(f"form must be {', '.join(FORMS)} or an EllipseUpdate, got {self.form!r}")
        check_numbers(self, positive=("iterations", "sigma", "widened"))
        if not (self.inflation > 1 and self.lost_below <= 1 and self.unseen <= 1):
            raise ValueError(
                f"inflation must be > 1, lost_below and unseen at most 1, got {self.inflation}, {self.lost_below}, "
                f"{self.unseen}"
            )

    @property
    def size_walk(self) -> float:
        """Random walk [m/sqrt(s)] of length and width."""
        return self.walk.size

    @cached_property
    def models(self) -> tuple[SplineModel, ...]:
        """The models that objects start from; of two, longer objects get the second."""
        return resolve(self.model)

    @cached_property
    def contours(self) -> tuple[NDArray, NDArray, NDArray]:
        """Control points, covariances and visibility of the models, with a first axis of these."""
        visible = np.stack([typical_visibility(model, self.grazing) for model in self.models])
        return np.stack([m.p for m in self.models]), np.stack([m.Sigma for m in self.models]), visible

    @cached_property
    def outline(self) -> Memoised[[NDArray, NDArray], NDArray]:
        """Drawn contours (..., C, 2) in the unit frame of control points and covariances."""
        return Memoised(partial(outlines, outward=self.outward))

    @cached_property
    def ellipses(self) -> Memoised[[NDArray, NDArray], UnitEllipses]:
        """The ellipses of control points and covariances in the unit frame."""
        return Memoised(partial(unit_ellipses, self.N))

    @cached_property
    def interior(self) -> float:
        """Share of the detections that come from anywhere inside, (PMHT.9)."""
        return float(np.mean([model.interior for model in self.models]))

    @cached_property
    def N(self) -> NDArray:
        """Weights (L, n_c) of the control points at the ellipses."""
        return chain(len(self.models[0].spread), len(self.models[0].points), DEGREE)

    def init(self, estimate: Estimate) -> SplineState:
        """State from a prior; raises ValueError for a prior that is not finite, positive, definite."""
        check_estimate(estimate)
        m, P = prior_moments(estimate, estimate.size, estimate.size_std)
        return SplineState(m, P, *self._contours(m[..., LENGTH]))

    @guarded_predict
    def predict(self, state: SplineState, dt: float) -> SplineState:
        """Time update over dt [s] >= 0: coordinated turn; the contour stays."""
        moved = predicted(state.m, state.P, self.walk, dt)
        return state._replace(m=moved.mean, P=moved.cov)

    @guarded_update
    def update(self, state: SplineState, scan: Scan) -> tuple[SplineState, SplineInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        n = scan.mask.sum(-1)
        if not n.any():
            return state, nothing(n)
        xy = scan.xy
        detections = self.relative(state.m, scan, xy)
        sensor = View.of(scan, state.m[..., :2], self.sensors)
        ellipses = self.ellipses(state.p, state.Sigma)
        m, P, expected = state.m, state.P, predict_ellipses(state.m, state.P, ellipses.mu)
        w, E, share = self._associate(state, ellipses, m, detections, sensor, expected.C)
        info = innovation(expected, w, E, detections, share, (share < self.lost_below) & (n > 0))
        wider: NDArray | float = 1.0
        if info.lost.any():  # (PMHT.18): the object is taken to be where its detections are
            wider = np.where(info.lost, self.inflation, 1.0)[..., None, None]
            jump = np.where(info.lost[..., None], self._displacement(state, ellipses, detections, sensor), 0.0)
            m, P = m.copy(), P.copy()
            m[..., :2] += jump  # (PMHT.18)
            P[..., :2, :2] += outer(jump)  # (PMHT.18)
            w, E, _ = self._associate(state, ellipses, m, detections, sensor, expected.C, wider)
            expected = predict_ellipses(state.m, P, ellipses.mu)
        prior = P
        for k in range(self.iterations):
            if k > 0:
                w, E, _ = self._associate(state, ellipses, m, detections, sensor, wider=wider)
            z = synthesise(w, detections)
            if isinstance(self.form, str):
                last = k == self.iterations - 1 and self.doubt > 0
                doubt = joint.Doubt(w, detections, self.doubt) if last else None
                m, P = joint.update(state.m, expected, E, z, doubt)
            else:
                m, P = self.form.update(state.m, prior, ellipses.mu, E, z)
            np.maximum(m[..., LENGTH:], LEAST_SIZE, out=m[..., LENGTH:])
        m, P = self.rates.correct(m, P, scan, xy)  # (RR.4)
        np.maximum(m[..., LENGTH:], LEAST_SIZE, out=m[..., LENGTH:])  # by correlation with the speed
        new = state._replace(m=m, P=P)
        return new if n.all() else select(n > 0, new, state), info

    def _associate(
        self,
        state: SplineState,
        ellipses: UnitEllipses,
        m: NDArray,
        detections: RelativeDetections,
        sensor: View,
        spare: NDArray | None = None,
        wider: NDArray | float = 1.0,
    ) -> tuple[NDArray, NDArray, NDArray]:
        """Weights (..., M, L) at the iterate m, covariances E (..., 3, L), explained share (...) of the scan.

        `spare` (..., 3, L) [m^2] is what the uncertainty of the state adds, in the first iteration only; `wider` is a
        factor of the ellipses' covariances.
        """
        placed = place(ellipses, m, state.m[..., :2])
        E = placed.E * wider  # (PMHT.18)
        C = self.widened * E
        log_joint = log_density(detections, placed.c, C if spare is None else C + spare)  # (PMHT.8)
        log_joint += self.log_weights(state.visible, placed.c, m[..., PHI], sensor)
        within = interior_density(placed, detections, self.interior)
        w = responsibilities(log_joint, detections.mask, self.eps + within)  # (PMHT.10)
        own = w.sum((-1, -2))
        if self.interior:
            share_within = (within / (within + max(self.eps, LEAST_DENSITY)))[..., 0]
            own = own + ((detections.mask - w.sum(-1)) * share_within).sum(-1)
        return w, E, own / np.maximum(detections.mask.sum(-1), 1)  # (PMHT.17)

    def _displacement(
        self, state: SplineState, ellipses: UnitEllipses, detections: RelativeDetections, sensor: View
    ) -> NDArray:
        """Mean of the detections less that of the ellipses which their sensors can see, (..., 2) [m]."""
        placed = place(ellipses, state.m, state.m[..., :2])
        pi = np.exp(self.log_weights(state.visible, placed.c, state.m[..., PHI], sensor))
        each = (detections.mask / np.maximum(detections.mask.sum(-1, keepdims=True), 1))[..., None]  # (..., M, 1)
        return (detections.z @ each)[..., 0] - (placed.c @ (pi * each).sum(-2)[..., None])[..., 0]  # (PMHT.18)

    def log_weights(self, visible: NDArray, c: NDArray, phi: NDArray, sensor: View) -> NDArray:
        """Log prior (..., M or 1, L) of the ellipses at c (..., 2, L) [m] for the sensors of M detections."""
        if self.visibility == "none":
            return np.full((1, c.shape[-1]), -np.log(c.shape[-1]))
        cover = sensor.cover(c) if self.sensors else 1.0
        return np.log(weights(visible, directions(c, phi, sensor.place), self.unseen, cover))  # (PMHT.22)

    def relative(self, m: NDArray, scan: Scan, xy: NDArray) -> RelativeDetections:
        """Detections relative to the centres of m (..., 7)."""
        mask, noise = scan.mask, scan.noise
        z = (xy - m[..., None, :2]).mT
        z = z if mask.all() else np.where(mask[..., None, :], z, 0.0)
        if np.isnan(noise[..., :2]).all():
            return RelativeDetections(z, self.sigma**2 * IDENTITY, mask)
        along = np.where(np.isnan(noise[..., 0]), self.sigma, noise[..., 0]) ** 2
        across = np.where(np.isnan(noise[..., 1]), self.sigma, scan.polar[..., 0] * noise[..., 1]) ** 2
        R = polar_noise(along, across, scan.sight)
        R = R if mask.all() else np.where(mask[..., None, :], R, IDENTITY)
        return RelativeDetections(z, R, mask)

    def on_sensors(self, sensors: Sequence[SensorModel]) -> "SplinePmht":
        """The same with the data sheets of the sensors, which say what they cover."""
        return replace(self, sensors=tuple(sensors))

    def resize(self, state: SplineState, size: NDArray, size_std: NDArray) -> SplineState:
        """State with another size (..., 2) [m] of standard deviation size_std (..., 2) [m]."""
        m, P = resized(state.m, state.P, size, size_std)
        contours = state[2:] if len(self.models) == 1 else self._contours(m[..., LENGTH])
        if all(map(np.array_equal, contours, state[2:])):
            contours = state[2:]  # the arrays themselves, so that `outline` is kept
        return SplineState(m, P, *contours)

    def log_spatial(self, state: SplineState, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""
        rows = SplineState(*(leaf[track] for leaf in state))
        pairs = scan._replace(
            polar=scan.polar[detection, None],
            mask=np.ones((len(track), 1), bool),
            **{name: spread_rows(getattr(scan, name), detection) for name in ("pose", "velocity", "noise", "sensor")},
        )
        m = rows.m
        detections = self.relative(m, pairs, pairs.xy)
        placed = place(unit_ellipses(self.N, rows.p, rows.Sigma), m, m[..., :2])
        where = columns(rows.P[..., None, :2, :2])
        placed = placed._replace(E=placed.E + where, box=placed.box + where)
        log_pi = self.log_weights(rows.visible, placed.c, m[..., PHI], View.of(pairs, m[..., :2], self.sensors))
        density = np.exp(log_density(detections, placed.c, placed.E) + log_pi).sum(-1)[..., 0]
        density = density + interior_density(placed, detections, self.interior)[..., 0, 0]  # (PMHT.20)
        return np.log(np.maximum((1 - self.interior) * density, LEAST_DENSITY))  # (PMHT.20)

    def estimate(self, state: SplineState) -> Estimate:
        """Box along the heading, and the curve through the middle of the detections or outside it, see `outward`."""
        found = estimate_of(state.m, state.P, self.outline(state.p, state.Sigma))
        if any(self.position_std):
            body = rotation(state.m[..., PHI]) * (found.size * self.position_std)[..., None, :]
            found.cov[..., :2, :2] += body @ body.mT
        return found

    def _contours(self, length: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Control points, covariances and visibility of objects of length (...) [m]."""
        p, Sigma, visible = (a[self.by_length(length)] for a in self.contours)
        return p, Sigma, visible

    def by_length(self, length: NDArray) -> NDArray:
        """Rows (...) int of the models of objects of length (...) [m]."""
        return (length > TRUCK_ABOVE).astype(int) if len(self.models) > 1 else np.zeros(length.shape, int)


@lru_cache(maxsize=64)
def typical_visibility(model: SplineModel, grazing: float) -> NDArray:
    """The visibility table (A, L) of a model at its typical size."""
    return visibility_table(model.p, np.array(model.size), len(model.spread), DEGREE, grazing)


def spread_rows(field: NDArray, index: NDArray) -> NDArray:
    """Rows index (G,) of a field (M or 1, k) of a scan, as (G, 1, k)."""
    return field[index if len(field) > 1 else np.zeros(len(index), int), None]
