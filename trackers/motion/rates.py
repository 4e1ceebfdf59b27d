"""Range rates of one scan, all of an object at once, under each of its motion modes.

Equations: docs/methods/motion-modes.md, section 4.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import cross, dot, perpendicular, unit
from trackers.linalg import outer, symmetrize
from trackers.motion.turn import OMEGA, PHI, SPEED
from trackers.parameters import check_numbers
from trackers.scan import Scan

MOVING = OMEGA + 1  # components of the state that a range rate depends on


class Body(NamedTuple):
    """What the modes take a body for."""

    lever: NDArray  # (..., K) [m] from the axle to the centre
    size: NDArray  # (..., K or 1, 2) [m] length and width


@dataclass(frozen=True)
class ScanRates:
    """How well a rigid body explains the range rates of a scan."""

    std: float = 0.07  # [m/s] of each, beside the sensor's noise
    common_std: float = 0.07  # [m/s] of what all of one scan share
    clip: float = 2.5  # standard deviations from which on a residual counts less
    sensor_std: tuple[float, float] = (0.2, 0.1)  # [m] across the line of sight, [m/s], of a scan that states none

    def __post_init__(self) -> None:
        check_numbers(self, positive=("clip", "sensor_std"))

    def correct(self, mu: NDArray, m: NDArray, P: NDArray, body: Body, scan: Scan) -> tuple[NDArray, NDArray, NDArray]:
        """Means (..., K, 7) and covariances after the range rates, and log likelihoods (..., K) of the modes."""
        use = scan.mask & np.isfinite(scan.polar[..., 2])
        if not use.any():
            return m, P, np.zeros(mu.shape)
        sight = scan.sight
        g = scan.rates(sight)
        across, noise = self._noise(scan, use)
        u, z, g = (np.where(use[..., None], a, 0.0) for a in (sight, scan.points(sight), g[..., None]))
        r, h, unknown = self._model(m, body, (u, z, g[..., 0]), use, across)
        yaw = (mu * (m[..., OMEGA] ** 2 + P[..., OMEGA, OMEGA])).sum(-1, keepdims=True)
        variance = noise**2 + self.std**2 + yaw * (mu[..., None] * unknown).sum(-2)  # (MODE.17)
        motion = P[..., :MOVING, :MOVING]
        S = ((h @ motion) * h).sum(-1) + (variance + self.common_std**2)[..., None, :]  # (..., K, M)
        zeta = np.sqrt((r**2 / S).min(-2))
        w = np.minimum(1.0, self.clip / np.maximum(zeta, 1e-9)) / variance  # (MODE.18)
        w = np.where(use, w, 0.0)[..., None, :]
        t = w.sum(-1) + 1 / self.common_std**2  # (..., 1)
        wh = w[..., None] * h
        a, rr = wh.sum(-2), (w * r).sum(-1)
        J, y = np.zeros(P.shape), np.zeros(m.shape)
        J[..., :MOVING, :MOVING] = wh.mT @ h - outer(a) / t[..., None, None]  # (MODE.19)
        y[..., :MOVING] = (wh * r[..., None]).sum(-2) - a * (rr / t)[..., None]  # (MODE.19)
        q = (w * r**2).sum(-1) - rr**2 / t  # (MODE.19)
        A = np.eye(m.shape[-1]) + P @ J
        P = symmetrize(np.linalg.solve(A, P))  # (MODE.20)
        x = (P @ y[..., None])[..., 0]  # (MODE.20)
        log_l = -0.5 * q + 0.5 * (y * x).sum(-1) - 0.5 * np.linalg.slogdet(A)[1]  # (MODE.21)
        return m + x, P, log_l

    def _noise(self, scan: Scan, use: NDArray) -> tuple[NDArray, NDArray]:
        """Standard deviations (..., M) of the place across the line of sight [m] and of the range rate [m/s]."""
        azimuth, rate = (np.broadcast_to(scan.noise[..., i], use.shape) for i in (1, 2))
        across = np.where(use, scan.polar[..., 0], 0.0) * azimuth
        across_std, rate_std = self.sensor_std
        return np.where(np.isnan(across), across_std, across), np.where(np.isnan(rate), rate_std, rate)

    def _model(
        self, m: NDArray, body: Body, seen: tuple[NDArray, NDArray, NDArray], use: NDArray, across: NDArray
    ) -> tuple[NDArray, NDArray, NDArray]:
        """Residuals (..., K, M) of range rates, their gradients (..., K, M, 5), 0 if unused.

        seen are lines of sight (..., M, 2), places (..., M, 2) [m] and range rates over ground (..., M), 0 if unused.
        The third array (..., K, M) [m^2] is the variance of what the body is turned by at the place of the detection.
        """
        u, z, g = seen[0][..., None, :, :], seen[1][..., None, :, :], seen[2][..., None, :]  # (..., 1, M, 2)
        e = unit(m[..., PHI])[..., None, :]
        n = perpendicular(e)
        v, omega, d = (a[..., None] for a in (m[..., SPEED], m[..., OMEGA], body.lever))
        along, aside = dot(u, e), dot(u, n)
        half = 0.5 * (np.abs(aside) * body.size[..., :1] + np.abs(along) * body.size[..., 1:])
        spread = half**2 / 3  # (MODE.16)
        gain = spread / np.maximum(spread + across[..., None, :] ** 2, 1e-9)  # (MODE.16)
        h = np.zeros((*along.shape, MOVING))
        h[..., 0], h[..., 1] = -gain * omega * u[..., 1], gain * omega * u[..., 0]  # (MODE.15)
        h[..., PHI] = v * aside - omega * d * along  # (MODE.15)
        h[..., SPEED] = along  # (MODE.15)
        h[..., OMEGA] = np.where(use[..., None, :], gain * cross(z - m[..., None, :2], u) + d * cross(e, u), 0.0)
        return g - v * along - omega * h[..., OMEGA], h, (1 - gain) * spread  # (MODE.14)
