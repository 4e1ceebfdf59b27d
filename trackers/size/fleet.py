"""The fleet: how long and how wide the vehicles of each class are, the prior of every size.

Equations: docs/methods/size-from-both-ends.md, section 5.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trackers.parameters import check_numbers


class Load(NamedTuple):
    """How much less a body shows from behind of what lies ahead of its load, or of its rear wheels."""

    share: float = 0.0  # of the class that is so
    part: float = 1.0  # of the length that shows as any other body does
    alone: float = (
        1.0  # density of detections ahead of that, as a share of the one in it, where the rear alone is in view
    )
    aslant: float = 1.0  # the same where a side is in view, too; it fades out 10 degrees off the axis

    @property
    def log_ratios(self) -> NDArray:
        """Logarithms (2, 2) of the density in that part, and ahead of it, to an even one, `alone` and `aslant`."""
        ahead = np.array([self.alone, self.aslant])
        return np.log([np.ones(2), ahead] / (self.part + (1 - self.part) * ahead))  # (ENDS.46)


NO_LOAD = Load()


@dataclass(frozen=True)
class VehicleClass:
    """Share of the traffic, mean and standard deviation [m] of length and width, and what a load hides of the cab."""

    name: str
    share: float
    length: tuple[float, float]
    width: tuple[float, float]
    load: Load = NO_LOAD  # of a class with a hinge also: in a bend its share has no detections ahead of that part
    inset: tuple[float, float] = (0.0, 0.0)  # [m] of the ends, as detections show them, from the box: mean and std
    rounding: tuple[float, float] = (0.0, 0.0)  # [m] by which detections end before the front, or rear, that faces away
    hinge: tuple[float, float] = (0.0, 0.0)  # [m] from a hinge back to the axle behind it, and on to the front

    def __post_init__(self) -> None:
        check_numbers(self, positive=("share", "length", "width"))
        if not (0 <= self.load.share <= 1 and all(0 < x <= 1 for x in self.load[1:])):
            raise ValueError(f"load must have shares from 0 to 1, and above 0 but for the first, got {self.load}")


FLEET = (
    VehicleClass("motorcycle", 0.05, (2.2, 0.15), (0.82, 0.08), inset=(0.28, 0.12)),
    VehicleClass("car", 0.62, (4.45, 0.42), (1.83, 0.09), rounding=(0.26, 0.14)),
    VehicleClass("van", 0.13, (5.8, 0.6), (2.03, 0.08), load=Load(0.1, 0.5, 0.1, 0.08), rounding=(0.25, 0.02)),
    VehicleClass("truck", 0.10, (9.0, 1.75), (2.48, 0.07), load=Load(0.95, 0.71, 0.4, 0.15)),
    VehicleClass("bus", 0.03, (12.2, 1.3), (2.55, 0.04)),
    VehicleClass("articulated", 0.07, (16.2, 1.1), (2.55, 0.04), load=Load(0.9, 0.82, 0.05, 0.8), hinge=(7.7, 4.5)),
)


@dataclass(frozen=True)
class Fleet:
    """Classes of vehicles; within a class length and width are independent."""

    classes: tuple[VehicleClass, ...] = FLEET
    floor: float = 1e-4  # probability spread evenly over all sizes, so that none is impossible

    def __post_init__(self) -> None:
        check_numbers(self)
        shares = [c.share for c in self.classes]
        if not shares or min(shares) <= 0 or not 0 < self.floor < 1:
            raise ValueError(
                f"classes must have positive shares and floor be within 0 and 1, got {shares} and {self.floor}"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the classes."""
        return tuple(c.name for c in self.classes)

    @property
    def shares(self) -> NDArray:
        """Shares (C,) of the traffic, which sum to one."""
        share = np.array([c.share for c in self.classes])
        return share / share.sum()

    def of_length(self, lengths: NDArray) -> NDArray:
        """Probabilities (C, K) of lengths (K,) [m] given the class."""
        return _gaussians(tuple(c.length for c in self.classes), lengths, self.floor)

    def of_width(self, widths: NDArray) -> NDArray:
        """Probabilities (C, K) of widths (K,) [m] given the class."""
        return _gaussians(tuple(c.width for c in self.classes), widths, self.floor)

    @property
    def insets(self) -> NDArray:
        """Mean and mean square (C, 2) of the insets."""
        mean, std = np.array([c.inset for c in self.classes]).T
        return np.stack([mean, mean**2 + std**2], -1)

    @property
    def roundings(self) -> NDArray:
        """The roundings (2, C), of front and rear, and the variances (C,) of the lengths, (3, C) together."""
        return np.array([(*c.rounding, c.length[1] ** 2) for c in self.classes]).T

    @property
    def hinges(self) -> NDArray:
        """The hinges (2, C)."""
        return np.array([c.hinge for c in self.classes]).T

    @property
    def loads(self) -> tuple[tuple[int, Load], ...]:
        """Index and load of the classes that have one."""
        return tuple((c, one.load) for c, one in enumerate(self.classes) if one.load.share > 0)

    def bends(self, lengths: NDArray) -> tuple[tuple[int, float, NDArray], ...]:
        """Classes with a hinge: index, share, and matrix (K, K) from a function of L_k to that of f L_k."""
        some = [(c, one.load) for c, one in enumerate(self.classes) if one.hinge[0] > 0]
        return tuple((c, load.share, _shortened(load.part, lengths)) for c, load in some)  # (ENDS.33)


class Prior(NamedTuple):
    """A fleet on the grids of C classes, K lengths and K' widths."""

    shares: NDArray  # (C,)
    length: NDArray  # (C, K) probabilities given the class
    width: NDArray  # (C, K')
    loads: tuple[tuple[int, Load], ...]  # as of `Fleet.loads`
    bends: tuple[tuple[int, float, NDArray], ...]  # as of `Fleet.bends`
    insets: NDArray  # (C, 2) as of `Fleet.insets`
    roundings: NDArray  # (3, C) as of `Fleet.roundings`
    hinges: NDArray  # (2, C) as of `Fleet.hinges`

    @classmethod
    def of(cls, fleet: Fleet, lengths: NDArray, widths: NDArray) -> "Prior":
        """Arrays of a fleet for lengths (K,) and widths (K',) [m]."""
        of_length, of_width, f = fleet.of_length(lengths), fleet.of_width(widths), fleet
        return cls(f.shares, of_length, of_width, f.loads, f.bends(lengths), f.insets, f.roundings, f.hinges)


def _shortened(share: float, x: NDArray) -> NDArray:
    """Matrix (K, K) that interpolates a function of evenly spaced values x (K,) at a share of each of them."""
    at = np.clip((share * x - x[0]) / (x[1] - x[0]), 0, len(x) - 1)
    return np.maximum(1 - np.abs(at[:, None] - np.arange(len(x))), 0.0)


def _gaussians(moments: tuple[tuple[float, float], ...], values: NDArray, floor: float) -> NDArray:
    """Gaussians (C, K) on evenly spaced values (K,), each summing to one, mixed with an even distribution."""
    mean, std = np.array(moments).T[..., None]
    p = np.exp(-0.5 * ((values - mean) / std) ** 2)
    return (1 - floor) * p / p.sum(-1, keepdims=True) + floor / len(values)  # (ENDS.15)
