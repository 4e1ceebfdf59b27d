"""Single-object trials, many runs at once: what a filter sees, what is true, and how far it is off.

All filters of a trial get the same detections. The set-ups are ours, after the papers' courses and parameters.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studies.papers.xia2020.generators import (
    FULL_VIEW,
    GENERATORS,
    NOISE,
    Course,
    draw_partial,
    draw_sizes,
    drive,
    seen_from,
)
from testbed.evaluation.metrics import gaussian_wasserstein, nees, rmse
from trackers.batch import stack, take
from trackers.estimate import Estimate, prior
from trackers.geometry import extent_matrix, rotation, to_world, unit, wrap_angle
from trackers.random_matrix.feldmann import RMState
from trackers.scan import Scan

DURATION = 20.0  # [s]
FULL_DT = 0.2  # [s] of the full view
FULL_STEPS = round(DURATION / FULL_DT)
SIZE = np.array([4.7, 1.8])  # [m] of the vehicle in full view
FIRST_SIZE = np.array([4.0, 2.2])  # [m] of the prior there
MEAN_SIZE = np.array([4.62, 1.95])  # [m] of the prior in partial view, an average car
START_STD = np.array([0.5, 0.5, 0.1, 1.0, 0.1])  # P0: x, y [m], heading [rad], speed [m/s], yaw rate [rad/s]


class Trial(NamedTuple):
    """T steps of R runs."""

    name: str
    dt: float  # [s]
    settled: int  # first step that counts
    pose: NDArray  # (T, R, 3) true centre x, y [m], heading [rad]
    velocity: NDArray  # (T, R, 2) [m/s]
    size: NDArray  # (R, 2) [m]
    scan: Scan  # (T, R) leading axes
    start: Estimate  # (R) prior before the first step


@dataclass(frozen=True)
class NamedFilter:
    """A filter with its settings: a row of a table."""

    name: str
    make: Callable[[], Any]  # a trackers.filter.Filter; called late, because it may learn a table
    size_std: float = 1 / 6  # initial size, standard deviation over mean; 1/6 is nu0 = 26 of a random matrix


class TrialEstimates(NamedTuple):
    """Estimates of one filter after every update, (T, R)."""

    estimate: Estimate
    extent: NDArray  # (T, R, 2, 2) [m^2] of the ellipse; a random matrix's own, or that of the box


class EllipseErrors(NamedTuple):
    """Errors (T, R) of the steps that count; length and width are those of the ellipse's axes, as in the papers."""

    position: NDArray  # [m]
    speed: NDArray  # [m/s]
    heading: NDArray  # [rad]
    length: NDArray  # [m] estimate minus truth
    width: NDArray  # [m]
    gwd2: NDArray  # [m^2] squared Gaussian Wasserstein distance
    nees: NDArray  # of the position, 2 is ideal
    nees_velocity: NDArray  # of the velocity, likewise

    def summary(self) -> dict[str, float]:
        """Root mean squares, means over runs and steps, and the standard error of the mean of gwd2 over the runs."""
        runs = self.gwd2.mean(0)
        return {
            "pos": rmse(self.position),
            "vel": rmse(self.speed),
            "head": float(np.degrees(rmse(self.heading))),
            "len": rmse(self.length),
            "wid": rmse(self.width),
            "len bias": float(self.length.mean()),
            "gwd2": float(runs.mean()),
            "se": float(runs.std(ddof=1) / np.sqrt(len(runs))) if len(runs) > 1 else np.nan,
            "gwd2 median": float(np.median(self.gwd2)),
            "gwd": float(np.sqrt(self.gwd2).mean()),
            "nees": float(self.nees.mean()),
            "nees vel": float(self.nees_velocity.mean()),
        }


