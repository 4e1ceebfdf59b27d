"""The state of data-region association: motion, and two vertices of the body.

Equations: docs/methods/data-regions.md. p1, p2 are relative to the centroid, on global axes; p3 = -p1, p4 = -p2.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.filter import Note
from trackers.geometry import dot, perpendicular, unit, wrap_angle
from trackers.imm import moments
from trackers.linalg import ROUNDING, quadratic, symmetrize

#          left
#   p4 ------------- p1
#    |       o-->     |  front      p1 + p2 is the length with the heading, p1 - p2 the width to the left
#   p3 ------------- p2
#          right
X, VX, AX, Y, VY, AY, W, P1X, P1Y, P2X, P2Y = range(11)
PLACE, VELOCITY, ACCELERATION, P1, P2 = [X, Y], [VX, VY], [AX, AY], [P1X, P1Y], [P2X, P2Y]
KINEMATIC = [X, Y, VX, VY]
VERTICES = [P1X, P1Y, P2X, P2Y]
PAIRS = [PLACE, VELOCITY, ACCELERATION, P1, P2]  # the vectors that turn with the world
N = 11
ORDER = [X, VX, Y, VY, W, P1X, P1Y, P2X, P2Y, AX, AY]  # of roots: components no detection depends on come last
OBSERVED = 9  # components that detections depend on
LEAST_AXIS = 1e-3  # [m] an axis shorter than this has no direction
SLOW = 2.0  # [m/s] speed at which the variance of (DRA.31) is twice that of a fast body
CLEARLY = 2.0  # standard deviations of the velocity in (DRA.38)
STANDING = 1e-3  # [m/s] least speed in (DRA.31)


class DataRegionState(NamedTuple):
    """p(x) = sum_k mu_k N(x; m_k, P_k) over the motion models K, (DRA.1)."""

    mu: NDArray  # (..., K)
    m: NDArray  # (..., K, 11) x, vx, ax, y, vy, ay, yaw rate, p1, p2 [m, s, rad]
    P: NDArray  # (..., K, 11, 11)


class DataRegionInfo(NamedTuple):
    """Innovation of the mean detection, the modes, and the likelihood of the scan."""

    n: NDArray  # (...) detections used
    eps: NDArray  # (..., 2) [m] innovation
    S: NDArray  # (..., 2, 2) [m^2] its covariance
    mode: NDArray  # (..., K) probabilities of the motion models
    log_likelihood: NDArray  # (...) of all detections, 0 without any
    notes: tuple[Note, ...] = ()

    @property
    def nis(self) -> NDArray:
        """Normalised innovation squared (...), NaN without a detection."""
        return np.where(self.n > 0, quadratic(self.eps, self.S), np.nan)


def vertices(heading: NDArray, size: NDArray) -> NDArray:
    """Coordinates p1, p2 (..., 4) [m] of rectangles with heading (...) [rad] and size (..., 2) [m]."""
    along = unit(heading) * size[..., :1] / 2
    left = perpendicular(unit(heading)) * size[..., 1:] / 2
    return np.concatenate([along + left, along - left], -1)  # (DRA.2)


def vertex_covariance(heading: NDArray, size: NDArray, size_std: NDArray, heading_std: NDArray) -> NDArray:
    """Covariance (..., 4, 4) [m^2] of p1, p2 from independent size and heading, and their std [m], [rad]."""
    u = unit(heading)
    n = perpendicular(u)
    p = vertices(heading, size)
    J = np.empty((*heading.shape, 4, 3))
    J[..., 0] = np.concatenate([u, u], -1) / 2  # (DRA.3)
    J[..., 1] = np.concatenate([n, -n], -1) / 2  # (DRA.3)
    J[..., 2] = np.concatenate([perpendicular(p[..., :2]), perpendicular(p[..., 2:])], -1)  # (DRA.3)
    std = np.concatenate([size_std, heading_std[..., None]], -1)
    return (J * std[..., None, :] ** 2) @ J.mT  # (DRA.3)


def from_estimate(estimate: Estimate, accel_std: float, shear_std: float) -> tuple[NDArray, NDArray]:
    """Mean (..., 11) and covariance (..., 11, 11) of a prior; shear_std [m] keeps the four coordinates independent."""
    heading = estimate.pose[..., 2]
    m = np.zeros((*heading.shape, N))
    m[..., PLACE], m[..., VELOCITY] = estimate.pose[..., :2], estimate.velocity
    m[..., W] = estimate.yaw_rate
    m[..., VERTICES] = vertices(heading, estimate.size)
    P = np.zeros((*m.shape, N))
    P[..., np.array(KINEMATIC)[:, None], KINEMATIC] = estimate.cov
    P[..., ACCELERATION, ACCELERATION] = accel_std**2
    P[..., W, W] = estimate.yaw_rate_std**2
    shape = vertex_covariance(heading, estimate.size, estimate.size_std, estimate.heading_std)
    P[..., P1X:, P1X:] = shape + shear_std**2 * np.eye(4)  # (DRA.3)
    return m, P


def swung(m: NDArray, P: NDArray, variance: float) -> NDArray:
    """Covariance (..., 11, 11) with a variance [rad^2] added to the direction of the body, which keeps its shape.

    Noise on each vertex would let the body turn, too, but it would forget length and width.
    """
    p = m[..., P1X:]
    turning = np.stack([-p[..., 1], p[..., 0], -p[..., 3], p[..., 2]], -1)
    P = P.copy()
    P[..., P1X:, P1X:] += variance * turning[..., :, None] * turning[..., None, :]  # (DRA.33)
    return P


class Axes(NamedTuple):
    """Length and width of parallelograms, and their directions."""

    length: NDArray  # (...) [m]
    width: NDArray  # (...) [m]
    along: NDArray  # (..., 2) unit vector of p1 + p2
    left: NDArray  # (..., 2) unit vector of p1 - p2


def axes(m: NDArray) -> Axes:
    """Axes of states m (..., 11)."""
    s, d = m[..., P1X:P2X] + m[..., P2X:], m[..., P1X:P2X] - m[..., P2X:]
    length, width = np.sqrt(dot(s, s)), np.sqrt(dot(d, d))
    along = s / np.maximum(length, LEAST_AXIS)[..., None]
    left = d / np.maximum(width, LEAST_AXIS)[..., None]
    return Axes(length, width, along, left)


def to_estimate(state: DataRegionState) -> Estimate:
    """The mixture's mean and covariance, the parallelogram as a box along p1 + p2, (DRA.35)."""
    m, P = moments(state.m, state.P, state.mu)
    length, width, along, left = axes(m)
    shape = P[..., P1X:, P1X:]
    across = perpendicular(along)
    directions = (_both(along, 1.0), _both(left, -1.0), _both(across, 1.0))
    rounding = ROUNDING * np.trace(shape, axis1=-2, axis2=-1)  # of directions that are known far better than others
    length_var, width_var, turn_var = (
        np.maximum(((shape @ v[..., None])[..., 0] * v).sum(-1), rounding) for v in directions
    )  # (DRA.35)
    cov = P[..., np.array(KINEMATIC)[:, None], KINEMATIC]
    return Estimate(
        pose=np.concatenate([m[..., PLACE], np.arctan2(along[..., 1], along[..., 0])[..., None]], -1),  # (DRA.35)
        velocity=m[..., VELOCITY],
        yaw_rate=m[..., W],
        size=np.maximum(np.stack([length, width], -1), LEAST_AXIS),  # (DRA.35)
        cov=symmetrize(cov),
        size_std=np.sqrt(np.stack([length_var, width_var], -1)),
        heading_std=np.sqrt(turn_var) / np.maximum(length, LEAST_AXIS),  # (DRA.35)
        yaw_rate_std=np.sqrt(P[..., W, W]),
    )


