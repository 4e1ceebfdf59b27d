"""Koch's random matrix with a contour ellipse that virtual detections keep in its place.

Symbols and equations: card rm_vmm, sections 4 to 6, after Hoher et al. (2022) and a project report on it. A sensor sees
one side of an object, so the mean and the spread of its detections are not those of the body. The filter follows the
mean; beside it runs an ellipse with centre c, length l and width w, adapted until the detections that a ray caster
would get from it have the mean and the spread of the real ones. Only c, l and w are output.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.batch import select
from trackers.estimate import Estimate
from trackers.geometry import rotation, to_frame, unit
from trackers.linalg import sqrtm
from trackers.protocols import UpdateInfo
from trackers.random_matrix.adaptation import Bayes, Belief, Difference, GaussNewton, Lms, descend
from trackers.random_matrix.box import box_hits, box_outline, box_sector
from trackers.random_matrix.direct_fit import DirectFit
from trackers.random_matrix.ellipse import grid_fan, near_hits, outline, root_of, sector_fan, tangent_sector
from trackers.random_matrix.feldmann import masked_mean, moments
from trackers.random_matrix.koch import Koch, KochState
from trackers.scan import Scan, check_scan

LEAST_SIZE = 0.02  # [m] of an ellipse that may be proposed
LEAST_DETECTIONS = 3  # fewer have no spread to compare with
TILTS = ("velocity", "square-root", "abc")
MOMENTS = ("body", "eigenvalues")
BODIES = ("ellipse", "box")


class ContourState(NamedTuple):
    """The filter's belief, and the contour ellipse beside it."""

    koch: KochState
    centre: NDArray  # (..., 2) [m]
    size: NDArray  # (..., 2) full length, width [m]
    tilt: NDArray  # (...) [rad] of the length
    size_std: NDArray  # (..., 2) [m]
    steps: NDArray  # (...) int, updates with a detection


class Look(NamedTuple):
    """The detections of the sensor that made most of them, in the frame of the ellipse before its adaptation."""

    sensor: NDArray  # (..., 2) [m] where it is
    xy: NDArray  # (..., M, 2) [m]
    mask: NDArray  # (..., M)
    n: NDArray  # (...)
    mean: NDArray  # (..., 2) [m]
    C: NDArray  # (..., 2, 2) [m^2] spread, divided by n
    R: NDArray  # (..., 2, 2) [m^2] mean noise


