"""What every form of the update returns: a Gaussian in whitened coordinates for each motion model; card dra_imm, 8."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Posterior(NamedTuple):
    """p(x) = N(xhat + L u; mean u, covariance C) after all detections of B objects under K models.

    L has the columns that detections see; the others keep mean 0 and covariance I.
    """

    u: NDArray  # (B, K, 9)
    C: NDArray  # (B, K, 9, 9)
    log_c1: NDArray  # (B, K) likelihood of all detections, c1 of the model in (31)
    capped: NDArray  # (B,) bool, hypotheses were left out


def softmax(log_w: NDArray, axis: int = -1) -> tuple[NDArray, NDArray]:
    """Weights (..., n, ...) that sum to one along the axis, and the logarithm (...) of the sum, somewhere not -inf."""
    top = log_w.max(axis, keepdims=True)
    w = np.exp(log_w - top)
    total = w.sum(axis, keepdims=True)
    return w / total, (top + np.log(total)).squeeze(axis)
