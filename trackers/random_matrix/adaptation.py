"""How a contour ellipse is moved until its virtual detections look like the real ones; card rm_vmm, section 5.

theta (..., D) are the parameters that are adapted, eps = y - y~(theta) (..., D) the difference between the statistics
of the real and of the virtual detections. A rule proposes a step M eps; `descend` takes it when the difference does not
grow and halves the gain when it does. A rejected step leaves theta AND eps as they were.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

# theta (..., C, D), C candidates side by side -> eps (..., C, D) and whether theta is a possible ellipse (..., C)
Difference = Callable[[NDArray], tuple[NDArray, NDArray]]


class Belief(NamedTuple):
    """How well parameters and statistics are known, for the rule that weighs them."""

    theta_var: NDArray  # (..., D) of theta before the scan
    y_var: NDArray  # (..., D) of y as a statistic of so many detections


class Rule(Protocol):
    """Where to step."""

    @property
    def gain(self) -> float:
        """First step size K."""

    @property
    def iterations(self) -> int:
        """Number of steps, rejected ones included."""

    def step(self, theta: NDArray, difference: Difference, belief: Belief) -> tuple[NDArray, NDArray]:
        """The matrix M of the step M eps, and the sensitivity J = dy~/dtheta, both (..., D, D)."""


@dataclass(frozen=True)
class Lms:
    """Least mean squares as in the paper: step along the difference itself, as if y~ were theta.

    Stable only where dy~/dtheta has eigenvalues of positive real part: with body moments, not with eigenvalues.
    """

    gain: float = 0.1
    iterations: int = 2
    shape_gain: float = 1.0  # extra gain on the components after the centre

    def step(self, theta: NDArray, difference: Difference, belief: Belief) -> tuple[NDArray, NDArray]:
        """The identity, with the extra gain; the sensitivity is taken for the identity too."""
        D = theta.shape[-1]
        one = np.broadcast_to(np.eye(D), (*theta.shape, D))
        return one * np.where(np.arange(D) < 2, 1.0, self.shape_gain)[:, None], one


@dataclass(frozen=True)
class GaussNewton:
    """Damped Gauss-Newton: a descent direction wherever the numerical Jacobian is accurate."""

    gain: float = 0.3
    iterations: int = 1
    damping: float = 0.1
    delta: float = 0.02  # [m] of the central differences

    def step(self, theta: NDArray, difference: Difference, belief: Belief) -> tuple[NDArray, NDArray]:
        """(J^T J + damping I)^-1 J^T and J."""
        J = jacobian(theta, difference, self.delta)
        return np.linalg.solve(J.mT @ J + self.damping * np.eye(theta.shape[-1]), J.mT), J


@dataclass(frozen=True)
class Bayes:
    """One Gauss-Newton step of the maximum a posteriori estimate: the gain follows from what is known already.

    Ours, after the report's third proposal, a Bayesian extent: few detections move the contour little, and what they
    do not show stays as the prior has it.
    """

    gain: float = 1.0
    iterations: int = 1
    delta: float = 0.02  # [m] of the central differences
    model_std: float = 0.3  # [m] of the virtual statistics: real bodies are no ellipses and no boxes

    def step(self, theta: NDArray, difference: Difference, belief: Belief) -> tuple[NDArray, NDArray]:
        """P J^T (J P J^T + R)^-1 and J, with the variances of the belief on the diagonals of P and R."""
        J = jacobian(theta, difference, self.delta)
        PJ = belief.theta_var[..., :, None] * J.mT
        R = (belief.y_var + self.model_std**2)[..., None] * np.eye(theta.shape[-1])
        return np.linalg.solve((J @ PJ + R).mT, PJ.mT).mT, J


def jacobian(theta: NDArray, difference: Difference, delta: float) -> NDArray:
    """J = dy~/dtheta (..., D, D) by central differences; zero where a body next to theta is impossible."""
    D = theta.shape[-1]
    shift = delta * np.concatenate([np.eye(D), -np.eye(D)])
    eps, valid = difference(theta[..., None, :] + shift)
    J = (eps[..., D:, :] - eps[..., :D, :]).mT / (2 * delta)  # eps falls where y~ grows
    return np.where(np.asarray(valid.all(-1))[..., None, None], J, 0.0)


class Descent(NamedTuple):
    """Where the steps led."""

    theta: NDArray  # (..., D)
    eps: NDArray  # (..., D) difference that is left
    kept: NDArray  # (..., D) share of the old error of each parameter that is left, 1 where no step was taken


def descend(rule: Rule, theta: NDArray, difference: Difference, active: NDArray, belief: Belief) -> Descent:
    """Apply a rule to theta (..., D) where active (...); rows are independent of each other."""
    eps, valid = _at(theta, difference)
    K = np.full(theta.shape[:-1], rule.gain)
    kept = np.ones_like(theta)
    active = active & valid
    for _ in range(rule.iterations):
        M, J = rule.step(theta, difference, belief)
        trial = theta + K[..., None] * (M @ eps[..., None])[..., 0]
        eps_trial, valid = _at(trial, difference)
        better = active & valid & ((eps_trial**2).sum(-1) <= (eps**2).sum(-1))
        accept = better[..., None]
        pull = K[..., None] * np.diagonal(M @ J, axis1=-2, axis2=-1)
        kept = np.where(accept, kept * np.clip(1 - pull, 0.0, 1.0), kept)
        theta, eps = np.where(accept, trial, theta), np.where(accept, eps_trial, eps)
        K = np.where(better, K, K / 2)
    return Descent(theta, eps, kept)


def _at(theta: NDArray, difference: Difference) -> tuple[NDArray, NDArray]:
    eps, valid = difference(theta[..., None, :])
    return eps[..., 0, :], valid[..., 0]
