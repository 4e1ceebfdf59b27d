"""htg-rm: the random matrix with a hole whose sides are found from every scan; card section 4a.

Source: slides of the hierarchical truncated Gaussian with online bounds. The detections are shared out over the four
sides of the hole by expectation-maximisation; each side is then the root of a one-dimensional likelihood equation.
Sides that do not face the sensor are open to infinity.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfcx, log_ndtr

from trackers.batch import select
from trackers.estimate import Estimate
from trackers.htg.density import HTG, complement, log_density, log_mass
from trackers.htg.learned import LEAST_SHARE
from trackers.htg.pseudo import Hole, Sample, correct, fill, frame, mean_extent, recount, sample_of
from trackers.motion import PHI
from trackers.protocols import UpdateInfo
from trackers.random_matrix import RandomMatrix, RMState
from trackers.scan import Scan, check_scan

AXIS = np.array([0, 1, 0, 1])  # of the sides a1, a2, b1, b2: rear, right, front, left
SIGN = np.array([-1.0, -1.0, 1.0, 1.0])
PSEUDO_COUNT = 0.1  # of a side, in its share of the detections
NEWTON = 10  # steps; five reach rounding from the middle of the bracket


class OnlineState(NamedTuple):
    """A random matrix and the sides of its hole."""

    rm: RMState
    bounds: NDArray  # (..., 4) a1, a2, b1, b2 in unit coordinates, finite also for sides that are now open


class Sides(NamedTuple):
    """Detections against the four sides, all (..., M, 4) but the last two (..., 4)."""

    mu: NDArray  # where the source of the detection probably is, outwards
    sg: NDArray  # with this standard deviation
    mask: NDArray  # valid detection and facing side
    s: NDArray  # (..., 4) standard deviation of the source
    facing: NDArray  # (..., 4) bool


def hazard(x: NDArray) -> NDArray:
    """phi_n(x) / Phi(-x), the inverse Mills ratio, to the last digit in either tail."""
    return np.sqrt(2 / np.pi) / erfcx(x / np.sqrt(2))


def responsibilities(sides: Sides, bounds: NDArray, share: NDArray) -> NDArray:
    """Which side made which detection, (..., M, 4), rows sum to one under the mask."""
    log_g = log_ndtr((sides.mu - bounds[..., None, :]) / sides.sg) - log_ndtr(-bounds / sides.s)[..., None, :]
    log_g = np.where(sides.mask, log_g + np.log(share)[..., None, :], -np.inf)
    top = log_g.max(-1, keepdims=True)
    g = np.exp(log_g - np.where(np.isfinite(top), top, 0.0))
    total = g.sum(-1, keepdims=True)
    return g / np.where(total > 0, total, 1.0)


def best_bounds(sides: Sides, g: NDArray, cap: NDArray) -> NDArray:
    """Sides b (..., 4) in [0, cap] that maximise sum_j g_j [log Phi((mu_j - b) / sg) - log Phi(-b / s)].

    Newton's method on the derivative, kept in a bracket that shrinks.
    """
    W, s = g.sum(-2), sides.s

    def slope(b: NDArray) -> tuple[NDArray, NDArray]:
        x, y = b / s, (b[..., None, :] - sides.mu) / sides.sg
        h, k = hazard(x), hazard(y)
        first = W * h / s - (g * k / sides.sg).sum(-2)
        return first, W * h * (h - x) / s**2 - (g * k * (k - y) / sides.sg**2).sum(-2)

    low, high = np.zeros_like(s), cap
    at_zero, at_cap = slope(low)[0], slope(high)[0]
    b = 0.5 * (low + high)
    for _ in range(NEWTON):
        f, df = slope(b)
        low, high = np.where(f > 0, b, low), np.where(f > 0, high, b)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = b - f / df
        b = np.where((step >= low) & (step <= high), step, 0.5 * (low + high))
    return np.where(at_zero <= 0, 0.0, np.where(at_cap >= 0, cap, b))


@dataclass(frozen=True)
class HTGOnline:
    """Iterated pseudo-measurement update with the hole of this scan; `n_count` repairs its confidence."""

    rm: RandomMatrix = field(default_factory=lambda: RandomMatrix(rho=0.35))  # rho, noise, motion, memory, range rates
    iterations: int = 10
    n_count: bool = True  # information of the n true detections only, the card's repair; else the slides' update
    rounds: int = 3  # of expectation-maximisation in an iteration
    full_view: bool = False  # all four sides are seen, wherever the sensor is
    cap: float = 2.0  # [s] largest bound, in standard deviations of the source
    start: float = 0.7  # bounds of a new object
    least_weight: float = 0.3  # a side with fewer detections keeps its bound

    def init(self, estimate: Estimate) -> OnlineState:
        """State from a prior; raises ValueError for a prior that is not finite, positive, definite."""
        rm = self.rm.init(estimate)
        return OnlineState(rm, np.full((*rm.nu.shape, 4), self.start))

    def predict(self, state: OnlineState, dt: float) -> OnlineState:
        """Time update over dt [s] >= 0, coordinated turn."""
        return state._replace(rm=self.rm.predict(state.rm, dt))

    def update(self, state: OnlineState, scan: Scan) -> tuple[OnlineState, UpdateInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        check_scan(scan)
        s = sample_of(scan, self.rm.sigma)
        some = s._replace(n=np.maximum(s.n, 1))  # rows without a detection must stay regular
        xy = np.where(scan.mask[..., None], scan.xy, 0.0)
        noise = s.noise + np.where(s.n > 0, 0.0, 1.0)[..., None, None] * np.eye(2)
        Y = self.rm.rho * mean_extent(state.rm) + noise
        new, bounds = state.rm, state.bounds
        for _ in range(self.iterations):
            A = frame(mean_extent(new), new.m[..., PHI])
            p, bounds = self._hole(new, bounds, A, noise, xy, scan.mask, s)
            hole = Hole(np.maximum(np.exp(log_mass(p)), LEAST_SHARE), *complement(p._replace(r=0 * p.r)))
            count, mean, spread = fill(some, hole, new.m[..., :2], A, noise)
            new, eps, S = correct(state.rm, count, mean, spread, Y)
        if self.n_count:
            new = recount(state.rm, new, some.n, Y)
        m, P = self.rm.range_rates(new.m, new.P, scan, scan.xy)
        updated = OnlineState(new._replace(m=m, P=P), bounds)
        return select(s.n > 0, updated, state), UpdateInfo(s.n, eps, S)

    def _hole(
        self, rm: RMState, bounds: NDArray, A: NDArray, noise: NDArray, xy: NDArray, mask: NDArray, s: Sample
    ) -> tuple[HTG, NDArray]:
        """The density with the sides of this scan, and its bounds (..., 4) with the closed ones remembered."""
        into = np.linalg.inv(A)
        u = (xy - rm.m[..., None, :2]) @ into.mT
        r = np.diagonal(into @ noise @ into.mT, axis1=-2, axis2=-1)
        facing = self._facing(into, rm.m[..., :2], s.sensor)
        sides = self._sides(u, r, mask, facing)
        share = np.where(facing, 0.25, 1e-300)
        cap = np.full(facing.shape, self.cap * np.sqrt(self.rm.rho))
        for _ in range(self.rounds):
            g = responsibilities(sides, bounds, share)
            W = g.sum(-2)
            share = (W + PSEUDO_COUNT) / (W.sum(-1, keepdims=True) + 4 * PSEUDO_COUNT)
            bounds = np.where(self.least_weight > W, bounds, best_bounds(sides, g, cap))
        rho = np.full(facing.shape[:-1], self.rm.rho)
        p = HTG(rho, np.where(facing, bounds, np.inf), np.zeros_like(rho), r)
        return p, bounds

    def _facing(self, into: NDArray, centre: NDArray, sensor: NDArray) -> NDArray:
        """Sides (..., 4) whose outward normal meets the sensor; all of them in full view, or inside the body."""
        where = (into @ (sensor - centre)[..., None])[..., 0]
        facing = (SIGN * where[..., AXIS] > 1) | self.full_view
        return facing | ~facing.any(-1, keepdims=True)

    def _sides(self, u: NDArray, r: NDArray, mask: NDArray, facing: NDArray) -> Sides:
        k = self.rm.rho / (self.rm.rho + r)
        mu = (k[..., None, :] * u)[..., AXIS] * SIGN
        sg = np.broadcast_to(np.sqrt(k * r)[..., None, AXIS], mu.shape)
        s = np.full(facing.shape, np.sqrt(self.rm.rho))
        return Sides(mu, sg, mask[..., None] & facing[..., None, :], s, facing)

    def estimate(self, state: OnlineState) -> Estimate:
        """Box along the heading."""
        return self.rm.estimate(state.rm)

    def resize(self, state: OnlineState, size: NDArray, size_std: NDArray) -> OnlineState:
        """State with another size (..., 2) [m] of standard deviation size_std (..., 2) [m]."""
        return state._replace(rm=self.rm.resize(state.rm, size, size_std))

    def log_spatial(self, state: OnlineState, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""
        rm, e = state.rm, self.estimate(state)
        A = frame(mean_extent(rm), rm.m[..., PHI])[track]
        into = np.linalg.inv(A)
        sensor = np.broadcast_to(scan.pose[:, :2], (scan.mask.shape[-1], 2))[detection]
        facing = self._facing(into, rm.m[track, :2], sensor)
        C = scan.position_noise(self.rm.sigma)[detection] + e.cov[track, :2, :2]
        r = np.diagonal(into @ C @ into.mT, axis1=-2, axis2=-1)
        rho = np.full(len(track), self.rm.rho)
        p = HTG(rho, np.where(facing, state.bounds[track], np.inf), np.zeros(len(track)), r)
        u = (into @ (scan.xy[detection] - rm.m[track, :2])[..., None])[..., 0]
        return log_density(u, p) + np.log(np.abs(np.linalg.det(into)))
