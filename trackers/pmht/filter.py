"""pmht-spline: the coordinated-turn UKF on ellipses chained by a B-spline, with PMHT association.

Symbols and equations: card bspline_pmht, after Yao et al. (2021). Detections of one scan are shared out among the
ellipses by their probabilities; the synthetic detection of each ellipse then corrects pose, motion and size at once.
"""

from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from trackers.batch import select
from trackers.estimate import Estimate, check_estimate
from trackers.geometry import rotation
from trackers.linalg import outer
from trackers.motion import PHI
from trackers.pmht import joint, sequential
from trackers.pmht.association import Seen, log_density, responsibilities, synthesise
from trackers.pmht.ellipses import Shape, inside, place, shape_of
from trackers.pmht.info import SplineInfo, innovation, nothing
from trackers.pmht.joint import look
from trackers.pmht.model import DEGREE, SplineModel, outlines, resolve
from trackers.pmht.motion import Walk, predicted
from trackers.pmht.rates import RangeRates
from trackers.pmht.spline import chain
from trackers.pmht.state import LEAST_SIZE, LENGTH, SplineState, estimate_of, moments_of, resized
from trackers.pmht.symmetric import columns, polar_noise
from trackers.pmht.visibility import directions, sight_table, weights
from trackers.scan import Scan, check_scan

VISIBILITIES = ("rays", "none")
FORMS = ("joint", "sequential")
LEAST_DENSITY = 1e-300
IDENTITY = np.array([[1.0], [0.0], [1.0]])  # as columns
TRUCK_ABOVE = 6.5  # [m] where a filter of two models takes the second


