"""Scattering centres that stay on a body for a while: an option of a sensor, off unless it is given.

The k-th detection of an object is that of its centre k. All that is random about it follows from a hash of the run's
seed, the object, k and the number of the centre's lifetime. Equations: docs/methods/radar.md, section 11.
"""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from sensors.hashing import fold, uniform
from sensors.illumination import Illuminated
from sensors.raycast import Edges
from sensors.scattering import weighted_choice
from sensors.scene import Scene
from trackers.geometry import cross, unit, wrap_angle

CELL = 0.1  # [m] longest cell of an outline; within its cell a centre may move as the view changes
BIRTH, PLACE, DRAW = range(3)  # independent keys of one centre


@dataclass(frozen=True)
class Persistence:
    """How long a scattering centre stays where it is on its body.

    Raises:
        ValueError: a lifetime that is not positive and finite.
    """

    lifetime: float  # [s] of each centre; centres of one body are renewed at different times

    def __post_init__(self) -> None:
        if not (np.isfinite(self.lifetime) and self.lifetime > 0):
            raise ValueError(
                f"persistence.lifetime must be positive and finite, got {self.lifetime}; "
                "persistence=None draws centres anew in every scan"
            )


class Centres:
    """The centres of all detections (D,) of one scan; draws like a generator, the same while a centre lasts."""

    def __init__(self, key: NDArray) -> None:
        """Keys (D,) uint64, one a centre and lifetime."""
        self.place, self._draw, self._calls = fold(key, PLACE), fold(key, DRAW), 0

    def random(self, size: int) -> NDArray:
        """Uniform numbers (D,) within [0, 1), others with each call; `size` is D."""
        self._calls += 1
        return uniform(fold(self._draw, self._calls))

    def uniform(self, low: float, high: float, size: int) -> NDArray:
        """Uniform numbers (D,) within [low, high)."""
        return low + (high - low) * self.random(size)

    def integers(self, high: int, size: int) -> NDArray:
        """Integers (D,) below `high`."""
        return (self.random(size) * high).astype(int)

    def standard_normal(self, size: tuple[int, int]) -> NDArray:
        """Standard normal numbers, size = (D, n), by Box and Muller (1958)."""
        n, columns = size
        pairs = [(self.random(n), self.random(n)) for _ in range(columns)]
        return np.stack([np.sqrt(-2.0 * np.log1p(-a)) * np.cos(2.0 * np.pi * b) for a, b in pairs], -1)


def centres(lifetime: NDArray, scene: Scene, counts: NDArray, rng: Generator) -> Centres:
    """The centres of the detections that S sensors have of N objects, counts (S, N).

    lifetime (S,) [s] is that of the centres of each sensor; where it is 0, `rng` draws them for this scan alone.
    """
    sensor, row = (np.repeat(index.ravel(), counts.ravel()) for index in np.indices(counts.shape))
    slot = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts.ravel(), counts.ravel())
    who = fold(fold(run_key(rng), scene.objects.id[row]), slot)
    lasts = lifetime[sensor] > 0
    period = np.where(lasts, lifetime[sensor], 1.0)
    life = np.floor(scene.time / period + uniform(fold(who, BIRTH))).astype(np.int64)  # (RAD.37)
    anew = rng.integers(2**64, size=len(row), dtype=np.uint64) if not lasts.all() else who
    return Centres(np.where(lasts, fold(who, life), anew))


def run_key(rng: Generator) -> NDArray:
    """Key (1,) uint64 of the seed that a generator was made from, however much was drawn from it since."""
    try:
        return rng.bit_generator.seed_seq.generate_state(1, np.uint64)
    except (AttributeError, NotImplementedError):
        raise ValueError(
            "rng must know its seed for sensor.persistence, got one without a SeedSequence; "
            "make it by numpy.random.default_rng(seed)"
        ) from None


