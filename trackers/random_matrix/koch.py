"""Koch's random matrix with Singer's motion model: centre and extent share one covariance.

The covariance of the kinematic state is the Kronecker product P (x) X^ with the extent X^ = X / (nu - 3): uncertainty
has the shape of the object, and X^ is the spread of its detections, sensor noise included.
Equations: docs/methods/random-matrices.md; sources: Koch (2008), Singer (1970), Hoher et al. (2022).
"""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.batch import select
from trackers.estimate import Estimate, check_estimate
from trackers.filter import Extent, Gaussian, UpdateInfo
from trackers.geometry import extent_matrix, perpendicular, rotation, unit, wrap_angle
from trackers.linalg import inverse, outer, symmetrize
from trackers.parameters import check_numbers
from trackers.random_matrix.feldmann import moments
from trackers.range_rate import over_ground
from trackers.scan import Scan
from trackers.validation import guarded_predict, guarded_update

NU_LEAST = 3.5  # the mean of the extent exists above 3
NU_SPREAD = 5.5  # its variance above 5
ROUNDING = 1e-9  # [m^2] keeps the scale matrix regular when all detections of many scans fall on one point


class KochState(NamedTuple):
    """p(x | X) p(X) = N(x; m, P (x) X) IW(X; nu, scale X), (RM.17)."""

    x: NDArray  # (..., 6) px, py [m], vx, vy [m/s], ax, ay [m/s^2]
    P: NDArray  # (..., 3, 3) covariance factor of position, velocity, acceleration; times X^ [m^2]
    nu: NDArray  # (...) degrees of freedom, > 3
    X: NDArray  # (..., 2, 2) scale matrix [m^2], mean extent X / (nu - 3)
    heading: NDArray  # (...) [rad] of the velocity; at standstill the last one known

    @property
    def extent(self) -> NDArray:
        """Mean extent X^ (..., 2, 2) [m^2]."""
        return self.X / (self.nu - 3)[..., None, None]  # (RM.17)


