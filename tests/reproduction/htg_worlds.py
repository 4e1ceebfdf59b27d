"""The simulations of card htg_rm, section 8: generators of detections, courses, and one loop over them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers import Scan, prior
from trackers.geometry import extent_matrix, rotation, wrap_angle
from trackers.htg.bins import aspect_angle
from trackers.htg.density import HTG, sample
from trackers.linalg import sqrtm
from trackers.motion import coordinated_turn

PUBLISHED = HTG(np.array(0.183), np.array([0.675, 0.670, 0.611, 0.648]), np.array(0.763), np.array([0.037, 0.035]))

# 5 degrees of freedom: mean, scale, weight, in unit coordinates; card section 8.1
STUDENT = (
    *(((x, y), (0.08, 0.10), 0.11) for x in (-0.92, 0.92) for y in (-0.88, 0.88)),
    *(((x, 0.0), (0.06, 0.35), 0.14) for x in (-0.95, 0.95)),
    *(((x, y), (0.12, 0.08), 0.07) for x in (-0.6, 0.6) for y in (-0.9, 0.9)),
)


def draw_htg(rng, shape, size):
    """Unit coordinates (*shape, 2) of the published density."""
    return sample(PUBLISHED, int(np.prod(shape)), rng).reshape(*shape, 2)


def draw_band(rng, shape, size):
    """Uniform on the square minus 0.8 times the square, plus 0.2 m of noise."""
    u = rng.uniform(-1, 1, (*shape, 2))
    while (inside := (np.abs(u) < 0.8).all(-1)).any():
        u[inside] = rng.uniform(-1, 1, (inside.sum(), 2))
    return u + rng.normal(0, 0.2, u.shape) / (np.asarray(size) / 2)


def draw_vrm(rng, shape, size):
    """Student-t mixture over corners, bumpers and wheels."""
    mean, scale, weight = (np.array([c[i] for c in STUDENT]) for i in range(3))
    k = rng.choice(len(STUDENT), shape, p=weight / weight.sum())
    t = rng.standard_normal((*shape, 2)) / np.sqrt(rng.chisquare(5, shape) / 5)[..., None]
    return mean[k] + scale[k] * t


FULL_VIEW = {"htg": draw_htg, "band": draw_band, "vrm": draw_vrm}


def draw_partial(rng, centre, heading, size, sensor, n):
    """Body coordinates (..., n, 2) [m] of detections in partial view, card section 8.2; noise not yet added."""
    lead = heading.shape
    half = size / 2
    s = (rotation(heading).mT @ (sensor - centre)[..., None])[..., 0]
    normal = np.array([[1.0, 0], [-1, 0], [0, 1], [0, -1]])  # front, rear, left, right
    middle = normal * half[..., None, :]
    d = s[..., None, :] - middle
    cosine = (d * normal).sum(-1) / np.hypot(d[..., 0], d[..., 1])
    weight = np.stack([size[..., 1], size[..., 1], size[..., 0], size[..., 0]], -1) * np.maximum(cosine, 0)
    cumulative = np.cumsum(weight / weight.sum(-1, keepdims=True), -1)
    side = (rng.random((*lead, n, 1)) > cumulative[..., None, :]).sum(-1).clip(0, 3)
    end = np.minimum(rng.normal(0.85, 0.1, (*lead, n)), 1) * rng.choice([-1, 1], (*lead, n))
    along = np.where(rng.random((*lead, n)) < 0.6, rng.uniform(-1, 1, (*lead, n)), end)
    half_n = half[..., None, :]
    ahead = side < 2
    depth = np.minimum(rng.exponential(0.25, (*lead, n)), np.where(ahead, half_n[..., 0], half_n[..., 1]))
    sign = np.where(side % 2 == 0, 1.0, -1.0)
    x = np.where(ahead, sign * (half_n[..., 0] - depth), along * half_n[..., 0])
    y = np.where(ahead, along * half_n[..., 1], sign * (half_n[..., 1] - depth))
    volume = rng.random((*lead, n)) < 0.1
    inside = rng.uniform(-1, 1, (*lead, n, 2)) * half_n
    return np.where(volume[..., None], inside, np.stack([x, y], -1))


class Training(NamedTuple):
    """Detections to learn from."""

    u: NDArray  # (N, 2) unit coordinates
    aspect: NDArray  # (N,)
    body: NDArray  # (N, 2) [m]
    size: NDArray  # (N, 2) [m]


def partial_training(count=24000, seed=11):
    """Detections of section 8.2 over aspects, ranges and sizes, one a vehicle."""
    rng = np.random.default_rng(seed)
    size = rng.uniform([4.0, 1.6], [5.4, 2.1], (count, 2))
    aspect, reach = rng.uniform(-np.pi, np.pi, count), rng.uniform(8, 50, count)
    centre = np.stack([reach, np.zeros(count)], -1)
    e = draw_partial(rng, centre, aspect, size, np.zeros(2), 1)[:, 0]
    noise = (rotation(aspect).mT @ rng.normal(0, 0.2, (count, 2, 1)))[..., 0]
    e = e + noise
    sensor = np.zeros(2)
    return Training(e / (size / 2), aspect_angle(centre, aspect, sensor), e, size)


@dataclass(frozen=True)
class Course:
    """Start (x, y, heading, speed) and turn-rate segments (rad/s, s) of object and ego."""

    start: tuple[float, ...]
    turns: tuple[tuple[float, float], ...]
    ego: tuple[tuple[float, float], ...] = ((0.0, 1e9),)


COURSES = {
    "following": Course((-15, 0.3, 0, 12), ((0.01, 5), (-0.01, 10), (0.01, 5))),
    "turn": Course((-12, 4, 0, 8), ((0, 7), (-0.26, 6), (0, 7)), ((0, 6), (-0.26, 6), (0, 8))),
    "s-curve": Course((-14, 0, 0, 8), ((0, 5), (0.2, 5), (-0.2, 5), (0, 5)), ((0, 3.5), (0.2, 5), (-0.2, 5), (0, 6.5))),
}
FULL = Course((0, 0, 0, 10), ((0, 6), (0.2, 6), (-0.2, 8)))


def drive(start, turns, dt, steps):
    """States (steps, 5) after each step; the turn rate is the one of the segment in which the step begins."""
    ends = np.cumsum([t for _, t in turns])
    x = np.array([*start, 0.0])
    states = []
    for k in range(steps):
        x[4] = turns[min(np.searchsorted(ends, k * dt + 1e-9, side="right"), len(turns) - 1)][0]
        x, _ = coordinated_turn(x, dt)
        states.append(x)
    return np.array(states)


class Result(NamedTuple):
    """Errors (steps, runs) of one filter after its start-up, and their normalised squares."""

    position: NDArray
    velocity: NDArray
    heading: NDArray
    length: NDArray
    width: NDArray
    gwd2: NDArray  # [m^2] of the estimated box
    extent_gwd2: NDArray  # [m^2] of the extent matrix where the state has one, as on the card; else as gwd2
    nees_position: NDArray
    nees_velocity: NDArray
    nees_size: NDArray

    def row(self):
        rms = lambda a: float(np.sqrt((a**2).mean()))  # noqa: E731
        return {
            "pos": rms(self.position),
            "vel": rms(self.velocity),
            "head": np.degrees(rms(self.heading)),
            "len": rms(self.length),
            "lenb": self.length.mean(),
            "wid": rms(self.width),
            "widb": self.width.mean(),
            "gwd2": self.gwd2.mean(),
            "Xgwd2": self.extent_gwd2.mean(),
            "med": float(np.median(self.gwd2)),
            "gwd": np.sqrt(self.gwd2).mean(),
            "NEESp": self.nees_position.mean(),
            "NEESv": self.nees_velocity.mean(),
            "NEESs": self.nees_size.mean(),
        }


def squared(d, cov):
    return (d * np.linalg.solve(cov, d[..., None])[..., 0]).sum(-1)


def gaussian_wasserstein(d, X, Y):
    """Squared distance (...) of two ellipses, card section 6; centres differ by d (..., 2)."""
    root = sqrtm(X)
    cross = sqrtm(root @ Y @ root)
    return np.maximum((d**2).sum(-1) + np.trace(X + Y - 2 * cross, axis1=-2, axis2=-1), 0.0)


def compare(filter, state, truth, size):
    """One row of `Result`, each (runs,)."""
    e, rm = filter.estimate(state), getattr(state, "rm", state)
    d = e.pose[..., :2] - truth[:2]
    v = e.velocity - truth[3] * np.array([np.cos(truth[2]), np.sin(truth[2])])
    ds = e.size - size
    X, Y = extent_matrix(e.pose[..., 2], e.size), extent_matrix(truth[2], size)
    X_hat = rm.V / (rm.nu - 6)[..., None, None] if hasattr(rm, "V") else X
    return (
        np.hypot(d[..., 0], d[..., 1]),
        np.hypot(v[..., 0], v[..., 1]),
        wrap_angle(e.pose[..., 2] - truth[2]),
        ds[..., 0],
        ds[..., 1],
        gaussian_wasserstein(d, X, Y),
        gaussian_wasserstein(d, X_hat, Y),
        squared(d, e.cov[..., :2, :2]),
        squared(v, e.cov[..., 2:, 2:]),
        ((ds / e.size_std) ** 2).sum(-1),
    )


def run_full(filter, draw: Callable[..., NDArray], runs=100, seed=0, size_std=0.2, first=10):
    """Full view, section 8.1."""
    rng = np.random.default_rng(seed)
    dt, steps, size = 0.2, 100, np.array([4.7, 1.8])
    truth = drive(FULL.start, FULL.turns, dt, steps)
    x0 = np.array([*FULL.start, 0.0]) + rng.standard_normal((runs, 5)) * [0.5, 0.5, 0.1, 1.0, 0.1]
    start = prior(
        x0[:, :3],
        velocity=x0[:, 3:4] * np.stack([np.cos(x0[:, 2]), np.sin(x0[:, 2])], -1),
        yaw_rate=x0[:, 4],
        size=(4.0, 2.2),
        size_std=np.array([4.0, 2.2]) * size_std,
    )
    state, rows = filter.init(start), []
    for k in range(steps):
        state = filter.predict(state, dt)
        n = rng.poisson(8, runs)
        M = max(int(n.max()), 1)
        e = draw(rng, (runs, M), size) * size / 2
        z = truth[k, :2] + e @ rotation(truth[k, 2]).T
        state, _ = filter.update(state, Scan.from_xy(z, np.arange(M) < n[:, None]))
        if k >= first:
            rows.append(compare(filter, state, truth[k], size))
    return Result(*map(np.array, zip(*rows, strict=True)))


def run_partial(filter, course: Course, rate=2.0, runs=100, seed=0, size_std=0.1, keep=None):
    """Partial view, section 8.2; the sensor is the ego's position."""
    rng = np.random.default_rng(seed)
    dt = 1 / rate
    steps = round(20 * rate)
    truth = drive(course.start, course.turns, dt, steps)
    ego = drive((0, 0, 0, course.start[3]), course.ego, dt, steps)
    size = rng.uniform([4.0, 1.6], [5.4, 2.1], (runs, 2))
    x0 = np.array(course.start, float)
    guess = np.array([4.62, 1.95])
    start = prior(
        np.tile(x0[:3], (runs, 1)),
        velocity=x0[3] * np.array([np.cos(x0[2]), np.sin(x0[2])]),
        size=guess,
        size_std=guess * size_std,
    )
    state, rows = filter.init(start), []
    for k in range(steps):
        state = filter.predict(state, dt)
        n = np.maximum(rng.poisson(5, runs), 1)
        M = int(n.max())
        heading = np.full(runs, truth[k, 2])
        e = draw_partial(rng, np.tile(truth[k, :2], (runs, 1)), heading, size, ego[k, :2], M)
        z = truth[k, :2] + e @ rotation(truth[k, 2]).T + rng.normal(0, 0.2, e.shape)
        scan = Scan.from_xy(z, np.arange(M) < n[:, None], pose=(*ego[k, :2], 0.0))
        state, _ = filter.update(state, scan)
        if (k + 1) * dt > 2:
            rows.append(compare(filter, state, truth[k], size))
            if keep is not None:
                keep.append((truth[k], ego[k], size, state))
    return Result(*map(np.array, zip(*rows, strict=True)))
