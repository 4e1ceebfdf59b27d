"""CONTOURS: outlines of road users seen from above, and the sizes that vehicles of each class have on the road.

An outline is written in the unit box, all sides of which it touches, and fitted to the length and width of each
vehicle: its ends keep their metres, the middle stretches. Equations and sources: docs/methods/vehicles.md.

        y
        |
    1---+---0      x forward, y to the left in the mathematical sense; vertices counter-clockwise
    |   o   |  x   from the front; every outline is symmetric about x, so one half is written down
    2-------3
"""

from dataclasses import dataclass
from functools import cached_property
from math import inf, isinf
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from trackers.geometry import cross, to_world
from trackers.lookup import look_up

Half = tuple[tuple[float, float], ...]
SHORTEST = 0.85  # share of the default length below which the ends shrink with the vehicle


@dataclass(frozen=True)
class Spread:
    """Normal distribution of one dimension, cut to a range; an infinite standard deviation makes it uniform.

    Raises:
        ValueError: the mean is outside the range, the standard deviation is negative, or a length is not positive.
    """

    mean: float  # [m]
    std: float  # [m]
    low: float  # [m]
    high: float  # [m]

    def __post_init__(self) -> None:
        if not (0 < self.low <= self.mean <= self.high < inf and self.std >= 0):
            raise ValueError(f"a spread needs 0 < low <= mean <= high and std >= 0, got {self}")

    def draw(self, rng: np.random.Generator) -> float:
        """One value [m]."""
        if isinf(self.std):
            return float(rng.uniform(self.low, self.high))
        while not self.low <= (value := float(rng.normal(self.mean, self.std))) <= self.high:
            pass
        return value


@dataclass(frozen=True)
class Sizes:
    """Sizes of one class; the width goes with the length.

    Raises:
        ValueError: the share of long vehicles is no share, or they are not longer than the others.
    """

    length: Spread
    width: Spread  # at the mean length
    slope: float = 0.0  # [m/m] of the mean width over the length
    long: tuple[float, float] | None = None  # share of the vehicles that have one greater length, and this length [m]

    def __post_init__(self) -> None:
        if self.long is not None and not (0 < self.long[0] < 1 and self.long[1] > self.length.high):
            raise ValueError(f"long needs a share in (0, 1) and a length above {self.length.high} m, got {self.long}")

    def draw(self, rng: np.random.Generator) -> NDArray:
        """Length and width (2,) [m] of one vehicle."""
        if self.long is not None and rng.uniform() < self.long[0]:
            length = self.long[1]
        else:
            length = self.length.draw(rng)  # (VEH.1)
        return np.array([length, self.slope * (length - self.length.mean) + self.width.draw(rng)])  # (VEH.2)

    @property
    def box(self) -> NDArray:
        """Least and greatest length and width, (2, 2) [m], those of the long vehicles included."""
        lengths = np.array([self.length.low, self.length.high if self.long is None else self.long[1]])
        widths = self.slope * (lengths - self.length.mean) + (self.width.low, self.width.high)
        return np.stack([lengths, widths], -1)


@dataclass(frozen=True)
class Contour:
    """One outline, the size that it is drawn at, and the sizes of its class.

    Raises:
        ValueError: the outline does not fill the unit box, is clockwise, or its ends leave no middle.
    """

    name: str
    length: float  # [m] default, at which the outline has the proportions that are written down
    width: float  # [m] default
    outline: tuple[tuple[float, float], ...]  # vertices in [-0.5, 0.5]^2, counter-clockwise, not closed
    note: str = ""
    ends: tuple[float, float] = (-0.5, 0.5)  # x of the unit box: the rear end is behind, the front end ahead
    sizes: Sizes | None = None  # of vehicles in traffic; None: all have the default size

    def __post_init__(self) -> None:
        xy = np.array(self.outline)
        box = np.stack([xy.min(0), xy.max(0)])
        if not np.array_equal(box, [[-0.5, -0.5], [0.5, 0.5]]):
            raise ValueError(f"{self.name}: outline must touch all sides of the unit box, its box is {box.tolist()}")
        if cross(xy, np.roll(xy, -1, 0)).sum() <= 0:
            raise ValueError(f"{self.name}: outline must be counter-clockwise; reverse the order of its vertices")
        rear, front = self.ends
        if not (-0.5 <= rear < front <= 0.5 and front - rear > 1 - SHORTEST):
            raise ValueError(f"{self.name}: ends must be in the unit box, {1 - SHORTEST:.2f} apart, got {self.ends}")

    @cached_property
    def points(self) -> NDArray:
        """Vertices (C, 2) in the unit box, read-only."""
        points = np.array(self.outline)
        points.flags.writeable = False
        return points

    @property
    def size(self) -> NDArray:
        """Default length and width (2,) [m]."""
        return np.array([self.length, self.width])

    @cached_property
    def stretched(self) -> NDArray:
        """Coordinates (C, 2) in the unit box of the part that grows with the body: -0.5 and 0.5 in the ends."""
        rear, front = self.ends
        along = np.clip((self.points[:, 0] - rear) / (front - rear), 0.0, 1.0) - 0.5  # (VEH.4)
        return np.column_stack([along, self.points[:, 1]])

    def fit(self, size: NDArray) -> NDArray:
        """Outline (C, 2) [m] about the centre of a body with length and width (2,) [m], x ahead."""
        keep = min(self.length, size[0] / SHORTEST)  # (VEH.3)
        return self.stretched * size + keep * (self.points - self.stretched)  # (VEH.5)

    def place(self, pose: NDArray, size: NDArray) -> NDArray:
        """Outline (C, 2) [m] in the world of a body with pose (3,) x, y [m], heading [rad] and size (2,) [m]."""
        return to_world(np.asarray(pose, float), self.fit(size))


