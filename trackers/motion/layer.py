"""SharedMotion: motion modes around a contour filter. The inner one has the place, the modes share its spatial update.

Equations: docs/methods/motion-modes.md.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.batch import select
from trackers.estimate import Estimate
from trackers.filter import Attentive, ContourFilter, Gaussian, Learning, Note, Restartable
from trackers.geometry import dot, perpendicular, unit
from trackers.imm import chain, mix, moments, reweight
from trackers.linalg import outer, symmetrize
from trackers.motion.modes import Modes
from trackers.motion.places import corrected, likelihood
from trackers.motion.rates import Body, ScanRates
from trackers.motion.turn import OMEGA, PHI, ROUNDING, SPEED
from trackers.parameters import check_numbers
from trackers.scan import Scan
from trackers.validation import guarded_predict, guarded_update

SIZE = OMEGA + 1  # first of the two components that hold the size
ANGLES = (PHI,)
AXLE_STD = 0.1  # of lambda, beyond the spread of the modes
LEAST_SIZE = 0.8  # [m] of a mode; where sizes are linear, one may extrapolate below 0


class SharedMotionState(NamedTuple):
    """p(x) = sum_k mu_k N(x; m_k, P_k), and the state of the inner filter with the moments of this mixture."""

    mu: NDArray  # (..., K)
    m: NDArray  # (..., K, 7)
    P: NDArray  # (..., K, 7, 7)
    inner: Any


class SharedMotionInfo(NamedTuple):
    """Information of the inner filter's update, and the modes."""

    n: NDArray  # (...) detections used
    eps: NDArray  # (..., 2) [m] innovation
    S: NDArray  # (..., 2, 2) [m^2] its covariance
    nis: NDArray  # (...) normalised innovation squared, NaN without a detection
    mode: NDArray  # (..., K) probabilities of the modes
    notes: tuple[Note, ...] = ()


