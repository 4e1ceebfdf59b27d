"""The contour ellipse fitted to the detections themselves, without virtual ones: the report's improvement 2.

Distances to the outline alone do not determine an ellipse: its length is not observable from one side, and its far side
can lock on to the detections. So each detection is compared with the near hit of its own bearing, and two more rows
compare the ellipse's tangents with the outermost bearings. Equations: docs/methods/virtual-measurements.md.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import perpendicular, unit, wrap_angle
from trackers.random_matrix.adaptation import Descent
from trackers.random_matrix.rays import near_hits, tangent_sector


@dataclass(frozen=True)
class DirectFit:
    """Damped Gauss-Newton on normal distances to the near side, and on the two tangents."""

    gain: float = 0.3
    iterations: int = 2
    damping: float = 0.1
    tangent_weight: float = 0.5
    pitch: float = float(np.radians(1.0))  # [rad] between rays of the sensor; the outermost hit is half of it inside
    within: float = 0.97  # share of the half sector that a bearing is clipped to

    def fit(self, theta: NDArray, sensor: NDArray, xy: NDArray, mask: NDArray, active: NDArray) -> Descent:
        """Step from theta (..., 4) = centre, l along x, w along y to the detections xy (..., M, 2) under the mask."""
        kept = np.ones_like(theta)
        e = np.zeros_like(theta)
        for _ in range(self.iterations):
            e, J = self._rows(theta, sensor, xy, mask)
            M = np.linalg.solve(J.mT @ J + self.damping * np.eye(4), J.mT)
            trial = theta - self.gain * (M @ e[..., None])[..., 0]  # (VM.25)
            accept = (active & (trial[..., 2:] > 0.02).all(-1) & np.isfinite(trial).all(-1))[..., None]
            pull = self.gain * np.diagonal(M @ J, axis1=-2, axis2=-1)
            kept = np.where(accept, kept * np.clip(1 - pull, 0.0, 1.0), kept)
            theta = np.where(accept, trial, theta)
        return Descent(theta, e, kept)

    def _rows(self, theta: NDArray, sensor: NDArray, xy: NDArray, mask: NDArray) -> tuple[NDArray, NDArray]:
        """Residuals e (..., M + 2) [m] and their Jacobian (..., M + 2, 4); zero outside the mask."""
        centre, half = theta[..., :2], theta[..., 2:] / 2
        L = half[..., None] * np.eye(2)
        middle, right, left = tangent_sector(sensor, centre, L)
        d = np.where(mask[..., None], xy, centre[..., None, :]) - sensor[..., None, :]
        bearing = wrap_angle(np.arctan2(d[..., 1], d[..., 0]) - middle[..., None])
        e, J = self._near_side(centre, half, sensor, xy, middle, bearing, right, left)
        share = mask / np.sqrt(np.maximum(mask.sum(-1, keepdims=True), 1))
        e, J = np.where(mask, share * e, 0.0), np.where(mask[..., None], share[..., None] * J, 0.0)
        low = np.where(mask, bearing, np.inf).min(-1, initial=np.inf) - self.pitch / 2
        high = np.where(mask, bearing, -np.inf).max(-1, initial=-np.inf) + self.pitch / 2
        rows = [(e, J)]
        for side, measured, sign in ((right, low, -1.0), (left, high, 1.0)):
            outermost = np.where(np.isfinite(measured), measured, side)  # no residual without a detection
            rows.append(self._tangent(centre, half, sensor, middle, side, outermost, sign))
        return np.concatenate([r[0] for r in rows], -1), np.concatenate([r[1] for r in rows], -2)

    def _near_side(
        self, centre: NDArray, half: NDArray, sensor: NDArray, xy: NDArray, middle: NDArray, bearing: NDArray,
        right: NDArray, left: NDArray,
    ) -> tuple[NDArray, NDArray]:  # fmt: skip
        """Normal distance (..., M) [m] of the detections from the near hit of their bearing, and its Jacobian."""
        clipped = np.clip(bearing, self.within * right[..., None], self.within * left[..., None])
        ray = middle[..., None] + clipped
        r = near_hits(sensor, ray, centre, half[..., None] * np.eye(2))
        hit = sensor[..., None, :] + np.where(np.isfinite(r), r, 0.0)[..., None] * unit(ray)
        half = half[..., None, :]
        body = hit - centre[..., None, :]
        gradient = body / half**2
        slope = np.sqrt((gradient**2).sum(-1, keepdims=True))
        normal = gradient / slope
        e = ((xy - hit) * normal).sum(-1)  # (VM.23)
        growth = -(body**2) / half**3 / slope / 2  # (VM.23), per full length and width
        return e, np.concatenate([-normal, growth], -1)

    def _tangent(
        self, centre: NDArray, half: NDArray, sensor: NDArray, middle: NDArray, side: NDArray, measured: NDArray,
        sign: float,
    ) -> tuple[NDArray, NDArray]:  # fmt: skip
        """Distance (..., 1) [m] at which the tangent passes the outermost detection, and its Jacobian (..., 1, 4)."""
        distance = np.hypot(*np.moveaxis(centre - sensor, -1, 0))
        normal = sign * perpendicular(unit(middle + side))  # outward, where the tangent touches
        support = np.sqrt((half**2 * normal**2).sum(-1, keepdims=True))
        grow = half * normal**2 / support / 2  # (VM.24), per full length and width
        moved = np.concatenate([normal, grow], -1)
        e = distance * (side - measured)  # (VM.24)
        return self.tangent_weight * e[..., None], self.tangent_weight * sign * moved[..., None, :]
