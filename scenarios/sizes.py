"""Lengths and widths of vehicles as they vary on the road: one distribution for each class.

Equations: docs/methods/vehicles.md.
"""

from dataclasses import dataclass
from math import inf, isinf

import numpy as np
from numpy.typing import NDArray


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