def resized(state: DataRegionState, size: NDArray, size_std: NDArray) -> DataRegionState:
    """State with another size and std (..., 2) [m], everything else as it was, (DRA.36).

    The axes of all models are stretched by the same factors. Where the std grows, independent variance is added; where
    it shrinks, the deviation of the size shrinks, and its correlations with it.
    """
    old = to_estimate(state)
    m, P = state.m.copy(), state.P
    ratio = (size / old.size)[..., None, :]  # (..., 1, 2), the same for all models
    gain = np.minimum(size_std / old.size_std, 1.0)[..., None, :]
    added = np.maximum(size_std**2 - old.size_std**2, 0.0)[..., None, :]
    _, _, along, left = axes(m)
    along = np.stack([along, left], -2)  # (..., K, 2, 2) directions of length and width
    # Deviations across an axis (heading, shear) grow with it; those along it are the size itself.
    A = ratio[..., None, None] * np.eye(2) + (gain - ratio)[..., None, None] * along[..., :, None] * along[..., None, :]
    T = np.zeros(P.shape)
    T[..., :P1X, :P1X] = np.eye(P1X)
    T[..., P1X:, P1X:] = _on_vertices(A)
    P = T @ P @ T.mT  # (DRA.36)
    more = _on_vertices(added[..., None, None] * along[..., :, None] * along[..., None, :])
    P[..., P1X:, P1X:] += more / 2  # (DRA.36)
    M = _on_vertices(ratio[..., None, None] * np.eye(2) + np.zeros_like(A))
    m[..., P1X:] = (M @ m[..., P1X:, None])[..., 0]
    return DataRegionState(state.mu, m, symmetrize(P))