def spread_scan(scan: Scan) -> Scan:
    """The scan with the leading axes of its mask on every field, so that `take` can pick steps and runs."""
    lead, M = scan.mask.shape[:-1], scan.mask.shape[-1]

    def grow(a: NDArray, *tail: int) -> NDArray:
        return np.broadcast_to(a, (*lead, *tail))

    count = {name: max(getattr(scan, name).shape[-2], 1) for name in ("pose", "velocity", "noise")}
    return Scan(
        polar=scan.polar,
        mask=scan.mask,
        pose=grow(scan.pose, count["pose"], 3),
        velocity=grow(scan.velocity, count["velocity"], 2),
        noise=grow(scan.noise, count["noise"], 3),
        sensor=grow(scan.sensor, M if scan.sensor.shape[-1] == M else 1),
        platform=grow(scan.platform, 6),
    )


def counts_to_mask(n: NDArray) -> NDArray:
    """Mask (..., M) of n (...) detections, M being the largest count and at least 1."""
    return np.arange(max(int(n.max()), 1)) < n[..., None]


def full_view(
    generator: str, runs: int, rng: np.random.Generator, rate: float = 8.0, start_std: ArrayLike = START_STD
) -> Trial:
    """Full view: detections all around a vehicle of 4.7 x 1.8 m in two turns at 10 m/s, 5 Hz.

    rate: mean number of detections a scan; start_std (5,): of the first state.
    """
    if generator not in GENERATORS:
        raise ValueError(f"generator must be one of {', '.join(GENERATORS)}, got {generator!r}")
    t = FULL_DT * np.arange(1, FULL_STEPS + 1)
    truth = drive(FULL_VIEW.start, FULL_VIEW.turns, t)[:, None]
    x0 = np.array([*FULL_VIEW.start, 0.0]) + rng.standard_normal((runs, 5)) * np.asarray(start_std)
    n = rng.poisson(rate, (len(t), runs))
    mask = counts_to_mask(n)
    e = GENERATORS[generator](rng, mask.shape, SIZE) * SIZE / 2
    scan = Scan.from_xy(to_world(truth[..., :3], e), mask)
    std = np.maximum(np.asarray(start_std, float), START_STD)
    return Trial(
        f"full view, {generator}", FULL_DT, 10, *motion(truth, runs), np.tile(SIZE, (runs, 1)), spread_scan(scan),
        start(x0, FIRST_SIZE, std),
    )  # fmt: skip


def partial_view(
    course: Course, hertz: float, runs: int, rng: np.random.Generator, rate: float = 5.0,
    start_std: ArrayLike = (0.0, 0.0, 0.0, 0.0, 0.0),
) -> Trial:  # fmt: skip
    """Partial view: detections on the sides that face the ego; the first kinematic state is the truth.

    rate: mean number of detections a scan, at least 1 each; start_std (5,): error of the first state.
    """
    dt = 1 / hertz
    t = dt * np.arange(1, round(DURATION * hertz) + 1)
    truth = drive(course.start, course.turns, t)[:, None]
    sensor = drive((0.0, 0.0, 0.0, course.start[3]), course.ego, t)[:, None, :3]
    size = draw_sizes(rng, runs)
    mask = counts_to_mask(np.maximum(rng.poisson(rate, (len(t), runs)), 1))
    to_sensor, _ = seen_from(truth[..., :3], sensor[..., :2])
    shape = (len(t), runs, 2)
    e = draw_partial(rng, np.broadcast_to(to_sensor, shape), np.broadcast_to(size, shape), mask.shape[-1])
    z = to_world(truth[..., :3], e) + rng.normal(0, NOISE, e.shape)
    pose = np.concatenate([sensor[..., :2], np.zeros((len(t), 1, 1))], -1)[..., None, :]
    d = z - pose[..., :2]
    polar = np.stack(
        [np.hypot(d[..., 0], d[..., 1]), np.arctan2(d[..., 1], d[..., 0]), np.full(mask.shape, np.nan)], -1
    )
    scan = Scan(polar, mask, pose, np.zeros((1, 2)), np.full((1, 3), np.nan))
    x0 = np.array([*course.start, 0.0]) + rng.standard_normal((runs, 5)) * np.asarray(start_std)
    return Trial(
        f"{course.name}, {hertz:g} Hz", dt, int((t <= 2.0 + 1e-9).sum()), *motion(truth, runs), size,
        spread_scan(scan), start(x0, MEAN_SIZE, np.maximum(start_std, START_STD)),
    )  # fmt: skip


