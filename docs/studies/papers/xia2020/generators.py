"""What the experiments of xia2020 are made of: courses, and generators of detections on a body.

Courses and generators are ours, after the pictures and the few numbers of the papers. Heading turns from x towards y
and "left" is mathematical here, not as highway-env draws. Unit coordinates u put the body on [-1, 1]^2: x to the front,
y to the left.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_ndtr, ndtr, ndtri, ndtri_exp

from trackers.geometry import rotation, unit
from trackers.htg.bins import aspect_angle
from trackers.htg.density import HTG
from trackers.motion.turn import coordinated_turn

# -- courses ----------------------------------------------------------------------------------------------------------


class Turn(NamedTuple):
    """A stretch of constant yaw rate."""

    duration: float  # [s]
    yaw_rate: float  # [rad/s]


class Course(NamedTuple):
    """Object and ego at the same constant speed; the ego starts at the origin and carries the sensor."""

    name: str
    start: tuple[float, float, float, float]  # x, y [m], heading [rad], speed [m/s] of the object
    turns: tuple[Turn, ...]
    ego: tuple[Turn, ...] = (Turn(20.0, 0.0),)


FULL_VIEW = Course("full view", (0, 0, 0, 10), (Turn(6, 0), Turn(6, 0.2), Turn(8, -0.2)))
FOLLOWING = Course("following", (-15, 0.3, 0, 12), (Turn(5, 0.01), Turn(10, -0.01), Turn(5, 0.01)))
RIGHT_TURN = Course(
    "right turn", (-12, 4, 0, 8), (Turn(7, 0), Turn(6, -0.26), Turn(7, 0)), (Turn(6, 0), Turn(6, -0.26), Turn(8, 0))
)
S_CURVE = Course(
    "S curve",
    (-14, 0, 0, 8),
    (Turn(5, 0), Turn(5, 0.2), Turn(5, -0.2), Turn(5, 0)),
    (Turn(3.5, 0), Turn(5, 0.2), Turn(5, -0.2), Turn(6.5, 0)),
)
COURSES = (FOLLOWING, RIGHT_TURN, S_CURVE)


def drive(start: ArrayLike, turns: tuple[Turn, ...], t: NDArray) -> NDArray:
    """States (T, 5) x, y, heading, speed, yaw rate at times t (T,) [s]; exact, whatever the steps.

    start (4,): x, y [m], heading [rad], speed [m/s]. After the last stretch the last yaw rate goes on.
    """
    ends = np.cumsum([turn.duration for turn in turns])
    piece = np.minimum(np.searchsorted(ends, t - 1e-9), len(turns) - 1)
    states = np.empty((len(t), 5))
    state, begin = np.array([*np.asarray(start, float), 0.0]), 0.0
    for k, turn in enumerate(turns):
        state[4] = turn.yaw_rate
        for i in np.flatnonzero(piece == k):
            states[i] = coordinated_turn(state, float(t[i] - begin))[0]
        state, begin = coordinated_turn(state, turn.duration)[0], begin + turn.duration
    return states


# -- full view: a generator gives unit coordinates (*shape, 2) of a body with size (2,) [m] ---------------------------

DrawDetections = Callable[[np.random.Generator, tuple[int, ...], NDArray], NDArray]

PUBLISHED = HTG(np.array(0.183), np.array([0.675, 0.670, 0.611, 0.648]), np.array(0.763), np.array([0.037, 0.035]))
HOLE = 0.8  # of the unit square, of the band
NOISE = 0.2  # [m] standard deviation of the band and of the partial view

# Student-t mixture: mean, scale (2,) each in unit coordinates, weight; corners, bumpers, wheel houses
MIXTURE = (
    *(((x, y), (0.08, 0.10), 0.11) for x in (-0.92, 0.92) for y in (-0.88, 0.88)),
    *(((x, 0.0), (0.06, 0.35), 0.14) for x in (-0.95, 0.95)),
    *(((x, y), (0.12, 0.08), 0.07) for x in (-0.60, 0.60) for y in (-0.90, 0.90)),
)
FREEDOM = 5  # of the Student-t


def draw_band(rng: np.random.Generator, shape: tuple[int, ...], size: NDArray) -> NDArray:
    """Uniform between the squares of half width 1 and 0.8, and 0.2 m of noise."""
    u = rng.uniform(-1, 1, (*shape, 2))
    while (hidden := (np.abs(u) < HOLE).all(-1)).any():
        u[hidden] = rng.uniform(-1, 1, (int(hidden.sum()), 2))
    return u + rng.normal(0, NOISE, u.shape) * 2 / size


def draw_htg(rng: np.random.Generator, shape: tuple[int, ...], size: NDArray) -> NDArray:
    """The published density itself, its noise included."""
    return sample(PUBLISHED, int(np.prod(shape)), rng).reshape(*shape, 2)


def draw_vrm(rng: np.random.Generator, shape: tuple[int, ...], size: NDArray) -> NDArray:
    """A Student-t mixture in place of the trained variational radar model, of which the slides print no parameters."""
    mean, scale, weight = (np.array(column) for column in zip(*MIXTURE, strict=True))
    k = rng.choice(len(weight), shape, p=weight / weight.sum())
    t = rng.standard_normal((*shape, 2)) / np.sqrt(rng.chisquare(FREEDOM, shape) / FREEDOM)[..., None]
    return mean[k] + scale[k] * t


GENERATORS: dict[str, DrawDetections] = {"band": draw_band, "htg": draw_htg, "vrm": draw_vrm}


# -- partial view -----------------------------------------------------------------------------------------------------

NORMALS = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])  # front, rear, left, right
LENGTHS, WIDTHS = (4.0, 5.4), (1.6, 2.1)  # [m] of the vehicles
DEPTH = 0.25  # [m] mean depth of a detection behind the surface
FROM_BODY, FROM_ENDS = 0.1, 0.4  # shares: anywhere in the body; of the others, near the ends of the side


def draw_sides(rng: np.random.Generator, to_sensor: NDArray, half: NDArray, n: int) -> NDArray:
    """Side (..., n) of each detection: length times cosine of incidence at its middle, for those that face the sensor.

    to_sensor (..., 2) [m] in the frame of the body, half (..., 2) [m] half length and width.
    """
    d = to_sensor[..., None, :] - NORMALS * half[..., None, :]
    cosine = (d * NORMALS).sum(-1) / np.hypot(d[..., 0], d[..., 1])
    weight = half[..., [1, 1, 0, 0]] * np.maximum(cosine, 0.0)
    total = weight.sum(-1, keepdims=True)
    if (total <= 0).any():
        raise ValueError(f"{int((total <= 0).sum())} sensors lie inside the body that they see; keep them outside")
    share = np.cumsum(weight / total, -1)
    return (rng.random((*half.shape[:-1], n, 1)) > share[..., None, :3]).sum(-1)


def draw_partial(rng: np.random.Generator, to_sensor: NDArray, size: NDArray, n: int) -> NDArray:
    """Body coordinates (..., n, 2) [m] of sources on bodies of size (..., 2) [m], seen from to_sensor (..., 2) [m]."""
    half = size / 2
    shape = (*size.shape[:-1], n)
    side = draw_sides(rng, to_sensor, half, n)
    lengthwise = side >= 2  # left and right run along x
    ends = np.minimum(rng.normal(0.85, 0.1, shape), 1.0) * rng.choice([-1.0, 1.0], shape)
    along = np.where(rng.random(shape) < FROM_ENDS, ends, rng.uniform(-1, 1, shape))
    normal = NORMALS[side]
    room = np.where(lengthwise, half[..., 1:], half[..., :1])
    depth = np.minimum(rng.exponential(DEPTH, shape), room)
    run = np.where(lengthwise, half[..., :1], half[..., 1:]) * along
    surface = normal * (room - depth)[..., None] + np.abs(normal[..., ::-1]) * run[..., None]
    anywhere = rng.uniform(-1, 1, (*shape, 2)) * half[..., None, :]
    return np.where((rng.random(shape) < FROM_BODY)[..., None], anywhere, surface)


class Training(NamedTuple):
    """Detections to learn from."""

    u: NDArray  # (N, 2) unit coordinates
    aspect: NDArray  # (N,) [rad]
    size: NDArray  # (N, 2) [m] of the car
    to_sensor: NDArray  # (N, 2) [m] in the frame of the body


def draw_sizes(rng: np.random.Generator, count: int) -> NDArray:
    """Lengths and widths (count, 2) [m] of cars."""
    return np.stack([rng.uniform(*LENGTHS, count), rng.uniform(*WIDTHS, count)], -1)


def draw_training(rng: np.random.Generator, count: int = 24000) -> Training:
    """Lone cars at uniform aspects and ranges of 8 to 50 m, a detection each."""
    size = draw_sizes(rng, count)
    aspect = rng.uniform(-np.pi, np.pi, count)
    reach = rng.uniform(8.0, 50.0, count)
    to_sensor = -reach[:, None] * unit(-aspect)  # the line of sight has the angle -aspect in the body
    e = draw_partial(rng, to_sensor, size, 1)[:, 0] + rng.normal(0, NOISE, (count, 2))
    return Training(2 * e / size, aspect, size, to_sensor)


def seen_from(pose: NDArray, sensor: NDArray) -> tuple[NDArray, NDArray]:
    """Sensor position (..., 2) [m] in the frame of bodies with pose (..., 3), and their aspect angle (...) [rad]."""
    d = (rotation(pose[..., 2]).mT @ (sensor - pose[..., :2])[..., None])[..., 0]
    return d, aspect_angle(pose[..., :2], pose[..., 2], sensor)


def sample(p: HTG, n: int, rng: np.random.Generator) -> NDArray:
    """Draw n points (..., n, 2) from each of the densities p (...).

    The outside of the hole is two half planes, left and right of it, and two strips; every piece is drawn by tail-safe
    inversion, so that a hole with nearly all the mass costs no more than any other.
    """
    s = np.sqrt(p.rho)[..., None, None]
    t = np.moveaxis(p.bounds, -1, 0)[..., None] / s[..., 0]  # (4, ..., 1)
    with np.errstate(divide="ignore"):
        inside_x = np.log(ndtr(t[2]) - ndtr(-t[0]))
    log_piece = np.stack([log_ndtr(-t[0]), log_ndtr(-t[2]), inside_x + log_ndtr(-t[1]), inside_x + log_ndtr(-t[3])])
    piece = np.exp(log_piece - np.logaddexp.reduce(log_piece, 0))
    shape = (*p.rho.shape, n)
    k = (rng.random(shape) > np.cumsum(piece, 0)[:3]).sum(0)
    log_u, v = np.log1p(-rng.random(shape)), rng.random(shape)
    low, high = ndtr(-t[0]), ndtr(t[2])
    x = np.select(
        [k == 0, k == 1],
        [ndtri_exp(log_piece[0] + log_u), -ndtri_exp(log_piece[1] + log_u)],
        ndtri(low + v * (high - low)),
    )
    y = np.select([k == 2, k == 3], [ndtri_exp(log_ndtr(-t[1]) + log_u), -ndtri_exp(log_ndtr(-t[3]) + log_u)], ndtri(v))
    z = s * np.stack([x, y], -1) + rng.standard_normal((*shape, 2)) * np.sqrt(p.r)[..., None, :]
    return z @ rotation(p.theta).mT
