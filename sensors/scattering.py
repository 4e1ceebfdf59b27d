"""How many returns a vehicle gives, and where on it they lie; docs/methods/radar.md, sections 4 and 5."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sensors.illumination import Illuminated
from sensors.raycast import Edges, crossing_range
from trackers.geometry import cross, unit


class Draws(Protocol):
    """What is asked for random numbers: a generator of numpy, or `sensors.persistence.Centres`."""

    def random(self, size: int, /) -> NDArray:
        """Uniform numbers (size,) within [0, 1)."""

    def uniform(self, low: float, high: float, size: int, /) -> NDArray:
        """Uniform numbers (size,) within [low, high)."""

    def integers(self, high: int, /, *, size: int) -> NDArray:
        """Integers (size,) below `high`."""

    def standard_normal(self, size: tuple[int, int], /) -> NDArray:
        """Standard normal numbers of shape `size`."""


def draw_counts(mean: NDArray, shape: NDArray, rng: np.random.Generator) -> NDArray:
    """Counts (...) of the given mean (...), negative binomial with variance mean + mean^2 / shape.

    Drawn as a Poisson count whose rate is gamma distributed. An infinite shape is Poisson; zero stands for no
    randomness: the mean, rounded.
    """
    random = np.isfinite(shape) & (shape > 0)
    if random.all():
        return rng.poisson(mean * rng.gamma(shape, size=mean.shape) / shape)  # (RAD.11)
    k = np.where(random, shape, 1.0)
    rate = np.where(random, mean * rng.gamma(k, size=mean.shape) / k, mean)  # (RAD.11)
    return np.where(shape == 0, np.rint(mean).astype(int), rng.poisson(rate))


def choose_elements(elements: Illuminated, weight: NDArray, counts: NDArray, rng: np.random.Generator) -> NDArray:
    """Indices (D,) of elements drawn with replacement, counts (S, N) for each radar and object.

    weight (L,) is positive; the count of an object without an element must be zero.
    """
    group = elements.sensor * counts.shape[1] + elements.object
    drawn = np.repeat(np.arange(counts.size), counts.ravel())
    return weighted_choice(group, weight, drawn, rng.random(len(drawn)))


def weighted_choice(group: NDArray, weight: NDArray, drawn: NDArray, x: NDArray) -> NDArray:
    """Indices (D,) of elements of the groups `drawn` (D,), at the share x (D,) of the weight of its group.

    group (L,) int and weight (L,) are those of all elements; each group that is drawn must have one.
    """
    order = np.argsort(group, kind="stable")
    total = np.cumsum(weight[order])
    bounds = np.searchsorted(group[order], np.arange(drawn.max(initial=-1) + 2))
    upto = np.concatenate([[0.0], total])[bounds]
    at = upto[drawn] + (upto[drawn + 1] - upto[drawn]) * x
    index = np.searchsorted(total, at, "right")
    return order[np.clip(index, bounds[drawn], bounds[drawn + 1] - 1)]


def surface_points(origin: NDArray, bearing: NDArray, spacing: NDArray, a: NDArray, b: NDArray, rng: Draws) -> NDArray:
    """Points (D, 2) [m] on segments a -> b (D, 2), uniform in azimuth over the sector of the ray that reached them.

    origin (D, 2) [m] is the sensor, bearing (D,) [rad] and spacing (D,) [rad] are those of the ray.
    """
    u = unit(bearing + spacing * (rng.random(len(bearing)) - 0.5))
    sa, sb = cross(u, a - origin), cross(u, b - origin)
    apart = sa != sb
    t = np.clip(np.where(apart, sa / np.where(apart, sa - sb, 1.0), 0.5), 0.0, 1.0)
    return a + t[:, None] * (b - a)  # (RAD.14)


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


def draw_depth(mean: NDArray, room: NDArray, rng: Draws) -> NDArray:
    """Depths (D,) [m] behind the surface: exponential with `mean` [m], cut at `room` [m]; infinite mean is uniform."""
    x = rng.random(len(room))
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = -mean * np.log1p(-x * -np.expm1(-room / mean))  # (RAD.15)
    depth = np.where(np.isinf(mean), x * room, depth)
    return np.where(mean > 0, np.minimum(depth, room), 0.0)


def draw_scatter(share: NDArray, std: NDArray, rng: Draws) -> NDArray:
    """Displacements (D, 2) [m]: Gaussian with `std` [m] for a share of the detections, none for the others."""
    astray = rng.random(len(share)) < share
    return (astray * std)[:, None] * rng.standard_normal((len(share), 2))
