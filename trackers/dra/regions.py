"""The five regions of the body and the gates around them.

Equations: docs/methods/data-regions.md, after Xu et al. (2023). A point of region i is q = alpha p1 + beta p2 from the
centroid, alpha and beta linear in s1, s2, both even on [0, 1].

                left
        p4 ------------- p1
    rear |   interior    |  front     sides run p2 to p1, p3 to p2, p4 to p3, p1 to p4
        p3 ------------- p2
               right
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from trackers.dra.state import P1, P2, PLACE, Axes, axes
from trackers.estimate import Estimate
from trackers.geometry import cross, dot, perpendicular, rotation
from trackers.linalg import outer
from trackers.scan import Scan

REGIONS = 5
FRONT, RIGHT, REAR, LEFT, INTERIOR = range(REGIONS)
# (DRA.4): alpha and beta (region, 3) as weights of 1, s1, s2
ALPHA = np.array([[0, 1, 0], [-1, 1, 0], [0, -1, 0], [1, -1, 0], [1, -1, -1]], float)
BETA = np.array([[1, -1, 0], [0, 1, 0], [-1, 1, 0], [0, -1, 0], [0, 1, -1]], float)
MIDDLE = np.array([1.0, 0.5, 0.5])  # the mean of 1, s1, s2
# Corners (4, 2) that a side joins, as weights of p1, p2: p1, p2, p3, p4
CORNERS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]], float)
FROM, TO = [1, 2, 3, 0], [0, 1, 2, 3]  # corners at s1 = 0 and s1 = 1 of the four sides
TIE = 1e-6  # [m] off a corner two sides are as near: the first is taken, whatever the rounding
LEAST_SINE = 1e-3  # between the axes; a flat parallelogram has no coordinates
LEAST_DENSITY = 1e-300
ROOT_2PI = np.sqrt(2 * np.pi)
LEAST_PRIOR = 1e-6


def corners(m: NDArray) -> NDArray:
    """The four corners (..., 4, 2) [m] p1, p2, p3, p4 from the centroid, of states m (..., 11)."""
    p = np.stack([m[..., P1], m[..., P2]], -2)
    return CORNERS @ p


def region_moments(m: NDArray) -> tuple[NDArray, NDArray]:
    """Mean (..., 5, 2) [m] from the centroid and covariance (..., 5, 2, 2) [m^2] of points of each region."""
    p = np.stack([m[..., P1], m[..., P2]], -2)
    weight = np.stack([ALPHA, BETA], -1)  # (5, 3, 2)
    q = weight @ p[..., None, :, :]  # (..., 5, 3, 2): constant, along s1, along s2
    return MIDDLE @ q, (outer(q[..., 1, :]) + outer(q[..., 2, :])) / 12  # (DRA.6)


def gates(m: NDArray, xy: NDArray, R: NDArray, t: float, interior: float, sigmas: float) -> NDArray:
    """Which regions (..., M, 5) the detections xy (..., M, 2) [m] may come from; R (..., M, 2, 2) is their noise.

    t and `interior` scale the gates of sides and interior, `sigmas` their margins. Gates grow with the side that they
    belong to; the paper prints the width's for all four. A detection outside all gates belongs to the nearest side.
    """
    a = axes(m)
    e = oblique(a, xy - m[..., None, PLACE])
    half = np.stack([a.length, a.width])[..., None] / 2  # (2, ..., 1) along the length, along the width
    margin = sigmas * np.sqrt(np.stack([_spread(R, a.along), _spread(R, a.left)]))  # (DRA.8)
    beside = np.abs(e) <= (1 + 2 * t) * half + margin  # (2, ..., M) not beyond the ends
    thick = 2 * t * half + margin
    above, below = np.abs(e - half) <= thick, np.abs(e + half) <= thick
    inside = np.abs(e) <= interior * half + margin
    along, across = 0, 1
    found = np.empty((*e.shape[1:], REGIONS), bool)
    found[..., FRONT] = above[along] & beside[across]  # (DRA.9a)
    found[..., RIGHT] = below[across] & beside[along]  # (DRA.9a)
    found[..., REAR] = below[along] & beside[across]  # (DRA.9a)
    found[..., LEFT] = above[across] & beside[along]  # (DRA.9a)
    found[..., INTERIOR] = inside[along] & inside[across]  # (DRA.9b)
    lost = ~found.any(-1)
    if lost.any():
        nearest = (side_distance(e[:, lost], np.broadcast_to(half, e.shape)[:, lost]) + TIE * np.arange(4)).argmin(-1)
        found[(*np.nonzero(lost), nearest)] = True
    return found


def oblique(a: Axes, d: NDArray) -> NDArray:
    """Coordinates (2, ..., M) [m] of the vectors d (..., M, 2) along the axes of a parallelogram."""
    u, v = a.along[..., None, :], a.left[..., None, :]
    sine = cross(u, v)
    sine = np.where(np.abs(sine) < LEAST_SINE, LEAST_SINE, sine)
    return np.stack([cross(d, v), cross(u, d)]) / sine  # (DRA.7)


def side_distance(e: NDArray, half: NDArray) -> NDArray:
    """Distance (..., 4) [m] of oblique coordinates e (2, ...) [m] from the sides of a body of half axes half (2, ...).

    As if the axes were at right angles, like the gates: by the distance on the ground a sheared body that lags behind
    would shear more, and the error of a single motion model in the turn of Xu et al. (2023) grows by half.
    """
    along, across = e
    half_length, half_width = half
    past_end, past_flank = np.maximum(np.abs(e) - half, 0.0)
    front, rear = (np.hypot(along - s * half_length, past_flank) for s in (1, -1))  # (DRA.10)
    left, right = (np.hypot(across - s * half_width, past_end) for s in (1, -1))  # (DRA.10)
    return np.stack([front, right, rear, left], -1)


def _spread(R: NDArray, axis: NDArray) -> NDArray:
    """Variance (..., M) of noise R (..., M, 2, 2) along axis (..., 2)."""
    u, v = axis[..., None, 0], axis[..., None, 1]
    return u * u * R[..., 0, 0] + 2 * u * v * R[..., 0, 1] + v * v * R[..., 1, 1]


def log_density(e: NDArray, size: NDArray, std: NDArray, prior: NDArray) -> NDArray:
    """Log density (G,) [1/m^2] at e (G, 2) [m] from the centre, in body axes, of points even on sides or inside.

    size (G, 2) [m]; std (G, 2) [m] of the noise that blurs all regions; prior (G, 5) of the regions.
    """
    half = size / 2
    # On the far side of an axis both terms are near one: the mirrored tail keeps its digits.
    a = np.abs(e)
    even = (ndtr((half - a) / std) - ndtr((-half - a) / std)) / size  # (DRA.37a)
    ahead, behind = (np.exp(-0.5 * ((e - s * half) / std) ** 2) / (std * ROOT_2PI) for s in (1, -1))
    front, left = (ahead * even[:, ::-1]).T
    rear, right = (behind * even[:, ::-1]).T
    regions = np.stack([front, right, rear, left, even.prod(-1)], -1)
    return np.log(np.maximum((prior * regions).sum(-1), LEAST_DENSITY))  # (DRA.37b)


def log_spatial(
    estimate: Estimate, prior: NDArray, scan: Scan, track: NDArray, detection: NDArray, sigma: float, surface: float
) -> NDArray:
    """Log density (G,) [1/m^2] of pairs of track (G,) and detection (G,); prior (G, 5) of the regions of each pair.

    The noise of the detection (sigma [m] where unknown), the roughness of the surface [m] and the uncertainty of
    centre and size blur the density.
    """
    pose, size = estimate.pose[track], estimate.size[track]
    body = rotation(pose[:, 2])
    C = scan.position_noise(sigma)[detection] + estimate.cov[track, :2, :2]
    variance = (body * (C @ body)).sum(-2) + surface**2 + estimate.size_std[track] ** 2 / 4
    e = (body.mT @ (scan.xy[detection] - pose[:, :2])[..., None])[..., 0]
    return log_density(e, size, np.sqrt(variance), prior)


def uniform_prior(shape: tuple[int, ...]) -> NDArray:
    """Probabilities (..., 5), the same for all regions; 1 / (number of hypotheses), as printed, favours few gates."""
    return np.full((*shape, REGIONS), 1 / REGIONS)  # (DRA.11)


def ray_prior(m: NDArray, sensor: NDArray, near: float, far: float) -> NDArray:
    """Probabilities (..., 5) from the angles under which a sensor (..., 2) [m] sees the sides of a state m (..., 11).

    The visible sides share `near`, the hidden ones `far`, and the interior has the rest. A sensor inside the body makes
    all regions equally likely.
    """
    p = corners(m)
    a, b = p[..., FROM, :], p[..., TO, :]
    eye = (sensor - m[..., PLACE])[..., None, :]
    u, v = a - eye, b - eye
    angle = np.abs(np.arctan2(cross(u, v), dot(u, v)))  # (DRA.12)
    # Sides run counter-clockwise around p1, p4, p3, p2 where p1 is left of p2: their outward normal is to the right.
    normal = -perpendicular(b - a) * np.sign(cross(p[..., 1, :], p[..., 0, :]))[..., None, None]
    visible = dot(normal, eye - (a + b) / 2) > 0  # (DRA.12)
    P = _share(angle, visible, near) + _share(angle, ~visible, far)  # (DRA.13)
    rest = np.full((*P.shape[:-1], 1), 1 - near - far)  # (DRA.13)
    P = np.where(visible.any(-1, keepdims=True), np.concatenate([P, rest], -1), 1 / REGIONS)  # else inside
    P = np.maximum(P, LEAST_PRIOR)
    return P / P.sum(-1, keepdims=True)


def _share(angle: NDArray, where: NDArray, total: float) -> NDArray:
    """Shares (..., 4) of a probability in proportion to the angles there, (DRA.13)."""
    angle = np.where(where, angle, 0.0)
    return total * angle / np.maximum(angle.sum(-1, keepdims=True), 1e-12)