def motion(truth: NDArray, runs: int) -> tuple[NDArray, NDArray]:
    """Poses (T, R, 3) and velocities (T, R, 2) of states (T, 1, 5)."""
    velocity = truth[..., 3:4] * unit(truth[..., 2])
    shape = (len(truth), runs)
    return np.broadcast_to(truth[..., :3], (*shape, 3)), np.broadcast_to(velocity, (*shape, 2))


def start(x0: NDArray, size: NDArray, std: NDArray) -> Estimate:
    """Prior (R) of first states x0 (R, 5) with standard deviations std (5,) and a size (2,) [m]."""
    return prior(
        x0[:, :3],
        velocity=x0[:, 3:4] * unit(x0[:, 2]),
        yaw_rate=x0[:, 4],
        size=size,
        position_std=std[:2].max(),
        heading_std=std[2],
        velocity_std=std[3],
        yaw_rate_std=std[4],
        size_std=size / 6,
    )


def track(method: NamedFilter, trial: Trial) -> TrialEstimates:
    """Estimates of a filter over the steps of a trial."""
    f = method.make()
    state = f.init(trial.start._replace(size_std=method.size_std * trial.start.size))
    estimates, extents = [], []
    for k in range(len(trial.pose)):
        state = f.predict(state, trial.dt)
        state, _ = f.update(state, take(trial.scan, np.array(k)))
        estimates.append(f.estimate(state))
        extents.append(extent_of(state, estimates[-1]))
    return TrialEstimates(stack(estimates), np.stack(extents))


def extent_of(state: Any, estimate: Estimate) -> NDArray:
    """Extent (..., 2, 2) [m^2]: the mean of the inverse Wishart where the state has one, else that of the box.

    A random matrix lags in turns, so its axes are not along the heading; the papers judge the matrix itself.
    """
    rm = getattr(state, "rm", state)
    if isinstance(rm, RMState):
        return rm.V / (rm.nu - 6)[..., None, None]
    return extent_matrix(estimate.pose[..., 2], estimate.size)


def errors(found: TrialEstimates, trial: Trial) -> EllipseErrors:
    """Errors from the settled step on."""
    e: Estimate = take(found.estimate, np.arange(trial.settled, len(trial.pose)))
    pose, velocity = trial.pose[trial.settled :], trial.velocity[trial.settled :]
    extent = found.extent[trial.settled :]
    axes = 2 * np.sqrt(np.linalg.eigvalsh(extent)[..., ::-1])
    d, ds = e.pose[..., :2] - pose[..., :2], axes - trial.size
    return EllipseErrors(
        position=np.hypot(d[..., 0], d[..., 1]),
        speed=e.speed - np.hypot(velocity[..., 0], velocity[..., 1]),
        heading=wrap_angle(e.pose[..., 2] - pose[..., 2]),
        length=ds[..., 0],
        width=ds[..., 1],
        gwd2=wasserstein(found, trial)[trial.settled :],
        nees=nees(d, e.cov[..., :2, :2]),
        nees_velocity=nees(e.velocity - velocity, e.cov[..., 2:, 2:]),
    )


def wasserstein(found: TrialEstimates, trial: Trial) -> NDArray:
    """Squared Gaussian Wasserstein distance (T, R) [m^2] to the truth, from the first step on."""
    true = extent_matrix(trial.pose[..., 2], np.broadcast_to(trial.size, (*trial.pose.shape[:2], 2)))
    return gaussian_wasserstein(found.estimate.pose[..., :2], found.extent, trial.pose[..., :2], true)


def unit_coordinates(trial: Trial) -> tuple[NDArray, NDArray]:
    """Unit coordinates (N, 2) and aspect angles (N,) [rad] of all detections of a trial, in the true boxes."""
    d = trial.scan.xy - trial.pose[..., None, :2]
    u = 2 * (d @ rotation(trial.pose[..., 2])) / trial.size[:, None, :]
    _, aspect = seen_from(trial.pose[..., None, :], np.broadcast_to(trial.scan.pose[..., :2], u.shape))
    return u[trial.scan.mask], aspect[trial.scan.mask]
