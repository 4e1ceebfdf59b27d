"""Motion models CV, CA and CT of a centroid with two vertices.

Equations: docs/methods/interacting-models.md, after Xu et al. (2023).
"""

import numpy as np
from numpy.typing import NDArray

from trackers.dra.parameters import Parameters, ProcessNoise
from trackers.dra.state import AX, AY, P1X, P2X, VX, VY, N, W, X, Y
from trackers.linalg import symmetrize

SMALL = 1e-4  # [rad] turned in a step, below which series are used
COMPONENTS = {"cv": (), "ca": (AX, AY), "ct": (W,)}  # of the state beyond position, velocity and vertices


def components(model: str, rotating_ca: bool) -> NDArray:
    """Which of the components (11,) the model has; the others are zero."""
    has = np.ones(N, bool)
    has[[AX, AY, W]] = False
    has[list(COMPONENTS[model])] = True
    has[W] |= model == "ca" and rotating_ca
    return has


def turn(w: NDArray, T: float) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """F = sin(wT) / w, g = (1 - cos(wT)) / w and their derivatives by w, each (...), of (IMM.4) and (IMM.6)."""
    small = np.abs(w * T) < SMALL
    v = np.where(small, 1.0, w)
    s, c = np.sin(v * T), np.cos(v * T)
    x = w * T
    a = np.where(small, T * (1 - x**2 / 6), s / v)
    b = np.where(small, x * T / 2 * (1 - x**2 / 12), (1 - c) / v)
    da = np.where(small, -(T**2) * x / 3, (T * c * v - s) / v**2)
    db = np.where(small, T**2 / 2 * (1 - x**2 / 4), (T * s * v - (1 - c)) / v**2)
    return a, b, da, db


def transition(model: str, m: NDArray, T: float, parameters: Parameters) -> tuple[NDArray, NDArray]:
    """Mean (..., 11) after T [s], and the matrix (..., 11, 11) that the covariance is multiplied with."""
    if model == "ct":
        return _coordinated_turn(m, T, parameters.turn_jacobian)
    F = np.eye(N)
    F[X, VX] = F[Y, VY] = T  # (IMM.2)
    F[AX, AX] = F[AY, AY] = F[W, W] = 0.0  # (IMM.2)
    if model == "ca":
        F[AX, AX] = F[AY, AY] = 1.0
        F[X, AX] = F[Y, AY] = T**2 / 2  # (IMM.3)
        F[VX, AX] = F[VY, AY] = T  # (IMM.3)
    moved = m @ F.T
    J = np.zeros((*m.shape, N)) + F
    if model == "ca" and parameters.rotating_ca:
        moved[..., W], J[..., W, W] = m[..., W], 1.0
        _turn_vertices(m, moved, J, T, column=True)
    return moved, J


def noise(q: ProcessNoise, T: float, step: float) -> NDArray:
    """Process noise (11, 11) of a time T [s]; the printed one for T = step.

    The acceleration is constant within T. The random walks (acceleration, yaw rate, vertices) have variances that grow
    with time.
    """
    G = np.array([T**2 / 2, T, np.sqrt(T / step)])
    Q = np.diag([0.0] * W + [q.yaw_rate * T / step] + 4 * [q.vertex * T / step])  # (IMM.7)
    Q[X:Y, X:Y] = Q[Y:W, Y:W] = q.accel * G[:, None] * G  # (IMM.7)
    return Q


def predict(model: str, m: NDArray, P: NDArray, T: float, parameters: Parameters) -> tuple[NDArray, NDArray]:
    """Mean (..., 11) and covariance (..., 11, 11) of one model T [s] later, (IMM.8)."""
    moved, J = transition(model, m, T, parameters)
    Q = noise(getattr(parameters, model), T, parameters.step)
    return moved, symmetrize(J @ P @ J.mT + Q)  # (IMM.8)


def _coordinated_turn(m: NDArray, T: float, column: bool) -> tuple[NDArray, NDArray]:
    w, vx, vy = m[..., W], m[..., VX], m[..., VY]
    a, b, da, db = turn(w, T)
    s, c = np.sin(w * T), np.cos(w * T)
    F = np.zeros((*m.shape, N))
    F[..., X, X] = F[..., Y, Y] = F[..., W, W] = 1.0
    F[..., X, VX] = F[..., Y, VY] = a  # (IMM.4)
    F[..., Y, VX], F[..., X, VY] = b, -b  # (IMM.4)
    F[..., VX, VX] = F[..., VY, VY] = c  # (IMM.4)
    F[..., VY, VX], F[..., VX, VY] = s, -s  # (IMM.4)
    moved = (F @ m[..., None])[..., 0]
    if column:  # not printed; without it the yaw rate is observable through range rates only
        F[..., X, W], F[..., Y, W] = da * vx - db * vy, db * vx + da * vy  # (IMM.6)
        F[..., VX, W], F[..., VY, W] = T * (-s * vx - c * vy), T * (c * vx - s * vy)  # (IMM.6)
    _turn_vertices(m, moved, F, T, column)
    return moved, F


def _turn_vertices(m: NDArray, moved: NDArray, J: NDArray, T: float, column: bool) -> None:
    """Rotate both vertices of m (..., 11) by the yaw rate: writes them into moved (..., 11) and J (..., 11, 11)."""
    s, c = np.sin(m[..., W] * T), np.cos(m[..., W] * T)
    for i in (P1X, P2X):
        px, py = m[..., i], m[..., i + 1]
        J[..., i, i] = J[..., i + 1, i + 1] = c
        J[..., i + 1, i], J[..., i, i + 1] = s, -s
        moved[..., i], moved[..., i + 1] = c * px - s * py, s * px + c * py  # (IMM.5)
        if column:
            J[..., i, W], J[..., i + 1, W] = -T * moved[..., i + 1], T * moved[..., i]  # (IMM.6)
