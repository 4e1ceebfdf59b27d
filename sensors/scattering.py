"""Where on a vehicle a radar return comes from, and how many there are: functions of arrays and a generator."""

import numpy as np
from numpy.typing import NDArray

from sensors.illumination import Lit
from sensors.raycast import Edges, crossing_range
from trackers.geometry import cross, unit


def draw_counts(mean: NDArray, shape: NDArray, rng: np.random.Generator) -> NDArray:
    """Counts (...) with the given mean (...).

    The variance is mean + mean^2 / shape: negative binomial, as a Poisson count whose rate is gamma distributed.
    An infinite shape is Poisson. A shape of zero stands for no randomness: the mean, rounded.
    """
    mean, shape = np.broadcast_arrays(mean, shape)
    random = np.isfinite(shape) & (shape > 0)
    k = np.where(random, shape, 1.0)
    rate = np.where(random, mean * rng.gamma(k) / k, mean)
    return np.where(shape == 0, np.rint(mean).astype(int), rng.poisson(rate))


def choose_elements(lit: Lit, weight: NDArray, counts: NDArray, rng: np.random.Generator) -> NDArray:
    """Draw, with replacement, counts (S, N) elements of each object as seen by each radar; indices (D,) into `lit`.

    weight (L,) is positive; a count of an object without a lit element must be zero.
    """
    N = counts.shape[1]
    group = lit.sensor * N + lit.object
    order = np.argsort(group, kind="stable")
    total = np.cumsum(weight[order])
    bounds = np.searchsorted(group[order], np.arange(counts.size + 1))
    upto = np.concatenate([[0.0], total])[bounds]
    drawn = np.repeat(np.arange(counts.size), counts.ravel())
    x = upto[drawn] + (upto[drawn + 1] - upto[drawn]) * rng.random(len(drawn))
    index = np.searchsorted(total, x, "right")
    return order[np.clip(index, bounds[drawn], bounds[drawn + 1] - 1)]


def surface_points(
    origin: NDArray, bearing: NDArray, spacing: NDArray, a: NDArray, b: NDArray, rng: np.random.Generator
) -> NDArray:
    """Points (D, 2) [m] on segments a -> b (D, 2), each uniform in azimuth over the sector of the ray that lit it."""
    u = unit(bearing + spacing * (rng.random(len(bearing)) - 0.5))
    sa, sb = cross(u, a - origin), cross(u, b - origin)
    apart = sa != sb
    t = np.clip(np.where(apart, sa / np.where(apart, sa - sb, 1.0), 0.5), 0.0, 1.0)
    return a + t[:, None] * (b - a)


def room_behind(origin: NDArray, point: NDArray, body: NDArray, edges: Edges) -> NDArray:
    """Length (D,) [m] of the ray origin -> point inside the body (D,) that it enters at point (D, 2)."""
    sight = point - origin
    r = np.hypot(sight[:, 0], sight[:, 1])
    u = sight / np.maximum(r, 1e-12)[:, None]
    size = np.diff(edges.start, append=len(edges.a))[body]
    column = np.arange(size.max(initial=0))
    real = column < size[:, None]
    index = edges.start[body, None] + np.where(real, column, 0)
    leave = crossing_range(u[:, None], edges.a[index] - origin[:, None], edges.b[index] - origin[:, None])
    leave = np.where(real & (leave > r[:, None] + 1e-6), leave, np.inf).min(-1, initial=np.inf)
    return np.where(np.isfinite(leave), leave - r, 0.0)


def draw_depth(mean: NDArray, room: NDArray, rng: np.random.Generator) -> NDArray:
    """Depths (D,) [m] behind the surface: exponential with `mean` [m], cut at `room` [m]; infinite mean is uniform."""
    x = rng.random(len(room))
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = -mean * np.log1p(-x * -np.expm1(-room / mean))
    depth = np.where(np.isinf(mean), x * room, depth)
    return np.where(mean > 0, np.minimum(depth, room), 0.0)


def draw_scatter(share: NDArray, std: NDArray, rng: np.random.Generator) -> NDArray:
    """Displacements (D, 2) [m]: Gaussian with `std` [m] for a share of the detections, none for the others."""
    astray = rng.random(len(share)) < share
    return (astray * std)[:, None] * rng.standard_normal((len(share), 2))
