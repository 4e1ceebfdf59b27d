"""Learning a contour from detections of vehicles whose boxes are known, seen from one side at a time.

Equations: docs/methods/spline-pmht.md. Beyond the expectation maximisation of the paper, the ellipses weigh by what the
sensor of each detection can see, known noise is taken out of the covariances, and detections from inside the body have
a component of their own, or they would draw the ellipses inwards.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.linalg import inverse, outer, symmetrize
from trackers.pmht.association import BOX, LOG_2PI
from trackers.pmht.learning import EllipseStatistics, SplineContour, centres, control_points
from trackers.pmht.model import DEGREE, MOST_ELLIPSES, chain
from trackers.pmht.visibility import visibility_table, weights

PART = 4000  # detections worked on together


class LabelledDetections(NamedTuple):
    """N detections of vehicles whose boxes are known, in the unit frame."""

    z: NDArray  # (N, 2)
    noise: NDArray  # (N, 2, 2) known covariance; zero where it is part of what is learned
    direction: NDArray  # (N,) [rad] of the sensor from the vehicle, in its frame


class LearnedContour(NamedTuple):
    """The contour, and the course of its learning."""

    contour: SplineContour
    interior: float  # share of the detections from anywhere inside
    log_likelihood: NDArray  # (iterations,) [nat] mean over the detections, in the unit frame
    counts: NDArray  # (L,) detections of each ellipse


@dataclass(frozen=True)
class OfflineLearning:
    """How a contour is learned offline."""

    ellipses: int = 24
    points: int = 12
    iterations: int = 80
    tolerance: float = 1e-4  # of the log-likelihood [nat]
    visibility: str = "rays"  # or "none": equal weights
    interior: float = 0.2  # first guess of the share; 0 leaves it out
    mirrored: bool = True  # also learn from mirror images: vehicles are symmetric
    unseen: float = 0.02  # (PMHT.22)
    grazing: float = 0.5  # (PMHT.21)
    stiffness: float = 1e-4  # lambda of (PMHT.27) for each detection; holds sides without detections at the start

    def __post_init__(self) -> None:
        if self.visibility not in ("rays", "none"):
            raise ValueError(f"visibility must be one of rays, none, got {self.visibility!r}")
        if not DEGREE < self.points <= self.ellipses <= MOST_ELLIPSES:
            raise ValueError(
                f"ellipses must be at most {MOST_ELLIPSES} and points between {DEGREE + 1} and their number, got "
                f"{self.ellipses} ellipses and {self.points} points"
            )
        if self.iterations < 1 or not 0 <= self.interior < 1:
            raise ValueError(
                f"iterations must be at least 1 and interior a share below 1, got {self.iterations}, {self.interior}"
            )

    def run(
        self, data: LabelledDetections, size: NDArray, progress: Callable[[int, int], None] = lambda done, total: None
    ) -> LearnedContour:
        """The contour of some detections of vehicles of typical size (2,) [m]."""
        if self.mirrored:
            data = with_mirror(data)
        start = now = rectangle_start(self.ellipses, self.points)
        interior, history = self.interior, [-np.inf]
        stiffness = np.asarray(self.stiffness * len(data.z))
        for k in range(self.iterations):
            s, inside, value = self.expect(data, now, interior, size)
            now = maximise(now, s, stiffness, start.p)
            interior = inside / len(data.z)  # (PMHT.28)
            history.append(value)
            progress(k + 1, self.iterations)
            if value - history[-2] < self.tolerance and k > 10:
                break
        return LearnedContour(now, float(interior), np.array(history[1:]), s.M)

    def expect(
        self, data: LabelledDetections, now: SplineContour, interior: float, size: NDArray
    ) -> tuple[EllipseStatistics, float, float]:
        """Sums over the detections, the number from inside, and the mean log likelihood."""
        table = visibility_table(now.p, size, self.ellipses, DEGREE, self.grazing)
        M, first, second = np.zeros(self.ellipses), np.zeros((self.ellipses, 2)), np.zeros((self.ellipses, 2, 2))
        inside = total = 0.0
        for at in range(0, len(data.z), PART):
            part = LabelledDetections(*(a[at : at + PART] for a in data))
            log_pi = self._log_weights(table, part.direction)
            w, x, spread, w_in, value = expected(part, now, log_pi, interior)
            M += w.sum(0)  # (PMHT.25)
            first += np.einsum("nl,nli->li", w, x)
            second += np.einsum("nl,nlij->lij", w, spread + outer(x))
            inside, total = inside + float(w_in.sum()), total + float(value.sum())
        zb = first / np.maximum(M, 1e-9)[:, None]  # (PMHT.25)
        return EllipseStatistics(M, zb, second - M[:, None, None] * outer(zb)), inside, total / len(data.z)

    def _log_weights(self, table: NDArray, direction: NDArray) -> NDArray:
        if self.visibility == "none":
            return np.full((1, self.ellipses), -np.log(self.ellipses))
        seen_from = np.broadcast_to(direction[:, None], (len(direction), self.ellipses))
        return np.log(np.maximum(weights(table, seen_from, self.unseen), 1e-12))


def expected(
    data: LabelledDetections, now: SplineContour, log_pi: NDArray, interior: float
) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray]:
    """Weights (N, L), means (N, L, 2) and covariances (N, L, 2, 2) of the points without noise, given each ellipse.

    Also the weights (N,) of the inside and the log likelihoods (N,). log_pi (N or 1, L) are those of the ellipses.
    """
    mu = centres(now.p, now.Sigma.shape[-3])
    d = data.z[:, None] - mu
    S = now.Sigma + data.noise[:, None]  # (N, L, 2, 2)
    information = inverse(S)
    pull = (information @ d[..., None])[..., 0]
    log_joint = log_pi - 0.5 * ((d * pull).sum(-1) + np.log(np.linalg.det(S))) - LOG_2PI
    box = BOX + data.noise
    away = (data.z * (inverse(box) @ data.z[..., None])[..., 0]).sum(-1)
    log_box = -0.5 * (away + np.log(np.linalg.det(box))) - LOG_2PI
    with np.errstate(divide="ignore"):
        all_ = np.concatenate([log_joint + np.log1p(-interior), (np.log(interior) + log_box)[:, None]], -1)
    top = all_.max(-1, keepdims=True)
    e = np.exp(all_ - top)
    total = e.sum(-1, keepdims=True)
    w = e / total  # (PMHT.23)
    x = mu + (now.Sigma @ pull[..., None])[..., 0]  # (PMHT.24)
    spread = now.Sigma - now.Sigma @ information @ now.Sigma  # (PMHT.24)
    return w[:, :-1], x, spread, w[:, -1], (top + np.log(total))[:, 0]


def with_mirror(data: LabelledDetections) -> LabelledDetections:
    """The detections and their mirror images, left for right."""
    flip = np.array([1.0, -1.0])
    mirror = LabelledDetections(data.z * flip, data.noise * flip[:, None] * flip, -data.direction)
    return LabelledDetections(*(np.concatenate([a, b]) for a, b in zip(data, mirror, strict=True)))


def maximise(
    now: SplineContour,
    s: EllipseStatistics,
    stiffness: NDArray | float,
    off: NDArray,
    floor: float = 1e-6,
    keep_below: float = 2.0,
) -> SplineContour:
    """First the control points with the old Sigma_l, then Sigma_l with the new points.

    floor is the least eigenvalue of Sigma_l; an ellipse with fewer than keep_below detections keeps its Sigma_l.
    """
    p = control_points(now, s, stiffness, off)
    d = s.zb - centres(p, now.Sigma.shape[-3])
    M = np.maximum(s.M, 1e-9)[..., None, None]
    Sigma = symmetrize(outer(d) + s.Zb / M)  # (PMHT.28), divisor M_l where the paper prints M_l + 1
    value, vector = np.linalg.eigh(Sigma)
    Sigma = (vector * np.maximum(value, floor)[..., None, :]) @ vector.mT
    return SplineContour(p, np.where(s.M[..., None, None] >= keep_below, Sigma, now.Sigma))


def rectangle_start(L: int = 24, n_c: int = 12) -> SplineContour:
    """A spline through points spread evenly over a rectangle, counter-clockwise from ahead: a start for learning."""
    half = np.array([2.3, 0.8])
    corners = np.array([[1, 0], [1, 1], [-1, 1], [-1, -1], [1, -1], [1, 0]]) * half
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    at = np.arange(L) * (length[-1] / L)
    points = np.stack([np.interp(at, length, corners[:, i]) for i in range(2)], -1) / [5.0, 2.0]
    p = np.linalg.lstsq(chain(L, n_c, DEGREE), points, rcond=None)[0]
    return SplineContour(p, np.tile(np.diag([(0.3 / 5) ** 2, (0.15 / 2) ** 2]), (L, 1, 1)))
