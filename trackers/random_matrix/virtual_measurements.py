"""Koch's random matrix with a contour ellipse, or box, that virtual detections keep in its place.

Only one side of an object is visible to a sensor, so the mean and the spread of its detections are not those of the
body. The filter follows the mean; the contour beside it, with centre c, length l and width w, is adapted until the
detections that a ray caster would get from it have the mean and the spread of the real ones.
Equations: docs/methods/virtual-measurements.md; source: Hoher et al. (2022), through a project report on it.
"""

from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.batch import select
from trackers.estimate import Estimate
from trackers.filter import Gaussian, UpdateInfo
from trackers.geometry import rotation, to_frame, unit, wrap_angle
from trackers.parameters import check_numbers
from trackers.random_matrix.adaptation import Descent, Difference, GaussNewton, Rule, Variances, descend
from trackers.random_matrix.feldmann import masked_mean, moments
from trackers.random_matrix.koch import Koch, KochState
from trackers.random_matrix.rays import (
    box_hits,
    box_outline,
    box_sector,
    near_hits,
    outline,
    root_of,
    sector_fan,
    tangent_sector,
)
from trackers.scan import Scan
from trackers.validation import definite, guarded_update, unguarded

LEAST_SIZE = 0.02  # [m] of a contour that may be proposed
LEAST_DETECTIONS = 3  # fewer have no spread to compare with
BODIES = ("ellipse", "box")


class ContourState(NamedTuple):
    """The state of the filter, and the contour beside it."""

    koch: KochState
    centre: NDArray  # (..., 2) [m]
    size: NDArray  # (..., 2) full length, width [m]
    tilt: NDArray  # (...) [rad] of the length
    size_std: NDArray  # (..., 2) [m]
    steps: NDArray  # (...) int, updates with a detection


class ContourScan(NamedTuple):
    """The detections of the sensor that made most of them, in the frame of the contour before its adaptation."""

    sensor: NDArray  # (..., 2) [m] position of the sensor
    xy: NDArray  # (..., M, 2) [m]
    mask: NDArray  # (..., M)
    n: NDArray  # (...)
    mean: NDArray  # (..., 2) [m]
    C: NDArray  # (..., 2, 2) [m^2] covariance
    R: NDArray  # (..., 2, 2) [m^2] mean noise


