"""Random-matrix filters: the extent is a symmetric positive definite matrix with an inverse Wishart density.

Equations: docs/methods/random-matrices.md; sources: Feldmann et al. (2011), and Xia et al. (2020), eq. (12)-(15).
"""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers import held_gaussian
from trackers.batch import select
from trackers.estimate import Estimate, check_estimate
from trackers.filter import Extent, UpdateInfo
from trackers.geometry import extent_matrix, rotation
from trackers.held_gaussian import box_estimate, prior_moments
from trackers.linalg import I2, inverse, inverse_sqrtm, outer, sqrtm, symmetrize
from trackers.motion.turn import OMEGA, PHI, coordinated_turn, turn_noise
from trackers.parameters import check_numbers
from trackers.range_rate import RangeRates
from trackers.scan import Scan
from trackers.validation import guarded_predict, guarded_update

NU_REST = 1e-9  # of nu above 6 that no forgetting takes: at 0 the mean of the extent does not exist
NU_MIN = 8.5  # the variance of the extent exists for nu > 8 only


class RMState(NamedTuple):
    """p(x) p(X) = N(x; m, P) IW(X; nu, V), (RM.1)."""

    m: NDArray  # (..., 5) px, py [m], phi [rad], v [m/s], omega [rad/s]
    P: NDArray  # (..., 5, 5)
    nu: NDArray  # (...) degrees of freedom, > 6
    V: NDArray  # (..., 2, 2) scale matrix [m^2], mean extent V / (nu - 6)


