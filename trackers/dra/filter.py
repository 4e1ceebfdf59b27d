"""Data-region association: every detection comes from one of four sides or the interior of a moving parallelogram.

Symbols and equations: card dra_imm, after Xu et al. (2023).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from trackers.dra import motion, parameters, region_prior
from trackers.dra.constraints import heading, rectangle
from trackers.dra.joint import joint
from trackers.dra.looks import Looks, flatten
from trackers.dra.measurement import pieces, residuals
from trackers.dra.parameters import MODELS, Parameters
from trackers.dra.posterior import Posterior, softmax
from trackers.dra.regions import gates, region_moments
from trackers.dra.sequential import sequential
from trackers.dra.soft import soft
from trackers.dra.spatial import log_spatial
from trackers.dra.state import (
    ORDER,
    PAIRS,
    PLACE,
    SEEN,
    DataRegionInfo,
    DataRegionState,
    N,
    W,
    axes,
    from_estimate,
    resized,
    swung,
    to_estimate,
)
from trackers.estimate import Estimate, check_estimate
from trackers.imm import LEAST, chain, mix, reweight
from trackers.linalg import symmetrize
from trackers.scan import Scan, check_scan

PRIORS = ("uniform", "rays")
FORMS = ("joint", "sequential", "soft")
ROUNDING = 1e-13 * np.eye(N)  # keeps the root of a covariance regular


@dataclass(frozen=True)
class DataRegion:
    """DRA with one motion model, DRA-IMM with several, EDRA-IMM with prior "rays"."""

    models: tuple[str, ...] = MODELS
    prior: str = "rays"  # of the regions, or "uniform" as in DRA
    form: str = "sequential"  # moment matching after each detection; or "joint" as in the paper, or "soft"
    parameters: str | Parameters = "recommended"  # or another of PARAMETERS, or one's own
    reading: str = "V"  # of the paper's eq. (42): variances, or S, the last two standard deviations
    cap: int = 32  # hypotheses of the joint form
    passes: int = 3  # of the soft form
    sigma_range: float = 0.1  # [m] of detections that do not tell theirs, as the two below
    sigma_azimuth: float = 0.005  # [rad]
    sigma_rate: float = 0.027  # [m/s]
    surface_std: float = 0.2  # [m] roughness of a side, in the density of detections only
    centre_std: float = 0.0  # [m] of bodies that are no rectangles with evenly spread detections, in estimates only

    def __post_init__(self) -> None:
        if not self.models or not set(self.models) <= set(MODELS):
            raise ValueError(f"models must be some of {', '.join(MODELS)}, got {self.models!r}")
        for name, known in (("prior", PRIORS), ("form", FORMS)):
            if getattr(self, name) not in known:
                raise ValueError(f"{name} must be one of {', '.join(known)}, got {getattr(self, name)!r}")
        if self.cap < 1 or self.passes < 1:
            raise ValueError(f"cap and passes must be at least 1, got {self.cap} and {self.passes}")
        chain(len(self.models), self.numbers.stay, 1.0)

    @cached_property
    def numbers(self) -> Parameters:
        """The parameter set."""
        return parameters.find(self.parameters, self.reading)

    @cached_property
    def components(self) -> NDArray:
        """Which components (K, 11) of the state each model has."""
        return np.stack([motion.components(name, self.numbers.rotating_ca) for name in self.models])

    def init(self, estimate: Estimate) -> DataRegionState:
        """State from a prior, all modes equally likely; raises ValueError for a prior that no filter can start from."""
        check_estimate(estimate)
        K = len(self.models)
        m, P = from_estimate(estimate, self.numbers.accel_prior_std, self.numbers.shear_prior_std)
        m = np.where(self.components, m[..., None, :], 0.0)
        P = np.repeat(P[..., None, :, :], K, -3)
        return DataRegionState(np.full(m.shape[:-1], 1 / K), m, P)

    def predict(self, state: DataRegionState, dt: float) -> DataRegionState:
        """Time update over dt [s] >= 0: mixing, then each model's own; without time nothing changes."""
        if not dt >= 0:
            raise ValueError(f"dt must be >= 0 s, got {dt}; scans come in the order of time")
        if dt == 0:
            return state
        Pi = chain(len(self.models), self.numbers.stay, dt / self.numbers.step)
        m, P, mu = mix(state.m, state.P, state.mu, Pi, self.components if self.numbers.own_components else None)
        moved = [
            motion.predict(name, m[..., k, :], P[..., k, :, :], dt, self.numbers) for k, name in enumerate(self.models)
        ]
        m, P = np.stack([a for a, _ in moved], -2), np.stack([b for _, b in moved], -3)
        if self.numbers.swing:
            stiff = ~self.components[:, W]
            variance = self.numbers.swing * dt / self.numbers.step
            P[..., stiff, :, :] = swung(m[..., stiff, :], P[..., stiff, :, :], variance)
        return DataRegionState(mu, m, P)

    def update(self, state: DataRegionState, scan: Scan) -> tuple[DataRegionState, DataRegionInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        check_scan(scan)
        lead, K = state.mu.shape[:-1], len(self.models)
        n = scan.mask.sum(-1)
        flat = DataRegionState(state.mu.reshape(-1, K), state.m.reshape(-1, K, N), state.P.reshape(-1, K, N, N))
        eps, S = np.zeros((n.size, 2)), np.zeros((n.size, 2, 2)) + np.eye(2)
        evidence, capped = np.zeros(n.size), np.zeros(n.size, bool)
        if n.any():
            hit, looks = flatten(scan, (self.sigma_range, self.sigma_azimuth, self.sigma_rate))
            mu, m, P = (field.copy() for field in flat)
            prior = self._region_prior(mu[hit], m[hit], looks)
            eps[hit], S[hit] = centroid(mu[hit], m[hit], P[hit], looks, prior)
            m[hit], P[hit], posterior = self._correct(m[hit], P[hit], looks, prior)
            _, evidence[hit] = softmax(np.log(np.maximum(mu[hit], LEAST)) + posterior.log_c1)
            capped[hit] = posterior.capped
            mu[hit] = reweight(mu[hit], posterior.log_c1)
            flat = DataRegionState(mu, m, P)
        new = DataRegionState(*(field.reshape(old.shape) for field, old in zip(flat, state, strict=True)))
        info = (eps.reshape(*lead, 2), S.reshape(*lead, 2, 2), new.mu, evidence.reshape(lead), capped.reshape(lead))
        return new, DataRegionInfo(n, *info)

    def estimate(self, state: DataRegionState) -> Estimate:
        """Mean of the mixture as a box along p1 + p2."""
        box = to_estimate(state)
        box.cov[..., [0, 1], [0, 1]] += self.centre_std**2
        return box

    def resize(self, state: DataRegionState, size: NDArray, size_std: NDArray) -> DataRegionState:
        """State with another size (..., 2) [m] of standard deviation size_std (..., 2) [m]."""
        return resized(state, size, size_std)

    def log_spatial(self, state: DataRegionState, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""
        box = to_estimate(state)
        p = self.numbers
        if self.prior == "uniform":
            prior = region_prior.uniform(track.shape)
        else:
            body = from_estimate(box, 0.0, 0.0)[0]
            sensor = np.broadcast_to(scan.pose[:, :2], (scan.mask.shape[-1], 2))
            prior = region_prior.rays(body[track], sensor[detection], p.near, p.far)
        return log_spatial(box, prior, scan, track, detection, self.sigma_range, self.surface_std)

    def _region_prior(self, mu: NDArray, m: NDArray, looks: Looks) -> NDArray:
        """Probabilities (B, S, 5) of the regions, those of the most likely model."""
        if self.prior == "uniform":
            return region_prior.uniform(looks.pose.shape[:2])
        best = most_likely(mu, m)
        return region_prior.rays(best[:, None], looks.pose[..., :2], self.numbers.near, self.numbers.far)

    def _correct(self, m: NDArray, P: NDArray, looks: Looks, prior: NDArray) -> tuple[NDArray, NDArray, Posterior]:
        """All models (B, K, ...) after the detections."""
        p = self.numbers
        L = root(m, P)
        parts = pieces(m, L, looks, p.independence)
        gate = gates(m, looks.xy[:, None], looks.R_xy[:, None], p.gate, p.interior_gate, p.gate_sigmas)
        seen = residuals(parts, looks, np.log(prior), gate)
        if self.form == "joint":
            posterior = joint(parts, seen, looks, self.cap)
        elif self.form == "soft":
            posterior = soft(parts, seen, looks, self.passes)
        else:
            posterior = sequential(parts, seen, looks)
        seen_by, other = L[..., :SEEN], L[..., SEEN:]
        m = m + (seen_by @ posterior.u[..., None])[..., 0]
        P = seen_by @ posterior.C @ seen_by.mT + other @ other.mT
        if np.isfinite(p.rectangle_std):
            m, P = rectangle(m, P, p.rectangle_std)
        if np.isfinite(p.heading_std):
            m, P = heading(m, P, p.heading_std)
        return m, symmetrize(P), posterior


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
    return T @ np.linalg.cholesky(T.mT @ P @ T + ROUNDING)


def most_likely(mu: NDArray, m: NDArray) -> NDArray:
    """Means (B, ...) of the most likely models of m (B, K, ...)."""
    return m[np.arange(len(m)), mu.argmax(-1)]


def centroid(mu: NDArray, m: NDArray, P: NDArray, looks: Looks, prior: NDArray) -> tuple[NDArray, NDArray]:
    """Innovation (B, 2) of the mean detection under the most likely model, and its covariance (B, 2, 2)."""
    m, P = most_likely(mu, m), most_likely(mu, P)
    real = np.arange(looks.z.shape[1]) < looks.n[:, None]
    weight = real / looks.n[:, None]  # (B, M)
    q, C = region_moments(m)
    p = prior[np.arange(len(m))[:, None], looks.look]  # (B, M, 5)
    share = (weight[..., None] * p).sum(1)  # (B, 5)
    where = (share[..., None] * q).sum(1)
    d = q - where[:, None]
    spread = (share[..., None, None] * (C + d[..., :, None] * d[..., None, :])).sum(1)
    noise = (weight[..., None, None] * looks.R_xy).sum(1)
    eps = (weight[..., None] * looks.xy).sum(1) - m[:, PLACE] - where
    return eps, symmetrize(P[:, PLACE][:, :, PLACE] + (spread + noise) / looks.n[:, None, None])
