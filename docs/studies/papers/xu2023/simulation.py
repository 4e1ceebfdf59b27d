"""The simulation of xu2023: a car on the maneuvers of Table I before a radar that drives the same, many runs at once.

What the paper does not print (the radar's course, the start) is ours: docs/reproductions.md says what, and why.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from testbed.evaluation.metrics import contour_iou
from trackers.dra import DataRegion, DataRegionState
from trackers.dra.motion import turn
from trackers.dra.regions import ALPHA, BETA, REGIONS, corners, ray_prior
from trackers.dra.state import AX, AY, P1, P2, PLACE, VELOCITY, VERTICES, VX, VY, N, W, X, Y, vertices
from trackers.geometry import dot, perpendicular, rotation, wrap_angle
from trackers.scan import Scan

STEP = 0.1  # [s]
STEPS = 500
CAR = np.array([4.8, 1.8])  # [m]
START, SPEED = (0.0, 800.0), 30.0  # [m], [m/s]: ends the straight parts at (20, 0) m/s
TABLE_1 = (  # from [s], acceleration [m/s^2], yaw rate [rad/s]
    (0.0, (0.0, 0.0), 0.0),
    (10.0, (-3.0, -2.0), 0.0),
    (15.0, (-3.0, -4.0), 0.0),
    (20.0, (2.0, 3.0), 0.0),
    (30.0, (0.0, 0.0), 0.0),
    (40.0, (0.0, 0.0), np.pi / 20),
)
STAGES = {"CV": ((0, 10), (30, 40)), "CA": ((10, 30),), "CT": ((40, 50),)}  # [s]
NOISE = np.array([0.1, 0.005, 0.027])  # std of range [m], azimuth [rad], range rate [m/s]
MORE_DETECTIONS = 5.0  # Poisson mean of those beyond the first
PRIOR_STD = np.array([0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.05, 0.3, 0.3, 0.3, 0.3])  # of the initial state
IOU_EVERY = 5  # steps; cutting polygons costs as much as a fast update


class SimulatedStep(NamedTuple):
    """One step of all runs: the truth and its detections."""

    x: NDArray  # (R, 11) the target
    scan: Scan  # (R, M)


class TrackedStep(NamedTuple):
    """Errors and modes after one update of all runs, with the estimated and the true outline."""

    position: NDArray  # (R,) [m^2] squared error
    velocity: NDArray  # (R,) [m^2/s^2] squared error
    outline: NDArray  # (R, 4, 2) [m] corners of the parallelogram
    truth: NDArray  # (R, 4, 2) likewise
    mode: NDArray  # (R, K) probabilities


class RunErrors(NamedTuple):
    """Squared errors of all runs (steps, R), IoU, and the modes."""

    position: NDArray  # [m^2]
    velocity: NDArray  # [m^2/s^2]
    iou: NDArray  # (steps / IOU_EVERY, R)
    mode: NDArray  # (steps, R, K) probabilities


def maneuver(k: int) -> tuple[NDArray, float, int]:
    """Acceleration (2,) [m/s^2] and yaw rate [rad/s] of step k, and which motion model it is: CV, CA, CT."""
    _, a, w = [row for row in TABLE_1 if row[0] <= k * STEP + 1e-9][-1]
    return np.array(a), w, 2 if w else int(any(a))


def advance(x: NDArray, k: int, rng: np.random.Generator, follows: bool) -> NDArray:
    """Targets x (R, 11) one step later."""
    a, w, _ = maneuver(k)
    acceleration = a + rng.normal(0, 0.5 if w else 0.1, (len(x), 2))
    new, v = x.copy(), x[:, VELOCITY]
    s, c, _, _ = turn(np.array(w), STEP)
    new[:, X] += s * v[:, 0] - c * v[:, 1]
    new[:, Y] += c * v[:, 0] + s * v[:, 1]
    new[:, PLACE] += STEP**2 / 2 * acceleration
    R = rotation(w * STEP)
    new[:, VELOCITY] = v @ R.T + STEP * acceleration
    new[:, [AX, AY]], new[:, W] = acceleration, w
    new[:, P1], new[:, P2] = x[:, P1] @ R.T, x[:, P2] @ R.T
    if follows:
        before, after = (np.arctan2(u[:, VY], u[:, VX]) for u in (x, new))
        new[:, W] = wrap_angle(after - before) / STEP
        new[:, VERTICES] = vertices(after, np.broadcast_to(CAR, (len(x), 2)))
    return new


def detect(x: NDArray, radar: NDArray, rng: np.random.Generator) -> Scan:
    """Detections of targets x (R, 11) by radars (R, 11) that point along their velocity."""
    count = rng.poisson(MORE_DETECTIONS, len(x)) + 1
    R, M = len(x), int(count.max())
    P = ray_prior(x, radar[:, PLACE], 0.6, 0.1)
    region = (rng.random((R, M, 1)) > P.cumsum(-1)[:, None]).sum(-1).clip(0, REGIONS - 1)
    s = np.concatenate([np.ones((R, M, 1)), rng.random((R, M, 2))], -1)
    q = (ALPHA[region] * s).sum(-1)[..., None] * x[:, None, P1] + (BETA[region] * s).sum(-1)[..., None] * x[:, None, P2]
    r = x[:, None, PLACE] + q - radar[:, None, PLACE]
    distance = np.sqrt(dot(r, r))
    v = x[:, None, VELOCITY] + x[:, None, [W]] * perpendicular(q) - radar[:, None, VELOCITY]
    heading = np.arctan2(radar[:, VY], radar[:, VX])
    polar = np.stack([distance, np.arctan2(r[..., 1], r[..., 0]) - heading[:, None], dot(v, r) / distance], -1)
    polar += rng.standard_normal(polar.shape) * NOISE
    pose = np.concatenate([radar[:, PLACE], heading[:, None]], -1)[:, None]
    return Scan(polar, np.arange(M) < count[:, None], pose, radar[:, None, VELOCITY], NOISE[None])


def start() -> NDArray:
    """The target's state (11,) at the start."""
    x = np.zeros(N)
    x[PLACE], x[VX] = START, SPEED
    x[VERTICES] = vertices(np.array(0.0), CAR)
    return x


