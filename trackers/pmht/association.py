"""Which ellipse made which detection: probabilities, and one synthetic detection an ellipse.

Equations: docs/methods/spline-pmht.md. Arrays over detections and ellipses are (..., M, L); positions are relative to
the object's centre, because expanded squares lose digits far from the origin. Covariances are columns xx, xy, yy, see
`symmetric.py`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

LOG_2PI = float(np.log(2 * np.pi))
LEAST_WEIGHT = 1e-9  # of an ellipse, below which it has no detection


class RelativeDetections(NamedTuple):
    """Detections of objects, each relative to a point of its object."""

    z: NDArray  # (..., 2, M) [m], 0 for padding
    R: NDArray  # (..., 3, M or 1) noise [m^2], the identity for padding
    mask: NDArray  # (..., M)


class SyntheticDetections(NamedTuple):
    """One detection for each ellipse, made of those that it got a share of."""

    M: NDArray  # (..., L) sum of the weights
    z: NDArray  # (..., 2, L) [m] mean; without a detection anything
    R: NDArray  # (..., 3, L or 1) mean noise [m^2]


def log_density(detections: RelativeDetections, c: NDArray, C: NDArray) -> NDArray:
    """Log N(z_i; c_l, C_l + R_i) (..., M, L) for centres c (..., 2, L) [m] and covariances C (..., 3, L) [m^2]."""
    d = detections.z[..., None] - c[..., None, :]
    S = C[..., None, :] + detections.R[..., None]
    dx, dy, xx, xy, yy = d[..., 0, :, :], d[..., 1, :, :], S[..., 0, :, :], S[..., 1, :, :], S[..., 2, :, :]
    det = xx * yy - xy * xy
    S = S / (-2 * det)[..., None, :, :]
    log_norm = -0.5 * np.log(det) - LOG_2PI
    value = dx * S[..., 2, :, :]  # in place from here on: these are the large arrays of the filter
    cross = dy * S[..., 1, :, :]
    cross *= 2
    value -= cross
    value *= dx
    dy *= dy
    dy *= S[..., 0, :, :]
    value += dy
    value += log_norm  # (PMHT.10), log N
    return value


def responsibilities(log_joint: NDArray, mask: NDArray, rest: NDArray | float) -> NDArray:
    """Probability w (..., M, L) of each ellipse, from log pi_l N_il and the density rest (..., M, 1) of all else."""
    with np.errstate(divide="ignore"):
        log_rest = np.log(rest)
    top = np.maximum(log_joint.max(-1, keepdims=True), log_rest)
    w = log_joint - top
    np.exp(w, out=w)
    w *= mask[..., None] / (w.sum(-1, keepdims=True) + np.exp(log_rest - top))  # (PMHT.10)
    return w


def synthesise(w: NDArray, detections: RelativeDetections) -> SyntheticDetections:
    """SyntheticDetections detections from the weights (..., M, L)."""
    M = w.sum(-2)  # (PMHT.11)
    share = w / np.maximum(M, LEAST_WEIGHT)[..., None, :]  # (PMHT.11)
    each = detections.R.shape[-1] == share.shape[-2]  # each detection has its own noise
    return SyntheticDetections(M, detections.z @ share, detections.R @ share if each else detections.R)  # (PMHT.11)


def outlier_density(clutter: float, expected: float) -> float:
    """Density eps [1/m^2] of (PMHT.10), from false alarms clutter [1/m^2] and expected detections of the object a scan.

    Ellipse l makes detections with intensity `expected` pi_l N_il, clutter with its own; eps is the clutter's over
    `expected`. Raises ValueError for a negative density or no expected detection.
    """
    if not (clutter >= 0 and expected > 0):
        raise ValueError(f"clutter must be >= 0 and expected > 0, got {clutter} and {expected}; per m^2 and per scan")
    return clutter / expected
