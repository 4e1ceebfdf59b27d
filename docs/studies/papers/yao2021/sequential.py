"""The paper's update of `trackers.pmht.SplinePmht`: one ellipse after the other.

Equations: docs/methods/spline-pmht.md.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trackers.linalg import symmetrize
from trackers.pmht.association import LEAST_WEIGHT, SyntheticDetections, matrices
from trackers.pmht.joint import predict_ellipses


@dataclass(frozen=True)
class OneByOne:
    """A form of the update for `trackers.pmht.SplinePmht`, in the natural order of the ellipses."""

    def update(
        self, m: NDArray, P: NDArray, mu: NDArray, E: NDArray, z: SyntheticDetections
    ) -> tuple[NDArray, NDArray]:
        """Moments (..., 7), (..., 7, 7) after the synthetic detections z, relative to the centre of m.

        mu (..., 2, L) in the unit frame; E (..., 3, L) [m^2] covariances of the detections of each ellipse.
        """
        V = matrices((E + z.R) / np.maximum(z.M, LEAST_WEIGHT)[..., None, :])  # (PMHT.14)
        start = m[..., :2].copy()
        for l in range(mu.shape[-1]):
            now = predict_ellipses(m, P, mu[..., l : l + 1])
            h = now.h[..., 0]  # (..., 7, 2) in u
            S = matrices(now.C)[..., 0, :, :] + V[..., l, :, :]  # (PMHT.16)
            r = z.z[..., l] - now.c[..., 0] - (m[..., :2] - start)
            C = now.T @ h  # (PMHT.13), cross covariance of state and centre
            K = np.linalg.solve(S, C.mT).mT  # (PMHT.16)
            some = (z.M[..., l] > LEAST_WEIGHT)[..., None]
            m = np.where(some, m + (K @ r[..., None])[..., 0], m)  # (PMHT.16)
            P = np.where(some[..., None], symmetrize(P - K @ C.mT), P)  # (PMHT.16)
        return m, P
