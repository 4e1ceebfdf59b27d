"""Detections of many objects as one row an object, and their range, range rate and azimuth from points of the regions.

Equations: docs/methods/data-regions.md, after Xu et al. (2023). The moments of the measurement, linearised by the
unscented transform, depend on where the sensor is, how it moves, its noise, and whether it measured a range rate, but
not on the detection: detections that share these are a group, and the moments are worked out once a group. A sigma
point moves the state or the place within a region, never both, so they do not depend on other detections and regions.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.dra.regions import ALPHA, BETA, MIDDLE
from trackers.dra.state import OBSERVED, P1, P2, VX, W, X, Y
from trackers.geometry import unit
from trackers.linalg import inverse_and_log_det, outer
from trackers.scan import Scan


class FlatScan(NamedTuple):
    """M detections of B objects in up to S groups; objects with more detections come first."""

    z: NDArray  # (B, M, 3) range [m], range rate [m/s], azimuth [rad]; 0 for padding and rates not measured
    xy: NDArray  # (B, M, 2) [m]
    R_xy: NDArray  # (B, M, 2, 2) [m^2] covariance of xy
    n: NDArray  # (B,) > 0, falling; detections come before padding
    group: NDArray  # (B, M) int < S
    pose: NDArray  # (B, S, 3) of the sensor [m, m, rad]
    velocity: NDArray  # (B, S, 2) of the sensor [m/s]
    R: NDArray  # (B, S, 3) variances of range, range rate, azimuth; 1 for a rate that is not measured
    measured: NDArray  # (B, S) bool, whether the detections have a range rate


def flatten(scan: Scan, noise: tuple[float, float, float]) -> tuple[NDArray, FlatScan]:
    """Indices (B,) of the objects with detections among all, in flat order, and their detections.

    noise is the std of range [m], azimuth [rad] and range rate [m/s] where the scan does not state it. Detections are
    sorted, so that forms of the update that depend on their order do not depend on the scan's.
    """
    mask = scan.mask.reshape(-1, scan.mask.shape[-1])
    n = mask.sum(-1)
    hit = np.argsort(-n, kind="stable")[: (n > 0).sum()]
    M = int(n.max(initial=0))
    data = np.empty((*scan.mask.shape, 11))
    data[..., :3], data[..., 3:6] = scan.polar, scan.pose
    data[..., 6:8], data[..., 8:] = scan.velocity, scan.noise
    data = np.where(mask[hit][..., None], data.reshape(*mask.shape, 11)[hit], np.inf)
    order = np.lexsort((data[..., 2], data[..., 1], data[..., 0]), axis=-1)[:, :M]
    data = data[np.arange(len(data))[:, None], order]
    real = np.arange(M) < n[hit][:, None]
    data = np.where(real[..., None], data, data[:, :1])
    return hit, _grouped(data, n[hit], noise)


def _grouped(data: NDArray, n: NDArray, noise: tuple[float, float, float]) -> FlatScan:
    """From sorted rows (B, M, 11) of range, azimuth, rate, pose, velocity, noise; padding repeats the first."""
    polar, pose, velocity = data[..., :3], data[..., 3:6], data[..., 6:8]
    std = np.where(np.isnan(data[..., 8:]), noise, data[..., 8:])
    measured = np.isfinite(polar[..., 2])
    group, first = _distinct(np.concatenate([pose, velocity, std, measured[..., None]], -1))

    def of_group(field: NDArray) -> NDArray:
        return field[np.arange(len(field))[:, None], first]

    z = np.stack([polar[..., 0], np.where(measured, polar[..., 2], 0.0), polar[..., 1]], -1)
    R = of_group(std)[..., [0, 2, 1]] ** 2
    has_rate = of_group(measured)
    R[..., 1] = np.where(has_rate, R[..., 1], 1.0)
    xy, R_xy = _positions(polar, pose, std)
    return FlatScan(z, xy, R_xy, n, group, of_group(pose), of_group(velocity), R, has_rate)


def _positions(polar: NDArray, pose: NDArray, std: NDArray) -> tuple[NDArray, NDArray]:
    """Detections (B, M, 2) [m] in the tracking frame, and their covariances (B, M, 2, 2) [m^2]."""
    sight = unit(polar[..., 1] + pose[..., 2])
    along = std[..., 0] ** 2
    across = (polar[..., 0] * std[..., 1]) ** 2
    R = (along - across)[..., None, None] * outer(sight)
    R[..., 0, 0] += across
    R[..., 1, 1] += across
    return pose[..., :2] + polar[..., :1] * sight, R


def _distinct(rows: NDArray) -> tuple[NDArray, NDArray]:
    """Which of the distinct rows (B, M) of its object each row (B, M, F) is, and where (B, S) each first stands."""
    if (rows == rows[:, :1]).all():
        return np.zeros(rows.shape[:2], int), np.zeros((len(rows), 1), int)
    _, name = np.unique(rows.reshape(-1, rows.shape[-1]), axis=0, return_inverse=True)
    name = name.reshape(rows.shape[:2])
    order = np.argsort(name, axis=-1, kind="stable")
    ordered = np.take_along_axis(name, order, -1)
    begins = np.diff(ordered, axis=-1, prepend=-1) != 0
    number = np.cumsum(begins, -1) - 1
    group, first = np.zeros_like(name), np.zeros((len(name), int(number.max()) + 1), int)
    np.put_along_axis(group, order, number, -1)
    which = np.nonzero(begins)
    first[which[0], number[which]] = order[which]
    return group, first


SPREAD = np.sqrt(3.0)  # c: sigma points at +- c standard deviations, those of s at exactly 0 and 1
POINTS = 1 + 2 * OBSERVED + 4  # the mean, both ways along every column of L, both ways along s1 and s2
RANGE, RATE, AZIMUTH = range(3)


class LinearisedRegions(NamedTuple):
    """Measurement of each region by each group: z = zbar_i + D_i u + N(0, B_i), for x = xhat + L u, (DRA.19)."""

    zbar: NDArray  # (B, K, S, 5, 3)
    D: NDArray  # (B, K, S, 5, 3, 9)
    B: NDArray  # (B, K, S, 5, 3, 3)


class RegionResiduals(NamedTuple):
    """Every detection against every region."""

    nu: NDArray  # (B, K, 5, M, 3) z - zbar, azimuth wrapped
    log_prior: NDArray  # (B, K, M, 5) of the region, -inf outside its gate


def observe(q: NDArray, centre: NDArray, velocity: NDArray, yaw_rate: NDArray, flat: FlatScan) -> NDArray:
    """Range [m], range rate [m/s] and azimuth [rad] (B, K, S, ..., 3, points) of points of moving bodies, (DRA.5).

    q (B, K, 1, ..., points, 2) [m] from the centroid; centre, velocity (B, K, 1, ..., points, 2) and yaw_rate
    (B, K, 1, ..., points) of the body at each point; the groups of the scan come on axis 2. The azimuth is not wrapped,
    and the rate is 0 in groups that measure none.
    """
    tail = (1,) * (q.ndim - 5)
    B, S = flat.pose.shape[:2]
    pose = flat.pose.reshape(B, 1, S, *tail, 1, 3)
    moving, measured = flat.velocity.reshape(B, 1, S, *tail, 1, 2), flat.measured.reshape(B, 1, S, *tail, 1)
    x, y = centre[..., 0] - pose[..., 0] + q[..., 0], centre[..., 1] - pose[..., 1] + q[..., 1]
    vx = velocity[..., 0] - moving[..., 0] - yaw_rate * q[..., 1]
    vy = velocity[..., 1] - moving[..., 1] + yaw_rate * q[..., 0]
    distance = np.sqrt(x * x + y * y)
    h = np.empty((*x.shape[:-1], 3, x.shape[-1]))
    h[..., RANGE, :] = distance  # (DRA.5)
    h[..., RATE, :] = (vx * x + vy * y) / np.maximum(distance, 1e-9) * measured  # (DRA.5), (RR.7)
    h[..., AZIMUTH, :] = np.arctan2(y, x) - pose[..., 2]  # (DRA.5)
    return h


def sigma_points(m: NDArray, L: NDArray) -> tuple[NDArray, NDArray]:
    """States (..., 11, 23) at the sigma points, and the point q (..., 5, 23, 2) [m] of each region there, (DRA.15)."""
    x = m[..., None] + L[..., :OBSERVED] @ _STEPS  # (DRA.15)
    q = np.empty((2, *m.shape[:-1], *_ALPHA.shape))  # each coordinate in one piece
    for i in range(2):
        np.multiply(_ALPHA, x[..., None, P1[i], :], out=q[i])
        q[i] += _BETA * x[..., None, P2[i], :]  # (DRA.4)
    return x, np.moveaxis(q, 0, -1)


def _places() -> NDArray:
    """The vector 1, s1, s2 (3, 23) at every sigma point."""
    s = np.repeat(MIDDLE[:, None], POINTS, 1)
    step = SPREAD / np.sqrt(12)  # (DRA.15)
    s[1, -4:] += [step, -step, 0, 0]
    s[2, -4:] += [0, 0, step, -step]
    return s


def _differences() -> NDArray:
    """Matrix (22, 9 + 2 + 2 + 9 + 1) that turns h - h0 at all points but the mean into D, o, e, E and their mean."""
    odd, even = [[1.0], [-1.0]], [[1.0], [1.0]]  # of the steps both ways, which alternate for places only
    state, place = np.eye(OBSERVED), np.eye(2)
    A = np.zeros((POINTS - 1, 2 * OBSERVED + 5))
    A[: 2 * OBSERVED, :OBSERVED] = np.kron(odd, state)  # (DRA.16), D
    A[: 2 * OBSERVED, -OBSERVED - 1 : -1] = np.kron(even, state)  # (DRA.16), E
    A[2 * OBSERVED :, OBSERVED : OBSERVED + 2] = np.kron(place, odd)  # (DRA.16), o
    A[2 * OBSERVED :, OBSERVED + 2 : OBSERVED + 4] = np.kron(place, even)  # (DRA.16), e
    A[:, -1] = 1 / SPREAD  # (DRA.17)
    return A / (2 * SPREAD)


_ALPHA, _BETA = ALPHA @ _places(), BETA @ _places()  # (5, 23)
_STEPS = SPREAD * np.hstack(
    [np.zeros((OBSERVED, 1)), np.eye(OBSERVED), -np.eye(OBSERVED), np.zeros((OBSERVED, 4))]
)  # (9, 23)
_DIFFERENCES = _differences()


def linearise_regions(m: NDArray, L: NDArray, flat: FlatScan, independence: float = 1.0) -> LinearisedRegions:
    """Moments of the regions' measurements for states m (B, K, 11) with roots L (B, K, 11, 11) of their covariance.

    The correlation of the second-order terms of two detections is left out, which keeps joint covariances positive
    definite for any number of detections. Of the information of range and azimuth only the share `independence` counts:
    on a real body detections crowd at a few places.
    """
    x, q = sigma_points(m, L)
    body = x[:, :, None, None]  # axes S and region
    place, velocity = body[..., X : W : Y - X, :].mT, body[..., VX : W : Y - X, :].mT
    h = observe(q[:, :, None], place, velocity, body[..., W, :], flat)  # (B, K, S, 5, 3, 23)
    h0 = h[..., :1]
    d = h[..., 1:] - h0  # (DRA.15)
    _wrap(d[..., AZIMUTH, :])
    d = d @ _DIFFERENCES  # (DRA.16), (DRA.17)
    second = d[..., OBSERVED:-1]  # o, e and E
    B = second @ second.mT
    for i in (RANGE, RATE, AZIMUTH):
        B[..., i, i] += flat.R[:, None, :, None, i]  # (DRA.18)
    if independence != 1:
        widen = np.where(np.arange(3) == RATE, 1.0, 1 / np.sqrt(independence))
        B *= widen * widen[:, None]  # (DRA.18), W
    return LinearisedRegions(h0[..., 0] + d[..., -1], np.ascontiguousarray(d[..., :OBSERVED]), B)  # (DRA.17)


def residuals(regions: LinearisedRegions, flat: FlatScan, log_prior: NDArray, gate: NDArray) -> RegionResiduals:
    """Residuals of all detections; log_prior (B, S, 5), gate (B, K, M, 5)."""
    zbar = np.moveaxis(of_detection(regions.zbar, flat), 2, -1)
    nu = flat.z.mT[:, None, None] - zbar  # (B, K, 5, 3, M), (DRA.19)
    _wrap(nu[..., AZIMUTH, :])
    log_P = log_prior[np.arange(len(log_prior))[:, None], flat.group][:, None]
    return RegionResiduals(nu.mT, np.where(gate, log_P, -np.inf))


def _wrap(angle: NDArray) -> None:
    """Take whole turns off angles [rad], in place; cheaper than a remainder."""
    angle -= 2 * np.pi * np.rint(angle / (2 * np.pi))


def of_detection(field: NDArray, flat: FlatScan) -> NDArray:
    """A field (B, K, S, ...) of the groups as each detection has it, (B, K, M or 1, ...)."""
    if field.shape[2] == 1:
        return field
    rows = np.arange(len(field))[:, None]
    return np.moveaxis(field[rows, :, flat.group], 1, 2)


def transform(v: NDArray, A: NDArray, flat: FlatScan) -> NDArray:
    """Products v^T A (B, K, 5, M, n) of v (B, K, 5, M, m) with A (B, K, S, 5, m, n) of the group of each detection."""
    out = v @ A[:, :, 0]
    for s in range(1, A.shape[2]):
        out = np.where((flat.group == s)[:, None, None, :, None], v @ A[:, :, s], out)
    return out


def log_constant(flat: FlatScan) -> NDArray:
    """Half log (2 pi) times the numbers measured by each detection, (B, 1, M): rates not measured do not count."""
    measured = flat.measured[np.arange(len(flat.group))[:, None], flat.group]
    return 0.5 * np.log(2 * np.pi) * (2 + measured)[:, None]


def marginal(regions: LinearisedRegions, residuals: RegionResiduals, flat: FlatScan) -> NDArray:
    """Log prior plus log likelihood (B, K, M, 5) of every detection by itself in every region, (DRA.20)."""
    S_inv, log_det = inverse_and_log_det(regions.D @ regions.D.mT + regions.B)
    d2 = np.einsum("...a,...a->...", transform(residuals.nu, S_inv, flat), residuals.nu).mT
    return residuals.log_prior - 0.5 * (d2 + of_detection(log_det, flat)) - log_constant(flat)[..., None]  # (DRA.20)
