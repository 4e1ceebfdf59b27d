"""htg-map: maximum a posteriori update of centre, heading and size under the hierarchical truncated Gaussian.

Ours: Fisher scoring of the density of the papers, no pseudo-measurements. xi = [px, py, phi, v, omega, log l, log w].
Equations: docs/methods/hierarchical-truncated-gaussians.md.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers import held_gaussian
from trackers.estimate import Estimate, check_estimate
from trackers.filter import UpdateInfo
from trackers.geometry import rotation
from trackers.held_gaussian import box_estimate, prior_moments, resized
from trackers.htg.bins import HTGTable, log_spatial, metric_ends, resolve
from trackers.htg.density import moments
from trackers.htg.objective import LOG_L, LOG_W, PHI, Objective, Points, flatten, information, shape_of
from trackers.linalg import symmetrize
from trackers.motion.turn import coordinated_turn, turn_noise
from trackers.parameters import check_numbers
from trackers.scan import Scan
from trackers.validation import guarded_predict, guarded_update

LOG_SIZES = np.log((0.01, 1e3))  # [m] detections of something else, scan after scan, draw the sizes no further


class MotionSizeState(NamedTuple):
    """Motion and log size, p(xi) = N(xi; m, P)."""

    m: NDArray  # (..., 7)
    P: NDArray  # (..., 7, 7)


@dataclass(frozen=True)
class HTGMap:
    """Fisher scoring on seven states, all objects at once."""

    table: str | HTGTable = "surround-car+surround-truck"  # see `bins.resolve`
    accel_std: float = 1.5  # [m/s^2] process noise along the heading
    yaw_accel_std: float = 0.1  # [rad/s^2]
    size_walk: float = 0.005  # [1/sqrt(s)] random walk of the log sizes
    sigma: float = 0.2  # [m] noise of detections whose scan does not state it; 0 where the table contains it
    alpha: float = 1.0  # information of a detection in the covariance; those of one vehicle are not independent
    rate_std: float = 0.5  # [m/s] range rate, scattering on the body included; larger than the radar's own
    rate_alpha: float = 0.3  # information of a range rate in the covariance
    rate_clip: float = 1.5  # [m/s] larger residuals count as this
    metric: bool = True  # near ends as anchors (`metric_ends`) where a table has none; False: coordinates of the paper
    shape_std: tuple[float, float] = (0.0, 0.0)  # outline off the learned one over length and width, (HTG.39)
    rounds: int = 5  # evaluations of the posterior after the start; each is a step or a halved step
    flat: float = 1e-3  # [nat] gain of the log posterior below which a step is not worth taking
    two_starts: bool = True  # also from the prediction moved by the sample mean
    contest: int = 2  # rounds after which the better start goes on alone
    size_step: float = 0.2  # largest change of a log size in a step

    angles: ClassVar[tuple[int, ...]] = (PHI,)  # of m
    log_size: ClassVar[bool] = True
    gaussian, with_gaussian, shift = held_gaussian.gaussian, held_gaussian.with_gaussian, held_gaussian.shift

    def __post_init__(self) -> None:
        positive = ("alpha", "rate_std", "rate_clip", "rounds", "contest", "size_step")
        check_numbers(self, positive, unlimited=("rate_clip",))

    def model(self) -> HTGTable:
        """The table, with its near ends as anchors unless it has anchors of its own."""
        table = resolve(self.table)
        return metric_ends(table) if self.metric and not table.anchor.any() else table

    def init(self, estimate: Estimate) -> MotionSizeState:
        """State from a prior; raises ValueError for a prior that is not finite, positive, definite."""
        check_estimate(estimate)
        m, P = prior_moments(estimate, np.log(estimate.size), estimate.size_std / estimate.size)
        return MotionSizeState(m, P)

    @guarded_predict
    def predict(self, state: MotionSizeState, dt: float) -> MotionSizeState:
        """Time update over dt [s] >= 0: coordinated turn, sizes a random walk."""
        m, P = state
        m5, G5 = coordinated_turn(m[..., :LOG_L], dt)  # (RM.9a)
        G = np.zeros(P.shape)
        G[..., :5, :5] = G5
        G[..., LOG_L, LOG_L] = G[..., LOG_W, LOG_W] = 1.0
        P = G @ P @ G.mT  # (RM.9b)
        P[..., :5, :5] += turn_noise(m[..., PHI], dt, self.accel_std, self.yaw_accel_std)  # (RM.9b)
        P[..., LOG_L, LOG_L] += self.size_walk**2 * dt  # (HTG.29)
        P[..., LOG_W, LOG_W] += self.size_walk**2 * dt  # (HTG.29)
        return MotionSizeState(np.concatenate([m5, m[..., LOG_L:]], -1), symmetrize(P))

    @guarded_update
    def update(self, state: MotionSizeState, scan: Scan) -> tuple[MotionSizeState, UpdateInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        n = scan.mask.sum(-1)
        eps, S = np.zeros((*n.shape, 2)), np.zeros((*n.shape, 2, 2)) + np.eye(2)
        if not n.any():
            return state, UpdateInfo(n, eps, S)
        hit, points = flatten(scan, self.sigma)
        m, P = state.m.reshape(-1, 7), state.P.reshape(-1, 7, 7)
        xi, cov, eps_hit, S_hit = self._update_flat(m[hit], P[hit], points)
        m, P = m.copy(), P.copy()
        m[hit], P[hit] = xi, cov
        eps.reshape(-1, 2)[hit], S.reshape(-1, 2, 2)[hit] = eps_hit, S_hit
        return MotionSizeState(m.reshape(state.m.shape), P.reshape(state.P.shape)), UpdateInfo(n, eps, S)

    def _update_flat(self, m: NDArray, P: NDArray, points: Points) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """Posterior mean (N, 7) and covariance, innovation of the centroid (N, 2) and its covariance."""
        table = self.model()
        shape = shape_of(table, m, points)
        precision = np.linalg.inv(P)
        objective = Objective(points, shape, m, precision, self.rate_std, self.rate_clip)
        J_place = objective.spatial_information(table, information(table, shape.bin, shape.noise.T))
        J_rate = objective.rate_information()
        gain = np.linalg.inv(precision + J_place + J_rate)  # (HTG.36)
        eps, S, K = centroid(table, objective, P)
        starts = np.stack([m, m + (K @ eps[..., None])[..., 0]]) if self.two_starts else m[None]  # (HTG.37)
        xi = self._maximise(objective, gain, starts)
        np.clip(xi[:, LOG_L:], *LOG_SIZES, out=xi[:, LOG_L:])
        cov = np.linalg.inv(precision + self.alpha * J_place + self.rate_alpha * J_rate)  # (HTG.38)
        return xi, symmetrize(cov), eps, S

    def _maximise(self, objective: Objective, gain: NDArray, xi: NDArray) -> NDArray:
        """Best state (N, 7) reached from the starts xi (S, N, 7) by steps of gain (N, 7, 7) times gradient.

        A step that does not climb is halved; the leading start goes on alone after `contest` evaluations. Each object
        stops by itself: its result does not depend on the others.
        """
        value, gradient = objective.evaluate(xi)
        length = np.ones(value.shape)
        for k in range(self.rounds):
            if k == self.contest and len(xi) > 1:
                lead = value.argmax(0), np.arange(value.shape[1])
                xi, value, gradient, length = (a[lead][None] for a in (xi, value, gradient, length))
            step = (gain @ gradient[..., None])[..., 0]  # (HTG.36)
            going = (length * (gradient * step).sum(-1)).max(0) >= self.flat
            if not going.any():
                break
            np.clip(step[..., LOG_L:], -self.size_step, self.size_step, out=step[..., LOG_L:])
            trial = xi + length[..., None] * step  # (HTG.36)
            trial_value, trial_gradient = objective.evaluate(trial)
            better = going & (trial_value >= value)
            xi = np.where(better[..., None], trial, xi)
            gradient = np.where(better[..., None], trial_gradient, gradient)
            value = np.where(better, trial_value, value)
            length = np.where(better, 1.0, 0.5 * length)
        return xi[value.argmax(0), np.arange(xi.shape[1])]

    def resize(self, state: MotionSizeState, size: NDArray, size_std: NDArray) -> MotionSizeState:
        """State with another size (..., 2) [m] of standard deviation size_std (..., 2) [m]."""
        return MotionSizeState(*resized(state.m, state.P, np.log(size), size_std / size))

    def log_spatial(self, state: MotionSizeState, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""
        sure = replace(self, shape_std=(0.0, 0.0)).estimate(state)  # the density has their scatter already
        return log_spatial(self.model(), sure, scan, track, detection, self.sigma)

    def estimate(self, state: MotionSizeState) -> Estimate:
        """Box along the heading."""
        m, P = state
        size = np.exp(m[..., LOG_L:])
        found = box_estimate(m, P, size, size * np.sqrt(P.diagonal(axis1=-2, axis2=-1)[..., LOG_L:]))
        body = rotation(m[..., PHI]) * (size * self.shape_std)[..., None, :]
        found.cov[..., :2, :2] += body @ body.mT  # (HTG.39)
        return found


def centroid(table: HTGTable, objective: Objective, P: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Innovation (N, 2) of the sample mean under the moments of the bins, its covariance and gain (N, 7, 2), (HTG.37).

    P (N, 7, 7) predicted covariance. This is the Kalman update of htg-mm, without its extent.
    """
    points, m, index = objective.points, objective.mean, objective.shape.bin
    row, start = points.row, points.start
    mean, cov = (a[index] for a in bin_moments(table))
    h, shift = table.warp(0.5 * np.exp(m[:, LOG_L:])[row], index)
    M = rotation(m[:, PHI])[row]
    A = M * h[:, None, :]
    c, s = points.sight
    along, across = points.variance
    R = np.empty((len(row), 2, 2))
    R[:, 0, 0], R[:, 1, 1] = along * c * c + across * s * s, along * s * s + across * c * c
    R[:, 0, 1] = R[:, 1, 0] = (along - across) * c * s
    n = np.diff(start, append=len(row))[:, None]
    offset = (M @ (shift + h * mean)[..., None])[..., 0]
    eps = np.add.reduceat(points.z.T - offset, start) / n - m[:, :2]  # (HTG.37)
    S = P[:, :2, :2] + np.add.reduceat(A @ cov @ A.mT + R, start) / n[..., None] ** 2  # (HTG.37)
    return eps, S, np.linalg.solve(S, P[:, :2, :]).mT


@lru_cache(maxsize=64)
def bin_moments(table: HTGTable) -> tuple[NDArray, NDArray]:
    """Mean (B, 2) and covariance (B, 2, 2) of the densities, in unit coordinates."""
    return moments(table.p)
