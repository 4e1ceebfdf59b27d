"""Interacting multiple model: several filters with a common Gaussian state, mixed by a Markov chain of modes.

Symbols and equations: card dra_imm, section 9, after Xu et al. (2023), eq. (29)-(35). Models are one more axis K.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from trackers.batch import select
from trackers.estimate import Estimate
from trackers.geometry import wrap_angle
from trackers.linalg import quadratic, symmetrize
from trackers.scan import Scan

LEAST = 1e-8  # probability of a mode; one that is lost for good could never come back


def chain(modes: int, stay: float, steps: float) -> NDArray:
    """Transition matrix (K, K) after `steps` steps, stay [1] the probability to keep the mode in one of them.

    All other modes are equally likely. With no step it is the identity, and k steps are the k-th power of one.
    """
    if modes == 1:
        return np.ones((1, 1))
    if not 1 / modes <= stay <= 1:
        raise ValueError(f"stay must lie between 1 / {modes} and 1, got {stay}; less is a mode that flees itself")
    memory = ((modes * stay - 1) / (modes - 1)) ** steps
    return memory * np.eye(modes) + (1 - memory) / modes


def moments(m: NDArray, P: NDArray, mu: NDArray, angles: tuple[int, ...] = ()) -> tuple[NDArray, NDArray]:
    """Mean (..., n) and covariance (..., n, n) of the mixture of N(m, P) over the last axis K of mu, (34), (35).

    Components named in `angles` [rad] are averaged around the most likely model's.
    """
    about = _centre(m, mu, angles)
    d = _difference(m, about, angles)
    mean = (mu[..., None] * d).sum(-2)
    d = d - mean[..., None, :]
    n = m.shape[-1]
    within = (mu[..., None, :] @ P.reshape(*P.shape[:-2], n * n)).reshape(*mean.shape, n)
    cov = within + (mu[..., None] * d).mT @ d
    return about[..., 0, :] + mean, symmetrize(cov)


def mix(
    m: NDArray,
    P: NDArray,
    mu: NDArray,
    Pi: NDArray,
    own: NDArray | None = None,
    angles: tuple[int, ...] = (),
) -> tuple[NDArray, NDArray, NDArray]:
    """Mixed initial conditions of each model, and its predicted probability.

    m (..., K, n), P (..., K, n, n), mode probabilities mu (..., K), Pi[i, j] = p(j | i). Where own (K, n) is given, it
    says which components a model has: what model i lacks goes into model j with j's own mean and covariance.
    """
    w = Pi * mu[..., :, None]  # (..., i, j)
    c = w.sum(-2)  # (33)
    w = w / np.maximum(c, np.finfo(float).tiny)[..., None, :]
    m_ji, P_ji = np.broadcast_to(m[..., None, :, :], (*w.shape, m.shape[-1])), P[..., None, :, :, :]
    if own is not None and not own.all():
        m_ji, P_ji = _own(m, P, own)
    m_j, P_j = moments(m_ji, P_ji, w.mT, angles)  # (29), (30) with w inside the sum
    return m_j, P_j, c


def reweight(c: NDArray, log_likelihood: NDArray) -> NDArray:
    """Mode probabilities (..., K) after an update, c (..., K) before it, (31), (32)."""
    log_mu = np.log(np.maximum(c, LEAST)) + log_likelihood
    likely = np.exp(log_mu - log_mu.max(-1, keepdims=True))
    mu = np.maximum(likely / likely.sum(-1, keepdims=True), LEAST)
    return mu / mu.sum(-1, keepdims=True)


def _own(m: NDArray, P: NDArray, own: NDArray) -> tuple[NDArray, NDArray]:
    """Means (..., j, i, n) and covariances of model i as model j takes them."""
    lacks = ~own & own[:, None]  # (j, i, n): j has what i lacks
    m_ji = np.where(lacks, m[..., :, None, :], m[..., None, :, :])
    both, none = (lacks[..., :, None] & lacks[..., None, :]), ~(lacks[..., :, None] | lacks[..., None, :])
    P_ji = none.astype(float) * P[..., None, :, :, :]
    P_ji += both.astype(float) * P[..., :, None, :, :]
    return m_ji, P_ji


def _centre(m: NDArray, mu: NDArray, angles: tuple[int, ...]) -> NDArray:
    if not angles:
        return np.zeros((*m.shape[:-2], 1, m.shape[-1]))
    best = np.broadcast_to(mu, m.shape[:-1]).argmax(-1)[..., None, None]
    about = np.zeros((*m.shape[:-2], 1, m.shape[-1]))
    about[..., list(angles)] = np.take_along_axis(m, best, -2)[..., list(angles)]
    return about


def _difference(m: NDArray, about: NDArray, angles: tuple[int, ...]) -> NDArray:
    d = m - about
    for a in angles:
        d[..., a] = wrap_angle(d[..., a])
    return d


class IMMState(NamedTuple):
    """Mode probabilities and the state of every model."""

    mu: NDArray  # (..., K)
    models: Any  # the filters' state with the axis K behind the leading axes; has fields m and P only


class IMMInfo(NamedTuple):
    """Innovation of the most likely model, and the modes."""

    n: NDArray  # (...) detections used
    eps: NDArray  # (..., 2) [m] innovation
    S: NDArray  # (..., 2, 2) [m^2] its covariance
    mode: NDArray  # (..., K) probabilities

    @property
    def nis(self) -> NDArray:
        """Normalised innovation squared (...), NaN without a detection."""
        return np.where(self.n > 0, quadratic(self.eps, self.S), np.nan)


@runtime_checkable
class Evidence(Protocol):
    """Information of an update that tells the likelihood of all detections itself."""

    log_likelihood: NDArray  # (...)


@dataclass(frozen=True)
class IMM:
    """Filters that differ in their motion, with one state of fields m (..., n) and P (..., n, n)."""

    filters: tuple[Any, ...]  # Filters
    stay: float = 0.98  # probability to keep the mode for a time `step`
    step: float = 0.1  # [s]
    angles: tuple[int, ...] = ()  # components of m that are angles [rad]

    def __post_init__(self) -> None:
        if not self.filters:
            raise ValueError("filters must name at least one filter, got none; one alone is that filter")
        if not self.step > 0:
            raise ValueError(f"step must be positive, got {self.step} s; it is the time that `stay` refers to")
        chain(len(self.filters), self.stay, 1.0)

    def init(self, estimate: Estimate) -> IMMState:
        """State from a prior, all modes equally likely."""
        K = len(self.filters)
        mu = np.full((*estimate.yaw_rate.shape, K), 1 / K)
        return IMMState(mu, _join([f.init(estimate) for f in self.filters]))

    def predict(self, state: IMMState, dt: float) -> IMMState:
        """Time update over dt [s] >= 0: mixing, then each model's own."""
        if not dt >= 0:
            raise ValueError(f"dt must be >= 0 s, got {dt}; scans come in the order of time")
        Pi = chain(len(self.filters), self.stay, dt / self.step)
        m, P, mu = mix(state.models.m, state.models.P, state.mu, Pi, angles=self.angles)
        mixed = type(state.models)(m, P)
        return IMMState(mu, _join([f.predict(_model(mixed, k), dt) for k, f in enumerate(self.filters)]))

    def update(self, state: IMMState, scan: Scan) -> tuple[IMMState, IMMInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        done = [f.update(_model(state.models, k), scan) for k, f in enumerate(self.filters)]
        infos = [info for _, info in done]
        mu = reweight(state.mu, np.stack([log_evidence(info) for info in infos], -1))
        new = select(infos[0].n > 0, IMMState(mu, _join([s for s, _ in done])), state)
        best = new.mu.argmax(-1)
        eps = np.take_along_axis(np.stack([i.eps for i in infos], -2), best[..., None, None], -2)[..., 0, :]
        S = np.take_along_axis(np.stack([i.S for i in infos], -3), best[..., None, None, None], -3)[..., 0, :, :]
        return new, IMMInfo(infos[0].n, eps, S, new.mu)

    def estimate(self, state: IMMState) -> Estimate:
        """What the mixture says about the object, as the first filter describes it."""
        m, P = moments(state.models.m, state.models.P, state.mu, self.angles)
        return self.filters[0].estimate(type(state.models)(m, P))


def log_evidence(info: Any) -> NDArray:
    """Log likelihood (...) of a scan: the filter's own, or that of the centroid; 0 without a detection."""
    if isinstance(info, Evidence):
        return info.log_likelihood
    log_det = np.linalg.slogdet(info.S)[1]
    return np.where(info.n > 0, -0.5 * (quadratic(info.eps, info.S) + log_det) - np.log(2 * np.pi), 0.0)


def _model(models: Any, k: int) -> Any:
    return type(models)(m=models.m[..., k, :], P=models.P[..., k, :, :])


def _join(states: list[Any]) -> Any:
    return type(states[0])(m=np.stack([s.m for s in states], -2), P=np.stack([s.P for s in states], -3))
