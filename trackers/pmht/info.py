"""What an update of the filters on a spline tells."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import dot
from trackers.linalg import I2
from trackers.pmht.association import Seen
from trackers.pmht.joint import Look
from trackers.pmht.symmetric import matrices
from trackers.protocols import Note


class SplineInfo(NamedTuple):
    """What an update tells: innovation of the centroid, and how well the ellipses explained the detections."""

    n: NDArray  # (...) detections used
    eps: NDArray  # (..., 2) [m] innovation
    S: NDArray  # (..., 2, 2) [m^2] its covariance
    share: NDArray  # (...) of the detections that the predicted ellipses explain, NaN without a detection
    lost: NDArray  # (...) bool, so few that the object was looked for in the wider neighbourhood
    notes: tuple[Note, ...] = ()

    @property
    def nis(self) -> NDArray:
        """Normalised innovation squared (...), NaN without a detection."""
        d = np.linalg.solve(self.S, self.eps[..., None])[..., 0]
        return np.where(self.n > 0, dot(self.eps, d), np.nan)


def innovation(view: Look, w: NDArray, E: NDArray, seen: Seen, share: NDArray, lost: NDArray) -> SplineInfo:
    """Innovation of the mean of the detections under the ellipses that they were shared out to."""
    n = seen.mask.sum(-1)
    part = w.sum(-2)
    part = (part / np.maximum(part.sum(-1, keepdims=True), 1e-12))[..., None]  # (..., L, 1)
    count = np.maximum(n, 1)[..., None]
    each = (seen.mask / count)[..., None]
    eps = (seen.z @ each - view.c @ part)[..., 0]
    h = (view.h @ part[..., None, :, :])[..., 0]  # (..., 7, 2)
    R = seen.R @ each if seen.R.shape[-1] == each.shape[-2] else seen.R
    noise = (E @ part + R) / count[..., None]
    S = h.mT @ h + matrices(noise)[..., 0, :, :]
    some = n > 0
    S = np.where(some[..., None, None], S, I2)
    told = (Note("lost", "contour explained too little of the scan, looked for around", lost),) if lost.any() else ()
    return SplineInfo(n, np.where(some[..., None], eps, 0.0), S, np.where(some, share, np.nan), lost, told)


def nothing(n: NDArray) -> SplineInfo:
    """What an update without a detection tells."""
    zero = np.zeros(n.shape)
    return SplineInfo(n, zero[..., None] * np.ones(2), zero[..., None, None] + I2, zero * np.nan, n > 0)
