"""Range rates of one scan, all of an object at once, under each of its motion modes.

Equations: docs/methods/motion-modes.md, section 4.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import cross, dot, perpendicular, unit
from trackers.linalg import symmetrize
from trackers.motion import OMEGA, PHI, SPEED
from trackers.scan import Scan


@dataclass(frozen=True)
class ScanRates:
    """How well a rigid body explains the range rates of a scan."""

    std: float = 0.1  # [m/s] of each, beside the sensor's noise
    common_std: float = 0.1  # [m/s] of what all of one scan share
    clip: float = 2.5  # standard deviations from which on a residual counts less
    sensor_std: float = 0.1  # [m/s] where a scan does not state it

    def correct(self, m: NDArray, P: NDArray, lever: NDArray, scan: Scan) -> tuple[NDArray, NDArray, NDArray]:
        """Means (..., K, 7) and covariances after the range rates, and log likelihoods (..., K) of the modes.

        lever (..., K) [m] from the axle to the centre.
        """
        g = scan.ground_rate
        use = scan.mask & np.isfinite(g)
        if not use.any():
            return m, P, np.zeros(lever.shape)
        r, h = self._model(m, lever, scan, np.where(use, g, 0.0), use)
        noise = np.broadcast_to(scan.noise[..., 2], g.shape)
        variance = np.where(np.isnan(noise), self.sensor_std, noise) ** 2 + self.std**2
        motion = P[..., : OMEGA + 1, : OMEGA + 1]
        S = ((h @ motion) * h).sum(-1) + (variance + self.common_std**2)[..., None, :]  # (..., K, M)
        zeta = np.sqrt((r**2 / S).min(-2))
        w = np.where(use, np.minimum(1.0, self.clip / np.maximum(zeta, 1e-9)) / variance, 0.0)[
            ..., None, :
        ]  # (MODE.16)
        t = w.sum(-1) + 1 / self.common_std**2  # (..., 1)
        wh = w[..., None] * h
        a, rr = wh.sum(-2), (w * r).sum(-1)
        J, y = np.zeros(P.shape), np.zeros(m.shape)
        J[..., : OMEGA + 1, : OMEGA + 1] = (
            wh.mT @ h - a[..., :, None] * a[..., None, :] / t[..., None, None]
        )  # (MODE.17)
        y[..., : OMEGA + 1] = (wh * r[..., None]).sum(-2) - a * (rr / t)[..., None]  # (MODE.17)
        q = (w * r**2).sum(-1) - rr**2 / t  # (MODE.17)
        A = np.eye(m.shape[-1]) + P @ J
        P = symmetrize(np.linalg.solve(A, P))  # (MODE.18)
        x = (P @ y[..., None])[..., 0]  # (MODE.18)
        log_l = -0.5 * q + 0.5 * (y * x).sum(-1) - 0.5 * np.linalg.slogdet(A)[1]  # (MODE.19)
        return m + x, P, log_l

    def _model(self, m: NDArray, lever: NDArray, scan: Scan, g: NDArray, use: NDArray) -> tuple[NDArray, NDArray]:
        """Residuals (..., K, M) of range rates over ground g (..., M), and gradients (..., K, M, 5), 0 if unused."""
        u = np.where(use[..., None], scan.sight, 0.0)[..., None, :, :]  # (..., 1, M, 2)
        z = np.where(use[..., None], scan.xy, 0.0)[..., None, :, :]
        e = unit(m[..., PHI])
        axle = m[..., :2] - lever[..., None] * e
        v, omega, d = (a[..., None] for a in (m[..., SPEED], m[..., OMEGA], lever))
        along = dot(u, e[..., None, :])
        h = np.zeros((*along.shape, OMEGA + 1))
        h[..., 0], h[..., 1] = -omega * u[..., 1], omega * u[..., 0]  # (MODE.15)
        h[..., PHI] = v * dot(u, perpendicular(e)[..., None, :]) - omega * d * along  # (MODE.15)
        h[..., SPEED] = along  # (MODE.15)
        h[..., OMEGA] = np.where(use[..., None, :], cross(z - axle[..., None, :], u), 0.0)  # (MODE.15)
        return g[..., None, :] - v * along - omega * h[..., OMEGA], h  # (MODE.14)