@dataclass(frozen=True)
class SharedMotion:
    """Motion modes over `filter`, which sees the places of detections and not their range rates."""

    filter: Any  # a ContourFilter
    motion: Modes = field(default_factory=Modes)
    rates: ScanRates = field(default_factory=ScanRates)
    stay: float = 0.98  # probability to keep the mode for `step`
    step: float = 0.1  # [s]
    course: float = 0.3  # share of a shift across the body that is taken for motion
    backwards: float = 2.0  # [m/s] faster than this nothing reverses; its heading is wrong

    def __post_init__(self) -> None:
        check_numbers(self, positive=("step",))
        if not isinstance(self.filter, ContourFilter):
            raise ValueError(
                f"motion needs a filter of place, polar velocity and size, got {type(self.filter).__name__}; "
                "take htg-map or a pmht-spline"
            )
        chain(len(self.modes), self.stay, 1.0)

    @cached_property
    def learning(self) -> Learning | None:
        """The inner filter if it learns on the way; cached, because `isinstance` of a protocol is slow."""
        return self.filter if isinstance(self.filter, Learning) else None

    @cached_property
    def attentive(self) -> Attentive | None:
        """The inner filter if it needs to know which scans show an object completely."""
        return self.filter if isinstance(self.filter, Attentive) else None

    @property
    def modes(self) -> tuple[str, ...]:
        """Names of the modes."""
        return self.motion.names

    def init(self, estimate: Estimate) -> SharedMotionState:
        """State from a prior; raises ValueError for a prior that is not finite, positive, definite."""
        return self._started(self.filter.init(estimate))

    @guarded_predict
    def predict(self, state: SharedMotionState, dt: float) -> SharedMotionState:
        """Time update over dt [s] >= 0: mixing, then the motion of each mode; with dt = 0 nothing changes."""
        if not dt >= 0:
            raise ValueError(f"dt must be >= 0 s, got {dt}; scans come in the order of time")
        if dt == 0:
            return state
        Pi = chain(len(self.modes), self.stay, dt / self.step)
        m, P, mu = mix(state.m, state.P, state.mu, Pi, angles=ANGLES)
        m, P = self.motion.moved(m, P, self._size(m)[..., 0], dt)
        P[..., [SIZE, SIZE + 1], [SIZE, SIZE + 1]] += self.filter.size_walk**2 * dt  # (MODE.4)
        inner = state.inner if self.learning is None else self.learning.predict(state.inner, dt)  # its past too
        return self._collapsed(mu, m, P, inner)

    @guarded_update
    def update(self, state: SharedMotionState, scan: Scan) -> tuple[SharedMotionState, SharedMotionInfo]:
        """Measurement update; without a detection the state is returned as it came."""
        before, blind = self.filter.gaussian(state.inner), without_rates(scan)
        inner, after, info = self._located(state.inner, blind)
        some = np.asarray(scan.mask.any(-1))
        if not some.any():
            return state, informed(info, state.mu)
        m, P, log_l = corrected(state.m, state.P, likelihood(before, after), after)
        if not self.filter.log_size:
            m[..., SIZE:] = np.maximum(m[..., SIZE:], LEAST_SIZE)
        size = self._size(m)
        m, P, more = self.rates.correct(state.mu, m, P, Body(self.motion.axle * size[..., 0], size), scan)
        mu = reweight(state.mu, log_l + more)  # (MODE.22)
        m, P, g, turned = self._forward(mu, m, P)
        if self.learning is None:
            inner = self.filter.with_gaussian(inner, g)
        else:
            inner, info = self.learning.learned(inner, g, blind, info)
            after = self.learning.gaussian(inner)
            m, P = followed(m, P, g, after)
            if turned.any():
                fresh = self.learning.restart(inner, self.learning.estimate(inner))  # what it saw was turned round
                inner = select(turned, self.learning.with_gaussian(fresh, after), inner)
        new = SharedMotionState(mu, m, P, inner)
        new = new if some.all() else select(some, new, state)
        return new, informed(info, new.mu)

    def estimate(self, state: SharedMotionState) -> Estimate:
        """The inner filter's, with the velocity of the centre, which the axle moves across when the body turns."""
        box, (m, P) = self.filter.estimate(state.inner), self.filter.gaussian(state.inner)
        v, omega = m[..., SPEED, None], m[..., OMEGA, None]
        along = unit(m[..., PHI])
        across = perpendicular(along)
        length = box.size[..., 0]
        mean = (state.mu * self.motion.axle).sum(-1)
        d = (length * mean)[..., None]
        J = np.zeros((*m.shape[:-1], 4, OMEGA + 1))
        J[..., 0, 0] = J[..., 1, 1] = 1.0
        J[..., 2:, PHI] = v * across - omega * d * along  # (MODE.25)
        J[..., 2:, SPEED], J[..., 2:, OMEGA] = along, d * across  # (MODE.25)
        cov = symmetrize(J @ P[..., : OMEGA + 1, : OMEGA + 1] @ J.mT) + ROUNDING
        axle_var = (state.mu * self.motion.axle**2).sum(-1) - mean**2 + AXLE_STD**2
        more = P[..., PHI, PHI] * P[..., SPEED, SPEED] + (length * m[..., OMEGA]) ** 2 * axle_var  # (MODE.26)
        cov[..., 2:, 2:] += more[..., None, None] * outer(across)  # (MODE.26)
        cov[..., :2, :2] = box.cov[..., :2, :2]  # with what the outline adds
        return box._replace(velocity=v * along + omega * d * across, cov=cov)  # (MODE.24)

    @property
    def angles(self) -> tuple[int, ...]:
        """The heading."""
        return ANGLES

    def gaussian(self, state: SharedMotionState) -> Gaussian:
        """The moments of all modes together."""
        return self.filter.gaussian(state.inner)

    def with_gaussian(self, state: SharedMotionState, gaussian: Gaussian) -> SharedMotionState:
        """The state with another mean and covariance, the same in every mode."""
        K = len(self.modes)
        m, P = np.stack([gaussian.m] * K, -2), np.stack([gaussian.P] * K, -3)
        return state._replace(m=m, P=P, inner=self.filter.with_gaussian(state.inner, gaussian))

    def resize(self, state: SharedMotionState, size: NDArray, size_std: NDArray) -> SharedMotionState:
        """State with another size (..., 2) [m] of standard deviation size_std (..., 2) [m], in every mode."""
        inner = self.filter.resize(state.inner, size, size_std)
        old, new = self.filter.gaussian(state.inner), self.filter.gaussian(inner)
        before, after = (g.P.diagonal(axis1=-2, axis2=-1)[..., SIZE:] for g in (old, new))
        gain = np.ones(state.m.shape)
        gain[..., SIZE:] = np.sqrt(np.minimum(after / before, 1.0))[..., None, :]
        m, P = state.m.copy(), gain[..., :, None] * state.P * gain[..., None, :]  # (MODE.27)
        d = m[..., SIZE:] - old.m[..., None, SIZE:]
        m[..., SIZE:] = new.m[..., None, SIZE:] + gain[..., SIZE:] * d  # (MODE.27)
        P[..., [SIZE, SIZE + 1], [SIZE, SIZE + 1]] += np.maximum(after - before, 0.0)[..., None, :]  # (MODE.27)
        return state._replace(m=m, P=P, inner=inner)

    def shift(self, state: SharedMotionState, d: NDArray) -> SharedMotionState:
        """State with d (..., 2) [m], in the world, added to the centre in every mode.

        Of a body that is found beside its box again and again the heading is wrong: a share of the part of d across
        the body corrects heading, speed and yaw rate, as they are correlated with the place.
        """
        m, moving = state.m.copy(), slice(PHI, SIZE)
        n = perpendicular(unit(m[..., PHI]))
        gain = (state.P[..., moving, :2] @ np.linalg.solve(state.P[..., :2, :2], n[..., None]))[..., 0]  # (MODE.28)
        m[..., :2] += d[..., None, :]
        m[..., moving] += self.course * dot(n, d[..., None, :])[..., None] * gain  # (MODE.28)
        return self._collapsed(state.mu, m, state.P, self.filter.shift(state.inner, d))

    def restart(self, state: SharedMotionState, estimate: Estimate) -> SharedMotionState:
        """State that starts again from an estimate; the modes start anew, the inner filter keeps what it learned."""
        if isinstance(self.filter, Restartable):
            return self._started(self.filter.restart(state.inner, estimate))
        return self.init(estimate)

    def learn_where(self, state: SharedMotionState, where: NDArray) -> SharedMotionState:
        """State whose next update is by a scan that shows the objects where (...) is true completely."""
        if self.attentive is None:
            return state
        return state._replace(inner=self.attentive.learn_where(state.inner, where))

    def log_spatial(self, state: SharedMotionState, scan: Scan, track: NDArray, detection: NDArray) -> NDArray:
        """Log density (G,) [1/m^2] of the detections with indices detection (G,) under the tracks track (G,)."""
        return self.filter.log_spatial(state.inner, scan, track, detection)

    def _started(self, inner: Any) -> SharedMotionState:
        """The state over that of the inner filter, with the modes as at birth."""
        mu, m, P = self.motion.at_birth(*self.filter.gaussian(inner))
        return self._collapsed(mu, m, P, inner)

    def _collapsed(self, mu: NDArray, m: NDArray, P: NDArray, inner: Any) -> SharedMotionState:
        """The state, the inner filter with the moments of the mixture."""
        g = Gaussian(*moments(m, P, mu, ANGLES))  # (MODE.9)
        return SharedMotionState(mu, m, P, self.filter.with_gaussian(inner, g))

    def _size(self, m: NDArray) -> NDArray:
        """Length and width (..., 2) [m] of means m (..., 7)."""
        return np.exp(m[..., SIZE:]) if self.filter.log_size else m[..., SIZE:]

    def _located(self, inner: Any, scan: Scan) -> tuple[Any, Gaussian, Any]:
        """The inner filter's state, its Gaussian after the scan, and information; one that learns has not yet."""
        if self.learning is not None:
            return inner, *self.learning.located(inner, scan)
        new, info = self.filter.update(inner, scan)
        return new, self.filter.gaussian(new), info

    def _forward(self, mu: NDArray, m: NDArray, P: NDArray) -> tuple[NDArray, NDArray, Gaussian, NDArray]:
        """Modes with the heading turned round where (...) the body would move backwards too fast, and their moments."""
        g = Gaussian(*moments(m, P, mu, ANGLES))  # (MODE.9)
        v, std = g.m[..., SPEED], np.sqrt(g.P[..., SPEED, SPEED])
        turned = np.asarray((v < -self.backwards) & (-v > 3 * std))  # (MODE.23)
        if not turned.any():
            return m, P, g, turned
        sign = np.where(turned[..., None] & (np.arange(m.shape[-1]) == SPEED), -1.0, 1.0)[..., None, :]
        m = m * sign
        m[..., PHI] += np.pi * turned[..., None]  # (MODE.23)
        P = P * sign[..., :, None] * sign[..., None, :]
        return m, P, Gaussian(*moments(m, P, mu, ANGLES)), turned  # (MODE.9)


def followed(m: NDArray, P: NDArray, before: Gaussian, after: Gaussian) -> tuple[NDArray, NDArray]:
    """Means (..., K, 7) and covariances of modes that go where learning moved the moments of their mixture."""
    moved = (after.m != before.m).any(-1)[..., None]
    m = m + np.where(moved, after.m - before.m, 0.0)[..., None, :]
    return m, np.where(moved[..., None, None], after.P[..., None, :, :], P)


def without_rates(scan: Scan) -> Scan:
    """The scan as of a sensor that measures no range rates."""
    polar = scan.polar.copy()
    polar[..., 2] = np.nan
    return scan._replace(polar=polar)


def informed(info: Any, mu: NDArray) -> SharedMotionInfo:
    """The inner filter's information with the modes."""
    return SharedMotionInfo(info.n, info.eps, info.S, info.nis, mu, getattr(info, "notes", ()))
