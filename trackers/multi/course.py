"""Velocity and heading of a cell from its range rates, under three hypotheses of its course.

One radar sees one component of the velocity. Equations: docs/methods/life-cycle-of-tracks.md, section 3.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from trackers.geometry import dot, perpendicular, unit
from trackers.linalg import outer
from trackers.multi.window import Unexplained
from trackers.parameters import check_numbers


class Lanes(NamedTuple):
    """What the map, or without one the way of the ego and the tracks, says at B cells."""

    direction: NDArray  # (B,) [rad] of the lane, off the lanes of the way of the ego
    along: NDArray  # (B,) how sure it is that others drive along it, 1 on a lane of the map, 0 off the lanes
    ego_speed: float  # [m/s]
    direction_std: NDArray  # (B,) [rad]
    curvature: NDArray | None = None  # (B,) [1/m] of the lane, positive to the left; None: not asked for
    mapped: bool = False  # there is a map, off whose lanes others drive anywhere


class Motion(NamedTuple):
    """Velocities of B cells."""

    velocity: NDArray  # (B, 2) [m/s]
    cov: NDArray  # (B, 2, 2)
    heading: NDArray  # (B,) [rad]
    heading_std: NDArray  # (B,) [rad]


Told = tuple[NDArray, NDArray, NDArray]  # information (B, 2, 2), its vector (B, 2), weighed sum of squares (B,)
Fit = tuple[NDArray, NDArray, NDArray]  # velocity (..., B, 2), covariance (..., B, 2, 2), log evidence (..., B)


@dataclass(frozen=True)
class Course:
    """Priors of the velocity: with the lane, against it, in any direction."""

    sigma_rate: float = 0.3  # [m/s] range rate in the fit
    turn_std: float = 0.3  # [rad/s] yaw rate, by which range rates differ across the line of sight
    lane_std: tuple[float, float] = (12.0, 1.0)  # [m/s] along and across the lane, around the ego's speed, either way
    any_std: float = 15.0  # [m/s] of any direction, around standstill
    any_log_odds: tuple[float, float] = (-3.0, 2.0)  # of any direction against along the lane: on lanes, off them
    crossed: tuple[float, float] = (3.0, 8.0)  # [m/s] of the ego, without a map: up to the first all is as off lanes,
    # from the second on as on lanes, for hardly anybody crosses a road on which one drives so fast
    above: float = 4.0  # [m/s] the heading follows the velocity above this speed
    slow_std: float = 0.1  # [rad] of the heading below it
    std_bounds: tuple[float, float] = (0.03, 0.3)  # [rad] of the heading above it
    standing_std: float = 1.0  # [m/s] of the velocity of a standing cell

    def __post_init__(self) -> None:
        check_numbers(
            self,
            positive=("sigma_rate", "lane_std", "any_std", "slow_std", "std_bounds", "standing_std"),
            signed=("any_log_odds",),
        )
        slow, fast = self.crossed
        if slow >= fast:
            raise ValueError(f"Course.crossed must be two speeds of which the second is greater, got {self.crossed}")

    def of(self, points: Unexplained, W: NDArray, lanes: Lanes, standing: NDArray) -> Motion:
        """Motion of the cells W (B, P) of detections; standing (B,) bool those that seem not to move.

        A lane seen from the side hides the speed on it: such a cell may stand, or drive. Cells without range rates have
        the velocity of their likeliest prior, and the heading of the lane.
        """
        along = lanes.ego_speed * unit(lanes.direction)
        M = np.stack([unit(lanes.direction), perpendicular(unit(lanes.direction))], -1)
        forth, across = self.lane_std
        across = np.hypot(across, lanes.ego_speed * np.minimum(lanes.direction_std, 1.0))  # (LIFE.55)
        lane = M * np.square(np.stack([np.full_like(across, forth), across], -1))[:, None] @ M.mT
        broad = np.broadcast_to(self.any_std**2 * np.eye(2), lane.shape)
        standing_cov = np.broadcast_to(self.standing_std**2 * np.eye(2), lane.shape)
        on, off = self.any_log_odds
        none, odds = np.zeros(len(W)), off + (on - off) * lanes.along
        still = np.zeros_like(along)
        priors = np.stack([along, -along, still, still]), np.stack([lane, lane, broad, standing_cov])
        fits = fit(self._told(points, W, lanes), *priors)  # (4, B, ...)
        log_p, b = fits[2][:3] + np.stack([none, none, odds]), np.arange(len(W))
        if not lanes.mapped:
            log_p -= np.linalg.slogdet(fits[1][:3])[1] / 2  # (LIFE.14)
        best = np.argmax(log_p, 0)  # (LIFE.14)
        velocity, cov = fits[0][best, b], fits[1][best, b]
        either = mixture(*([a[k] for a in fits] for k in (3, 0)))
        velocity = np.where(standing[:, None], either[0], velocity)
        cov = np.where(standing[:, None, None], either[1], cov)
        motion = self._with_heading(velocity, cov, lanes.direction, (best < 2) | standing)
        unknown = ~(W & points.measured).any(1)
        return motion._replace(
            heading=np.where(unknown, lanes.direction, motion.heading),
            heading_std=np.where(unknown, self.std_bounds[1], motion.heading_std),
        )

    def uncrossed(self, speed: float) -> float:
        """How sure it is that others drive along the way of the ego, at its speed [m/s], where there is no map."""
        slow, fast = self.crossed
        return float(np.clip((speed - slow) / (fast - slow), 0.0, 1.0))  # (LIFE.53)

    def _with_heading(self, velocity: NDArray, cov: NDArray, lane: NDArray, in_lane: NDArray) -> Motion:
        """Headings: of the lane (B,) [rad] for slow cells in_lane (B,) bool, else where the velocity may lead."""
        power, axis = np.linalg.eigh(outer(velocity) + cov)  # (LIFE.15)
        axis = axis[..., 1] * np.where(dot(axis[..., 1], velocity) < 0, -1.0, 1.0)[:, None]
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        slow = in_lane & (speed < self.above)
        heading = np.where(slow, lane, np.arctan2(axis[:, 1], axis[:, 0]))
        std = np.sqrt(power[:, 0] / np.maximum(power[:, 1], self.above**2))  # (LIFE.15)
        return Motion(velocity, cov, heading, np.clip(np.where(slow, self.slow_std, std), *self.std_bounds))

    def _told(self, points: Unexplained, W: NDArray, lanes: Lanes) -> Told:
        """What the range rates of the cells W (B, P) say of the velocity, whatever its prior."""
        rate, u = points.filled_rate, np.where(points.measured[:, None], points.sight, 0.0)
        middle = (W @ points.xy) / W.sum(1)[:, None]
        across = perpendicular(u)
        lever = dot(points.xy, across) - middle @ across.T  # (B, P) [m]
        w = W / (self.sigma_rate**2 + (self.turn_std * lever) ** 2)  # (LIFE.11)
        if lanes.curvature is None:
            S = (w @ (u[:, :, None] * u[:, None]).reshape(-1, 4)).reshape(-1, 2, 2)
            return S, w @ (u * rate[:, None]), w @ rate**2
        turn = -(lanes.curvature[:, None] * lever)[..., None] * unit(lanes.direction)[:, None]  # (B, P, 2)
        v = w[..., None] * (u + turn)  # (LIFE.50)
        return v.mT @ (u + turn), (v * rate[:, None]).sum(1), w @ rate**2


def fit(told: Told, mean: NDArray, cov: NDArray) -> Fit:
    """Velocity (..., B, 2), covariance and log evidence of what range rates told, under Gaussian priors.

    mean (..., B, 2) and cov (..., B, 2, 2) are those of the priors.
    """
    S, r, square = told
    information = np.linalg.inv(cov) + S  # (LIFE.11)
    Sm = (S @ mean[..., None])[..., 0]
    score = r - Sm  # (LIFE.11)
    posterior = np.linalg.inv(information)  # (LIFE.12)
    shift = (posterior @ score[..., None])[..., 0]  # (LIFE.12)
    chi2 = square - (2 * r * mean - Sm * mean + score * shift).sum(-1)  # (LIFE.13)
    log_det = np.linalg.slogdet(information)[1] + np.linalg.slogdet(cov)[1]  # (LIFE.13)
    return mean + shift, posterior, -0.5 * (chi2 + log_det)


def mixture(a: Sequence[NDArray], b: Sequence[NDArray]) -> tuple[NDArray, NDArray]:
    """Mean (B, 2) and covariance (B, 2, 2) of two Gaussians weighed by their evidence."""
    w = expit(b[2] - a[2])[:, None]  # (LIFE.29)
    d = b[0] - a[0]
    cov = (1 - w)[..., None] * a[1] + w[..., None] * b[1] + (w * (1 - w))[..., None] * outer(d)  # (LIFE.29)
    return a[0] + w * d, cov  # (LIFE.29)
