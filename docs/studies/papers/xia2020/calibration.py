"""Unbiased scores: scale and shift of the unit coordinates, fitted together with the parameters of the density.

The source of the density is round and centred on the body. So its family is not closed under a shift and a stretch of
one axis, and at the maximum of (HTG.41) the mean score in place and size of the body is not zero: each detection pulls
a little in the same wrong direction, and a filter that adds up detections becomes certain of it. With a scale k and a
shift t of the unit coordinates in every bin,

    p(u) = p_HTG((u - t) / k) / (k_x k_y), (HTG.46)

the maximum likelihood makes these mean scores vanish, whether the density is true or not.
Equations: docs/methods/hierarchical-truncated-gaussians.md.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from trackers.htg.bins import HTGTable
from trackers.htg.density import HTG, evaluate, lift, prepare
from trackers.htg.likelihood import descend, mean_log_density

TURN = 0.3  # [rad] largest theta: a hole on its corner is likelier, but four blobs are no side of a vehicle
STEP = 1e-5  # of log k, for its derivative
FLAT = 1e-7  # [nat] of the mean log-likelihood: a run of the optimiser that gains less is the last
# log rho, a1, a2, b1, b2, theta, log r1, log r2, log kx, log ky, tx, ty
LOW = np.array([np.log(0.01), 0, 0, 0, 0, -TURN, *np.log([1e-4, 1e-4]), *np.log([0.25, 0.25]), -1.5, -1.5])
HIGH = np.array([0.0, 3, 3, 3, 3, TURN, *np.log([0.5, 0.5]), *np.log([4.0, 4.0]), 1.5, 1.5])


def density(x: NDArray) -> HTG:
    """The density of a parameter vector (12,)."""
    return HTG(np.exp(x[0]), x[1:5], x[5], np.exp(x[6:8]))


def value(x: NDArray, u: NDArray, variance: NDArray) -> tuple[float, NDArray]:
    """Mean of log p at u (N, 2) with known noise variances (N, 2), and its slopes (8,) in the density."""
    k = np.exp(x[8:10])
    noise = (variance / k**2)[:, :, None] * np.eye(2)
    mean, slope, _, _ = mean_log_density(x[:8], (u - x[10:]) / k, noise)
    return mean - x[8:10].sum(), slope  # (HTG.46)


def negative(x: NDArray, u: NDArray, variance: NDArray) -> tuple[float, NDArray]:
    """The negative of `value` and its gradient (12,)."""
    mean, slope = value(x, u, variance)
    k, p = np.exp(x[8:10]), density(x)
    c2, s2 = np.cos(x[5]) ** 2, np.sin(x[5]) ** 2
    along = variance / k**2 @ np.array([[c2, s2], [s2, c2]])
    pull = score((u - x[10:]) / k, HTG(*map(np.asarray, p)), along).mean(0) / k
    stretch = [(value(x + STEP * e, u, variance)[0] - mean) / STEP for e in np.eye(12)[8:10]]
    return -mean, -np.concatenate([slope, stretch, -pull])


def calibrate(
    table: HTGTable, body: NDArray, size: NDArray, aspect: NDArray, noise: NDArray | None = None, mirrored: bool = True
) -> HTGTable:
    """The table with scale, shift and parameters at the joint maximum, bin by bin, from the ones it has.

    Args:
        table: with its anchors, learned from the same detections.
        body: (N, 2) [m] detections in the frame of the body.
        size: (N, 2) [m] length and width.
        aspect: (N,) [rad].
        noise: (N, 2) [m] known standard deviations along the axes of the body; None: all noise is in r.
        mirrored: each bin also learns from the mirror image of its opposite.

    """
    noise = np.zeros((len(body), 2)) if noise is None else noise
    if mirrored:
        body, aspect = np.concatenate([body, body * [1, -1]]), np.concatenate([aspect, -aspect])
        size, noise = np.concatenate([size, size]), np.concatenate([noise, noise])
    index = table.bin_of(aspect)
    h, shift = table.warp(size / 2, index)
    u, variance = (body - shift) / h, (noise / h) ** 2
    x = np.stack([polish(table.of(np.array(b)), u[index == b], variance[index == b]) for b in range(len(table))])
    base = table.frame(np.arange(len(table)))
    p = HTG(np.exp(x[:, 0]), x[:, 1:5], x[:, 5], np.exp(x[:, 6:8]))
    return replace(table, p=p, scale=base.scale * np.exp(x[:, 8:10]), shift=base.shift + base.scale * x[:, 10:])


def polish(p: HTG, u: NDArray, variance: NDArray) -> NDArray:
    """Parameter vector (12,) at the maximum likelihood of u (N, 2) that is reached from p () with k = 1, t = 0."""
    start = np.array([np.log(p.rho), *p.bounds, p.theta, *np.log(p.r), 0, 0, 0, 0])
    box = list(zip(LOW, HIGH, strict=True))
    return descend(lambda x: negative(x, u, variance), np.clip(start, LOW, HIGH), box, FLAT)[0]


def score(u: NDArray, p: HTG, noise: NDArray | None = None) -> NDArray:
    """Gradient (..., 2) of the log density with respect to u (..., 2), (HTG.7)."""
    return np.moveaxis(evaluate(np.moveaxis(u, -1, 0), prepare(lift(p, u.ndim - 1), noise))[1], 0, -1)


def single(p: HTG, mean: NDArray, cov: NDArray) -> HTGTable:
    """A table of one bin: the same density p () from every side."""
    return HTGTable(HTG(*(np.asarray(leaf, float)[None] for leaf in p)), mean[None], cov[None])