def simulate(offset: NDArray, follows: bool, rng: np.random.Generator) -> Iterator[SimulatedStep]:
    """All steps of R runs; target and radar drive the same table with independent noise.

    The radar starts at `offset` (R, 2) [m] from the target. The body `follows` the velocity, or it does not turn
    unless Table I has a yaw rate, which is 0 while the velocity turns by 90 degrees.
    """
    x = np.repeat(start()[None], len(offset), 0)
    radar = x.copy()
    radar[:, PLACE] += offset
    for k in range(STEPS):
        x, radar = advance(x, k, rng, follows), advance(radar, k, rng, follows=False)
        yield SimulatedStep(x, detect(x, radar, rng))


def track(
    filter: DataRegion, offset: NDArray, prior_std: NDArray, seed: int | Sequence[int], follows: bool = False
) -> Iterator[TrackedStep]:
    """Every step of R runs; their first estimates are off by prior_std (R, 11), which the filter starts with.

    `offset` and `follows` are those of `simulate`. The same seed gives every filter the same targets, detections and
    initial errors.
    """
    world, error = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(2))
    m = start() + error.standard_normal(prior_std.shape) * prior_std
    m[:, [AX, AY, W]] = 0.0  # the first estimate has no acceleration and does not turn
    R, K = len(m), len(filter.models)
    P = np.repeat((prior_std[..., None] ** 2 * np.eye(N))[:, None], K, 1)
    state = DataRegionState(np.full((R, K), 1 / K), np.repeat(m[:, None], K, 1), P)
    for x, scan in simulate(offset, follows, world):
        state, info = filter.update(filter.predict(state, STEP), scan)
        mean = (state.mu[..., None] * state.m).sum(-2)  # (34)
        d, v = mean[:, PLACE] - x[:, PLACE], mean[:, VELOCITY] - x[:, VELOCITY]
        yield TrackedStep(dot(d, d), dot(v, v), outline(mean), outline(x), info.mode)


def outline(x: NDArray) -> NDArray:
    """Corners (R, 4, 2) [m] of states x (R, 11)."""
    return x[:, None, PLACE] + corners(x)


def collect(steps: Iterator[TrackedStep]) -> RunErrors:
    """All steps as arrays."""
    all_steps = TrackedStep(*(np.stack(field) for field in zip(*steps, strict=True)))
    iou = contour_iou(all_steps.outline[::IOU_EVERY], all_steps.truth[::IOU_EVERY])
    return RunErrors(all_steps.position, all_steps.velocity, iou, all_steps.mode)


def join(batches: Sequence[RunErrors]) -> RunErrors:
    """The runs of several batches as one."""
    return RunErrors(*(np.concatenate(field, 1) for field in zip(*batches, strict=True)))


def split(together: RunErrors, parts: int) -> list[RunErrors]:
    """The runs of `parts` variants apart, which follow one another in one record."""
    return [RunErrors(*part) for part in zip(*(np.split(field, parts, 1) for field in together), strict=True)]
