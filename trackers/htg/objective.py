"""The log posterior of htg-map for many objects at once, over one flat list of detections.

The valid detections form one list of G, sorted by object: half of a padded array would be evaluated for nothing.
Equations: docs/methods/hierarchical-truncated-gaussians.md.

xi = [px, py, phi, v, omega, log l, log w]: centre [m], heading [rad], speed [m/s], yaw rate [rad/s], size [m].
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.htg.bins import HTGTable, UnitFrame, growth, log_masses, warp
from trackers.htg.density import HTG, Prepared, evaluate, lift, prepare, turned
from trackers.range_rate import polar_gradient
from trackers.scan import Scan

PX, PY, PHI, SPEED, OMEGA, LOG_L, LOG_W = range(7)
RATE_ROWS = [0, 1 + PHI, 1 + SPEED, 1 + OMEGA]  # of a value and its gradient
SPATIAL = np.array([PX, PY, PHI, LOG_L, LOG_W])  # components that the position of a detection depends on
LEVELS = np.array([0.0, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0])  # noise variances in unit coordinates, along one axis
SWITCH = np.sqrt(np.maximum(LEVELS[:-1], 1e-3) * LEVELS[1:])  # between neighbours; the geometric mean
SPAN, STEP, MOST = 4.5, 0.7, 160  # grid: half width and spacing in standard deviations, points along an axis


class Points(NamedTuple):
    """G detections in the order of their objects, every one of which has at least one."""

    row: NDArray  # (G,) object
    start: NDArray  # (N,) first detection of each object
    z: NDArray  # (2, G) [m]
    sensor: NDArray  # (2, G) [m]
    sight: NDArray  # (2, G) unit lines of sight
    variance: NDArray  # (2, G) [m^2] noise along and across the line of sight
    rate: NDArray  # (G,) [m/s] over ground, NaN: not measured

    def total(self, value: NDArray) -> NDArray:
        """Sums over the detections of each object: (..., G) to (..., N)."""
        return np.add.reduceat(value, self.start, -1)


def flatten(scan: Scan, sigma: float) -> tuple[NDArray, Points]:
    """Flat indices (N,) of the objects with a detection, and their detections; unknown noise is sigma [m]."""
    place = np.nonzero(scan.mask)
    G = len(place[-1])
    lead, M = scan.mask.shape[:-1], scan.mask.shape[-1]
    flat = np.ravel_multi_index(place[:-1], lead) if lead else np.zeros(G, int)

    def pick(a: NDArray) -> NDArray:
        return np.broadcast_to(a, (*lead, M, a.shape[-1]))[place].T

    polar, pose, velocity, noise = (pick(a) for a in (scan.polar, scan.pose, scan.velocity, scan.noise))
    angle = polar[1] + pose[2]
    sight = np.stack([np.cos(angle), np.sin(angle)])
    std = np.stack([noise[0], polar[0] * noise[1]])
    variance = np.where(np.isnan(std), sigma, std) ** 2
    start = np.flatnonzero(np.diff(flat, prepend=-1))
    row = np.repeat(np.arange(len(start)), np.diff(start, append=G))
    rate = polar[2] + (sight * velocity).sum(0)
    return flat[start], Points(row, start, pose[:2] + polar[0] * sight, pose[:2], sight, variance, rate)


class PlacedDensity(NamedTuple):
    """The density of each of G detections, chosen at the predicted state and kept during one update."""

    bin: NDArray  # (G,) of the table
    noise: NDArray  # (2, G) variances in unit coordinates along the turned axes
    frame: UnitFrame | None  # leaves (2, 1, G); None for the plain unit coordinates of the paper, e / half
    prepared: Prepared


def shape_of(table: HTGTable, xi: NDArray, points: Points) -> PlacedDensity:
    """Bins, noise and prepared densities of the detections under the states xi (N, 7)."""
    x = np.take(xi.T, points.row, -1)
    size = np.exp(x[LOG_L:]).T
    index = table.bin_at(x[:PHI].T, x[PHI], size[:, 0], points.sensor.T)
    p = table.of(index)
    frame = table.frame(index)
    scale, _ = warp(size / 2, frame)
    noise = body_noise(scale.T, x[PHI], p.theta, points)
    inside = None if table.plain else UnitFrame(*(leaf.T[:, None] for leaf in frame))
    return PlacedDensity(index, noise, inside, prepare(lift(p, 2), noise.T[None], log_masses(table)[index]))


def body_noise(scale: NDArray, phi: NDArray, theta: NDArray, points: Points) -> NDArray:
    """Noise variances (2, G) in unit coordinates along axes turned by theta (G,).

    scale (2, G) [m] of the unit coordinates, phi (G,) [rad] headings.
    """
    along = turned(points.sight, np.cos(phi), np.sin(phi))  # line of sight in body axes
    across = np.stack([-along[1], along[0]])
    along, across = along / scale, across / scale
    if theta.any():
        c, s = np.cos(theta), np.sin(theta)
        along, across = turned(along, c, s), turned(across, c, s)
    return points.variance[0] * along**2 + points.variance[1] * across**2  # (HTG.31)


class Objective(NamedTuple):
    """Log posterior of N objects given all their detections, as a function of the states."""

    points: Points
    shape: PlacedDensity
    mean: NDArray  # (N, 7) predicted
    precision: NDArray  # (N, 7, 7) inverse of the predicted covariance
    rate_std: float
    rate_clip: float

    @property
    def measured(self) -> bool:
        """Whether there is any range rate."""
        return bool(np.isfinite(self.points.rate).any())

    def evaluate(self, xi: NDArray) -> tuple[NDArray, NDArray]:
        """Log posterior (S, N), up to a constant, and its gradient (S, N, 7) at the states xi (S, N, 7)."""
        x = self.spread(xi)
        sums = self.points.total(self.places(x))
        if self.measured:
            sums[RATE_ROWS] += self.points.total(self.rates(x))
        d = xi - self.mean
        pull = (self.precision @ d[..., None])[..., 0]
        return sums[0] - 0.5 * (d * pull).sum(-1), sums[1:].transpose(1, 2, 0) - pull  # (HTG.30)

    def spread(self, xi: NDArray) -> NDArray:
        """The states xi (..., N, 7) of the objects of the detections, (8, ..., G).

        Position, cosine and sine of the heading, speed, yaw rate, half length and width.
        """
        rows = np.empty((8, *xi.shape[:-1]))
        rows[0], rows[1], rows[4], rows[5] = (xi[..., i] for i in (PX, PY, SPEED, OMEGA))
        rows[2], rows[3] = np.cos(xi[..., PHI]), np.sin(xi[..., PHI])
        rows[6], rows[7] = xi[..., LOG_L], xi[..., LOG_W]
        rows[6:] = 0.5 * np.exp(rows[6:])
        return rows.take(self.points.row, -1)

    def places(self, x: NDArray) -> NDArray:
        """Log likelihood of the position of each detection and its gradient, (1 + 7, S, G)."""
        _, _, frame, prepared = self.shape
        c, s, half = x[2], x[3], x[6:]
        e = turned(self.points.z[:, None] - x[:2], c, s)
        h, shift = (half, 0.0) if frame is None else warp(half, frame)
        u = (e - shift) / h  # (HTG.14)
        log_p, g = evaluate(u, prepared)
        terms = np.zeros((8, *log_p.shape))
        terms[0] = log_p - np.log(h[0] * h[1])  # (HTG.8)
        moved = g / h
        np.negative(turned(moved, c, -s), out=terms[1:3])  # (HTG.32), centre
        terms[3] = moved[0] * e[1] - moved[1] * e[0]  # (HTG.32), heading
        terms[6:] = -1.0 - g * u  # (HTG.32), sizes in the coordinates of the paper
        if frame is not None:
            wider, further = growth(half, frame)
            terms[6:] = wider * terms[6:] - further * g  # (HTG.32)
        return terms

    def rates(self, x: NDArray) -> NDArray:
        """Log likelihood of each range rate, linear beyond the clip, and its gradient in phi, v, omega: (4, S, G)."""
        residual, h = self.rate_model(x)
        clipped = np.minimum(np.maximum(residual, -self.rate_clip), self.rate_clip) / self.rate_std**2
        terms = np.empty((4, *residual.shape))
        terms[0] = -clipped * (residual - 0.5 * clipped * self.rate_std**2)  # (HTG.33)
        terms[1:] = h * clipped  # (HTG.33)
        return terms

    def rate_model(self, x: NDArray) -> tuple[NDArray, NDArray]:
        """Residuals (..., G) of the ground range rates and their gradients h (3, ..., G) in phi, v, omega.

        Both are 0 where no range rate was measured. The lever arm z - c is held at the predicted centre: a range rate
        informs about motion, not about position. x (8, ..., G) as in `spread`.
        """
        points = self.points
        c, s, v, omega = x[2:6]
        lever = points.z - self.mean[:, :2].T.take(points.row, -1)
        h = np.empty((3, *c.shape))
        h[0], h[1], h[2] = polar_gradient(points.sight, (c, s), v, lever)  # (RR.3)
        measured = np.isfinite(points.rate)
        residual = np.where(measured, points.rate - v * h[1] - omega * h[2], 0.0)  # (RR.3)
        return residual, h * measured

    def spatial_information(self, table: HTGTable, F: NDArray) -> NDArray:
        """Expected information (N, 7, 7) of the positions of the detections at the prediction; F (G, 6, 6)."""
        points, index = self.points, self.shape.bin
        # Over neighbours of one object and one bin, F is added up before it is transformed, which is cheaper.
        runs = np.flatnonzero((np.diff(index, prepend=-1) != 0) | (np.diff(points.row, prepend=-1) != 0))
        L = jacobian(self.mean[points.row[runs]], table.frame(index[runs]))
        J5 = np.add.reduceat(L @ np.add.reduceat(F, runs) @ L.mT, np.searchsorted(runs, points.start))  # (HTG.34)
        J = np.zeros((len(self.mean), 7, 7))
        J[:, SPATIAL[:, None], SPATIAL] = J5
        return J

    def rate_information(self) -> NDArray:
        """Information (N, 7, 7) of the range rates at the prediction."""
        J = np.zeros(self.precision.shape)
        if self.measured:
            _, h = self.rate_model(self.spread(self.mean))
            motion = slice(PHI, LOG_L)
            J[:, motion, motion] = self.points.total(h[:, None] * h).transpose(2, 0, 1) / self.rate_std**2  # (HTG.36)
        return J


def jacobian(xi: NDArray, frame: UnitFrame) -> NDArray:
    """L (..., 5, 6) of (HTG.35): the score in px, py, phi, log l, log w is L f; states xi (..., 7), frame (..., 2)."""
    c, s = np.cos(xi[..., PHI]), np.sin(xi[..., PHI])
    half = 0.5 * np.exp(xi[..., LOG_L:])
    h, shift = warp(half, frame)
    hx, hy = h[..., 0], h[..., 1]
    grows, moves = growth(half, frame)
    L = np.zeros((*xi.shape[:-1], 5, 6))
    L[..., 0, 0], L[..., 0, 1] = -c / hx, s / hy  # (HTG.35)
    L[..., 1, 0], L[..., 1, 1] = -s / hx, -c / hy  # (HTG.35)
    L[..., 2, 0], L[..., 2, 1] = shift[..., 1] / hx, -shift[..., 0] / hy  # (HTG.35)
    L[..., 2, 2], L[..., 2, 3] = hy / hx, -hx / hy  # (HTG.35)
    L[..., 3, 4], L[..., 3, 0] = -grows[..., 0], -moves[..., 0]  # (HTG.35)
    L[..., 4, 5], L[..., 4, 1] = -grows[..., 1], -moves[..., 1]  # (HTG.35)
    return L


def score_moments(p: HTG) -> NDArray:
    """F (6, 6) of one density p (), by a rectangle rule fine enough for its sharpest edge."""
    half = SPAN * np.sqrt(p.rho + p.r)
    edge = STEP * np.sqrt(p.rho * p.r / (p.rho + p.r))
    count = np.minimum(np.ceil(2 * half / edge), MOST).astype(int)
    zx, zy = (np.linspace(-h, h, n) for h, n in zip(half, count, strict=True))
    zx, zy = (a.ravel() for a in np.meshgrid(zx, zy, indexing="ij"))
    x, y = np.cos(p.theta) * zx - np.sin(p.theta) * zy, np.sin(p.theta) * zx + np.cos(p.theta) * zy
    log_p, (gx, gy) = evaluate(np.stack([x, y]), prepare(lift(p, 1)))
    f = np.stack([gx, gy, gx * y, gy * x, gx * x + 1, gy * y + 1])  # (HTG.34)
    weight = np.exp(log_p)
    return (f * (weight / weight.sum())) @ f.T  # (HTG.34)


@lru_cache(maxsize=64)
def information_table(table: HTGTable) -> NDArray:
    """F (B, levels, levels, 6, 6) of every bin with additional noise along the two turned axes."""
    B, K = len(table), len(LEVELS)
    F = np.empty((B, K, K, 6, 6))
    for b, i, j in np.ndindex(B, K, K):
        p = table.of(np.array(b))
        F[b, i, j] = score_moments(p._replace(r=p.r + LEVELS[[i, j]]))
    return F


def information(table: HTGTable, index: NDArray, noise: NDArray) -> NDArray:
    """F (..., 6, 6) for bins index (...) and additional noise variances (..., 2), at the nearest tabulated level."""
    level = np.searchsorted(SWITCH, noise)
    return information_table(table)[index, level[..., 0], level[..., 1]]
