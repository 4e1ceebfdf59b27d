"""Densities of detections in unit coordinates that the hierarchical truncated Gaussian has to stand up against.

Each `fit_...` takes detections (N, 2) of one aspect bin and returns their log density as a function of points (M, 2).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from testbed.learn.detections import GROWN
from trackers.htg.density import log_density
from trackers.htg.learning import FitOptions, fit
from trackers.linalg import outer

LogDensity = Callable[[NDArray], NDArray]

FLOOR = 1e-4  # least variance of a component, against collapse onto one detection
ROUNDS = 300  # of expectation and maximisation at most
SETTLED = 1e-6  # [nat] gain a detection at which they end
STARTS = 3  # random starts of a mixture
SCREEN = 500  # detections on which the starts of the HTG compete; a shipped table takes three times as many


@dataclass(frozen=True)
class DensityModel:
    """One way to describe where detections lie, an aspect bin at a time."""

    name: str
    parameters: int  # a bin
    fit: Callable[[NDArray], LogDensity]
    bins: int = 8
    centred: bool = True


class Mixture(NamedTuple):
    """Weighted Gaussians."""

    weight: NDArray  # (K,)
    mean: NDArray  # (K, 2)
    cov: NDArray  # (K, 2, 2)


def log_parts(u: NDArray, g: Mixture) -> NDArray:
    """Log of weight times density (N, K) of the components at points u (N, 2)."""
    whiten = np.linalg.inv(np.linalg.cholesky(g.cov))  # (K, 2, 2), lower triangles
    d = u[:, None] - g.mean
    x = whiten[:, 0, 0] * d[..., 0]
    y = whiten[:, 1, 0] * d[..., 0] + whiten[:, 1, 1] * d[..., 1]
    scale = np.log(g.weight * whiten[:, 0, 0] * whiten[:, 1, 1]) - np.log(2 * np.pi)
    return scale - (x * x + y * y) / 2


def expectation_maximisation(u: NDArray, start: Mixture, tied: bool) -> tuple[Mixture, float]:
    """Local maximum of the likelihood from a start, and its mean log-likelihood [nat]; tied: one covariance for all."""
    g, before = start, -np.inf
    for _ in range(ROUNDS):
        parts = log_parts(u, g)
        total = logsumexp(parts, axis=1)
        value = float(total.mean())
        if value - before < SETTLED:
            break
        before = value
        share = np.exp(parts - total[:, None])
        mass = share.sum(0) + 1e-12
        mean = share.T @ u / mass[:, None]
        d = u[:, None] - mean
        scatter = (share.T[:, None] * d.transpose(1, 2, 0)) @ d.transpose(1, 0, 2)
        cov = np.broadcast_to(scatter.sum(0) / len(u), scatter.shape) if tied else scatter / mass[:, None, None]
        g = Mixture(mass / mass.sum(), mean, cov + FLOOR * np.eye(2))
    return g, value


def fit_mixture(u: NDArray, K: int, tied: bool, rng: np.random.Generator) -> LogDensity:
    """The best of several random starts of a mixture of K Gaussians."""
    cov = np.cov(u.T) / K + FLOOR * np.eye(2)
    tries = []
    for _ in range(STARTS):
        mean = u[rng.choice(len(u), K, replace=False)]
        start = Mixture(np.full(K, 1 / K), mean, np.broadcast_to(cov, (K, 2, 2)))
        tries.append(expectation_maximisation(u, start, tied))
    best, _ = max(tries, key=lambda found: found[1])
    return lambda z: logsumexp(log_parts(z, best), axis=1)


def fit_gaussian(u: NDArray) -> LogDensity:
    """One Gaussian."""
    m = u.mean(0)
    C = outer(u - m).mean(0)
    one = Mixture(np.ones(1), m[None], C[None])
    return lambda z: log_parts(z, one)[:, 0]


def fit_uniform(u: NDArray) -> LogDensity:
    """The same density everywhere in the grown box."""
    return lambda z: np.full(len(z), -np.log((2 * GROWN) ** 2))


def fit_htg(u: NDArray, options: FitOptions) -> LogDensity:
    """The hierarchical truncated Gaussian."""
    return partial(log_density, p=fit(u, options=options).p)


def mixture(K: int, tied: bool) -> Callable[[NDArray], LogDensity]:
    """A mixture whose random starts are the same in every call."""
    return lambda u: fit_mixture(u, K, tied, np.random.default_rng(K))


HTG_MODEL = DensityModel("HTG", 8, partial(fit_htg, options=FitOptions(screen=SCREEN)))
RIVALS = (
    DensityModel("uniform in the grown box", 0, fit_uniform),
    DensityModel("one Gaussian", 5, fit_gaussian),
    DensityModel("two Gaussians, one covariance", 8, mixture(2, tied=True)),
    DensityModel("two Gaussians", 11, mixture(2, tied=False)),
    DensityModel("five Gaussians", 29, mixture(5, tied=False)),
)
VARIANTS = (
    DensityModel("HTG, theta = 0", 7, partial(fit_htg, options=FitOptions(theta=0.0, screen=SCREEN))),
    DensityModel("HTG, c_D at least 0.25", 8, partial(fit_htg, options=FitOptions(mass_min=0.25, screen=SCREEN))),
    DensityModel("HTG, bins with edges at 0 and 180 deg", 8, HTG_MODEL.fit, centred=False),
)
