"""The hierarchical truncated Gaussian: a Gaussian with a hole, blurred by noise, in unit coordinates of the body.

Equations: docs/methods/hierarchical-truncated-gaussians.md; source: Xia et al. (2020), eq. (3)-(9), corrected. Unit
coordinates put the body on [-1, 1]^2, x to the front, y to the left (heading turns from x towards y), (HTG.1).

    +----------------------+     The source is N(0, rho I) outside the box [-a1, b1] x [-a2, b2], which is turned
    |  .  . source  .  .   |     by theta; the detection is the source plus N(0, R), R = M(theta) diag(r) M(theta)^T.
    |  +----------------+  |
    | .|-a1   hole    b1|. |
    |  +----------------+  |
    +----------------------+
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfcx, log_ndtr, ndtr

from trackers.geometry import rotation

SQRT2, SQRTPI, SQRT2PI = np.sqrt(2.0), np.sqrt(np.pi), np.sqrt(2 * np.pi)
SIDES = np.array([-1.0, 1.0])  # direction of the sides a and b along their axis


class HTG(NamedTuple):
    """Parameters of hierarchical truncated Gaussians with any leading axes; all in unit coordinates."""

    rho: NDArray  # (...) variance of the source, > 0
    bounds: NDArray  # (..., 4) a1, a2, b1, b2: rear, right, front, left side of the hole, >= 0, inf for an open side
    theta: NDArray  # (...) [rad] turn of the hole
    r: NDArray  # (..., 2) noise variances along the turned axes, > 0


class Prepared(NamedTuple):
    """Constants of the density of points; axes first: (2 sides, 2 axes, ...) or (2 axes, ...)."""

    turn: tuple[NDArray, NDArray] | None  # cosine and sine (...) of theta; None where no hole is turned
    precision: NDArray  # (2, ...) 1 / (rho + r)
    gain: NDArray  # (2, 2, ...) of t = gain * z - offset, distance outside a side in sqrt(2) standard deviations
    offset: NDArray  # (2, 2, ...)
    constant: NDArray  # (...) log of everything that does not depend on the point


def lift(p: HTG, ndim: int) -> HTG:
    """The same parameters with axes of length 1 in front, at least `ndim` leading axes in all."""
    new = (1,) * (ndim - p.rho.ndim)
    return HTG(*(leaf.reshape(new + leaf.shape) for leaf in p))


def prepare(p: HTG, noise: NDArray | None = None, log_c: NDArray | None = None) -> Prepared:
    """Constants of the density under p (...), with additional noise variances (..., 2) along the turned axes.

    log_c (...): log_mass(p), where it is known.
    """
    if noise is not None:
        p = lift(p, noise.ndim - 1)
    r = np.moveaxis(p.r if noise is None else p.r + noise, -1, 0)
    bounds = np.moveaxis(p.bounds, -1, 0).reshape(2, 2, *p.bounds.shape[:-1])
    precision = 1 / (p.rho + r)
    scale = 1 / (SQRT2 * np.sqrt(p.rho * r * precision))  # 1 / (sqrt(2) s), (HTG.3)
    log_c = log_mass(p) if log_c is None else log_c
    constant = 0.5 * np.log(precision[0] * precision[1]) - np.log(2 * np.pi) - log_c  # (HTG.5)
    gain = SIDES.reshape(2, *(1,) * r.ndim) * (p.rho * precision * scale)  # k / (sqrt(2) s), (HTG.3)
    turn = (np.cos(p.theta), np.sin(p.theta)) if p.theta.any() else None
    return Prepared(turn, precision, gain, bounds * scale, constant)


def evaluate(u: NDArray, c: Prepared) -> tuple[NDArray, NDArray]:
    """Log density (...) and its gradient (2, ...) at the points u (2, ...).

    Tails are kept to the last digit: every Phi of a negative argument is exp(-t^2) times a scaled complementary error
    function, and the exponent of the nearest side is taken out of the sum.
    """
    z = u if c.turn is None else turned(u, c.turn[0], c.turn[1])  # M(-theta) u, (HTG.3)
    t = c.gain * z - c.offset  # arguments of (HTG.4) over sqrt(2)
    nearest = np.minimum(np.maximum(*np.maximum(t[0], t[1])), 0.0)  # of the sides, for a point in the hole
    shift = nearest * nearest
    bell = np.exp(shift - t * t)  # sqrt(2 pi) phi_n e^shift
    tail = (0.5 * bell) * erfcx(np.abs(t))
    side = np.where(t < 0, tail, 1.0 - tail)  # Phi e^shift; an argument is positive only where shift is 0
    q = side[0] + side[1]  # (HTG.4) times e^shift
    inside = 1.0 - q * np.exp(-shift)
    Q = q[0] + inside[0] * q[1]  # (HTG.5) times e^shift
    slope = c.gain[1] * ((bell[1] - bell[0]) / SQRTPI)  # dq/dz e^shift
    pull = c.precision * z
    g = slope * inside[::-1] / Q - pull  # (HTG.7)
    log_p = c.constant - 0.5 * (pull[0] * z[0] + pull[1] * z[1]) + np.log(Q) - shift  # (HTG.5)
    return log_p, g if c.turn is None else turned(g, c.turn[0], -c.turn[1])


def turned(v: NDArray, c: NDArray, s: NDArray) -> NDArray:
    """Vectors (2, ...) in axes turned by the angle with cosine c and sine s (...)."""
    along = c * v[0] + s * v[1]
    out = np.empty((2, *along.shape))
    out[0], out[1] = along, c * v[1] - s * v[0]
    return out


def log_density(u: NDArray, p: HTG, noise: NDArray | None = None, log_c: NDArray | None = None) -> NDArray:
    """Log density (...) at points u (..., 2), (HTG.5).

    The leading axes of p broadcast against those of u. `noise` (..., 2): variances in unit coordinates, along the
    turned axes, that each point has besides p.r; log_c (...): log_mass(p), where it is known.
    """
    return evaluate(np.moveaxis(u, -1, 0), prepare(lift(p, u.ndim - 1), noise, log_c))[0]


def log_mass(p: HTG) -> NDArray:
    """Log of c_D (...), the probability of the source Gaussian outside the hole, (HTG.6)."""
    t = np.moveaxis(p.bounds / np.sqrt(p.rho)[..., None], -1, 0)
    log_q = np.logaddexp(log_ndtr(-t[:2]), log_ndtr(-t[2:]))  # outside along x, along y
    inside_x = ndtr(t[2]) - ndtr(-t[0])
    with np.errstate(divide="ignore"):
        return np.logaddexp(log_q[0], np.log(inside_x) + log_q[1])  # (HTG.6), added up from tails


def noise_matrix(p: HTG) -> NDArray:
    """Noise covariance R_UC (..., 2, 2) along the axes of the body."""
    M = rotation(p.theta)
    return (M * p.r[..., None, :]) @ M.mT  # (HTG.2)


def truncated(low: NDArray, high: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Mass, mean and variance (...) of the standard normal distribution between low and high (...), inf allowed."""
    ends = np.stack([low, high])
    width = high - low
    narrow = width < 1e-4
    below = ndtr(ends)
    bell = np.exp(-0.5 * ends * ends) / SQRT2PI
    ends = np.where(np.isinf(ends), 0.0, ends)  # the bell is 0 there
    mass = below[1] - below[0]
    scale = np.where(narrow, 1.0, mass)
    mean = (bell[0] - bell[1]) / scale  # (HTG.9)
    edge = ends * bell
    var = np.where(narrow, width**2 / 12, 1 + (edge[0] - edge[1]) / scale - mean**2)  # (HTG.9)
    return mass, np.where(narrow, (ends[0] + ends[1]) / 2, mean), var


