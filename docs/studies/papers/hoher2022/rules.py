"""Other rules of the adaptation than the one that the tracker takes: the paper's, and a Bayesian one of ours.

Equations: docs/methods/virtual-measurements.md.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trackers.parameters import check_numbers
from trackers.random_matrix.adaptation import Difference, Variances, jacobian


@dataclass(frozen=True)
class Lms:
    """Least mean squares as in the paper: step along the difference itself, as if y~ were theta.

    Stable only where dy~/dtheta has eigenvalues of positive real part.
    """

    gain: float = 0.1
    iterations: int = 2

    def __post_init__(self) -> None:
        check_numbers(self, positive=("gain", "iterations"))

    def step(self, theta: NDArray, difference: Difference, variances: Variances) -> tuple[NDArray, NDArray]:
        """The identity (VM.18), and the identity for the sensitivity."""
        D = theta.shape[-1]
        one = np.broadcast_to(np.eye(D), (*theta.shape, D))
        return one, one


@dataclass(frozen=True)
class Bayes:
    """One Gauss-Newton step of the maximum a posteriori estimate: the gain follows from the variances.

    Ours, after the report's third proposal, a Bayesian extent: few detections move the contour little, and a parameter
    that they do not inform about stays as it was.
    """

    gain: float = 1.0
    iterations: int = 1
    delta: float = 0.02  # [m] of the central differences
    model_std: float = 0.3  # [m] of the virtual statistics: real bodies are no ellipses and no boxes

    def __post_init__(self) -> None:
        check_numbers(self, positive=("gain", "iterations", "delta", "model_std"))

    def step(self, theta: NDArray, difference: Difference, variances: Variances) -> tuple[NDArray, NDArray]:
        """P J^T (J P J^T + R)^-1 and J, with the variances on the diagonals of P and R."""
        J = jacobian(theta, difference, self.delta)
        PJ = variances.theta_var[..., :, None] * J.mT
        R = (variances.y_var + self.model_std**2)[..., None] * np.eye(theta.shape[-1])  # (VM.15)
        return np.linalg.solve((J @ PJ + R).mT, PJ.mT).mT, J  # (VM.15)
