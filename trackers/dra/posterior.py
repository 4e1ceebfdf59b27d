"""What every form of the update makes of a scan: a Gaussian of the whitened state for each motion model.

Equations: docs/methods/data-regions.md.
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from trackers.dra.flat_scan import FlatScan
from trackers.dra.measurement import LinearisedRegions, RegionResiduals


class RegionPosterior(NamedTuple):
    """p(x) = N(xhat + L u; mean u, covariance C) after all detections of B objects under K models, (DRA.21).

    L has the columns that detections depend on; along the others mean 0 and covariance I stay.
    """

    u: NDArray  # (B, K, 9)
    C: NDArray  # (B, K, 9, 9)
    log_c1: NDArray  # (B, K) log likelihood of all detections


class RegionUpdate(Protocol):
    """A form of the update that is not built in, such as `studies.papers.xu2023.enumeration.Enumeration`."""

    def posterior(self, regions: LinearisedRegions, residuals: RegionResiduals, flat: FlatScan) -> RegionPosterior:
        """The posterior of all objects and models, which start at u ~ N(0, I)."""


def softmax(log_w: NDArray, axis: int = -1) -> tuple[NDArray, NDArray]:
    """Weights (..., n, ...) that sum to one along the axis, and the log (...) of their sum; not all may be -inf."""
    top = log_w.max(axis, keepdims=True)
    w = np.exp(log_w - top)
    total = w.sum(axis, keepdims=True)
    return w / total, (top + np.log(total)).squeeze(axis)