@dataclass(frozen=True)
class Koch:
    """Random matrix of Koch (2008) with the innovation covariance that follows from its model; range rates are ours."""

    theta: float = 0.5  # [s] time constant of the acceleration
    tau: float = 0.5  # [s] time constant with which the extent is forgotten; the paper has one constant for both
    var_a: float = 10.0  # [1/s^4] variance of the acceleration, in units of the extent
    sigmas: float = 2.0  # half axes of the body over the spread of its detections: 2 for a uniform ellipse
    least_speed: float = 0.5  # [m/s] below, the heading is held
    turn_speed: float = 2.0  # [m/s] least speed that a yaw rate is computed with
    rate_std: float = 0.5  # [m/s] range rate, scattering on the body included
    rate_weight: float = 0.0  # information of a range rate; 0: not used, as in the paper
    rate_clip: float = 1.5  # [m/s] larger residuals count as this

    angles: ClassVar[tuple[int, ...]] = ()  # no component of the state is one

    def __post_init__(self) -> None:
        positive = ("theta", "tau", "var_a", "sigmas", "rate_std", "rate_clip")
        check_numbers(self, positive, unlimited=("tau", "rate_clip"))

    def init(self, estimate: Estimate) -> KochState:
        """State from a prior; raises ValueError for a prior that is not finite, positive, definite."""
        check_estimate(estimate)
        x = np.concatenate([estimate.pose[..., :2], estimate.velocity, np.zeros_like(estimate.velocity)], -1)
        nu = degrees_of_freedom(estimate.size, estimate.size_std)
        heading = estimate.pose[..., 2]
        X_hat = extent_matrix(heading, estimate.size / self.sigmas)
        P = np.zeros((*nu.shape, 3, 3))
        P[..., :2, :2] = self._factor(estimate.cov, X_hat)  # (RM.18)
        P[..., 2, 2] = self.var_a  # (RM.18)
        return KochState(x, P, nu, (nu - 3)[..., None, None] * X_hat, heading.copy())  # (RM.18)

    @guarded_predict
    def predict(self, state: KochState, dt: float) -> KochState:
        """Time update over dt [s] >= 0, Singer's model."""
        x, P, nu, X, heading = state
        F, D = singer(dt, self.theta)
        moved = x @ np.kron(F, np.eye(2)).T
        fast = (self._speed(x) > self.least_speed) & (self._speed(moved) > self.least_speed)
        # Without the limits nu falls below 3 after two steps without detections, and the extent turns negative.
        nu_new = np.minimum(nu, np.maximum(np.exp(-dt / self.tau) * nu, NU_LEAST))  # (RM.20c)
        return KochState(
            x=moved,  # (RM.20a)
            P=F @ P @ F.T + self.var_a * D,  # (RM.20b)
            nu=nu_new,
            X=X * ((nu_new - 3) / (nu - 3))[..., None, None],  # (RM.20d)
            heading=heading + np.where(fast, wrap_angle(course(moved) - course(x)), 0.0),
        )

    @guarded_update
    def update(self, state: KochState, scan: Scan) -> tuple[KochState, UpdateInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        return self.correct(state, scan, np.zeros(2))

    def correct(self, state: KochState, scan: Scan, offset: NDArray) -> tuple[KochState, UpdateInfo]:
        """Measurement update by detections whose mean lies at offset (..., 2) [m] from the state's position."""
        x, P, nu, X, heading = state
        xy = scan.xy
        n, z_bar, Z = moments(xy, scan.mask)
        S = self.innovation_factor(P, n)
        W = P[..., 0] / S[..., None]  # (RM.21)
        eps = z_bar - offset - x[..., :2]  # (RM.21)
        shift = (W[..., :, None] * eps[..., None, :]).reshape(*eps.shape[:-1], 6)
        P_new = symmetrize(P - outer(W) * S[..., None, None])  # (RM.22b)
        x_new, P_new = self._range_rates(x + shift, P_new, state.extent, scan, xy, z_bar)  # (RM.22a), (RR.5)
        new = KochState(
            x=x_new,
            P=P_new,
            nu=nu + n,  # (RM.22c)
            X=symmetrize(X + outer(eps) / S[..., None, None] + Z + ROUNDING * np.eye(2)),  # (RM.22d)
            heading=np.where(self._speed(x_new) > self.least_speed, course(x_new), heading),
        )
        return select(n > 0, new, state), UpdateInfo(n, eps, S[..., None, None] * self.shape(state.extent))

    def estimate(self, state: KochState) -> Estimate:
        """Box along the heading; half length and width are `sigmas` roots of the extent's diagonal there."""
        M = rotation(state.heading)
        D = M.mT @ state.extent @ M
        size = 2 * self.sigmas * np.sqrt(np.stack([D[..., 0, 0], D[..., 1, 1]], -1))  # (RM.23)
        relative = np.sqrt(1 / (2 * (np.maximum(state.nu, NU_SPREAD) - 5)))  # (RM.23)
        return self.describe(state, state.x[..., :2], state.heading, size, size * relative[..., None])

    def resize(self, state: KochState, size: NDArray, size_std: NDArray) -> KochState:
        """State with another size (..., 2) [m] of standard deviation size_std (..., 2) [m].

        The factor P is scaled so that the total variance of the centre stays.
        """
        nu = degrees_of_freedom(size, size_std)
        X_hat = extent_matrix(state.heading, size / self.sigmas)
        before, after = self.shape(state.extent), self.shape(X_hat)
        ratio = np.trace(before, axis1=-2, axis2=-1) / np.trace(after, axis1=-2, axis2=-1)
        return state._replace(P=state.P * ratio[..., None, None], nu=nu, X=(nu - 3)[..., None, None] * X_hat)

    def shift(self, state: KochState, d: NDArray) -> KochState:
        """State with d (..., 2) [m] added to the centre."""
        x = state.x.copy()
        x[..., :2] += d
        return state._replace(x=x)

    def gaussian(self, state: KochState) -> Gaussian:
        """Two Gaussians (..., 2, 3) of position, velocity, acceleration, one a coordinate; P is the factor."""
        m = state.x.reshape(*state.x.shape[:-1], 3, 2).mT
        return Gaussian(m, np.broadcast_to(state.P[..., None, :, :], (*m.shape, 3)))

    def with_gaussian(self, state: KochState, gaussian: Gaussian) -> KochState:
        """The state with another mean and factor; the heading is that of the velocity, and is held at standstill."""
        x = gaussian.m.mT.reshape(*gaussian.m.shape[:-2], 6)
        moves = self._speed(x) > self.least_speed
        return state._replace(x=x, P=gaussian.P[..., 0, :, :], heading=np.where(moves, course(x), state.heading))

    def extent(self, state: KochState) -> Extent:
        """The density of the extent, which keeps its axes in a prediction."""
        return Extent(state.nu, state.X, np.zeros(state.nu.shape), 3.0)

    def with_extent(self, state: KochState, extent: Extent) -> KochState:
        """The state with another density of the extent."""
        return state._replace(nu=extent.nu, X=extent.V)

    def innovation_factor(self, P: NDArray, n: NDArray) -> NDArray:
        """S (...), the factor of the innovation covariance, from the factor P (..., 3, 3) and the count n (...)."""
        return P[..., 0, 0] + 1 / np.maximum(n, 1)  # (RM.21)

    def shape(self, X_hat: NDArray) -> NDArray:
        """The matrix (..., 2, 2) [m^2] that P is a factor of: the extent."""
        return X_hat

    def describe(
        self, state: KochState, centre: NDArray, heading: NDArray, size: NDArray, size_std: NDArray
    ) -> Estimate:
        """The record of a box whose motion is that of the state: velocity, yaw rate and their covariances."""
        C = self.covariance(state.P, state.extent)
        v, a = state.x[..., 2:4], state.x[..., 4:6]
        across = perpendicular(unit(course(state.x)))
        sideways = np.sqrt((across[..., None, :] @ C[..., 2:4, 2:4] @ across[..., None])[..., 0, 0])
        wobble = np.sqrt((across[..., None, :] @ C[..., 4:, 4:] @ across[..., None])[..., 0, 0])
        speed = self._speed(state.x)
        return Estimate(
            pose=np.concatenate([centre, wrap_angle(heading)[..., None]], -1),
            velocity=v.copy(),
            yaw_rate=self._yaw_rate(v, a),
            size=size,
            cov=symmetrize(C[..., :4, :4]) + ROUNDING * np.eye(4),
            size_std=size_std,
            heading_std=np.arctan2(sideways, np.maximum(speed, self.least_speed)),  # (RM.24)
            yaw_rate_std=wobble / np.maximum(speed, self.turn_speed),  # (RM.24)
        )

    def _yaw_rate(self, v: NDArray, a: NDArray) -> NDArray:
        speed2 = (v * v).sum(-1)
        turn = (perpendicular(v) * a).sum(-1) / np.maximum(speed2, self.turn_speed**2)  # (RM.24)
        return np.where(speed2 > self.least_speed**2, turn, 0.0)

    def _speed(self, x: NDArray) -> NDArray:
        return np.hypot(x[..., 2], x[..., 3])

    def covariance(self, P: NDArray, X_hat: NDArray) -> NDArray:
        """Covariance (..., 6, 6) of the kinematic state, P (x) X^."""
        B = self.shape(X_hat)
        return (P[..., :, None, :, None] * B[..., None, :, None, :]).reshape(*P.shape[:-2], 6, 6)  # (RM.17)

    def _factor(self, C: NDArray, X_hat: NDArray) -> NDArray:
        """Factor P (..., s, s) of a covariance C (..., 2 s, 2 s), exact where C is P (x) X^."""
        s = C.shape[-1] // 2
        B = inverse(self.shape(X_hat))
        blocks = C.reshape(*C.shape[:-2], s, 2, s, 2)
        return symmetrize((B[..., None, :, None, :] * blocks).sum((-3, -1)) / 2)  # (RM.18)

    def _range_rates(
        self, x: NDArray, P: NDArray, X_hat: NDArray, scan: Scan, xy: NDArray, centre: NDArray
    ) -> tuple[NDArray, NDArray]:
        """State and factor after the velocity is corrected by the ground range rates of the scan, (RR.5).

        After a correction along one line of sight the covariance is no Kronecker product; its nearest factor is taken.
        """
        g = scan.ground_rate
        use = scan.mask & np.isfinite(g)
        if self.rate_weight == 0 or not use.any():
            return x, P
        u = np.where(use[..., None], scan.sight, 0.0)
        v = x[..., 2:4]
        yaw_rate = self._yaw_rate(v, x[..., 4:6])[..., None]
        expected = over_ground(u, v[..., None, :], yaw_rate, xy - centre[..., None, :])  # (RR.5)
        residual = np.where(use, np.clip(g - expected, -self.rate_clip, self.rate_clip), 0.0)
        information = self.rate_weight / self.rate_std**2
        C = self.covariance(P, X_hat)
        J, score = np.zeros_like(C), np.zeros_like(x)
        J[..., 2:4, 2:4] = information * (u.mT @ u)
        score[..., 2:4] = information * (u * residual[..., None]).sum(-2)
        C_new = symmetrize(np.linalg.solve(np.eye(6) + C @ J, C))  # (RR.5)
        return x + (C_new @ score[..., None])[..., 0], self._factor(C_new, X_hat)


def singer(dt: float, theta: float) -> tuple[NDArray, NDArray]:
    """Transition F and noise shape D, both (3, 3), over dt [s]; the approximation that the paper uses."""
    e = np.exp(-dt / theta)
    F = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, e]])  # (RM.19)
    return F, (1 - e**2) * np.diag([0.0, 0.0, 1.0])  # (RM.19)


def course(x: NDArray) -> NDArray:
    """Direction (...) [rad] of the velocity of states x (..., 6)."""
    return np.arctan2(x[..., 3], x[..., 2])


def degrees_of_freedom(size: NDArray, size_std: NDArray) -> NDArray:
    """Nu (...) for the mean relative size variance of boxes with size and size_std (..., 2) [m]."""
    relative = ((size_std / size) ** 2).mean(-1)
    return 5 + 1 / (2 * np.maximum(relative, 1e-6))  # (RM.18)