def hole_moments(p: HTG) -> tuple[NDArray, NDArray]:
    """Mean (..., 2) and variances (..., 2), along the turned axes, of the source Gaussian inside the hole."""
    s = np.sqrt(p.rho)[..., None]
    _, mean, var = truncated(-p.bounds[..., :2] / s, p.bounds[..., 2:] / s)
    return s * mean, s**2 * var  # (HTG.10)


def complement(p: HTG) -> tuple[NDArray, NDArray]:
    """Mean z_c (..., 2) and covariance C_c (..., 2, 2) of the part that the hole cuts out, noise included, (HTG.10)."""
    mean, var = hole_moments(p)
    M = rotation(p.theta)
    return (M @ mean[..., None])[..., 0], (M * var[..., None, :]) @ M.mT + noise_matrix(p)


def moments(p: HTG) -> tuple[NDArray, NDArray]:
    """Mean (..., 2) and covariance (..., 2, 2) of the density, noise included.

    From the whole Gaussian minus the hole; loses digits where c_D falls under 1e-6.
    """
    c = np.exp(log_mass(p))[..., None]
    mean_c, var_c = hole_moments(p)
    mean = -(1 - c) / c * mean_c  # (HTG.11)
    second_c = mean_c[..., :, None] * mean_c[..., None, :] + var_c[..., None] * np.eye(2)
    rho, c = p.rho[..., None, None], c[..., None]
    second = (rho * np.eye(2) - (1 - c) * second_c) / c  # (HTG.11)
    M = rotation(p.theta)
    cov = M @ (second - mean[..., :, None] * mean[..., None, :]) @ M.mT  # (HTG.11)
    return (M @ mean[..., None])[..., 0], cov + noise_matrix(p)
