"""MotionModes: a mixture of Gaussians, one a motion mode, that shares the spatial update of a contour filter.

The filter has the place, the modes velocity, heading and yaw rate. Equations: docs/methods/motion-modes.md.
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.filter import Gaussian
from trackers.geometry import dot, perpendicular, unit
from trackers.imm import chain, mix, moments, reweight
from trackers.linalg import outer, symmetrize
from trackers.motion.modes import Modes
from trackers.motion.places import corrected, likelihood
from trackers.motion.rates import Body, ScanRates
from trackers.motion.turn import OMEGA, PHI, ROUNDING, SPEED
from trackers.parameters import check_numbers
from trackers.scan import Scan

SIZE = OMEGA + 1  # first of the two components that hold the size
ANGLES = (PHI,)
AXLE_STD = 0.15  # of lambda, beyond the spread of the modes
CREEP = 1.0  # [m/s] below which slip turns the course no further
LEAST_SIZE = 0.8  # [m] of a mode; where sizes are linear, one may extrapolate below 0


class Mixture(NamedTuple):
    """p(x) = sum_k mu_k N(x; m_k, P_k)."""

    mu: NDArray  # (..., K)
    m: NDArray  # (..., K, 7)
    P: NDArray  # (..., K, 7, 7)
    ahead: NDArray  # (...) [m] driven for certain, forward positive, since its heading was last turned round
    curvature: NDArray  # (...) [1/m] of the lane that it keeps, positive to the left

    def gaussian(self) -> Gaussian:
        """The moments of all modes together."""
        return Gaussian(*moments(self.m, self.P, self.mu, ANGLES))  # (MODE.9)


@dataclass(frozen=True)
class MotionModes:
    """How the modes mix, and what a scan says of them."""

    modes: Modes = field(default_factory=Modes)
    rates: ScanRates = field(default_factory=ScanRates)
    stay: float = 0.98  # probability to keep the mode for `step`
    step: float = 0.1  # [s]
    course: float = 0.3  # share of a shift across the body that is taken for motion
    backwards: float = 2.0  # [m/s] faster than this nothing reverses; its heading is wrong
    backed: float = 0.5  # [m] driven backwards, from which on the heading is wrong: less may be the speed

    def __post_init__(self) -> None:
        check_numbers(self, positive=("step",))
        chain(len(self.modes.table), self.stay, 1.0)

    def born(self, g: Gaussian) -> Mixture:
        """The modes as at birth."""
        none = np.zeros(g.m.shape[:-1])
        return Mixture(*self.modes.at_birth(*g), none, none)

    def predicted(self, x: Mixture, place: Any, dt: float) -> Mixture:
        """The modes after dt > 0 [s]: mixing, then the motion of each; place is the contour filter."""
        v = x.m[..., SPEED]
        sure = np.maximum(np.abs(v) - 2 * np.sqrt(x.P[..., SPEED, SPEED]), 0.0)
        ahead = x.ahead + (x.mu * np.sign(v) * sure).sum(-1) * dt  # (MODE.30)
        first = np.eye(len(self.modes.table))[0]
        kept = chain(len(first), self.stay, dt / self.step)
        n = perpendicular(unit(x.m[..., 0, PHI]))
        across = dot(n, (x.P[..., 0, :2, :2] @ n[..., None])[..., 0])
        begun = self.modes.begun((x.mu * x.m[..., SPEED]).sum(-1), across, dt, kept[0, 0])
        Pi = kept + first[:, None] * begun[..., None, :]  # (MODE.29)
        Pi[..., 0, 0] -= begun.sum(-1)  # (MODE.29)
        m, P, mu = mix(x.m, x.P, x.mu, Pi, angles=ANGLES)
        m, P, fit = self.modes.moved(m, P, size_of(m, place.log_size)[..., 0], dt, x.curvature)
        P[..., [SIZE, SIZE + 1], [SIZE, SIZE + 1]] += place.size_walk**2 * dt  # (MODE.4)
        return Mixture(reweight(mu, fit), m, P, ahead, x.curvature)  # (MODE.32)

    def corrected(self, x: Mixture, before: Gaussian, after: Gaussian, place: Any, scan: Scan) -> Mixture:
        """The modes after an update of the contour filter, which took `before` to `after`, and the range rates."""
        m, P, log_l = corrected(x.m, x.P, likelihood(before, after), after)
        m = positive(m, place.log_size)
        size = size_of(m, place.log_size)
        m, P, more = self.rates.correct(x.mu, m, P, Body(self.modes.axle * size[..., 0], size), scan)
        return x._replace(mu=reweight(x.mu, log_l + more), m=positive(m, place.log_size), P=P)  # (MODE.22)

    def forward(self, x: Mixture) -> tuple[Mixture, Gaussian, NDArray]:
        """The modes, turned round where (...) the body would move backwards too fast, their moments, and where."""
        g = x.gaussian()
        v, std = g.m[..., SPEED], np.sqrt(g.P[..., SPEED, SPEED])
        turned = np.asarray((v < -self.backwards) & (-v > 3 * std) & (x.ahead < -self.backed))  # (MODE.23)
        if not turned.any():
            return x, g, turned
        sign = np.where(turned[..., None] & (np.arange(x.m.shape[-1]) == SPEED), -1.0, 1.0)[..., None, :]
        m = x.m * sign
        m[..., PHI] += np.pi * turned[..., None]  # (MODE.23)
        x = x._replace(m=m, P=x.P * sign[..., :, None] * sign[..., None, :], ahead=np.where(turned, 0.0, x.ahead))
        return x, x.gaussian(), turned

    def shifted(self, x: Mixture, d: NDArray) -> Mixture:
        """The modes with d (..., 2) [m], in the world, added to the centre.

        Of a body that is found beside its box again and again the heading is wrong: a share of the part of d across
        the body corrects heading, speed and yaw rate, as they are correlated with the place.
        """
        m, moving = x.m.copy(), slice(PHI, SIZE)
        n = perpendicular(unit(m[..., PHI]))
        gain = (x.P[..., moving, :2] @ np.linalg.solve(x.P[..., :2, :2], n[..., None]))[..., 0]  # (MODE.28)
        m[..., :2] += d[..., None, :]
        m[..., moving] += self.course * dot(n, d[..., None, :])[..., None] * gain  # (MODE.28)
        return x._replace(m=m)

    def estimate(self, box: Estimate, g: Gaussian, mu: NDArray) -> Estimate:
        """The box with the velocity of the centre, which the axle moves across when the body turns.

        g has the moments of the modes, mu (..., K) are their probabilities.
        """
        m, P = g
        v, omega = m[..., SPEED, None], m[..., OMEGA, None]
        along = unit(m[..., PHI])
        across = perpendicular(along)
        length = box.size[..., 0]
        mean = (mu * self.modes.axle).sum(-1)
        d = (length * mean)[..., None]
        J = np.zeros((*m.shape[:-1], 4, OMEGA + 1))
        J[..., 0, 0] = J[..., 1, 1] = 1.0
        J[..., 2:, PHI] = v * across - omega * d * along  # (MODE.25)
        J[..., 2:, SPEED], J[..., 2:, OMEGA] = along, d * across  # (MODE.25)
        cov = symmetrize(J @ P[..., : OMEGA + 1, : OMEGA + 1] @ J.mT) + ROUNDING
        axle_var = (mu * self.modes.axle**2).sum(-1) - mean**2 + AXLE_STD**2
        more = P[..., PHI, PHI] * P[..., SPEED, SPEED] + (length * m[..., OMEGA]) ** 2 * axle_var  # (MODE.26)
        cov[..., 2:, 2:] += more[..., None, None] * outer(across)  # (MODE.26)
        cov[..., :2, :2] = box.cov[..., :2, :2]  # with what the outline adds
        slip = (length * m[..., OMEGA]) ** 2 / np.maximum(m[..., SPEED] ** 2, CREEP**2)
        heading_std = np.sqrt(box.heading_std**2 + AXLE_STD**2 * slip)  # (MODE.31)
        return box._replace(velocity=v * along + omega * d * across, cov=cov, heading_std=heading_std)  # (MODE.24)


def size_of(m: NDArray, log: bool) -> NDArray:
    """Length and width (..., 2) [m] of means m (..., 7), which hold their logarithms or themselves."""
    return np.exp(m[..., SIZE:]) if log else m[..., SIZE:]


def positive(m: NDArray, log: bool) -> NDArray:
    """Means m (..., 7) with sizes of `LEAST_SIZE` at least: places and, by correlation, range rates may extrapolate."""
    return m if log else np.concatenate([m[..., :SIZE], np.maximum(m[..., SIZE:], LEAST_SIZE)], -1)


def resized(x: Mixture, old: Gaussian, new: Gaussian) -> Mixture:
    """The modes after the size of a filter with their moments was replaced, which took `old` to `new`."""
    before, after = (g.P.diagonal(axis1=-2, axis2=-1)[..., SIZE:] for g in (old, new))
    gain = np.ones(x.m.shape)
    gain[..., SIZE:] = np.sqrt(np.minimum(after / before, 1.0))[..., None, :]
    m, P = x.m.copy(), gain[..., :, None] * x.P * gain[..., None, :]  # (MODE.27)
    d = m[..., SIZE:] - old.m[..., None, SIZE:]
    m[..., SIZE:] = new.m[..., None, SIZE:] + gain[..., SIZE:] * d  # (MODE.27)
    P[..., [SIZE, SIZE + 1], [SIZE, SIZE + 1]] += np.maximum(after - before, 0.0)[..., None, :]  # (MODE.27)
    return x._replace(m=m, P=P)


def followed(x: Mixture, before: Gaussian, after: Gaussian) -> Mixture:
    """The modes where learning moved their moments from `before` to `after`."""
    moved = (after.m != before.m).any(-1)[..., None]
    m = x.m + np.where(moved, after.m - before.m, 0.0)[..., None, :]
    return x._replace(m=m, P=np.where(moved[..., None, None], after.P[..., None, :, :], x.P))


def without_rates(scan: Scan) -> Scan:
    """The scan as of a sensor that measures no range rates."""
    polar = scan.polar.copy()
    polar[..., 2] = np.nan
    return scan._replace(polar=polar)
