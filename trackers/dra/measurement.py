"""Range, range rate and azimuth of points of the regions, and their unscented moments; card dra_imm, 3 and 7.

Symbols: card dra_imm, after Xu et al. (2023), eq. (7), (18)-(20). A sigma point moves the state or the place within a
region, never both, so everything follows from pieces per region that no other detection enters.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.dra.looks import Looks
from trackers.dra.matrix3 import inverse_and_log_det
from trackers.dra.regions import ALPHA, BETA, MIDDLE
from trackers.dra.state import P1, P2, SEEN, VX, W, X, Y

SPREAD = np.sqrt(3.0)  # c: sigma points at +- c standard deviations, those of s at exactly 0 and 1
POINTS = 1 + 2 * SEEN + 4  # the mean, both ways along every column of L, both ways along s1 and s2
RANGE, RATE, AZIMUTH = range(3)


class Pieces(NamedTuple):
    """Region i seen in look S: z = zbar_i + D_i u + noise of covariance B_i for a state x = xhat + L u, u ~ N(0, I)."""

    zbar: NDArray  # (B, K, S, 5, 3)
    D: NDArray  # (B, K, S, 5, 3, 9)
    B: NDArray  # (B, K, S, 5, 3, 3)


class Residuals(NamedTuple):
    """Every detection against every region."""

    nu: NDArray  # (B, K, 5, M, 3) z - zbar, azimuth wrapped
    log_prior: NDArray  # (B, K, M, 5) of the region, -inf outside its gate


def observe(q: NDArray, centre: NDArray, velocity: NDArray, yaw_rate: NDArray, looks: Looks) -> NDArray:
    """Eq. (7) at points q (B, K, 1, ..., 2) [m] from the centroid, range, rate, azimuth on a new axis before last.

    centre, velocity (B, K, 1, ..., 2), yaw_rate (B, K, 1, ...) of the body at each point; looks have S on axis 2. The
    last axis of points comes out last: (B, K, S, ..., 3, points). The azimuth is not wrapped.
    """
    tail = (1,) * (q.ndim - 5)
    B, S = looks.pose.shape[:2]
    pose = looks.pose.reshape(B, 1, S, *tail, 1, 3)
    moving, measured = looks.velocity.reshape(B, 1, S, *tail, 1, 2), looks.measured.reshape(B, 1, S, *tail, 1)
    x, y = centre[..., 0] - pose[..., 0] + q[..., 0], centre[..., 1] - pose[..., 1] + q[..., 1]
    vx = velocity[..., 0] - moving[..., 0] - yaw_rate * q[..., 1]
    vy = velocity[..., 1] - moving[..., 1] + yaw_rate * q[..., 0]
    distance = np.sqrt(x * x + y * y)
    h = np.empty((*x.shape[:-1], 3, x.shape[-1]))
    h[..., RANGE, :] = distance
    h[..., RATE, :] = (vx * x + vy * y) / np.maximum(distance, 1e-9) * measured
    h[..., AZIMUTH, :] = np.arctan2(y, x) - pose[..., 2]
    return h


def sigma_points(m: NDArray, L: NDArray) -> tuple[NDArray, NDArray]:
    """States (..., 11, 23) and the points q (..., 5, 23, 2) [m] of the regions that they stand for."""
    x = m[..., None] + L[..., :SEEN] @ _STEPS
    q = np.empty((2, *m.shape[:-1], *_ALPHA.shape))  # each coordinate in one piece
    for i in range(2):
        np.multiply(_ALPHA, x[..., None, P1[i], :], out=q[i])
        q[i] += _BETA * x[..., None, P2[i], :]
    return x, np.moveaxis(q, 0, -1)


def _places() -> NDArray:
    """The vector 1, s1, s2 (3, 23) of every sigma point."""
    s = np.repeat(MIDDLE[:, None], POINTS, 1)
    step = SPREAD / np.sqrt(12)
    s[1, -4:] += [step, -step, 0, 0]
    s[2, -4:] += [0, 0, step, -step]
    return s


def _differences() -> NDArray:
    """What turns the deviations of all points but the mean into D, o, e, E and their mean (22, 9 + 2 + 2 + 9 + 1)."""
    odd, even = [[1.0], [-1.0]], [[1.0], [1.0]]  # of the steps both ways, which alternate for places only
    state, place = np.eye(SEEN), np.eye(2)
    A = np.zeros((POINTS - 1, 2 * SEEN + 5))
    A[: 2 * SEEN, :SEEN], A[: 2 * SEEN, -SEEN - 1 : -1] = np.kron(odd, state), np.kron(even, state)
    A[2 * SEEN :, SEEN : SEEN + 2], A[2 * SEEN :, SEEN + 2 : SEEN + 4] = np.kron(place, odd), np.kron(place, even)
    A[:, -1] = 1 / SPREAD
    return A / (2 * SPREAD)


_ALPHA, _BETA = ALPHA @ _places(), BETA @ _places()  # (5, 23)
_STEPS = SPREAD * np.hstack([np.zeros((SEEN, 1)), np.eye(SEEN), -np.eye(SEEN), np.zeros((SEEN, 4))])  # (9, 23)
_DIFFERENCES = _differences()


def pieces(m: NDArray, L: NDArray, looks: Looks, independence: float = 1.0) -> Pieces:
    """Moments of the regions under states m (B, K, 11) with roots L (B, K, 11, 11) of their covariance, (18)-(20).

    The correlation of two detections' second-order terms is left out, which keeps everything positive definite for
    any number of detections (card, section 7: B = Bz + E E^T with b = 0). Of the information of range and azimuth
    only the share `independence` counts: on a real body detections crowd at a few places.
    """
    x, q = sigma_points(m, L)
    body = x[:, :, None, None]  # axes S and region
    place, velocity = body[..., X : W : Y - X, :].mT, body[..., VX : W : Y - X, :].mT
    h = observe(q[:, :, None], place, velocity, body[..., W, :], looks)  # (B, K, S, 5, 3, 23)
    h0 = h[..., :1]
    d = h[..., 1:] - h0
    _wrap(d[..., AZIMUTH, :])
    d = d @ _DIFFERENCES
    second = d[..., SEEN:-1]  # o, e and E
    B = second @ second.mT
    for i in (RANGE, RATE, AZIMUTH):
        B[..., i, i] += looks.R[:, None, :, None, i]
    if independence != 1:
        widen = np.where(np.arange(3) == RATE, 1.0, 1 / np.sqrt(independence))
        B *= widen * widen[:, None]
    return Pieces(h0[..., 0] + d[..., -1], np.ascontiguousarray(d[..., :SEEN]), B)


def residuals(pieces: Pieces, looks: Looks, log_prior: NDArray, gate: NDArray) -> Residuals:
    """Residuals of all detections; log_prior (B, S, 5), gate (B, K, M, 5)."""
    zbar = np.moveaxis(of_detection(pieces.zbar, looks), 2, -1)
    nu = looks.z.mT[:, None, None] - zbar  # (B, K, 5, 3, M)
    _wrap(nu[..., AZIMUTH, :])
    log_P = log_prior[np.arange(len(log_prior))[:, None], looks.look][:, None]
    return Residuals(nu.mT, np.where(gate, log_P, -np.inf))


def _wrap(angle: NDArray) -> None:
    """Take whole turns off angles [rad], in place; cheaper than a remainder."""
    angle -= 2 * np.pi * np.rint(angle / (2 * np.pi))


def of_detection(piece: NDArray, looks: Looks) -> NDArray:
    """Pieces (B, K, S, ...) as each detection has them, (B, K, M or 1, ...)."""
    if piece.shape[2] == 1:
        return piece
    rows = np.arange(len(piece))[:, None]
    return np.moveaxis(piece[rows, :, looks.look], 1, 2)


def transform(v: NDArray, A: NDArray, looks: Looks) -> NDArray:
    """Products v^T A (B, K, 5, M, n) of v (B, K, 5, M, m) with A (B, K, S, 5, m, n) of the look that each came with."""
    out = v @ A[:, :, 0]
    for s in range(1, A.shape[2]):
        out = np.where((looks.look == s)[:, None, None, :, None], v @ A[:, :, s], out)
    return out


def log_constant(looks: Looks) -> NDArray:
    """Half log (2 pi) times the numbers measured by each detection, (B, 1, M): rates not measured do not count."""
    measured = looks.measured[np.arange(len(looks.look))[:, None], looks.look]
    return 0.5 * np.log(2 * np.pi) * (2 + measured)[:, None]


def marginal(pieces: Pieces, seen: Residuals, looks: Looks) -> NDArray:
    """Log prior plus log likelihood (B, K, M, 5) of every detection alone in every region, N(z; zbar, D D^T + B)."""
    S_inv, log_det = inverse_and_log_det(pieces.D @ pieces.D.mT + pieces.B)
    d2 = np.einsum("...a,...a->...", transform(seen.nu, S_inv, looks), seen.nu).mT
    return seen.log_prior - 0.5 * (d2 + of_detection(log_det, looks)) - log_constant(looks)[..., None]
