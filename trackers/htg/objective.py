"""The log posterior of many objects at once, over one flat list of detections.

Detections of a scan lie unevenly on the objects; a padded array would be evaluated for nothing in half of its places.
So the valid ones form one list of G, sorted by object, and sums over an object are sums over a segment of it.

xi = [px, py, phi, v, omega, log l, log w]: centre [m], heading [rad], speed [m/s], yaw rate [rad/s], size [m].
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.htg.bins import Frame, HTGTable, growth, warp
from trackers.htg.density import Prepared, evaluate, lift, log_mass, prepare, turned
from trackers.scan import Scan

PX, PY, PHI, SPEED, OMEGA, LOG_L, LOG_W = range(7)
SPATIAL = np.array([PX, PY, PHI, LOG_L, LOG_W])  # what the place of a detection depends on


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


class Shape(NamedTuple):
    """The density of each of G detections, held fixed during one update at the predicted state."""

    bin: NDArray  # (G,) of the table
    noise: NDArray  # (2, G) variances in unit coordinates along the turned axes
    frame: Frame | None  # leaves (2, 1, G); None for the plain unit coordinates of the paper, e / half
    prepared: Prepared


def shape_of(table: HTGTable, xi: NDArray, points: Points) -> Shape:
    """Bins, noise and prepared densities of the detections under the states xi (N, 7)."""
    x = np.take(xi.T, points.row, -1)
    size = np.exp(x[LOG_L:]).T
    index = table.bin_at(x[:PHI].T, x[PHI], size[:, 0], points.sensor.T)
    p = table.of(index)
    frame = table.frame(index)
    scale, _ = warp(size / 2, frame)
    noise = body_noise(scale.T, x[PHI], p.theta, points)
    inside = None if table.plain else Frame(*(leaf.T[:, None] for leaf in frame))
    return Shape(index, noise, inside, prepare(lift(p, 2), noise.T[None], log_masses(table)[index]))


@lru_cache(maxsize=64)
def log_masses(table: HTGTable) -> NDArray:
    """Log c_D (B,) of the bins."""
    return log_mass(table.p)


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
    return points.variance[0] * along**2 + points.variance[1] * across**2


class Objective(NamedTuple):
    """Log posterior of N objects given all their detections, as a function of the states."""

    points: Points
    shape: Shape
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
        value, gradient = self.spatial(xi)
        if self.measured:
            rate_value, rate_gradient = self.range_rates(xi)
            value = value + rate_value
            gradient[..., PHI:LOG_L] += rate_gradient
        d = xi - self.mean
        pull = (self.precision @ d[..., None])[..., 0]
        return value - 0.5 * (d * pull).sum(-1), gradient - pull

    def spatial(self, xi: NDArray) -> tuple[NDArray, NDArray]:
        """Log likelihood (S, N) of the places of the detections and its gradient (S, N, 7)."""
        points, (_, _, frame, prepared) = self.points, self.shape
        rows = np.empty((6, *xi.shape[:-1]))
        rows[:2], rows[4:] = xi.T[:2].swapaxes(1, 2), 0.5 * np.exp(xi.T[LOG_L:].swapaxes(1, 2))
        rows[2], rows[3] = np.cos(xi[..., PHI]), np.sin(xi[..., PHI])
        x = np.take(rows, points.row, -1)  # (6, S, G)
        c, s, half = x[2], x[3], x[4:]
        e = turned(points.z[:, None] - x[:2], c, s)
        h, shift = (half, 0.0) if frame is None else warp(half, frame)
        u = (e - shift) / h
        log_p, g = evaluate(u, prepared)
        terms = np.empty((6, *log_p.shape))
        terms[0] = log_p - np.log(h[0] * h[1])
        moved = g / h
        terms[1:3] = turned(moved, c, -s)
        np.negative(terms[1:3], out=terms[1:3])
        terms[3] = moved[0] * e[1] - moved[1] * e[0]
        terms[4:] = -1.0 - g * u
        if frame is not None:
            wider, further = growth(half, frame)
            terms[4:] = wider * terms[4:] - further * g
        sums = points.total(terms)
        gradient = np.zeros(xi.shape)
        gradient[..., SPATIAL] = sums[1:].transpose(1, 2, 0)
        return sums[0], gradient

    def range_rates(self, xi: NDArray) -> tuple[NDArray, NDArray]:
        """Log likelihood (S, N) of the range rates, linear beyond the clip, and its gradient (S, N, 3)."""
        residual, h = self.rate_model(xi)
        clipped = np.clip(residual, -self.rate_clip, self.rate_clip) / self.rate_std**2
        value = clipped * (residual - 0.5 * clipped * self.rate_std**2)
        return -self.points.total(value), np.moveaxis(self.points.total(h * clipped), 0, -1)

    def rate_model(self, xi: NDArray) -> tuple[NDArray, NDArray]:
        """Residuals (..., G) of the ground range rates and their gradients h (3, ..., G) in phi, v, omega.

        g = sight . (v e_phi + omega J (z - c)), card multi_object, step 7; both are 0 where nothing was measured. The
        lever z - c is held at the predicted centre: a range rate tells motion, not place.
        """
        points = self.points
        phi, v, omega = np.moveaxis(xi[..., PHI:LOG_L], -1, 0)[..., points.row]
        c, s = np.cos(phi), np.sin(phi)
        ux, uy = points.sight
        lever = points.z - self.mean[points.row, :2].T
        swing = uy * lever[0] - ux * lever[1]
        ahead = ux * c + uy * s
        measured = np.isfinite(points.rate)
        residual = np.where(measured, points.rate - v * ahead - omega * swing, 0.0)
        return residual, np.stack(np.broadcast_arrays(v * (uy * c - ux * s), ahead, swing)) * measured

    def spatial_information(self, table: HTGTable, F: NDArray) -> NDArray:
        """Expected information (N, 7, 7) of the places of the detections at the prediction; F (G, 6, 6)."""
        points, first, index = self.points, self.points.start, self.shape.bin
        if (index == index[first[points.row]]).all():  # one bin an object: add up F before it is transformed
            L = jacobian(self.mean, table.frame(index[first]))
            J5 = L @ np.add.reduceat(F, first) @ L.mT
        else:
            L = jacobian(self.mean[points.row], table.frame(index))
            J5 = np.add.reduceat(L @ F @ L.mT, first)
        J = np.zeros((len(self.mean), 7, 7))
        J[:, SPATIAL[:, None], SPATIAL] = J5
        return J

    def rate_information(self) -> NDArray:
        """Information (N, 7, 7) of the range rates at the prediction."""
        J = np.zeros(self.precision.shape)
        if self.measured:
            _, h = self.rate_model(self.mean)
            J[:, PHI:LOG_L, PHI:LOG_L] = self.points.total(h[:, None] * h).transpose(2, 0, 1) / self.rate_std**2
        return J


def jacobian(xi: NDArray, frame: Frame) -> NDArray:
    """L (..., 5, 6): the score in px, py, phi, log l, log w is L f; states xi (..., 7), frame (..., 2)."""
    c, s = np.cos(xi[..., PHI]), np.sin(xi[..., PHI])
    half = 0.5 * np.exp(xi[..., LOG_L:])
    h, shift = warp(half, frame)
    hx, hy = h[..., 0], h[..., 1]
    grows, moves = growth(half, frame)
    L = np.zeros((*xi.shape[:-1], 5, 6))
    L[..., 0, 0], L[..., 0, 1] = -c / hx, s / hy
    L[..., 1, 0], L[..., 1, 1] = -s / hx, -c / hy
    L[..., 2, 0], L[..., 2, 1] = shift[..., 1] / hx, -shift[..., 0] / hy
    L[..., 2, 2], L[..., 2, 3] = hy / hx, -hx / hy
    L[..., 3, 4], L[..., 3, 0] = -grows[..., 0], -moves[..., 0]
    L[..., 4, 5], L[..., 4, 1] = -grows[..., 1], -moves[..., 1]
    return L
