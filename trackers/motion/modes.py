"""Five motion modes of one body: how each of them moves, and how fast it may turn.

Equations: docs/methods/motion-modes.md, sections 1 and 2. x = [px, py, phi, v, omega, s1, s2]: the place is the centre
of the box, v [m/s] the speed along the heading of the point that does not slide sideways, the axle.
"""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import perpendicular, unit
from trackers.linalg import outer, symmetrize
from trackers.motion.turn import OMEGA, PHI, SPEED, coordinated_turn
from trackers.parameters import check_numbers

SLOW = 3.0  # [m/s] below which a yaw rate may differ from 0 by `Modes.slow_yaw`, and turns begin less often
LEAST_BOUND = 1e-6  # [rad^2/s^2]
FULL_TURN = 0.3  # [rad/s] yaw rate that is possible at a speed from which the yaw rate walks as fast as it may


@dataclass(frozen=True)
class Mode:
    """One way to move; noises are densities, so that two half steps are about one step."""

    name: str
    speed_walk: float  # a [m/s/sqrt(s)]
    yaw_walk: float  # q [rad/s/sqrt(s)]
    axle: float  # lambda: the axle lies this share of the length behind the centre
    lateral: float  # L [m/s^2] acceleration across that bounds the yaw rate at speed
    onset: float = 0.0  # nu [1/s] rate at which it begins from the first mode, beside what the chain allows

    def __post_init__(self) -> None:
        check_numbers(self, positive=("lateral",))


FIVE = (
    Mode("straight", 0.1, 0.003, 0.25, 0.3),
    Mode("bend", 0.2, 0.03, 0.25, 3.0),
    Mode("brake", 2.0, 0.05, 0.25, 3.0),
    Mode("turn-centre", 0.3, 0.3, 0.0, 4.0, 2.0),
    Mode("turn-axle", 0.3, 0.3, 0.5, 4.0, 2.0),
)


