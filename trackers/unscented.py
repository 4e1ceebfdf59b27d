"""The unscented transform: moments of a function of a Gaussian from its values at sigma points.

Symbols and equations: card bspline_pmht, section 4, (8), (9) and (11), after Yao et al. (2021).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import wrap_angle
from trackers.linalg import symmetrize

LEAST_EIGENVALUE = 1e-14  # of a covariance that rounding has made indefinite


@dataclass(frozen=True)
class Scaling:
    """How far the sigma points lie out and what they weigh; not a tuning knob, card section 4."""

    alpha: float = 1.0
    beta: float = 2.0
    kappa: float = 0.0

    def reach(self, n: int) -> float:
        """Factor n + lambda of the covariance, lambda = alpha^2 (n + kappa) - n, in n dimensions."""
        reach = self.alpha**2 * (n + self.kappa)
        if not reach > 0:
            raise ValueError(f"alpha and kappa must make alpha^2 (n + kappa) positive, got {reach}; take kappa > -{n}")
        return reach

    def weights(self, n: int) -> tuple[NDArray, NDArray]:
        """Weights (2n + 1,) of the mean and of the covariance, (8)."""
        reach = self.reach(n)
        Wm = np.full(2 * n + 1, 0.5 / reach)
        Wm[0] = 1 - n / reach
        Wc = Wm.copy()
        Wc[0] += 1 - self.alpha**2 + self.beta
        return Wm, Wc


STANDARD = Scaling()


class Transformed(NamedTuple):
    """Moments of y = f(x) and how it goes with x."""

    mean: NDArray  # (..., k)
    cov: NDArray  # (..., k, k), without noise of f
    D: NDArray  # (..., n, k) cross covariance of x and y


def root(P: NDArray) -> NDArray:
    """Lower triangular L (..., n, n) with L L^T = P; eigenvalues are clipped where rounding took definiteness away."""
    P = symmetrize(P)
    try:
        return np.linalg.cholesky(P)
    except np.linalg.LinAlgError:
        value, vector = np.linalg.eigh(P)
        A = vector * np.sqrt(np.maximum(value, LEAST_EIGENVALUE))[..., None, :]
        R = np.linalg.qr(A.mT).R  # of rows that are definite R^T is their Cholesky root, but for signs
        sign = np.where(np.diagonal(R, axis1=-2, axis2=-1) < 0, -1.0, 1.0)
        return R.mT * sign[..., None, :]


def sigma_points(m: NDArray, P: NDArray, scaling: Scaling = STANDARD) -> NDArray:
    """Points (..., 2n + 1, n): the mean m (..., n), and it plus and minus the columns of a root of P (..., n, n)."""
    n = m.shape[-1]
    arms = np.sqrt(scaling.reach(n)) * root(P).mT
    centre = m[..., None, :]
    return np.concatenate([centre, centre + arms, centre - arms], -2)


def moments(X: NDArray, Y: NDArray, scaling: Scaling = STANDARD, angles: tuple[int, ...] = ()) -> Transformed:
    """Moments from sigma points X (..., 2n + 1, n) and their images Y (..., 2n + 1, k), (9), (11).

    Components of Y named in `angles` [rad] may be wrapped: they are averaged around the image of the mean.
    """
    Wm, Wc = scaling.weights(X.shape[-1])
    d = Y - Y[..., :1, :]
    for a in angles:
        d[..., a] = wrap_angle(d[..., a])
    shift = Wm @ d
    d = d - shift[..., None, :]
    weighted = Wc[:, None] * d
    D = (X - X[..., :1, :]).mT @ weighted
    return Transformed(Y[..., 0, :] + shift, symmetrize(d.mT @ weighted), D)


def transform(
    f: Callable[[NDArray], NDArray],
    m: NDArray,
    P: NDArray,
    scaling: Scaling = STANDARD,
    angles: tuple[int, ...] = (),
) -> Transformed:
    """Moments of f(x), x ~ N(m, P) with m (..., n); f takes points (..., 2n + 1, n) to (..., 2n + 1, k)."""
    X = sigma_points(m, P, scaling)
    return moments(X, f(X), scaling, angles)
