"""Koch's random matrix as the report prints it; docs/methods/virtual-measurements.md, (VM.21).

With S = H P H^T + sigma^2 / n the factor P is a covariance of each coordinate by itself, and `var_a` a variance.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trackers.linalg import I2
from trackers.random_matrix.koch import Koch


@dataclass(frozen=True)
class PrintedKoch(Koch):
    """Algorithm 1 of the report, lines 8 and 12 as printed."""

    var_a: float = 0.01  # [m^2/s^4]
    sigma: float = 0.5  # [m] sensor noise

    def innovation_factor(self, P: NDArray, n: NDArray) -> NDArray:
        """S (...) [m^2] as printed; the floor keeps it regular at sigma = 0."""
        return np.maximum(P[..., 0, 0] + self.sigma**2 / np.maximum(n, 1), 1e-12)  # (VM.21)

    def shape(self, X_hat: NDArray) -> NDArray:
        """The identity (..., 2, 2): P is a covariance itself."""
        return np.broadcast_to(I2, X_hat.shape)  # (VM.21)
