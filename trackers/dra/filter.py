"""Data-region association: every detection comes from one of four sides or the interior of a moving parallelogram.

Equations: docs/methods/data-regions.md, symbols after Xu et al. (2023); the recursion over motion models is that of
docs/methods/interacting-models.md.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from trackers import linalg
from trackers.dra import motion, parameters
from trackers.dra.forms import RegionPosterior, RegionUpdate, sequential, soft, softmax
from trackers.dra.measurement import FlatScan, LinearisedRegions, RegionResiduals, flatten, linearise_regions, residuals
from trackers.dra.parameters import MODELS, Parameters
from trackers.dra.regions import gates, log_spatial, ray_prior, region_moments, uniform_prior
from trackers.dra.state import (
    OBSERVED,
    ORDER,
    PAIRS,
    PLACE,
    DataRegionInfo,
    DataRegionState,
    N,
    W,
    along_velocity,
    axes,
    from_estimate,
    rectangle,
    resized,
    swung,
    to_estimate,
)
from trackers.estimate import Estimate, check_estimate
from trackers.filter import Gaussian
from trackers.imm import LEAST, chain, mix, moments, reweight
from trackers.linalg import symmetrize
from trackers.parameters import check_numbers
from trackers.scan import Scan
from trackers.validation import guarded_predict, guarded_update

PRIORS = ("uniform", "rays")
FORMS = ("sequential", "soft")
ROUNDING = 1e-13 * np.eye(N)  # keeps the root of a covariance regular


@dataclass(frozen=True)
class DataRegion:
    """DRA with one motion model, DRA-IMM with several, EDRA-IMM with prior "rays"."""

    models: tuple[str, ...] = MODELS
    prior: str = "rays"  # of the regions, or "uniform" as in DRA
    form: str | RegionUpdate = "sequential"  # moment matching after each detection; "soft", or one's own
    parameters: str | Parameters = "recommended"  # or another of PARAMETERS, or one's own
    passes: int = 3  # of the soft form
    sigma_range: float = 0.1  # [m] noise where a scan does not state it, as the two below
    sigma_azimuth: float = 0.005  # [rad]
    sigma_rate: float = 0.027  # [m/s]
    surface_std: float = 0.2  # [m] roughness of a side, in the density of detections only
    centre_std: float = 0.0  # [m] added in estimates, as no body is a rectangle with evenly spread detections

    angles: ClassVar[tuple[int, ...]] = ()  # no component of the state is one

    def __post_init__(self) -> None:
        if not self.models or not set(self.models) <= set(MODELS):
            raise ValueError(f"models must be some of {', '.join(MODELS)}, got {self.models!r}")
        if self.prior not in PRIORS:
            raise ValueError(f"prior must be one of {', '.join(PRIORS)}, got {self.prior!r}")
        if isinstance(self.form, str) and self.form not in FORMS:
            raise ValueError(f"form must be one of {', '.join(FORMS)} or a RegionUpdate, got {self.form!r}")
        check_numbers(self, positive=("passes", "sigma_range", "sigma_azimuth", "sigma_rate"))
        chain(len(self.models), self.numbers.stay, 1.0)

    @cached_property
    def numbers(self) -> Parameters:
        """The parameter set."""
        return parameters.find(self.parameters)

    @cached_property
    def components(self) -> NDArray:
        """Whether each model has each component of the state, (K, 11) bool."""
        return np.stack([motion.components(name, self.numbers.rotating_ca) for name in self.models])

    def init(self, estimate: Estimate) -> DataRegionState:
        """State from a prior, models equally likely; raises ValueError for a prior not finite, positive, definite."""
        check_estimate(estimate)
        K = len(self.models)
        m, P = from_estimate(estimate, self.numbers.accel_prior_std, self.numbers.shear_prior_std)
        m = np.where(self.components, m[..., None, :], 0.0)
        P = np.repeat(P[..., None, :, :], K, -3)
        return DataRegionState(np.full(m.shape[:-1], 1 / K), m, P)

    @guarded_predict
    def predict(self, state: DataRegionState, dt: float) -> DataRegionState:
        """Time update over dt [s] >= 0: mixing, then the prediction of each model; with dt = 0 nothing changes."""
        if dt == 0:
            return state
        m, P, mu = self._mix(state, dt)
        moved = [
            motion.predict(name, m[..., k, :], P[..., k, :, :], dt, self.numbers) for k, name in enumerate(self.models)
        ]
        m, P = np.stack([a for a, _ in moved], -2), np.stack([b for _, b in moved], -3)
        if self.numbers.swing:
            stiff = ~self.components[:, W]
            variance = self.numbers.swing * dt / self.numbers.step
            P[..., stiff, :, :] = swung(m[..., stiff, :], P[..., stiff, :, :], variance)  # (DRA.33)
        return DataRegionState(mu, m, P)

    @guarded_update
    def update(self, state: DataRegionState, scan: Scan) -> tuple[DataRegionState, DataRegionInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        lead, K = state.mu.shape[:-1], len(self.models)
        n = scan.mask.sum(-1)
        rows = DataRegionState(state.mu.reshape(-1, K), state.m.reshape(-1, K, N), state.P.reshape(-1, K, N, N))
        eps, S = np.zeros((n.size, 2)), np.zeros((n.size, 2, 2)) + np.eye(2)
        log_likelihood = np.zeros(n.size)
        if n.any():
            hit, flat = flatten(scan, (self.sigma_range, self.sigma_azimuth, self.sigma_rate))
            mu, m, P = (field.copy() for field in rows)
            prior = self._region_prior(mu[hit], m[hit], flat)
            eps[hit], S[hit] = innovation(mu[hit], m[hit], P[hit], flat, prior)
            m[hit], P[hit], log_c1 = self._correct(m[hit], P[hit], flat, prior)
            _, log_likelihood[hit] = softmax(np.log(np.maximum(mu[hit], LEAST)) + log_c1)
            mu[hit] = reweight(mu[hit], log_c1)  # (IMM.12)
            rows = DataRegionState(mu, m, P)
        new = DataRegionState(*(field.reshape(old.shape) for field, old in zip(rows, state, strict=True)))
        info = (eps.reshape(*lead, 2), S.reshape(*lead, 2, 2), new.mu, log_likelihood.reshape(lead))
        return new, DataRegionInfo(n, *info)

    def estimate(self, state: DataRegionState) -> Estimate:
        """Mean of the mixture as a box along p1 + p2, (DRA.35)."""
        box = to_estimate(state)
        box.cov[..., [0, 1], [0, 1]] += self.centre_std**2
        least = self.numbers.least_length_std * box.size[..., 0]
        box.size_std[..., 0] = np.maximum(box.size_std[..., 0], least)  # (DRA.39)
        return box

    def resize(self, state: DataRegionState, size: NDArray, size_std: NDArray) -> DataRegionState:
        """State with another size (..., 2) [m] of standard deviation size_std (..., 2) [m]."""
        return resized(state, size, size_std)

    def shift(self, state: DataRegionState, d: NDArray) -> DataRegionState:
        """State with d (..., 2) [m] added to the centre in every model."""
        m = state.m.copy()
        m[..., PLACE] += d[..., None, :]
        return state._replace(m=m)

    def gaussian(self, state: DataRegionState) -> Gaussian:
        """Mean and covariance of the state; of several models, of their mixture."""
        if len(self.models) == 1:
            return Gaussian(state.m[..., 0, :], state.P[..., 0, :, :])
        return Gaussian(*moments(state.m, state.P, state.mu))

    def with_gaussian(self, state: DataRegionState, gaussian: Gaussian) -> DataRegionState:
        """The state with another mean and covariance, the same in every model."""
        m = np.broadcast_to(gaussian.m[..., None, :], state.m.shape)
        return state._replace(m=m, P=np.broadcast_to(gaussian.P[..., None, :, :], state.P.shape))

    def mixed(self, state: DataRegionState, dt: float) -> tuple[NDArray, list[tuple[Any, Any]]] | None:
        """Probabilities (..., K) of the models after dt [s], and of each its filter and the state it starts from."""
        if len(self.models) == 1:
            return None
        m, P, c = self._mix(state, dt)
        sure = np.ones(c[..., :1].shape)
        return c, [
            (replace(self, models=(name,)), DataRegionState(sure, m[..., [k], :], P[..., [k], :, :]))
            for k, name in enumerate(self.models)
        ]

    def log_spatial(self, state: DataRegionState, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""
        box = to_estimate(state)
        p = self.numbers
        if self.prior == "uniform":
            prior = uniform_prior(track.shape)
        else:
            body = from_estimate(box, 0.0, 0.0)[0]
            sensor = np.broadcast_to(scan.pose[:, :2], (scan.mask.shape[-1], 2))
            prior = ray_prior(body[track], sensor[detection], p.near, p.far)
        return log_spatial(box, prior, scan, track, detection, self.sigma_range, self.surface_std)

    def _mix(self, state: DataRegionState, dt: float) -> tuple[NDArray, NDArray, NDArray]:
        """Mean and covariance that each model starts a prediction over dt [s] from, and its probability after it."""
        p = self.numbers
        Pi = chain(len(self.models), p.stay, dt / p.step)  # (IMM.9)
        return mix(state.m, state.P, state.mu, Pi, self.components if p.own_components else None)  # (IMM.10), (IMM.11)

    def _region_prior(self, mu: NDArray, m: NDArray, flat: FlatScan) -> NDArray:
        """Probabilities (B, S, 5) of the regions for each group, from the most likely model."""
        if self.prior == "uniform":
            return uniform_prior(flat.pose.shape[:2])
        best = most_likely(mu, m)
        return ray_prior(best[:, None], flat.pose[..., :2], self.numbers.near, self.numbers.far)

    def _correct(self, m: NDArray, P: NDArray, flat: FlatScan, prior: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Moments of all models (B, K, ...) after the detections, and log c1 (B, K)."""
        p = self.numbers
        L = root(m, P)
        regions = linearise_regions(m, L, flat, p.independence)
        gate = gates(m, flat.xy[:, None], flat.R_xy[:, None], p.gate, p.interior_gate, p.gate_sigmas)
        posterior = self._posterior(regions, residuals(regions, flat, np.log(prior), gate), flat)
        L_9, rest = L[..., :OBSERVED], L[..., OBSERVED:]
        m = m + (L_9 @ posterior.u[..., None])[..., 0]  # (DRA.21)
        P = L_9 @ posterior.C @ L_9.mT + rest @ rest.mT  # (DRA.21)
        if np.isfinite(p.rectangle_std):
            m, P = rectangle(m, P, p.rectangle_std)  # (DRA.30)
        if np.isfinite(p.heading_std):
            m, P = along_velocity(m, P, p.heading_std, p.heading_speed)  # (DRA.31)
        return m, symmetrize(P), posterior.log_c1

    def _posterior(self, regions: LinearisedRegions, nu: RegionResiduals, flat: FlatScan) -> RegionPosterior:
        """The update in the chosen form."""
        if not isinstance(self.form, str):
            return self.form.posterior(regions, nu, flat)
        return soft(regions, nu, flat, self.passes) if self.form == "soft" else sequential(regions, nu, flat)