@dataclass(frozen=True)
class VirtualMeasurements:
    """Random matrix and virtual measurement model, Hoher et al. (2022), as the card corrects it."""

    koch: Koch = field(default_factory=Koch)
    rule: Lms | GaussNewton | Bayes | DirectFit = field(default_factory=GaussNewton)
    moments: str = "body"  # spread along and across the heading, or "eigenvalues" as in the paper
    tilt: str = "velocity"  # or learned from the spread, for targets that drift: "square-root", "abc"
    body: str = "ellipse"  # or "box", ours: seen end-on it tells nothing of its length, and the length stays
    rays: int = 33  # virtual rays, spread evenly over the ellipse's sector
    pitch: float = 0.0  # [rad] of a regular grid of rays, which replaces them; the paper has 0.1 deg
    surface: float = 1.0  # virtual detections lie at this share of the way from the centre to the contour
    sigma: float = 0.2  # [m] sensor noise of detections that do not tell theirs
    unbiased: bool = False  # spread divided by n - 1 instead of n, for radars with few detections
    blur: bool = True  # sensor noise in the spread of the virtual detections; without it ellipses grow far too wide
    centre_std: float = 0.4  # [m] of the body's centre beside the filter's position, which knows nothing of bodies
    feedback_from: int | None = None  # update from which on the filter is told where on the body the mean lies

    def __post_init__(self) -> None:
        for name, known in (("moments", MOMENTS), ("tilt", TILTS), ("body", BODIES)):
            value = getattr(self, name)
            if value not in known:
                raise ValueError(f"{name} must be one of {', '.join(known)}, got {value!r}")
        if self.rays < 3 and not self.pitch:
            raise ValueError(f"rays must be at least 3 to have a spread, got {self.rays}")
        if self.body == "box" and (self.tilt != "velocity" or isinstance(self.rule, DirectFit)):
            raise ValueError(
                "body 'box' goes with tilt 'velocity' and with Lms or GaussNewton; the others need an ellipse"
            )
        if self.tilt != "velocity" and isinstance(self.rule, DirectFit):
            raise ValueError(f"tilt {self.tilt!r} is learned by Lms or GaussNewton; DirectFit takes the velocity's")

    def init(self, estimate: Estimate) -> ContourState:
        """State from a prior; raises ValueError for a prior that is not finite, positive, definite."""
        koch = self.koch.init(estimate)
        none = np.zeros(koch.nu.shape, int)
        pose = estimate.pose
        return ContourState(koch, pose[..., :2].copy(), estimate.size, koch.heading.copy(), estimate.size_std, none)

    def predict(self, state: ContourState, dt: float) -> ContourState:
        """Time update over dt [s] >= 0: the ellipse goes where the filter goes; a learned tilt stays."""
        koch = self.koch.predict(state.koch, dt)
        return state._replace(
            koch=koch,
            centre=state.centre + koch.x[..., :2] - state.koch.x[..., :2],
            tilt=state.tilt + (koch.heading - state.koch.heading if self.tilt == "velocity" else 0.0),
        )

    def update(self, state: ContourState, scan: Scan) -> tuple[ContourState, UpdateInfo]:
        """Measurement update of filter and ellipse; without a detection the state is returned as it came."""
        check_scan(scan)
        koch, info = self._filter(state, scan)
        tilt = koch.heading if self.tilt == "velocity" else state.tilt
        updated = state._replace(koch=koch, tilt=tilt, steps=state.steps + (info.n > 0))
        return select(info.n > 0, self.adapt(updated, scan), state), info

    def adapt(self, state: ContourState, scan: Scan) -> ContourState:
        """The state with its ellipse adapted to a scan, and everything else as it was."""
        look = self._look(state, scan)
        active = look.n >= LEAST_DETECTIONS
        if not active.any():
            return state
        theta = self._encode(state)
        if isinstance(self.rule, DirectFit):
            fit = self.rule.fit(theta, look.sensor, look.xy, look.mask, active)
        else:
            fit = descend(self.rule, theta, self._difference(look), active, self._belief(theta, state, look))
        size, turn = self._axes(fit.theta)
        adapted = state._replace(
            centre=state.centre + (rotation(state.tilt) @ fit.theta[..., :2, None])[..., 0],
            size=size,
            tilt=state.tilt + turn,
            # of a Bayesian gain the share of the error that is left is that of the variance
            size_std=np.sqrt(shape_share(fit.kept)) * state.size_std,
        )
        return select(active, adapted, state)

    def estimate(self, state: ContourState) -> Estimate:
        """Box around the contour ellipse; the motion is the filter's."""
        box = self.koch.describe(state.koch, state.centre, state.tilt, state.size.copy(), state.size_std.copy())
        box.cov[..., [0, 1], [0, 1]] += self.centre_std**2
        draw = box_outline if self.body == "box" else outline
        return box._replace(contour=draw(state.centre, root_of(state.size, state.tilt)))

    def resize(self, state: ContourState, size: NDArray, size_std: NDArray) -> ContourState:
        """State with another size (..., 2) [m] of standard deviation size_std (..., 2) [m]."""
        return state._replace(size=size.copy(), size_std=size_std.copy())

    def virtual(self, sensor: NDArray, centre: NDArray, L: NDArray) -> tuple[NDArray, NDArray]:
        """Virtual detections (..., B, 2) [m] of ellipses with centre (..., 2) and root L (..., 2, 2), and their mask.

        They are not random: a constant detection probability changes neither mean nor spread.
        """
        box = self.body == "box"
        middle, right, left = (box_sector if box else tangent_sector)(sensor, centre, L)
        if self.pitch:
            bearing, mask = grid_fan(middle, right, left, self.pitch)
        else:
            bearing, mask = sector_fan(middle, right, left, self.rays), np.array(True)
        r = (box_hits if box else near_hits)(sensor, bearing, centre, L)
        mask = mask & np.isfinite(r)
        hit = sensor[..., None, :] + np.where(mask, r, 0.0)[..., None] * unit(bearing)
        inner = centre[..., None, :]
        return inner + self.surface * (hit - inner), mask

    def _look(self, state: ContourState, scan: Scan) -> Look:
        sensor, mask = main_sensor(scan)
        pose = np.concatenate([state.centre, state.tilt[..., None]], -1)
        xy = to_frame(pose, scan.xy)
        n, mean, Z = moments(xy, mask)
        M = rotation(state.tilt)
        R = M.mT @ masked_mean(scan.position_noise(self.sigma), mask, axes=2) @ M
        seen = to_frame(pose, sensor[..., None, :])[..., 0, :]
        count = np.maximum(n - 1 if self.unbiased else n, 1)
        return Look(seen, xy, mask, n, mean, Z / count[..., None, None], R)

    def _filter(self, state: ContourState, scan: Scan) -> tuple[KochState, UpdateInfo]:
        """The filter's step; its position is where the mean of the detections is, or the centre with feedback."""
        told = np.zeros(state.steps.shape, bool) if self.feedback_from is None else state.steps >= self.feedback_from
        first = (state.steps == 0) & ~told
        offset = np.zeros_like(state.centre)
        if told.any() or first.any():
            look = self._look(state, scan)
            points, real = self.virtual(look.sensor, offset, np.eye(2) * state.size[..., None] / 2)
            mean = masked_mean(points, np.broadcast_to(real, points.shape[:-1]), axes=1)
            mean = (rotation(state.tilt) @ mean[..., None])[..., 0]
            offset = np.where((look.n > 0)[..., None], mean, 0.0)
        x = state.koch.x.copy()
        x[..., :2] += np.where(first[..., None], offset, 0.0)  # a new track starts where its detections should be
        return self.koch.correct(state.koch._replace(x=x), scan, np.where(told[..., None], offset, 0.0))

    def _difference(self, look: Look) -> Difference:
        """Eps = y - y~(theta) for candidates theta (..., C, D)."""
        y = self._statistics(look.mean, look.C)[..., None, :]
        R = look.R[..., None, :, :] if self.blur else 0.0

        def difference(theta: NDArray) -> tuple[NDArray, NDArray]:
            size, _ = self._axes(theta)
            possible = np.isfinite(size).all(-1) & (size.min(-1) > LEAST_SIZE)
            L = np.where(np.asarray(possible)[..., None, None], self._root(theta), np.eye(2))
            points, mask = self.virtual(look.sensor[..., None, :], theta[..., :2], L)
            n, mean, Z = moments(points, np.broadcast_to(mask, points.shape[:-1]))
            C = Z / np.maximum(n, 1)[..., None, None] + R
            return y - self._statistics(mean, C), possible & (n >= 2)

        return difference

    def _belief(self, theta: NDArray, state: ContourState, look: Look) -> Belief:
        """Variances of theta and y; a shape that is learned as a matrix has those of its axes."""
        spread = np.stack([look.C[..., 0, 0], look.C[..., 1, 1]], -1)
        mean_var = spread / np.maximum(look.n, 1)[..., None]
        shape_var = 2 * spread / np.maximum(look.n - 1, 1)[..., None]  # of 2 s: y^2 / (2 (n - 1)) with y = 2 s
        P = self.koch.covariance(state.koch)
        M = rotation(state.tilt)
        centre = M.mT @ P[..., :2, :2] @ M
        centre_var = np.stack([centre[..., 0, 0], centre[..., 1, 1]], -1) + self.centre_std**2
        parts = [state.size_std**2, shape_var]
        if theta.shape[-1] == 5:
            parts = [np.insert(v, 1, v.mean(-1), -1) for v in parts]
        return Belief(np.concatenate([centre_var, parts[0]], -1), np.concatenate([mean_var, parts[1]], -1))

    def _statistics(self, mean: NDArray, C: NDArray) -> NDArray:
        """Vector y (..., D): the mean, and the spread as lengths or as the three entries of a matrix."""
        if self.tilt == "abc":
            return np.concatenate([mean, entries(C)], -1)
        if self.tilt == "square-root":
            return np.concatenate([mean, entries(2 * sqrtm(C))], -1)
        if self.moments == "eigenvalues":
            spread = np.linalg.eigvalsh(C)[..., ::-1]
        else:
            spread = np.stack([C[..., 0, 0], C[..., 1, 1]], -1)
        return np.concatenate([mean, 2 * np.sqrt(np.maximum(spread, 0.0))], -1)

    def _encode(self, state: ContourState) -> NDArray:
        """Vector theta in the frame of the ellipse: (..., 4) centre, l, w, or (..., 5) centre, B11, 2 B12, B22."""
        if self.tilt == "velocity":
            return np.concatenate([np.zeros_like(state.centre), state.size], -1)
        a, b = np.moveaxis(state.size**2 / 4 if self.tilt == "abc" else state.size, -1, 0)
        zero = np.zeros_like(a)
        return np.stack([zero, zero, a, zero, b], -1)

    def _root(self, theta: NDArray) -> NDArray:
        """Root L (..., 2, 2) of the ellipse theta (..., D); NaN where B is not positive definite."""
        if self.tilt == "velocity":
            return theta[..., 2:, None] / 2 * np.eye(2)
        B = symmetric(theta[..., 2:])
        definite = (B[..., 0, 0] > 0) & (B[..., 0, 0] * B[..., 1, 1] > B[..., 0, 1] ** 2)
        B = np.where(definite[..., None, None], B, np.nan)
        return sqrtm(B) if self.tilt == "abc" else B / 2

    def _axes(self, theta: NDArray) -> tuple[NDArray, NDArray]:
        """Full length and width (..., 2) [m], and by how much (...) [rad] a learned tilt turned."""
        if self.tilt == "velocity":
            return theta[..., 2:], np.zeros(theta.shape[:-1])
        L = self._root(theta)
        a, b, c = L[..., 0, 0], L[..., 0, 1], L[..., 1, 1]
        half, split = (a + c) / 2, np.hypot((a - c) / 2, b)
        return 2 * np.stack([half + split, half - split], -1), np.arctan2(2 * b, a - c) / 2


def main_sensor(scan: Scan) -> tuple[NDArray, NDArray]:
    """Place (..., 2) [m] of the sensor that made most of the detections, and the mask (..., M) of those."""
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


def shape_share(kept: NDArray) -> NDArray:
    """Share (..., 2) of the error of length and width that is left, of the parameters' (..., 4 or 5)."""
    return kept[..., [2, -1]]


def entries(B: NDArray) -> NDArray:
    """B11, 2 B12, B22 (..., 3) of symmetric B (..., 2, 2)."""
    return np.stack([B[..., 0, 0], 2 * B[..., 0, 1], B[..., 1, 1]], -1)


def symmetric(b: NDArray) -> NDArray:
    """Symmetric matrices (..., 2, 2) of B11, 2 B12, B22 (..., 3); the inverse of `entries`."""
    return np.stack([b[..., 0], b[..., 1] / 2, b[..., 1] / 2, b[..., 2]], -1).reshape(*b.shape[:-1], 2, 2)
