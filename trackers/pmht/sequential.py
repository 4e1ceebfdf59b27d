"""The state update with one ellipse after the other, as the paper has it; card bspline_pmht, section 6."""

import numpy as np
from numpy.typing import NDArray

from trackers.linalg import symmetrize
from trackers.pmht.association import LEAST_WEIGHT, Synthetic
from trackers.pmht.joint import look
from trackers.pmht.symmetric import matrices


def update(m: NDArray, P: NDArray, mu: NDArray, E: NDArray, z: Synthetic) -> tuple[NDArray, NDArray]:
    """Moments (..., 7), (..., 7, 7) after the synthetic detections z, relative to the centre of m; in natural order.

    mu (..., 2, L) in the unit frame, E (..., 3, L) [m^2] as in `joint.update`.
    """
    V = matrices((E + z.R) / np.maximum(z.M, LEAST_WEIGHT)[..., None, :])
    start = m[..., :2].copy()
    for l in range(mu.shape[-1]):
        now = look(m, P, mu[..., l : l + 1])
        h = now.h[..., 0]  # (..., 7, 2) in u
        S = matrices(now.C)[..., 0, :, :] + V[..., l, :, :]
        r = z.z[..., l] - now.c[..., 0] - (m[..., :2] - start)
        C = now.T @ h  # cross covariance of state and centre
        K = np.linalg.solve(S, C.mT).mT
        some = (z.M[..., l] > LEAST_WEIGHT)[..., None]
        m = np.where(some, m + (K @ r[..., None])[..., 0], m)
        P = np.where(some[..., None], symmetrize(P - K @ C.mT), P)
    return m, P