def root(m: NDArray, P: NDArray) -> NDArray:
    """Roots L (..., 11, 11) of P = L L^T, lower triangular in the axes of the body with the components in ORDER.

    The unscented moments depend on the choice of the root; this one turns with the world.
    """
    along = axes(m).along
    T = np.zeros(P.shape)
    T[..., W, W] = 1.0
    for i, j in PAIRS:
        T[..., i, i] = T[..., j, j] = along[..., 0]
        T[..., j, i], T[..., i, j] = along[..., 1], -along[..., 1]
    T = T[..., ORDER]
    return T @ linalg.root(T.mT @ P @ T + ROUNDING)  # (DRA.14)


def most_likely(mu: NDArray, m: NDArray) -> NDArray:
    """Rows (B, ...) of the most likely models in m (B, K, ...)."""
    return m[np.arange(len(m)), mu.argmax(-1)]


def innovation(mu: NDArray, m: NDArray, P: NDArray, flat: FlatScan, prior: NDArray) -> tuple[NDArray, NDArray]:
    """Innovation (B, 2) of the mean detection under the most likely model, and its covariance (B, 2, 2), (DRA.34)."""
    m, P = most_likely(mu, m), most_likely(mu, P)
    real = np.arange(flat.z.shape[1]) < flat.n[:, None]
    weight = real / flat.n[:, None]  # (B, M)
    q, C = region_moments(m)
    p = prior[np.arange(len(m))[:, None], flat.group]  # (B, M, 5)
    share = (weight[..., None] * p).sum(1)  # (B, 5)
    where = (share[..., None] * q).sum(1)
    d = q - where[:, None]
    spread = (share[..., None, None] * (C + d[..., :, None] * d[..., None, :])).sum(1)
    noise = (weight[..., None, None] * flat.R_xy).sum(1)
    eps = (weight[..., None] * flat.xy).sum(1) - m[:, PLACE] - where  # (DRA.34a)
    return eps, symmetrize(P[:, PLACE][:, :, PLACE] + (spread + noise) / flat.n[:, None, None])  # (DRA.34b)
