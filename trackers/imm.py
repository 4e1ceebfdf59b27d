"""Interacting multiple models: Gaussians of several motion models, mixed by a Markov chain.

Equations: docs/methods/interacting-models.md, symbols after Xu et al. (2023). Models are one more axis K. A filter with
several models calls `chain` and `mix` before it predicts, `reweight` after its update and `moments` for its estimate,
as `trackers.dra.filter` does.
"""

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import wrap_angle
from trackers.linalg import symmetrize

LEAST = 1e-8  # probability of a model; one whose probability reaches 0 could never become likely again


def chain(modes: int, stay: float, steps: float) -> NDArray:
    """Transition matrix (K, K) after `steps` steps, stay [1] the probability to keep the model in one of them.

    All other models are equally likely. With no step it is the identity, and k steps are the k-th power of one.

    Raises:
        ValueError: `stay` is not between 1 / K and 1.

    """
    if modes == 1:
        return np.ones((1, 1))
    if not 1 / modes <= stay <= 1:
        raise ValueError(
            f"stay must lie between 1 / {modes} and 1, got {stay}; with less, a change is likelier than none"
        )
    kept = ((modes * stay - 1) / (modes - 1)) ** steps
    return kept * np.eye(modes) + (1 - kept) / modes  # (IMM.9)


def moments(m: NDArray, P: NDArray, mu: NDArray, angles: tuple[int, ...] = ()) -> tuple[NDArray, NDArray]:
    """Mean (..., n) and covariance (..., n, n) of the mixture of N(m, P) over the last axis K of mu.

    m (..., K, n), P (..., K, n, n), mu (..., K). Components named in `angles` [rad] are averaged around the most likely
    model's.
    """
    about = _centre(m, mu, angles)
    d = _difference(m, about, angles)
    mean = (mu[..., None] * d).sum(-2)  # (IMM.13), from `about`
    d = d - mean[..., None, :]
    n = m.shape[-1]
    within = (mu[..., None, :] @ P.reshape(*P.shape[:-2], n * n)).reshape(*mean.shape, n)
    cov = within + (mu[..., None] * d).mT @ d  # (IMM.13)
    return about[..., 0, :] + mean, symmetrize(cov)


def mix(
    m: NDArray,
    P: NDArray,
    mu: NDArray,
    Pi: NDArray,
    own: NDArray | None = None,
    angles: tuple[int, ...] = (),
) -> tuple[NDArray, NDArray, NDArray]:
    """Mixed mean and covariance that each model starts from, and its predicted probability.

    m (..., K, n), P (..., K, n, n), probabilities of the models mu (..., K), Pi[i, j] = p(j | i). Where own (K, n) is
    given, it says which components a model has: what model i lacks goes into model j with j's own mean and covariance.
    """
    w = Pi * mu[..., :, None]  # (..., i, j)
    c = w.sum(-2)  # (IMM.10)
    w = w / np.maximum(c, np.finfo(float).tiny)[..., None, :]  # (IMM.10)
    m_ji, P_ji = np.broadcast_to(m[..., None, :, :], (*w.shape, m.shape[-1])), P[..., None, :, :, :]
    if own is not None and not own.all():
        m_ji, P_ji = _own(m, P, own)  # (IMM.11)
    m_j, P_j = moments(m_ji, P_ji, w.mT, angles)  # (IMM.10), weights inside the sum
    return m_j, P_j, c


def reweight(c: NDArray, log_likelihood: NDArray) -> NDArray:
    """Probabilities of the models (..., K) after an update, from c (..., K) before it and log c1 (..., K)."""
    log_mu = np.log(np.maximum(c, LEAST)) + log_likelihood
    likely = np.exp(log_mu - log_mu.max(-1, keepdims=True))
    mu = np.maximum(likely / likely.sum(-1, keepdims=True), LEAST)  # (IMM.12)
    return mu / mu.sum(-1, keepdims=True)


def _own(m: NDArray, P: NDArray, own: NDArray) -> tuple[NDArray, NDArray]:
    """Means (..., j, i, n) and covariances of model i as model j takes them, (IMM.11)."""
    lacks = ~own & own[:, None]  # (j, i, n): j has what i lacks
    m_ji = np.where(lacks, m[..., :, None, :], m[..., None, :, :])
    both, none = (lacks[..., :, None] & lacks[..., None, :]), ~(lacks[..., :, None] | lacks[..., None, :])
    P_ji = none.astype(float) * P[..., None, :, :, :]
    P_ji += both.astype(float) * P[..., :, None, :, :]
    return m_ji, P_ji


def _centre(m: NDArray, mu: NDArray, angles: tuple[int, ...]) -> NDArray:
    """Point (..., 1, n) that differences are taken from: the most likely model's angles, else 0."""
    if not angles:
        return np.zeros((*m.shape[:-2], 1, m.shape[-1]))
    K, n = m.shape[-2:]
    each = mu if mu.shape == m.shape[:-1] else np.broadcast_to(mu, m.shape[:-1])
    best = each.reshape(-1, K).argmax(-1)
    about = np.zeros((len(best), 1, n))
    for a in angles:
        about[:, 0, a] = m[..., a].reshape(-1, K)[np.arange(len(best)), best]
    return about.reshape(*m.shape[:-2], 1, n)


def _difference(m: NDArray, about: NDArray, angles: tuple[int, ...]) -> NDArray:
    d = m - about
    for a in angles:
        d[..., a] = wrap_angle(d[..., a])
    return d