@dataclass(frozen=True)
class SplinePmht:
    """Defaults are the card's, for its experiment, but for visibility and range rates; see `trackers.registry`."""

    model: str | SplineModel | tuple[SplineModel, ...]
    visibility: str = "rays"  # weights of the ellipses by what each sensor can see, or "none": equal, the paper's
    form: str = "joint"  # or "sequential", the paper's, several times slower
    iterations: int = 3  # of association and update
    walk: Walk = field(default_factory=Walk)
    rates: RangeRates = field(default_factory=RangeRates)
    sigma: float = 0.2  # [m] noise of detections that do not tell theirs
    widened: float = 1.0  # times Sigma_l in the association; the paper prints 4, which is the less accurate [C3]
    eps: float = 1e-8  # [1/m^2] density of what is not of the object, see `association.outlier_density`
    unseen: float = 0.02  # share of the detections of ellipses that are out of sight: no contour is exact
    grazing: float = 0.5  # see `visibility.sight_table`
    lost_below: float = 0.5  # explained share of a scan that tells a lost association
    inflation: float = 9.0  # of the ellipses, in the scan that a lost object is found with
    outward: float = 0.0  # the drawn contour lies so many standard deviations of the ellipses outside their curve
    position_std: tuple[float, float] = (0.0, 0.0)  # of length and width: how far the outline lies off the model's

    def __post_init__(self) -> None:
        for name, known in (("visibility", VISIBILITIES), ("form", FORMS)):
            if getattr(self, name) not in known:
                raise ValueError(f"{name} must be one of {', '.join(known)}, got {getattr(self, name)!r}")
        if self.iterations < 1:
            raise ValueError(f"iterations must be at least 1, got {self.iterations}")
        if not (self.eps >= 0 and self.inflation > 1 and 0 <= self.lost_below <= 1 and 0 <= self.unseen <= 1):
            raise ValueError(
                f"eps must be >= 0, inflation > 1, lost_below and unseen within 0 and 1, got {self.eps}, "
                f"{self.inflation}, {self.lost_below}, {self.unseen}"
            )

    @property
    def angles(self) -> tuple[int, ...]:
        """The heading is unwrapped, but starts anew where a track does."""
        return (PHI,)

    @cached_property
    def models(self) -> tuple[SplineModel, ...]:
        """The models that objects start from; of two, longer objects get the second."""
        return resolve(self.model)

    @cached_property
    def interior(self) -> float:
        """Share of the detections that come from anywhere inside."""
        return float(np.mean([model.interior for model in self.models]))

    @cached_property
    def N(self) -> NDArray:
        """Weights (L, n_c) of the control points at the ellipses."""
        return chain(len(self.models[0].spread), len(self.models[0].points), DEGREE)

    def init(self, estimate: Estimate) -> SplineState:
        """State from a prior; raises ValueError for a prior that is not finite, positive, definite."""
        check_estimate(estimate)
        m, P = moments_of(estimate)
        return SplineState(m, P, *self._contours(m[..., LENGTH]))

    def predict(self, state: SplineState, dt: float) -> SplineState:
        """Time update over dt [s] >= 0: coordinated turn; the contour stays."""
        if not dt >= 0:
            raise ValueError(f"dt must be >= 0 s, got {dt}; scans come in the order of time")
        moved = predicted(state.m, state.P, self.walk, dt)
        return state._replace(m=moved.mean, P=moved.cov)

    def update(self, state: SplineState, scan: Scan) -> tuple[SplineState, SplineInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        check_scan(scan)
        n = scan.mask.sum(-1)
        if not n.any():
            return state, nothing(n)
        xy = scan.xy
        seen = self.relative(state.m, scan, xy)
        sensor = scan.pose[..., :2] - state.m[..., None, :2]
        shape = shape_of(self.N, state)
        m, P, view = state.m, state.P, look(state.m, state.P, shape.mu)
        w, E, share = self._associate(state, shape, m, seen, sensor, view.C)
        info = innovation(view, w, E, seen, share, (share < self.lost_below) & (n > 0))
        wider: NDArray | float = 1.0
        if info.lost.any():  # the object is where its detections are, and nothing else is known of where that is
            wider = np.where(info.lost, self.inflation, 1.0)[..., None, None]
            jump = np.where(info.lost[..., None], self._displacement(state, shape, seen, sensor), 0.0)
            m, P = m.copy(), P.copy()
            m[..., :2] += jump
            P[..., :2, :2] += outer(jump)
            w, E, _ = self._associate(state, shape, m, seen, sensor, view.C, wider)
            view = look(state.m, P, shape.mu)
        prior = P
        for k in range(self.iterations):
            if k > 0:
                w, E, _ = self._associate(state, shape, m, seen, sensor, wider=wider)
            z = synthesise(w, seen)
            if self.form == "joint":
                m, P = joint.update(state.m, view, E, z)
            else:
                m, P = sequential.update(state.m, prior, shape.mu, E, z)
            np.maximum(m[..., LENGTH:], LEAST_SIZE, out=m[..., LENGTH:])
        m, P = self.rates.correct(m, P, scan, xy)
        new = state._replace(m=m, P=P)
        return new if n.all() else select(n > 0, new, state), info

    def _associate(
        self,
        state: SplineState,
        shape: Shape,
        m: NDArray,
        seen: Seen,
        sensor: NDArray,
        spare: NDArray | None = None,
        wider: NDArray | float = 1.0,
    ) -> tuple[NDArray, NDArray, NDArray]:
        """Weights (..., M, L) at the iterate m, the covariances that go with them, explained share (...) of the scan.

        `spare` (..., 3, L) [m^2] is what the uncertainty of the state adds, the first time [C4].
        """
        placed = place(shape, m, state.m[..., :2])
        E = placed.E * wider
        C = self.widened * E
        log_joint = log_density(seen, placed.c, C if spare is None else C + spare)
        log_joint += self.log_weights(state.sight, placed.c, m[..., PHI], sensor)
        within = inside(placed, seen, self.interior)
        w = responsibilities(log_joint, seen.mask, self.eps + within)
        own = w.sum((-1, -2))
        if self.interior:
            share_within = (within / (within + max(self.eps, LEAST_DENSITY)))[..., 0]
            own = own + ((seen.mask - w.sum(-1)) * share_within).sum(-1)
        return w, E, own / np.maximum(seen.mask.sum(-1), 1)

    def _displacement(self, state: SplineState, shape: Shape, seen: Seen, sensor: NDArray) -> NDArray:
        """Mean of the detections less that which the sensors should see, (..., 2) [m]."""
        placed = place(shape, state.m, state.m[..., :2])
        pi = np.exp(self.log_weights(state.sight, placed.c, state.m[..., PHI], sensor))
        each = (seen.mask / np.maximum(seen.mask.sum(-1, keepdims=True), 1))[..., None]  # (..., M, 1)
        return (seen.z @ each)[..., 0] - (placed.c @ (pi * each).sum(-2)[..., None])[..., 0]

    def log_weights(self, sight: NDArray, c: NDArray, phi: NDArray, sensor: NDArray) -> NDArray:
        """Log prior (..., M or 1, L) of the ellipses at c (..., 2, L) [m] as sensors (..., M or 1, 2) [m] see them."""
        if self.visibility == "none":
            return np.full((1, c.shape[-1]), -np.log(c.shape[-1]))
        return np.log(weights(sight, directions(c, phi, sensor), self.unseen))

    def relative(self, m: NDArray, scan: Scan, xy: NDArray) -> Seen:
        """Detections relative to the centres of m (..., 7)."""
        mask, noise = scan.mask, scan.noise
        z = (xy - m[..., None, :2]).mT
        z = z if mask.all() else np.where(mask[..., None, :], z, 0.0)
        if np.isnan(noise[..., :2]).all():
            return Seen(z, self.sigma**2 * IDENTITY, mask)
        along = np.where(np.isnan(noise[..., 0]), self.sigma, noise[..., 0]) ** 2
        across = np.where(np.isnan(noise[..., 1]), self.sigma, scan.polar[..., 0] * noise[..., 1]) ** 2
        R = polar_noise(along, across, scan.sight)
        R = R if mask.all() else np.where(mask[..., None, :], R, IDENTITY)
        return Seen(z, R, mask)

    def resize(self, state: SplineState, size: NDArray, size_std: NDArray) -> SplineState:
        """State with another size (..., 2) [m] of standard deviation size_std (..., 2) [m]."""
        m, P = resized(state.m, state.P, size, size_std)
        if len(self.models) == 1:
            return state._replace(m=m, P=P)
        return SplineState(m, P, *self._contours(m[..., LENGTH]))

    def log_spatial(self, state: SplineState, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""
        rows = SplineState(*(leaf[track] for leaf in state))
        pairs = scan._replace(
            polar=scan.polar[detection, None],
            mask=np.ones((len(track), 1), bool),
            **{name: spread_rows(getattr(scan, name), detection) for name in ("pose", "velocity", "noise")},
        )
        m = rows.m
        seen = self.relative(m, pairs, pairs.xy)
        placed = place(shape_of(self.N, rows), m, m[..., :2])
        where = columns(rows.P[..., None, :2, :2])
        placed = placed._replace(E=placed.E + where, box=placed.box + where)
        log_pi = self.log_weights(rows.sight, placed.c, m[..., PHI], pairs.pose[..., :2] - m[..., None, :2])
        density = np.exp(log_density(seen, placed.c, placed.E) + log_pi).sum(-1)[..., 0]
        density = density + inside(placed, seen, self.interior)[..., 0, 0]
        return np.log(np.maximum((1 - self.interior) * density, LEAST_DENSITY))

    def estimate(self, state: SplineState) -> Estimate:
        """Box along the heading, and the curve through the middle of the detections or outside it, see `outward`."""
        outline = outlines(state.p, state.Sigma, self.outward)
        found = estimate_of(state.m, state.P, outline)
        if any(self.position_std):
            body = rotation(state.m[..., PHI]) * (found.size * self.position_std)[..., None, :]
            found.cov[..., :2, :2] += body @ body.mT
        return found

    def _contours(self, length: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Contour and sight of objects of length (...) [m]."""
        which = (length > TRUCK_ABOVE).astype(int) if len(self.models) > 1 else np.zeros(length.shape, int)
        sights = np.stack([shown(model, self.grazing) for model in self.models])
        p, Sigma = np.stack([m.p for m in self.models]), np.stack([m.Sigma for m in self.models])
        return p[which], Sigma[which], sights[which]


@lru_cache(maxsize=64)
def shown(model: SplineModel, grazing: float) -> NDArray:
    """The sight table (A, L) of a model at its typical size."""
    return sight_table(model.p, np.array(model.size), len(model.spread), DEGREE, grazing)


def spread_rows(field: NDArray, index: NDArray) -> NDArray:
    """Rows index (G,) of a field (M or 1, k) of a scan, as (G, 1, k)."""
    return field[index if len(field) > 1 else np.zeros(len(index), int), None]
