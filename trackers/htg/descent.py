"""Minimum of a smooth function within limits, by L-BFGS-B with restarts.

The likelihoods of this package have bent valleys, where the line search sometimes gives up far from the bottom, with a
gradient that is not zero and without an error. A fresh start at the same place forgets the curvature that led astray.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

Objective = Callable[[NDArray], tuple[float, NDArray]]
Limits = Sequence[tuple[float, float]]
Found = tuple[NDArray, float]


def descend(f: Objective, x: NDArray, box: Limits, flat: float, runs: int = 10, steps: int = 500) -> Found:
    """Minimum that is reached from x (n,), and its value.

    Args:
        f: value and gradient (n,).
        x: within the limits.
        box: limits of each coordinate.
        flat: a run of the optimiser that gains less is the last.
        runs: of the optimiser at most.
        steps: of one run at most.

    """
    settings = {"maxiter": steps, "ftol": flat / 100}
    value = np.inf
    for _ in range(runs):
        found = minimize(f, x, jac=True, method="L-BFGS-B", bounds=box, options=settings)
        x, gain, value = found.x, value - found.fun, float(found.fun)
        if gain < flat:
            break
    return x, value
