"""The unscented transform: moments of a function of a Gaussian from its values at sigma points.

Equations: docs/methods/smoothing.md, after Yao et al. (2021).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import wrap_angle
from trackers.linalg import symmetrize

LEAST_EIGENVALUE = 1e-14  # of a covariance that rounding has made indefinite


@dataclass(frozen=True)
class Scaling:
    """Distance and weights of the sigma points, (SM.1), (SM.2); results hardly depend on it."""

    alpha: float = 1.0
    beta: float = 2.0
    kappa: float = 0.0

    def reach(self, n: int) -> float:
        """Factor n + lambda of the covariance in n dimensions; raises ValueError where it is not positive."""
        reach = self.alpha**2 * (n + self.kappa)  # (SM.1)
        if not reach > 0:
            raise ValueError(f"alpha and kappa must make alpha^2 (n + kappa) positive, got {reach}; take kappa > -{n}")
        return reach

    def weights(self, n: int) -> tuple[NDArray, NDArray]:
        """Weights (2n + 1,) of the mean and of the covariance."""
        reach = self.reach(n)
        Wm = np.full(2 * n + 1, 0.5 / reach)  # (SM.2)
        Wm[0] = 1 - n / reach  # (SM.2)
        Wc = Wm.copy()
        Wc[0] += 1 - self.alpha**2 + self.beta  # (SM.2)
        return Wm, Wc


STANDARD = Scaling()


class Transformed(NamedTuple):
    """Moments of y = f(x), and its cross covariance with x."""

    mean: NDArray  # (..., k)
    cov: NDArray  # (..., k, k), without noise added to f
    D: NDArray  # (..., n, k) cross covariance of x and y


def root(P: NDArray) -> NDArray:
    """Lower triangular L (..., n, n) with L L^T = P; where rounding made P indefinite, its eigenvalues are clipped."""
    P = symmetrize(P)
    try:
        return np.linalg.cholesky(P)
    except np.linalg.LinAlgError:
        value, vector = np.linalg.eigh(P)
        A = vector * np.sqrt(np.maximum(value, LEAST_EIGENVALUE))[..., None, :]
        R = np.linalg.qr(A.mT).R  # R^T is a Cholesky root, but for the signs of its columns
        sign = np.where(np.diagonal(R, axis1=-2, axis2=-1) < 0, -1.0, 1.0)
        return R.mT * sign[..., None, :]


def sigma_points(m: NDArray, P: NDArray, scaling: Scaling = STANDARD) -> NDArray:
    """Points (..., 2n + 1, n): the mean m (..., n), and it plus and minus the columns of a root of P (..., n, n)."""
    n = m.shape[-1]
    offsets = np.sqrt(scaling.reach(n)) * root(P).mT
    centre = m[..., None, :]
    return np.concatenate([centre, centre + offsets, centre - offsets], -2)  # (SM.1)


def moments(X: NDArray, Y: NDArray, scaling: Scaling = STANDARD, angles: tuple[int, ...] = ()) -> Transformed:
    """Moments from sigma points X (..., 2n + 1, n) and their images Y (..., 2n + 1, k).

    Components of Y named in `angles` [rad] may be wrapped: they are averaged around the image of the mean.
    """
    Wm, Wc = scaling.weights(X.shape[-1])
    d = Y - Y[..., :1, :]
    for a in angles:
        d[..., a] = wrap_angle(d[..., a])
    shift = Wm @ d
    d = d - shift[..., None, :]
    weighted = Wc[:, None] * d
    D = (X - X[..., :1, :]).mT @ weighted  # (SM.3)
    return Transformed(Y[..., 0, :] + shift, symmetrize(d.mT @ weighted), D)  # (SM.3)