def cut_at_cells(
    elements: Illuminated, weight: NDArray, edges: Edges, pose: NDArray
) -> tuple[Illuminated, NDArray, NDArray]:
    """Elements cut where cells of their edges end: the parts, their weights (P,), and their cells (P,) of the edge.

    Each part has a share of the sector of its ray and of the weight (L,). pose (S, 3) is that of the sensors.
    """
    place, spacing = pose[elements.sensor, :2], elements.chord / elements.range
    a, b = edges.a[elements.segment] - place, edges.b[elements.segment] - place
    e = b - a
    number = cell_count(e)

    def sector_share(row: NDArray, point: NDArray) -> NDArray:  # from -1/2 to 1/2 over the sector of the ray
        azimuth = np.arctan2(point[:, 1], point[:, 0])
        return np.clip(wrap_angle(azimuth - elements.bearing[row]) / spacing[row], -0.5, 0.5)

    every = np.arange(len(number))
    ends = np.sort(np.stack([sector_share(every, a), sector_share(every, b)]), 0)
    cell = []
    for end in ends:
        u = unit(elements.bearing + spacing * end)
        sa, sb = cross(u, a), cross(u, b)
        t = np.clip(np.where(sa != sb, sa / np.where(sa != sb, sa - sb, 1.0), 0.5), 0.0, 1.0)  # (RAD.4)
        cell.append(np.minimum(np.floor(t * number).astype(int), number - 1))
    step, parts = np.sign(cell[1] - cell[0]), np.abs(cell[1] - cell[0]) + 1
    row = np.repeat(every, parts)
    nth = np.arange(len(row)) - np.repeat(np.cumsum(parts) - parts, parts)
    at = cell[0][row] + step[row] * nth
    border = a[row] + ((at + (step[row] > 0)) / number[row])[:, None] * e[row]
    last = nth == parts[row] - 1
    high = np.where(last, 0.5, sector_share(row, border))
    low = np.where(nth == 0, -0.5, np.concatenate([[-0.5], high[:-1]])) if len(row) else high
    share = np.maximum(high - low, 0.0)
    part = Illuminated(*(column[row] for column in elements))
    bearing = part.bearing + spacing[row] * (low + high) / 2
    return part._replace(bearing=bearing, chord=part.chord * share), weight[row] * share, at


def cell_count(edge: NDArray) -> NDArray:
    """How many cells edges (L, 2) [m] are divided into, (L,) int."""
    return np.maximum(np.ceil(np.hypot(edge[:, 0], edge[:, 1]) / CELL - 1e-6).astype(int), 1)


def choose_parts(
    centre: Centres, parts: Illuminated, weight: NDArray, cell: NDArray, edges: Edges, owner: NDArray, counts: NDArray
) -> NDArray:
    """Indices (D,) of the parts (P,) on which the centres lie, with probability proportional to weight (P,).

    cell (P,) is that of the edge, owner (B,) the object of each body, counts (S, N) the detections. The cells race,
    each with a time of its own for each centre, so a centre stays until its cell is hidden or others gain much weight.
    """
    nth_body = np.tril(owner[:, None] == owner, -1).sum(-1)[edges.body[parts.segment]]  # of its object
    name = fold(fold(fold(np.zeros(1, np.uint64), nth_body), edges.edge[parts.segment]), cell)
    group = parts.sensor * counts.shape[1] + parts.object
    order = np.lexsort((cell, parts.segment, group))
    new = np.diff(group[order], prepend=-1) | np.diff(parts.segment[order], prepend=-1)
    new = (new | np.diff(cell[order], prepend=-1)) != 0
    index = np.zeros(len(order), int)
    index[order] = np.cumsum(new) - 1  # of the cell in view, by sensor and object
    first = order[new]
    total = np.bincount(index, weight, len(first))
    bounds = np.searchsorted(group[first], np.arange(counts.size + 1))
    drawn = np.repeat(np.arange(counts.size), counts.ravel())
    runners = np.diff(bounds)[drawn]
    start = np.cumsum(runners) - runners
    row = np.repeat(np.arange(len(drawn)), runners)
    runner = np.arange(len(row)) + np.repeat(bounds[drawn] - start, runners)
    with np.errstate(divide="ignore", invalid="ignore"):
        time = -np.log1p(-uniform(fold(centre.place[row], name[first[runner]]))) / total[runner]  # (RAD.38)
    best = np.minimum.reduceat(time, start) if len(drawn) else time
    wins = np.flatnonzero(time == best[row])
    winner = runner[wins[np.searchsorted(row[wins], np.arange(len(drawn)))]]
    return weighted_choice(index, weight, winner, centre.random(len(winner)))