def mirrored(left: Half) -> Half:
    """The outline from its left half (y > 0), written from the front to the rear."""
    return left + tuple((x, -y) for x, y in reversed(left))


CONTOURS = MappingProxyType({c.name: c for c in (
    Contour(
        "car", 4.7, 1.9,
        mirrored((
            (0.5, 0.18), (0.485, 0.33), (0.455, 0.43), (0.4, 0.485), (0.3, 0.5),  # bumper, rounder than the rear, wing
            (-0.35, 0.5), (-0.43, 0.485), (-0.475, 0.43), (-0.495, 0.33), (-0.5, 0.2),  # rear wing, bumper
        )),
        "sedan with rounded corners",
        ends=(-0.35, 0.3),
        sizes=Sizes(Spread(4.45, 0.42, 3.6, 5.3), Spread(1.82, 0.05, 1.67, 1.97), slope=0.09),
    ),
    Contour(
        "van", 5.5, 2.0,
        mirrored((
            (0.5, 0.28), (0.485, 0.4), (0.45, 0.47), (0.38, 0.5),
            (-0.46, 0.5), (-0.49, 0.485), (-0.5, 0.44),
        )),
        "delivery van: short round nose, square tail",
        ends=(-0.46, 0.38),
        sizes=Sizes(Spread(5.8, 0.6, 4.9, 7.0), Spread(2.02, 0.06, 1.85, 2.2)),
    ),
    Contour(
        "bus", 12.0, 2.55,
        mirrored(((0.5, 0.36), (0.495, 0.45), (0.48, 0.5), (-0.485, 0.5), (-0.498, 0.47), (-0.5, 0.42))),
        "bus or coach",
        ends=(-0.485, 0.48),
        sizes=Sizes(Spread(12.2, 1.2, 10.0, 15.0), Spread(2.55, 0.0, 2.55, 2.55), long=(0.1, 18.0)),
    ),
    Contour(
        "truck", 8.1, 2.45,
        mirrored((
            (0.5, 0.36), (0.49, 0.44), (0.465, 0.47), (0.235, 0.47),  # cab, a little narrower than the load
            (0.235, 0.3), (0.205, 0.3),  # gap between cab and load
            (0.205, 0.5), (-0.5, 0.5),  # load
        )),
        "rigid truck with cab and box body",
        ends=(-0.5, 0.205),
        sizes=Sizes(Spread(9.0, inf, 6.0, 12.0), Spread(2.48, 0.07, 2.2, 2.6)),
    ),
    Contour(
        "tractor", 5.0, 2.5,
        mirrored((
            (0.5, 0.14), (0.47, 0.18), (0.42, 0.18),  # bonnet
            (0.42, 0.38), (0.2, 0.38), (0.2, 0.18),  # front wheel
            (-0.06, 0.22), (-0.06, 0.5), (-0.44, 0.5), (-0.44, 0.2), (-0.5, 0.15),  # rear wheel, linkage
        )),
        "farm tractor: narrow bonnet, wide rear wheels",
        sizes=Sizes(Spread(4.9, 0.4, 4.2, 5.8), Spread(2.38, 0.06, 2.26, 2.48), slope=0.08),
    ),
    Contour(
        "tractor-unit", 6.0, 2.55,
        mirrored((
            (0.5, 0.38), (0.49, 0.46), (0.465, 0.5), (0.12, 0.5),  # cab, 2.3 m
            (0.12, 0.3), (-0.1, 0.3),  # frame under the trailer
            (-0.1, 0.49), (-0.42, 0.49), (-0.42, 0.3), (-0.5, 0.3),  # drive wheels
        )),
        "front body of an articulated truck",
        ends=(-0.1, 0.12),
    ),
    Contour(
        "trailer", 13.6, 2.55,
        mirrored(((0.5, 0.45), (0.4975, 0.485), (0.491, 0.5), (-0.4955, 0.5), (-0.499, 0.49), (-0.5, 0.47))),
        "rear body of an articulated truck",
        ends=(-0.4955, 0.491),
        sizes=Sizes(Spread(13.3, 0.9, 11.1, 14.5), Spread(2.55, 0.0, 2.55, 2.55), long=(0.15, 15.85)),
    ),
    Contour(
        "motorcycle", 2.2, 0.8,
        mirrored((
            (0.5, 0.07), (0.27, 0.1), (0.25, 0.5), (0.19, 0.5),  # front wheel, handlebar
            (0.12, 0.3), (-0.1, 0.34), (-0.22, 0.2), (-0.3, 0.12), (-0.5, 0.1),  # rider, rear wheel
        )),
        "motorcycle with rider",
        ends=(-0.3, 0.12),
        sizes=Sizes(Spread(2.2, 0.13, 1.9, 2.5), Spread(0.82, 0.07, 0.65, 1.0)),
    ),
    Contour("box", 4.7, 1.9, mirrored(((0.5, 0.5), (-0.5, 0.5))), "plain rectangle, for obstacles and tests"),
)})  # fmt: skip


def find(name: str) -> Contour:
    """The contour of that name; the error names the nearest one."""
    return look_up(name, CONTOURS, "contour")
