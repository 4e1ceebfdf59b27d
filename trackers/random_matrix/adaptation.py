"""Rules by which a contour is moved until its virtual detections have the statistics of the real ones.

theta (..., D) are the parameters that are adapted, eps = y - y~(theta) (..., D) the difference between the statistics
of the real and of the virtual detections. A rule proposes a step M eps; `descend` takes it when the difference does not
grow and halves the gain when it does. A rejected step leaves theta AND eps as they were.
Equations: docs/methods/virtual-measurements.md, where M is G.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from trackers.parameters import check_numbers

# theta (..., C, D), C candidates side by side -> eps (..., C, D) and whether theta is a possible ellipse (..., C)
Difference = Callable[[NDArray], tuple[NDArray, NDArray]]


class Variances(NamedTuple):
    """Variances of parameters and statistics, for the rules that weigh them."""

    theta_var: NDArray  # (..., D) of theta before the scan
    y_var: NDArray  # (..., D) of y as a statistic of so many detections


class Rule(Protocol):
    """Chooses the steps."""

    @property
    def gain(self) -> float:
        """First step size K."""

    @property
    def iterations(self) -> int:
        """Number of steps, rejected ones included."""

    def step(self, theta: NDArray, difference: Difference, variances: Variances) -> tuple[NDArray, NDArray]:
        """The matrix M of the step M eps, and the sensitivity J = dy~/dtheta, both (..., D, D)."""


@dataclass(frozen=True)
class GaussNewton:
    """Damped Gauss-Newton: a descent direction wherever the numerical Jacobian is accurate."""

    gain: float = 0.3
    iterations: int = 1
    damping: float = 0.1
    delta: float = 0.02  # [m] of the central differences

    def __post_init__(self) -> None:
        check_numbers(self, positive=("gain", "iterations", "damping", "delta"))

    def step(self, theta: NDArray, difference: Difference, variances: Variances) -> tuple[NDArray, NDArray]:
        """(J^T J + damping I)^-1 J^T and J."""
        J = jacobian(theta, difference, self.delta)
        return np.linalg.solve(J.mT @ J + self.damping * np.eye(theta.shape[-1]), J.mT), J  # (VM.14)


def jacobian(theta: NDArray, difference: Difference, delta: float) -> NDArray:
    """J = dy~/dtheta (..., D, D) by central differences; zero where a body next to theta is impossible."""
    D = theta.shape[-1]
    shift = delta * np.concatenate([np.eye(D), -np.eye(D)])
    eps, valid = difference(theta[..., None, :] + shift)
    J = (eps[..., D:, :] - eps[..., :D, :]).mT / (2 * delta)  # (VM.13); eps falls where y~ grows
    return np.where(np.asarray(valid.all(-1))[..., None, None], J, 0.0)


class Descent(NamedTuple):
    """The parameters after the steps."""

    theta: NDArray  # (..., D)
    eps: NDArray  # (..., D) the remaining difference
    kept: NDArray  # (..., D) share of the error of each parameter that remains, 1 where no step was taken


def descend(rule: Rule, theta: NDArray, difference: Difference, active: NDArray, variances: Variances) -> Descent:
    """Apply a rule to theta (..., D) where active (...); rows are independent of each other."""
    eps, valid = _at(theta, difference)
    K = np.full(theta.shape[:-1], rule.gain)
    kept = np.ones_like(theta)
    active = active & valid
    for _ in range(rule.iterations):
        M, J = rule.step(theta, difference, variances)
        trial = theta + K[..., None] * (M @ eps[..., None])[..., 0]  # (VM.11)
        eps_trial, valid = _at(trial, difference)
        better = active & valid & ((eps_trial**2).sum(-1) <= (eps**2).sum(-1))  # (VM.12)
        accept = better[..., None]
        pull = K[..., None] * np.diagonal(M @ J, axis1=-2, axis2=-1)
        kept = np.where(accept, kept * np.clip(1 - pull, 0.0, 1.0), kept)  # (VM.16b)
        theta, eps = np.where(accept, trial, theta), np.where(accept, eps_trial, eps)
        K = np.where(better, K, K / 2)  # (VM.12)
    return Descent(theta, eps, kept)


def _at(theta: NDArray, difference: Difference) -> tuple[NDArray, NDArray]:
    eps, valid = difference(theta[..., None, :])
    return eps[..., 0, :], valid[..., 0]
