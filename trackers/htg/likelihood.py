"""Likelihood of the hierarchical truncated Gaussian with the gradient in its parameters, and its maximum, for learning.

`trackers.htg.density` has the gradient in the detection instead. The parameter vector is
x (8,) = log rho, a1, a2, b1, b2, theta, log r1, log r2.
Equations: docs/methods/hierarchical-truncated-gaussians.md; source: Xia et al. (2020), eq. (6)-(9), corrected.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import log_ndtr, ndtr

LOG_2PI = float(np.log(2 * np.pi))
Objective = Callable[[NDArray], tuple[float, NDArray]]
Limits = Sequence[tuple[float, float]]
Found = tuple[NDArray, float]


class Outside(NamedTuple):
    """Log-probability to lie outside a box and its slopes; axes first."""

    log_Q: NDArray  # (...) of Q = 1 - (1 - q1)(1 - q2), outside along either axis
    upper: NDArray  # (2, ...) D_A = d log Q / dA, A = (mu - b) / s
    lower: NDArray  # (2, ...) D_C = d log Q / dC, C = (-a - mu) / s


def log_cdf(x: NDArray) -> NDArray:
    """Log Phi(x); scipy's is thirty times slower for positive x, where nothing needs it."""
    return np.where(x < 0, log_ndtr(np.minimum(x, 0.0)), np.log(ndtr(np.maximum(x, 0.0))))


def outside(A: NDArray, C: NDArray) -> Outside:
    """Probability of a normal pair outside a box with standardised sides A, C (2, ...), without cancellation."""
    log_q = np.minimum(np.logaddexp(log_cdf(A), log_cdf(C)), 0.0)  # (HTG.4)
    inside = -np.expm1(log_q)  # 1 - q
    with np.errstate(divide="ignore"):
        log_Q = np.logaddexp(log_q[0], np.log(inside[0]) + log_q[1])  # (HTG.5)
    scale = inside[::-1]
    upper, lower = (scale * np.exp(-(x * x + LOG_2PI) / 2 - log_Q) for x in (A, C))
    return Outside(log_Q, upper, lower)


def mean_log_density(x: NDArray, u: NDArray, noise: NDArray) -> tuple[float, NDArray, float, NDArray]:
    """Mean of log p(u), (HTG.5), and log c_D, (HTG.6), with their gradients.

    x (8,); u (N, 2); noise (N, 2, 2) or (2, 2) in unit coordinates, of which the variances along the turned axes
    count. Returns mean, gradient (8,), log c_D, gradient (8,).
    """
    rho, theta, r = np.exp(x[0]), x[5], np.exp(x[6:8])
    a, b = x[1:3, None], x[3:5, None]
    z, extra, cross = turned(u, noise, theta)
    w = r[:, None] + extra  # noise of this detection
    v = rho + w
    k, sg = rho / v, np.sqrt(rho * w / v)  # (HTG.3)
    mu = k * z  # (HTG.3)
    A, C = (mu - b) / sg, (-a - mu) / sg
    out = outside(A, C)
    square = z * z / v
    log_p = out.log_Q - (square[0] + square[1] + np.log(v[0] * v[1])) / 2 - LOG_2PI  # (HTG.5)

    upper, lower = out.upper / sg, out.lower / sg
    tilt = upper - lower  # d log Q / d mu, (HTG.42a)
    shrink = -(upper * finite(A) + lower * finite(C)) / (2 * sg)  # d log Q / d sg^2, (HTG.42a)
    tail = (square - 1) / (2 * v)
    d_rho = tail + tilt * z * w / v**2 + shrink * (w / v) ** 2  # (HTG.42b)
    d_w = tail - tilt * z * rho / v**2 + shrink * k**2  # (HTG.42b)
    d_z = tilt * k - z / v  # (HTG.7)
    d_theta = d_z[0] * z[1] - d_z[1] * z[0] + 2 * cross * (d_w[0] - d_w[1])  # (HTG.42c)
    parts = (rho * d_rho.sum(0).mean(), *-lower.mean(1), *-upper.mean(1), d_theta.mean(), *(r * d_w.mean(1)))
    log_c, slope = log_mass_gradient(rho, x[1:3], x[3:5])  # (HTG.43)
    return float(log_p.mean()) - log_c, np.array(parts) - slope, log_c, slope


def turned(u: NDArray, noise: NDArray, theta: float) -> tuple[NDArray, NDArray, NDArray]:
    """Detections (2, N), variances (2, N or 1) and covariance (N or 1) of the noise, along axes turned by theta."""
    c, s = np.cos(theta), np.sin(theta)
    x, y = u[:, 0], u[:, 1]
    xx, xy, yy = (np.atleast_1d(noise[..., i, j]) for i, j in ((0, 0), (0, 1), (1, 1)))
    along, across = c * c * xx + 2 * c * s * xy + s * s * yy, s * s * xx - 2 * c * s * xy + c * c * yy
    cross = (c * c - s * s) * xy + c * s * (yy - xx)
    return np.stack([c * x + s * y, c * y - s * x]), np.stack([along, across]), cross


def finite(x: NDArray) -> NDArray:
    """The standardised side x, 0 for an open one: its density there is 0 anyway."""
    return np.where(np.isfinite(x), x, 0.0)


def log_mass_gradient(rho: float, a: NDArray, b: NDArray) -> tuple[float, NDArray]:
    """Return log c_D, the share of the source outside the box a, b (2,), and its gradient (8,), (HTG.43)."""
    s = np.sqrt(rho)
    A, C = -b / s, -a / s
    out = outside(A, C)
    turn = (out.upper * finite(A) + out.lower * finite(C)).sum() / 2
    return float(out.log_Q), np.array([-turn, *(-out.lower / s), *(-out.upper / s), 0.0, 0.0, 0.0])


def descend(f: Objective, x: NDArray, box: Limits, flat: float, runs: int = 10, steps: int = 500) -> Found:
    """Minimum of f, which gives value and gradient (n,), that is reached from x (n,) within the box, and its value.

    The line search of L-BFGS-B sometimes gives up in a bent valley far from its bottom; a fresh start at the same place
    forgets the curvature that led astray. A run that gains less than `flat` is the last.
    """
    settings = {"maxiter": steps, "ftol": flat / 100}
    value = np.inf
    for _ in range(runs):
        found = minimize(f, x, jac=True, method="L-BFGS-B", bounds=box, options=settings)
        x, gain, value = found.x, value - found.fun, float(found.fun)
        if gain < flat:
            break
    return x, value