def moments(z: NDArray, mask: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Count (...), mean (..., 2) and spread (..., 2, 2), a sum, of the detections z (..., M, 2) under the mask."""
    z = np.where(mask[..., None], z, 0.0)
    n = mask.sum(-1)  # (RM.10)
    z_bar = z.sum(-2) / np.maximum(n, 1)[..., None]  # (RM.10)
    d = np.where(mask[..., None], z - z_bar[..., None, :], 0.0)
    return n, z_bar, d.mT @ d  # (RM.10)


def masked_mean(value: NDArray, mask: NDArray, axes: int) -> NDArray:
    """Mean over the detection axis of value (..., M, ...), which has `axes` axes behind M, under the mask (..., M)."""
    weight = mask / np.maximum(mask.sum(-1, keepdims=True), 1)
    tail = (1,) * axes
    weight = weight.reshape(weight.shape + tail)
    return (np.where(weight > 0, value, 0.0) * weight).sum(-1 - axes)


@dataclass(frozen=True)
class RandomMatrix:
    """Random-matrix filter of Feldmann et al. (2011) on the coordinated-turn state.

    Two terms go beyond the paper. Range rates, where they are measured, correct heading, speed and yaw rate;
    `surface`, 0 by default, takes the offset of a one-sided scan out of the mean of the detections.
    """

    accel_std: float = 1.5  # [m/s^2] process noise along the heading
    yaw_accel_std: float = 0.1  # [rad/s^2]
    tau: float = 5.0  # [s] time constant with which the extent is forgotten
    rho: float = 0.25  # spread / extent; 1/4 for a uniform ellipse
    sigma: float = 0.2  # [m] sensor noise of detections whose scan does not state it
    surface: float = 0.0  # where the mean of the detections lies: 0 at the centre, 1 on the visible outline
    rate_std: float = 0.5  # [m/s] range rate, scattering on the body included; larger than the radar's own
    rate_weight: float = 0.3  # information of a range rate, because those of one vehicle are not independent
    rate_clip: float = 1.5  # [m/s] larger residuals count as this

    angles: ClassVar[tuple[int, ...]] = (PHI,)  # of m
    gaussian, with_gaussian, shift = held_gaussian.gaussian, held_gaussian.with_gaussian, held_gaussian.shift

    def __post_init__(self) -> None:
        check_numbers(self, positive=("tau", "rho", "rate_std", "rate_clip"), unlimited=("tau", "rate_clip"))

    @property
    def rates(self) -> RangeRates:
        """The correction by range rates."""
        return RangeRates(self.rate_weight, self.rate_std, self.rate_clip)

    def init(self, estimate: Estimate) -> RMState:
        """State from a prior; raises ValueError for a prior that is not finite, positive, definite."""
        check_estimate(estimate)
        m, P = prior_moments(estimate)  # (RM.5)
        nu = degrees_of_freedom(estimate.size, estimate.size_std)
        return RMState(m, P, nu, (nu - 6)[..., None, None] * extent_matrix(m[..., PHI], estimate.size))  # (RM.4)

    @guarded_predict
    def predict(self, state: RMState, dt: float) -> RMState:
        """Time update over dt [s] >= 0, coordinated turn."""
        m, P, nu, V = state
        m_new, G = coordinated_turn(m, dt)
        decay = np.minimum(np.maximum(np.exp(-dt / self.tau), NU_REST / (nu - 6)), 1.0)
        E = rotation(m[..., OMEGA] * dt)
        return RMState(
            m=m_new,  # (RM.9a)
            P=G @ P @ G.mT + turn_noise(m[..., PHI], dt, self.accel_std, self.yaw_accel_std),  # (RM.9b)
            nu=6 + decay * (nu - 6),  # (RM.9c)
            V=decay[..., None, None] * E @ V @ E.mT,  # (RM.9d)
        )

    @guarded_update
    def update(self, state: RMState, scan: Scan) -> tuple[RMState, UpdateInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        m, P, nu, V = state
        xy = scan.xy
        n, z_bar, Z = moments(xy, scan.mask)
        if self.surface:
            z_bar = z_bar - self.surface * self._offset(state, scan)  # (RM.11)
        X_hat = V / (nu - 6)[..., None, None]  # (RM.1)
        R = masked_mean(scan.position_noise(self.sigma), scan.mask, axes=2)
        Y = self.rho * X_hat + R + np.where(n > 0, 0.0, 1.0)[..., None, None] * I2  # (RM.12); regular for n = 0
        eps = z_bar - m[..., :2]  # (RM.12)
        S = P[..., :2, :2] + Y / np.maximum(n, 1)[..., None, None]  # (RM.12)
        K = P[..., :2] @ inverse(S)  # (RM.12)
        root = sqrtm(X_hat)
        A = root @ inverse_sqrtm(S)  # (RM.13d)
        B = root @ inverse_sqrtm(Y)  # (RM.13d)
        m_new, P_new = self.rates.correct(
            m + (K @ eps[..., None])[..., 0],  # (RM.13a)
            symmetrize(P - K @ P[..., :2, :]),  # (RM.13b)
            scan,
            xy,
        )
        new = RMState(
            m=m_new,
            P=P_new,
            nu=nu + n,  # (RM.13c)
            V=symmetrize(V + A @ outer(eps) @ A.mT + B @ Z @ B.mT),  # (RM.13d)
        )
        return select(n > 0, new, state), UpdateInfo(n, eps, S)

    def estimate(self, state: RMState) -> Estimate:
        """Box along the heading; half length and width are the roots of the extent's diagonal there."""
        size = self._size(state)
        log_std = np.sqrt(1 / (2 * (np.maximum(state.nu, NU_MIN) - 8)))  # (RM.14)
        return box_estimate(state.m, state.P, size, size * log_std[..., None])  # (RM.15)

    def resize(self, state: RMState, size: NDArray, size_std: NDArray) -> RMState:
        """State with another size (..., 2) [m] of standard deviation size_std (..., 2) [m]."""
        nu = degrees_of_freedom(size, size_std)
        return state._replace(nu=nu, V=(nu - 6)[..., None, None] * extent_matrix(state.m[..., PHI], size))  # (RM.4)

    def extent(self, state: RMState) -> Extent:
        """The density of the extent, which turns with the heading."""
        return Extent(state.nu, state.V, state.m[..., PHI], 6.0)

    def with_extent(self, state: RMState, extent: Extent) -> RMState:
        """The state with another density of the extent."""
        return state._replace(nu=extent.nu, V=extent.V)

    def _size(self, state: RMState) -> NDArray:
        M = rotation(state.m[..., PHI])
        D = M.mT @ state.V @ M / (state.nu - 6)[..., None, None]
        return 2 * np.sqrt(D.diagonal(axis1=-2, axis2=-1))  # (RM.14)

    def _offset(self, state: RMState, scan: Scan) -> NDArray:
        """Mean of the visible outline relative to the centre, (..., 2) [m]; zero without a detection."""
        n = scan.mask.sum(-1)
        where = np.broadcast_to(scan.pose[..., :2], (*scan.mask.shape, 2))
        offset = visible_offset(state.m[..., :3], self._size(state), masked_mean(where, scan.mask, axes=1))
        return np.where((n > 0)[..., None], offset, 0.0)


def degrees_of_freedom(size: NDArray, size_std: NDArray) -> NDArray:
    """Nu (...) for the mean relative size variance of boxes with size and size_std (..., 2) [m]."""
    relative = ((size_std / size) ** 2).mean(-1)
    return 8 + 1 / (2 * np.maximum(relative, 1e-6))  # (RM.4)


def visible_offset(pose: NDArray, size: NDArray, sensor: NDArray) -> NDArray:
    """Mean of the visible outline relative to the box centre, (..., 2) [m], world axes.

    pose (..., 3), size (..., 2) [m], sensor (..., 2) [m] position. Each visible side weighs with its projected length;
    for a sensor inside the box the offset is zero.
    """
    M = rotation(pose[..., 2])
    s = (M.mT @ (sensor - pose[..., :2])[..., None])[..., 0]
    half = size / 2
    depth = np.abs(s) - half  # > 0: the side of this axis faces the sensor
    visible = depth > 0
    side = np.sign(s) * half  # the side's distance along its own axis
    reach = np.hypot(np.maximum(depth, 1e-9), s[..., ::-1])  # from the side's midpoint to the sensor
    weight = np.where(visible, size[..., ::-1] * depth / reach, 0.0)  # (RM.16)
    total = weight.sum(-1, keepdims=True)
    body = weight * side / np.where(total > 0, total, 1.0)
    return (M @ body[..., None])[..., 0]  # (RM.16)