def _on_vertices(A: NDArray) -> NDArray:
    """The map (..., 4, 4) of (p1, p2) that is A[0] on p1 + p2 and A[1] on p1 - p2, A (..., 2, 2, 2)."""
    even, odd = A[..., 0, :, :] + A[..., 1, :, :], A[..., 0, :, :] - A[..., 1, :, :]
    return np.concatenate([np.concatenate([even, odd], -1), np.concatenate([odd, even], -1)], -2) / 2


def _both(v: NDArray, sign: float) -> NDArray:
    """Gradient (..., 4) of v . (p1 + sign p2)."""
    return np.concatenate([v, sign * v], -1)


def rectangle(m: NDArray, P: NDArray, std: float) -> tuple[NDArray, NDArray]:
    """Moments (..., 11), (..., 11, 11) given equal diagonals, which make a rectangle; std [m^2] of |p1|^2 - |p2|^2."""
    p1, p2 = m[..., P1], m[..., P2]
    H = np.zeros(m.shape)
    H[..., P1], H[..., P2] = 2 * p1, -2 * p2  # (DRA.30)
    return _condition(m, P, H, dot(p2, p2) - dot(p1, p1), np.full(m.shape[:-1], std**2))  # (DRA.30)


def along_velocity(m: NDArray, P: NDArray, std: float, least_speed: float) -> tuple[NDArray, NDArray]:
    """Moments (..., 11), (..., 11, 11) given that the length points along the velocity, with an error std [rad].

    The moments stay where the speed is not clearly above least_speed [m/s], (DRA.38); 0 leaves that test out.
    """
    a, v = m[..., P1] + m[..., P2], m[..., VELOCITY]
    a2, v2 = np.maximum(dot(a, a), 1e-6), np.maximum(dot(v, v), STANDING**2)
    H = np.zeros(m.shape)
    H[..., P1] = H[..., P2] = perpendicular(a) / a2[..., None]  # (DRA.31)
    H[..., VELOCITY] = -perpendicular(v) / v2[..., None]  # (DRA.31)
    turn = wrap_angle(np.arctan2(v[..., 1], v[..., 0]) - np.arctan2(a[..., 1], a[..., 0]))
    new = _condition(m, P, H, turn, std**2 * (1 + SLOW**2 / v2))  # (DRA.31)
    if least_speed == 0:
        return new
    spread = P[..., VELOCITY, VELOCITY].sum(-1)
    moving = v2 > least_speed**2 + CLEARLY**2 * spread  # (DRA.38)
    return np.where(moving[..., None], new[0], m), np.where(moving[..., None, None], new[1], P)


def _condition(m: NDArray, P: NDArray, H: NDArray, eps: NDArray, R: NDArray) -> tuple[NDArray, NDArray]:
    """Update by one number with residual eps (...), row H (..., 11) and variance R (...) > 0."""
    PH = (P @ H[..., None])[..., 0]
    S = (H * PH).sum(-1) + R  # (DRA.32)
    K = PH / S[..., None]  # (DRA.32)
    return m + K * eps[..., None], P - K[..., :, None] * PH[..., None, :]  # (DRA.32)
