"""Information of an update of the filters on a spline.

Equations: docs/methods/spline-pmht.md.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.filter import Note
from trackers.geometry import dot
from trackers.linalg import I2
from trackers.pmht.association import RelativeDetections
from trackers.pmht.joint import PredictedEllipses
from trackers.pmht.symmetric import matrices


class SplineInfo(NamedTuple):
    """Innovation of the centroid, and how well the ellipses explained the detections."""

    n: NDArray  # (...) detections used
    eps: NDArray  # (..., 2) [m] innovation
    S: NDArray  # (..., 2, 2) [m^2] its covariance
    share: NDArray  # (...) of the detections that the predicted ellipses explain, NaN without a detection
    lost: NDArray  # (...) bool, the share was so small that the object was searched in the neighbourhood
    notes: tuple[Note, ...] = ()

    @property
    def nis(self) -> NDArray:
        """Normalised innovation squared (...), NaN without a detection."""
        d = np.linalg.solve(self.S, self.eps[..., None])[..., 0]
        return np.where(self.n > 0, dot(self.eps, d), np.nan)


def innovation(
    expected: PredictedEllipses, w: NDArray, E: NDArray, detections: RelativeDetections, share: NDArray, lost: NDArray
) -> SplineInfo:
    """Innovation of the mean detection under the ellipses that the detections were shared out to, (PMHT.19)."""
    n = detections.mask.sum(-1)
    part = w.sum(-2)
    part = (part / np.maximum(part.sum(-1, keepdims=True), 1e-12))[..., None]  # (..., L, 1)
    count = np.maximum(n, 1)[..., None]
    each = (detections.mask / count)[..., None]
    eps = (detections.z @ each - expected.c @ part)[..., 0]  # (PMHT.19)
    h = (expected.h @ part[..., None, :, :])[..., 0]  # (..., 7, 2)
    R = detections.R @ each if detections.R.shape[-1] == each.shape[-2] else detections.R
    noise = (E @ part + R) / count[..., None]
    S = h.mT @ h + matrices(noise)[..., 0, :, :]  # (PMHT.19)
    some = n > 0
    S = np.where(some[..., None, None], S, I2)
    notes = (Note("lost", "contour explained too little of the scan, searched around", lost),) if lost.any() else ()
    return SplineInfo(n, np.where(some[..., None], eps, 0.0), S, np.where(some, share, np.nan), lost, notes)


def nothing(n: NDArray) -> SplineInfo:
    """Information of an update without a detection."""
    zero = np.zeros(n.shape)
    return SplineInfo(n, zero[..., None] * np.ones(2), zero[..., None, None] + I2, zero * np.nan, n > 0)