@dataclass(frozen=True)
class Modes:
    """K modes, and what they have in common."""

    table: tuple[Mode, ...] = FIVE
    curvature: float = 0.15  # kappa [1/m], the sharpest turn
    slow_yaw: float = 0.02  # omega_0 [rad/s] of a standing body
    fast: float = 10.0  # [m/s] from which on the acceleration across falls with the speed
    bound_time: float = 1.0  # [s] in which the bound of the yaw rate counts as one measurement
    birth_yaw_std: float = 0.3  # [rad/s] of all modes but the first, which has the prior's
    told_std: float = 0.05  # [m] of the place across the body, at which turns begin half as often
    first: float = 0.69  # probability of the first mode at birth; the others share the rest

    def __post_init__(self) -> None:
        if not self.table:
            raise ValueError("table must hold at least one Mode; one mode is a filter without interaction")
        check_numbers(self, positive=[field.name for field in fields(self)])
        if self.first > 1:
            raise ValueError(f"Modes.first must be a probability, got {self.first}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the modes."""
        return tuple(mode.name for mode in self.table)

    @cached_property
    def axle(self) -> NDArray:
        """Lambda (K,)."""
        return np.array([mode.axle for mode in self.table])

    def begun(self, speed: NDArray, across: NDArray, dt: float, stays: float = 1.0) -> NDArray:
        """Probabilities (..., K) that the modes begin from the first one within dt [s], at a speed (...) [m/s].

        across (...) [m^2] is the variance of the place across the body: where it is little known, an onset cannot be
        told. stays is the probability to be in the first mode still, by the chain: at most half of it is left in a
        long gap.
        """
        told = self.told_std**2 / (self.told_std**2 + across)  # (MODE.33)
        onset = self._onset * (told * np.minimum(1.0, np.abs(speed) / SLOW))[..., None]
        total = onset.sum(-1, keepdims=True)
        some = np.minimum(1 - np.exp(-total * dt), stays / 2)
        return some * onset / np.maximum(total, 1e-9)  # (MODE.29)

    @cached_property
    def _walks(self) -> tuple[NDArray, NDArray]:
        return np.array([mode.speed_walk for mode in self.table]), np.array([mode.yaw_walk for mode in self.table])

    @cached_property
    def _onset(self) -> NDArray:
        return np.array([mode.onset for mode in self.table])

    @cached_property
    def _lateral(self) -> NDArray:
        return np.array([mode.lateral for mode in self.table])

    def at_birth(self, m: NDArray, P: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Probabilities (..., K), means (..., K, 7) and covariances (..., K, 7, 7) from one Gaussian."""
        K = len(self.table)
        rest = (1 - self.first) / max(K - 1, 1)
        mu = np.zeros((*m.shape[:-1], K)) + np.where(np.arange(K) == 0, self.first if K > 1 else 1.0, rest)
        m, P = np.repeat(m[..., None, :], K, -2), np.repeat(P[..., None, :, :], K, -3)
        own = np.where(np.arange(K) == 0, P[..., OMEGA, OMEGA], self.birth_yaw_std**2)
        bound = self._possible(m[..., SPEED] ** 2 + P[..., SPEED, SPEED]) + self.slow_yaw**2
        P[..., OMEGA, OMEGA] = np.minimum(own, bound)  # (MODE.8)
        return mu, m, P

    def moved(
        self, m: NDArray, P: NDArray, length: NDArray, dt: float, curvature: NDArray | float = 0.0
    ) -> tuple[NDArray, NDArray, NDArray]:
        """Means (..., K, 7), covariances and log likelihoods (..., K), by the bounds of the yaw rate, after dt > 0 [s].

        length (..., K) [m] is that of the body, curvature (...) [1/m] that of its lane.
        """
        d = (self.axle * length)[..., None]
        m5, F = coordinated_turn(m[..., : OMEGA + 1], dt)
        e, e_new = unit(m[..., PHI]), unit(m5[..., PHI])
        n, n_new = perpendicular(e), perpendicular(e_new)
        m5[..., :2] += d * (e_new - e)  # (MODE.2)
        F[..., :2, PHI] += d * (n_new - n)  # (MODE.3)
        F[..., :2, OMEGA] += d * dt * n_new  # (MODE.3)
        G = np.zeros((*P.shape[:-2], 7, 7)) + np.eye(7)
        G[..., : OMEGA + 1, : OMEGA + 1] = F
        P = G @ P @ G.mT
        speed, yaw = np.zeros((2, *m.shape))
        a, q = self._walks
        possible = np.sqrt(self.curvature**2 * (m[..., SPEED] ** 2 + P[..., SPEED, SPEED]) + self.slow_yaw**2)
        q = q * np.minimum(1.0, possible / FULL_TURN)  # (MODE.5)
        speed[..., :2], speed[..., SPEED] = dt / 2 * e, 1.0  # (MODE.4)
        yaw[..., :2], yaw[..., PHI], yaw[..., OMEGA] = d * dt / 2 * n_new, dt / 2, 1.0  # (MODE.4)
        P += dt * (a[:, None, None] ** 2 * outer(speed) + (q**2)[..., None, None] * outer(yaw))  # (MODE.4)
        return self._bounded(np.concatenate([m5, m[..., OMEGA + 1 :]], -1), P, dt, np.asarray(curvature)[..., None])

    def _possible(self, u: NDArray) -> NDArray:
        """Variance (..., K) of the yaw rate that a mean square speed u (..., K) [m^2/s^2] allows."""
        u = np.maximum(u, 1e-9)
        lateral = self._lateral**2 * np.minimum(1.0, self.fast**2 / u)  # (MODE.6)
        return np.minimum(self.curvature**2 * u, lateral / u)  # (MODE.6)

    def _bounded(self, m: NDArray, P: NDArray, dt: float, curvature: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Moments after a pseudo-measurement of the yaw rate of the lane, and how likely (..., K) it is."""
        u = m[..., SPEED] ** 2 + P[..., SPEED, SPEED]
        B = np.maximum(self._possible(u) + self.slow_yaw**2 * (u < SLOW**2), LEAST_BOUND)  # (MODE.6)
        off = m[..., OMEGA] - curvature * m[..., SPEED]  # (MODE.34)
        row = P[..., OMEGA] - curvature[..., None] * P[..., SPEED]  # (MODE.34)
        S = row[..., OMEGA] - curvature * row[..., SPEED] + B * self.bound_time / dt
        fit = -0.5 * off**2 / S  # (MODE.32)
        gain = row / S[..., None]  # (MODE.7)
        m = m - gain * off[..., None]  # (MODE.7)
        return m, symmetrize(P - gain[..., :, None] * row[..., None, :]), fit  # (MODE.7)