@dataclass(frozen=True)
class VirtualMeasurements:
    """Random matrix and virtual measurement model of Hoher et al. (2022), corrected."""

    koch: Koch = field(default_factory=Koch)
    rule: Rule = field(default_factory=GaussNewton)
    body: str = "ellipse"  # or "box", ours: end-on detections do not inform about its length, and the length stays
    rays: int = 33  # virtual rays, spread evenly over the sector of the contour
    surface: float = 1.0  # virtual detections lie at this share of the way from the centre to the contour
    sigma: float = 0.2  # [m] sensor noise of detections whose scan does not state it
    unbiased: bool = False  # covariance divided by n - 1 instead of n, for radars with few detections
    centre_std: float = 0.4  # [m] of the centre of the body beside the filter's covariance, (VM.17)

    angles: ClassVar[tuple[int, ...]] = ()  # no component of the state is one

    def __post_init__(self) -> None:
        if self.body not in BODIES:
            raise ValueError(f"body must be one of {', '.join(BODIES)}, got {self.body!r}")
        check_numbers(self, positive=("surface",))
        if self.rays < 3:
            raise ValueError(f"rays must be at least 3 to have a spread, got {self.rays}")

    def init(self, estimate: Estimate) -> ContourState:
        """State from a prior; raises ValueError for a prior that is not finite, positive, definite."""
        koch = self.koch.init(estimate)
        none = np.zeros(koch.nu.shape, int)
        pose = estimate.pose
        return ContourState(koch, pose[..., :2].copy(), estimate.size, koch.heading.copy(), estimate.size_std, none)

    def predict(self, state: ContourState, dt: float) -> ContourState:
        """Time update over dt [s] >= 0: the contour moves and turns with the filter."""
        koch = self.koch.predict(state.koch, dt)
        return state._replace(
            koch=koch,
            centre=state.centre + koch.x[..., :2] - state.koch.x[..., :2],  # (VM.9)
            tilt=state.tilt + (koch.heading - state.koch.heading),  # (VM.9)
        )

    @guarded_update
    def update(self, state: ContourState, scan: Scan) -> tuple[ContourState, UpdateInfo]:
        """Measurement update of filter and contour; without a detection the state is returned as it came."""
        koch, info = self.correct(state, scan)
        updated = state._replace(koch=koch, tilt=self.tilt_of(state, koch), steps=state.steps + (info.n > 0))
        return select(info.n > 0, self.adapt(updated, scan), state), info

    def correct(self, state: ContourState, scan: Scan) -> tuple[KochState, UpdateInfo]:
        """Koch's update of the mean of the detections; the first one begins at the mean that the contour predicts."""
        first, koch = state.steps == 0, state.koch
        if first.any():
            x = koch.x.copy()
            x[..., :2] += np.where(first[..., None], self.predicted_offset(state, scan), 0.0)  # (VM.10)
            koch = koch._replace(x=x)
        new, info = unguarded(self.koch.update)(koch, scan)
        return definite(new, koch), info

    def tilt_of(self, state: ContourState, koch: KochState) -> NDArray:
        """Tilt (...) [rad] of the contour after the update of the filter: its heading."""
        return koch.heading

    def adapt(self, state: ContourState, scan: Scan) -> ContourState:
        """The state with its contour adapted to a scan, and everything else as it was."""
        z = self.contour_scan(state, scan)
        active = z.n >= LEAST_DETECTIONS
        if not active.any():
            return state
        theta = self.encode(state)
        return select(active, self.moved(state, self.fit(theta, state, z, active)), state)

    def fit(self, theta: NDArray, state: ContourState, z: ContourScan, active: NDArray) -> Descent:
        """Steps of the rule from theta (..., D), where active (...)."""
        return descend(self.rule, theta, self.difference(z), active, self.variances(state, z))

    def encode(self, state: ContourState) -> NDArray:
        """Theta (..., 4) of the contour in its own frame: centre, l, w."""
        return np.concatenate([np.zeros_like(state.centre), state.size], -1)

    def moved(self, state: ContourState, found: Descent) -> ContourState:
        """The state with the contour that was found."""
        return state._replace(
            centre=state.centre + (rotation(state.tilt) @ found.theta[..., :2, None])[..., 0],  # (VM.16a)
            size=found.theta[..., 2:],  # (VM.16a)
            size_std=np.sqrt(found.kept[..., 2:]) * state.size_std,  # (VM.16b)
        )

    def estimate(self, state: ContourState) -> Estimate:
        """Box around the contour; the motion is the filter's."""
        box = self.koch.describe(state.koch, state.centre, state.tilt, state.size.copy(), state.size_std.copy())
        box.cov[..., [0, 1], [0, 1]] += self.centre_std**2  # (VM.17)
        draw = box_outline if self.body == "box" else outline
        return box._replace(contour=draw(state.centre, root_of(state.size, state.tilt)))

    def resize(self, state: ContourState, size: NDArray, size_std: NDArray) -> ContourState:
        """State with another size (..., 2) [m] of standard deviation size_std (..., 2) [m]."""
        return state._replace(size=size.copy(), size_std=size_std.copy())

    def shift(self, state: ContourState, d: NDArray) -> ContourState:
        """State with d (..., 2) [m] added to the centre of the contour and to the mean that the filter follows."""
        return state._replace(koch=self.koch.shift(state.koch, d), centre=state.centre + d)

    def gaussian(self, state: ContourState) -> Gaussian:
        """The Gaussians of the filter."""
        return self.koch.gaussian(state.koch)

    def with_gaussian(self, state: ContourState, gaussian: Gaussian) -> ContourState:
        """The state with other Gaussians of the filter; the contour moves and turns with it, as in the prediction."""
        koch = self.koch.with_gaussian(state.koch, gaussian)
        turn = wrap_angle(koch.heading - state.koch.heading)
        shift = koch.x[..., :2] - state.koch.x[..., :2]
        return state._replace(koch=koch, centre=state.centre + shift, tilt=state.tilt + turn)

    def virtual(self, sensor: NDArray, centre: NDArray, L: NDArray) -> tuple[NDArray, NDArray]:
        """Virtual detections (..., B, 2) [m] of contours with centre (..., 2) and root L (..., 2, 2), and their mask.

        They are not random: a constant detection probability changes neither mean nor spread.
        """
        bearing, mask = self.fan(*(box_sector if self.body == "box" else tangent_sector)(sensor, centre, L))
        r = (box_hits if self.body == "box" else near_hits)(sensor, bearing, centre, L)
        mask = mask & np.isfinite(r)
        hit = sensor[..., None, :] + np.where(mask, r, 0.0)[..., None] * unit(bearing)
        inner = centre[..., None, :]
        return inner + self.surface * (hit - inner), mask  # (VM.7)

    def fan(self, middle: NDArray, right: NDArray, left: NDArray) -> tuple[NDArray, NDArray]:
        """Bearings (..., B) [rad] of the virtual rays in a sector, see `tangent_sector`, and their mask."""
        return sector_fan(middle, right, left, self.rays), np.array(True)

    def contour_scan(self, state: ContourState, scan: Scan) -> ContourScan:
        """The scan in the frame of the contour, and its statistics."""
        sensor, mask = main_sensor(scan)
        pose = np.concatenate([state.centre, state.tilt[..., None]], -1)
        xy = to_frame(pose, scan.xy)
        n, mean, Z = moments(xy, mask)
        M = rotation(state.tilt)
        R = M.mT @ masked_mean(scan.position_noise(self.sigma), mask, axes=2) @ M
        place = to_frame(pose, sensor[..., None, :])[..., 0, :]
        count = np.maximum(n - 1 if self.unbiased else n, 1)
        return ContourScan(place, xy, mask, n, mean, Z / count[..., None, None], R)

    def predicted_offset(self, state: ContourState, scan: Scan) -> NDArray:
        """Mean of the virtual detections minus the centre, (..., 2) [m], world axes; 0 without a detection."""
        z, zero = self.contour_scan(state, scan), np.zeros_like(state.centre)
        points, real = self.virtual(z.sensor, zero, np.eye(2) * state.size[..., None] / 2)
        mean = masked_mean(points, np.broadcast_to(real, points.shape[:-1]), axes=1)
        mean = (rotation(state.tilt) @ mean[..., None])[..., 0]
        return np.where((z.n > 0)[..., None], mean, 0.0)

    def difference(self, z: ContourScan) -> Difference:
        """Eps = y - y~(theta) for candidates theta (..., C, D)."""
        y = self.statistics(z.mean, z.C)[..., None, :]  # (VM.8a)
        R = z.R[..., None, :, :]

        def difference(theta: NDArray) -> tuple[NDArray, NDArray]:
            L, possible = self.roots(theta)
            points, mask = self.virtual(z.sensor[..., None, :], theta[..., :2], L)
            n, mean, Z = moments(points, np.broadcast_to(mask, points.shape[:-1]))
            C = Z / np.maximum(n, 1)[..., None, None] + R  # (VM.8b)
            return y - self.statistics(mean, C), possible & (n >= 2)

        return difference

    def roots(self, theta: NDArray) -> tuple[NDArray, NDArray]:
        """Roots (..., 2, 2) [m] of candidates theta and their mask (...); the identity where one is not possible."""
        possible = large_enough(theta[..., 2:])
        L = theta[..., 2:, None] / 2 * np.eye(2)  # (VM.1)
        return np.where(possible[..., None, None], L, np.eye(2)), possible

    def statistics(self, mean: NDArray, C: NDArray) -> NDArray:
        """Vector y (..., 4) [m]: the mean, and twice the standard deviations along and across the contour."""
        spread = np.stack([C[..., 0, 0], C[..., 1, 1]], -1)
        return np.concatenate([mean, 2 * np.sqrt(np.maximum(spread, 0.0))], -1)  # (VM.8)

    def variances(self, state: ContourState, z: ContourScan) -> Variances:
        """Variances of theta before the scan and of y, for rules that weigh them."""
        spread = np.stack([z.C[..., 0, 0], z.C[..., 1, 1]], -1)
        mean_var = spread / np.maximum(z.n, 1)[..., None]  # (VM.15)
        shape_var = 2 * spread / np.maximum(z.n - 1, 1)[..., None]  # (VM.15): y^2 / (2 (n - 1)) with y = 2 s
        P = self.koch.covariance(state.koch.P, state.koch.extent)
        M = rotation(state.tilt)
        centre = M.mT @ P[..., :2, :2] @ M
        centre_var = np.stack([centre[..., 0, 0], centre[..., 1, 1]], -1) + self.centre_std**2
        return Variances(np.concatenate([centre_var, state.size_std**2], -1), np.concatenate([mean_var, shape_var], -1))


def large_enough(size: NDArray) -> NDArray:
    """Mask (...) of the contours with size (..., 2) [m] that may be proposed, (VM.12)."""
    return np.asarray(np.isfinite(size).all(-1) & (size.min(-1) > LEAST_SIZE))


def main_sensor(scan: Scan) -> tuple[NDArray, NDArray]:
    """Position (..., 2) [m] of the sensor that made most of the detections, and the mask (..., M) of those."""
    mask = scan.mask
    if mask.shape[-1] == 0:
        return np.zeros((*mask.shape[:-1], 2)), mask
    sensor = np.broadcast_to(scan.sensor, mask.shape)
    same = (sensor[..., :, None] == sensor[..., None, :]) & mask[..., None, :]
    count = np.where(mask, same.sum(-1), -1)
    best = (count * (sensor.max() + 1) - sensor).argmax(-1)[..., None]  # of equal counts the first sensor
    place = np.broadcast_to(scan.pose[..., :2], (*mask.shape, 2))
    where = np.take_along_axis(place, best[..., None], -2)[..., 0, :]
    return where, mask & (sensor == np.take_along_axis(sensor, best, -1))
