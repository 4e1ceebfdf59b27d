"""htg-rm: the random matrix with a hole whose sides are found from every scan, Xia et al. (2020), ICASSP.

Expectation maximisation shares the detections out over the four sides of the hole; each bound is then the root of a
one-dimensional likelihood equation. Sides that do not face the sensor are open, their bounds infinite.
Equations: docs/methods/hierarchical-truncated-gaussians.md.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.batch import put, select, take
from trackers.estimate import Estimate
from trackers.filter import Extent, Gaussian, UpdateInfo
from trackers.htg import pseudo
from trackers.htg.density import HTG, log_density, truncated
from trackers.htg.learned import LEAST_SHARE
from trackers.htg.sides import BoundProblem, fit
from trackers.linalg import I2, sqrtm
from trackers.motion.turn import PHI
from trackers.parameters import check_numbers
from trackers.random_matrix.feldmann import RandomMatrix, RMState
from trackers.scan import Scan
from trackers.validation import guarded_update

AXIS = np.array([0, 1, 0, 1])  # of the sides a1, a2, b1, b2: rear, right, front, left
SIGN = np.array([-1.0, -1.0, 1.0, 1.0])


class OnlineState(NamedTuple):
    """A random matrix and the sides of its hole."""

    rm: RMState
    bounds: NDArray  # (..., 4) a1, a2, b1, b2 in unit coordinates; finite, also while a side is open


class FlatDetections(NamedTuple):
    """D detections in the order of their T objects, every one of which has at least one."""

    xy: NDArray  # (D, 2) [m]
    owner: NDArray  # (D,) object
    first: NDArray  # (T,) first detection of each object


@dataclass(frozen=True)
class HTGOnline:
    """Iterated pseudo-measurement update with the hole of this scan; `n_count` repairs its confidence."""

    rm: RandomMatrix = field(default_factory=lambda: RandomMatrix(rho=0.35))  # rho, noise, motion, range rates
    iterations: int = 10
    n_count: bool = True  # information of the n detections alone, (HTG.20); else of all N as in the slides
    rounds: int = 3  # of expectation-maximisation in an iteration
    full_view: bool = False  # no side is open, wherever the sensor is
    cap: float = 2.0  # [s] largest bound, in standard deviations of the source
    start: float = 0.7  # bounds of a new object
    least_weight: float = 0.3  # a side with fewer detections keeps its bound

    angles = RandomMatrix.angles

    def __post_init__(self) -> None:
        check_numbers(self, positive=("iterations", "rounds", "cap"))

    def init(self, estimate: Estimate) -> OnlineState:
        """State from a prior; raises ValueError for a prior that is not finite, positive, definite."""
        rm = self.rm.init(estimate)
        return OnlineState(rm, np.full((*rm.nu.shape, 4), self.start))

    def predict(self, state: OnlineState, dt: float) -> OnlineState:
        """Time update over dt [s] >= 0, coordinated turn."""
        return state._replace(rm=self.rm.predict(state.rm, dt))

    @guarded_update
    def update(self, state: OnlineState, scan: Scan) -> tuple[OnlineState, UpdateInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        every = pseudo.sample_of(scan, self.rm.sigma)
        some = every.n > 0
        s, (old, bounds) = take(every, some), take(state, some)
        detections = FlatDetections(
            xy=np.broadcast_to(scan.xy, (*scan.mask.shape, 2))[scan.mask],
            owner=np.repeat(np.arange(len(s.n)), s.n),
            first=np.cumsum(s.n) - s.n,
        )
        X_hat, cap, b = pseudo.mean_extent(old), self.cap * np.sqrt(self.rm.rho), bounds.T
        scale, m, X = pseudo.scale_of(sqrtm(X_hat), self.rm.rho * X_hat + s.noise), old.m, X_hat  # (HTG.18)
        for _ in range(self.iterations):
            A = pseudo.body_axes(X, m[:, PHI])  # (HTG.16)
            problem = self._problem(m, pseudo.inverse_axes(A), s, detections)
            b = fit(problem, b, cap, self.rounds, self.least_weight)  # (HTG.22), (HTG.23)
            count, mean, spread = pseudo.fill(s, self._hole(b, problem.facing), m[:, :2], A, s.noise)  # (HTG.17)
            last = pseudo.correct(old, scale, count, mean, spread)  # (HTG.19)
            m, X = last.m, last.X
        new = pseudo.posterior(old, last, scale, s.n if self.n_count else count)
        found: OnlineState = put(state, some, OnlineState(new, b.T))
        m, P = self.rm.rates.correct(found.rm.m, found.rm.P, scan, scan.xy)  # (RR.4)
        found = found._replace(rm=found.rm._replace(m=m, P=P))
        blank = UpdateInfo(every.n, np.zeros_like(every.mean), np.broadcast_to(np.eye(2), every.noise.shape))
        return select(some, found, state), put(blank, some, UpdateInfo(s.n, last.eps, last.S))

    def _problem(self, m: NDArray, into: NDArray, s: pseudo.Sample, detections: FlatDetections) -> BoundProblem:
        """The likelihood of the bounds of T objects, at the iterates m (T, 5); `into` (T, 2, 2) is A^-1."""
        rho, owner, (D, T) = self.rm.rho, detections.owner, (len(detections.owner), len(m))
        r = ((into @ s.noise) * into).sum(-1)  # (T, 2)
        k = rho / (rho + r)  # (HTG.3)
        precision = 1 / np.sqrt(k * r)  # 1 / s_k, (HTG.3)
        outwards = (k * precision)[..., None] * into
        reach, scale = np.zeros((4, D + T)), np.full((4, D + T), rho**-0.5)
        d = detections.xy - m[owner, :2]
        reach[2:, :D] = (outwards[owner] @ d[..., None])[..., 0].T  # mu / s_k
        reach[:2] = -reach[2:]
        scale[:2, :D] = scale[2:, :D] = precision.T[:, owner]
        facing = self._facing(into, m[:, :2], s.sensor)
        return BoundProblem(reach, scale, facing.T, np.concatenate([owner, np.arange(T)]), detections.first)

    def _hole(self, bounds: NDArray, facing: NDArray) -> pseudo.Hole:
        """The part of the source that the bounds (4, T) cut out, without sensor noise."""
        s = np.sqrt(self.rm.rho)
        t = np.where(facing, bounds, np.inf) / s
        mass, mean, var = truncated(-t[:2], t[2:])
        share = np.maximum(1 - mass[0] * mass[1], LEAST_SHARE)  # (HTG.6)
        return pseudo.Hole(share, s * mean.T, (s**2 * var.T)[..., None] * I2)  # (HTG.10) with R = 0

    def _facing(self, into: NDArray, centre: NDArray, sensor: NDArray) -> NDArray:
        """Sides (..., 4) that face the sensor; all of them in full view, or for a sensor inside the body."""
        where = (into @ (sensor - centre)[..., None])[..., 0]
        facing = (SIGN * where[..., AXIS] > 1) | self.full_view  # (HTG.25)
        return facing | ~facing.any(-1, keepdims=True)

    def estimate(self, state: OnlineState) -> Estimate:
        """Box along the heading."""
        return self.rm.estimate(state.rm)

    def resize(self, state: OnlineState, size: NDArray, size_std: NDArray) -> OnlineState:
        """State with another size (..., 2) [m] of standard deviation size_std (..., 2) [m]."""
        return state._replace(rm=self.rm.resize(state.rm, size, size_std))

    def shift(self, state: OnlineState, d: NDArray) -> OnlineState:
        """State with d (..., 2) [m] added to the centre."""
        return state._replace(rm=self.rm.shift(state.rm, d))

    def gaussian(self, state: OnlineState) -> Gaussian:
        """Mean and covariance of the motion."""
        return self.rm.gaussian(state.rm)

    def with_gaussian(self, state: OnlineState, gaussian: Gaussian) -> OnlineState:
        """The state with another mean and covariance of the motion."""
        return state._replace(rm=self.rm.with_gaussian(state.rm, gaussian))

    def extent(self, state: OnlineState) -> Extent:
        """The density of the extent."""
        return self.rm.extent(state.rm)

    def with_extent(self, state: OnlineState, extent: Extent) -> OnlineState:
        """The state with another density of the extent."""
        return state._replace(rm=self.rm.with_extent(state.rm, extent))

    def log_spatial(self, state: OnlineState, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""
        rm, e = state.rm, self.estimate(state)
        into = pseudo.inverse_axes(pseudo.body_axes(pseudo.mean_extent(rm), rm.m[..., PHI]))[track]
        sensor = np.broadcast_to(scan.pose[:, :2], (scan.mask.shape[-1], 2))[detection]
        facing = self._facing(into, rm.m[track, :2], sensor)
        C = scan.position_noise(self.rm.sigma)[detection] + e.cov[track, :2, :2]
        r = ((into @ C) * into).sum(-1)
        rho = np.full(len(track), self.rm.rho)
        p = HTG(rho, np.where(facing, state.bounds[track], np.inf), np.zeros(len(track)), r)
        u = (into @ (scan.xy[detection] - rm.m[track, :2])[..., None])[..., 0]
        return log_density(u, p) + np.log(np.abs(np.linalg.det(into)))  # (HTG.40)
