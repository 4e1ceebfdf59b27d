"""The virtual measurement model as the report has it, and with the report's improvements.

A subclass, because each variant replaces one step of the filter and keeps the others.
Equations: docs/methods/virtual-measurements.md, (VM.18) to (VM.25).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studies.papers.hoher2022.direct_fit import DirectFit
from studies.papers.hoher2022.rules import Lms
from trackers.filter import UpdateInfo
from trackers.linalg import sqrtm
from trackers.random_matrix.adaptation import Descent, Difference, Variances
from trackers.random_matrix.koch import KochState
from trackers.random_matrix.virtual_measurements import (
    ContourScan,
    ContourState,
    VirtualMeasurements,
    large_enough,
)
from trackers.scan import Scan

TILTS = ("velocity", "square-root", "abc")
MOMENTS = ("body", "eigenvalues")


@dataclass(frozen=True)
class ShapeLms(Lms):
    """Least mean squares with an extra gain on the components after the centre."""

    shape_gain: float = 1.0

    def step(self, theta: NDArray, difference: Difference, variances: Variances) -> tuple[NDArray, NDArray]:
        """The identity with the extra gain; the sensitivity is taken for the identity too."""
        D = theta.shape[-1]
        one = np.broadcast_to(np.eye(D), (*theta.shape, D))
        return one * np.where(np.arange(D) < 2, 1.0, self.shape_gain)[:, None], one  # (VM.18)


@dataclass(frozen=True)
class ReportVariant(VirtualMeasurements):
    """Virtual measurements with the choices of the report; defaults are those of the filter itself."""

    moments: str = "body"  # spread along and across the heading, or "eigenvalues" as in the report, (VM.19)
    tilt: str = "velocity"  # or learned from the spread, for targets that drift: "square-root", "abc", (VM.20)
    pitch: float = 0.0  # [rad] of a fixed grid of virtual rays, which replaces them; the report has 0.1 deg
    blur: bool = True  # sensor noise in the spread of the virtual detections, (VM.8b)
    feedback_from: int | None = None  # update from which on the filter knows the offset of the mean, (VM.22)
    direct: DirectFit | None = None  # fit without virtual detections, in place of the rule, (VM.23) to (VM.25)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, known in (("moments", MOMENTS), ("tilt", TILTS)):
            value = getattr(self, name)
            if value not in known:
                raise ValueError(f"{name} must be one of {', '.join(known)}, got {value!r}")
        if self.body == "box" and (self.tilt != "velocity" or self.direct is not None):
            raise ValueError("body 'box' goes with tilt 'velocity' and without a direct fit; these need an ellipse")
        if self.tilt != "velocity" and self.direct is not None:
            raise ValueError(f"tilt {self.tilt!r} is learned by a rule; a direct fit takes the velocity's")

    def predict(self, state: ContourState, dt: float) -> ContourState:
        """Time update over dt [s] >= 0; a learned tilt stays."""
        moved = super().predict(state, dt)
        return moved if self.tilt == "velocity" else moved._replace(tilt=state.tilt)

    def tilt_of(self, state: ContourState, koch: KochState) -> NDArray:
        """Tilt (...) [rad] after the update of the filter: its heading, or the learned one."""
        return koch.heading if self.tilt == "velocity" else state.tilt

    def correct(self, state: ContourState, scan: Scan) -> tuple[KochState, UpdateInfo]:
        """Koch's update; with feedback the position of the filter is the centre, from that update on."""
        if self.feedback_from is None:
            return super().correct(state, scan)
        fed = state.steps >= self.feedback_from
        offset = self.predicted_offset(state, scan)
        x = state.koch.x.copy()
        x[..., :2] += np.where(((state.steps == 0) & ~fed)[..., None], offset, 0.0)  # (VM.10)
        return self.koch.correct(state.koch._replace(x=x), scan, np.where(fed[..., None], offset, 0.0))  # (VM.22)

    def contour_scan(self, state: ContourState, scan: Scan) -> ContourScan:
        """The scan in the frame of the contour; without noise where it is not to blur the virtual spread."""
        z = super().contour_scan(state, scan)
        return z if self.blur else z._replace(R=np.zeros_like(z.R))

    def fan(self, middle: NDArray, right: NDArray, left: NDArray) -> tuple[NDArray, NDArray]:
        """Bearings (..., B) [rad] of the virtual rays in the sector, and their mask."""
        return grid_fan(middle, right, left, self.pitch) if self.pitch else super().fan(middle, right, left)

    def fit(self, theta: NDArray, state: ContourState, z: ContourScan, active: NDArray) -> Descent:
        """Steps of the rule, or of the direct fit."""
        if self.direct is None:
            return super().fit(theta, state, z, active)
        return self.direct.fit(theta, z.sensor, z.xy, z.mask, active)

    def statistics(self, mean: NDArray, C: NDArray) -> NDArray:
        """Vector y (..., D): the mean, and the spread as lengths or as the three entries of a matrix."""
        if self.tilt == "abc":
            return np.concatenate([mean, entries(C)], -1)  # (VM.20)
        if self.tilt == "square-root":
            return np.concatenate([mean, entries(2 * sqrtm(C))], -1)  # (VM.20)
        if self.moments == "body":
            return super().statistics(mean, C)
        spread = np.linalg.eigvalsh(C)[..., ::-1]
        return np.concatenate([mean, 2 * np.sqrt(np.maximum(spread, 0.0))], -1)  # (VM.19)

    def encode(self, state: ContourState) -> NDArray:
        """Theta in the frame of the contour: (..., 4) centre, l, w, or (..., 5) centre, B11, 2 B12, B22."""
        if self.tilt == "velocity":
            return super().encode(state)
        a, b = np.moveaxis(state.size**2 / 4 if self.tilt == "abc" else state.size, -1, 0)
        zero = np.zeros_like(a)
        return np.stack([zero, zero, a, zero, b], -1)  # (VM.20)

    def roots(self, theta: NDArray) -> tuple[NDArray, NDArray]:
        """Roots (..., 2, 2) [m] of candidates theta, and which are possible (...)."""
        if self.tilt == "velocity":
            return super().roots(theta)
        possible = large_enough(self.axes(theta)[0])
        return np.where(possible[..., None, None], self.matrix_root(theta), np.eye(2)), possible

    def matrix_root(self, theta: NDArray) -> NDArray:
        """Root L (..., 2, 2) [m] of the ellipse theta (..., 5); NaN where B is not positive definite."""
        B = symmetric(theta[..., 2:])
        definite = (B[..., 0, 0] > 0) & (B[..., 0, 0] * B[..., 1, 1] > B[..., 0, 1] ** 2)
        B = np.where(definite[..., None, None], B, np.nan)
        return sqrtm(B) if self.tilt == "abc" else B / 2  # (VM.20)

    def axes(self, theta: NDArray) -> tuple[NDArray, NDArray]:
        """Full length and width (..., 2) [m] of the ellipse theta (..., 5), and its tilt (...) [rad]."""
        L = self.matrix_root(theta)
        a, b, c = L[..., 0, 0], L[..., 0, 1], L[..., 1, 1]
        half, split = (a + c) / 2, np.hypot((a - c) / 2, b)
        return 2 * np.stack([half + split, half - split], -1), np.arctan2(2 * b, a - c) / 2

    def moved(self, state: ContourState, found: Descent) -> ContourState:
        """The state with the contour that was found, turned by its tilt."""
        if self.tilt == "velocity":
            return super().moved(state, found)
        size, turn = self.axes(found.theta)
        kept = found.kept[..., [2, -1]]
        lengths = np.concatenate([found.theta[..., :2], size], -1)
        moved = super().moved(state, Descent(lengths, found.eps, np.concatenate([found.kept[..., :2], kept], -1)))
        return moved._replace(tilt=state.tilt + turn)

    def variances(self, state: ContourState, z: ContourScan) -> Variances:
        """Variances of theta and y; a shape that is learned as a matrix has those of its axes."""
        theta_var, y_var = super().variances(state, z)
        if self.tilt == "velocity":
            return Variances(theta_var, y_var)
        return Variances(*(np.insert(v, 3, v[..., 2:].mean(-1), -1) for v in (theta_var, y_var)))


def grid_fan(middle: NDArray, right: NDArray, left: NDArray, pitch: float) -> tuple[NDArray, NDArray]:
    """Bearings (..., B) [rad] of the fixed grid j * pitch that fall into the sector, and their mask (..., B)."""
    first = np.ceil((middle + right) / pitch)
    count = np.floor((middle + left) / pitch) - first + 1
    circle = round(2 * np.pi / pitch)
    count = np.minimum(count, circle)  # both ends of a full circle are the same ray
    index = np.arange(int(max(count.max(initial=0), 1)))
    return (first[..., None] + index) * pitch, index < count[..., None]


def entries(B: NDArray) -> NDArray:
    """B11, 2 B12, B22 (..., 3) of symmetric B (..., 2, 2)."""
    return np.stack([B[..., 0, 0], 2 * B[..., 0, 1], B[..., 1, 1]], -1)


def symmetric(b: NDArray) -> NDArray:
    """Symmetric matrices (..., 2, 2) of B11, 2 B12, B22 (..., 3); the inverse of `entries`."""
    return np.stack([b[..., 0], b[..., 1] / 2, b[..., 1] / 2, b[..., 2]], -1).reshape(*b.shape[:-1], 2, 2)
