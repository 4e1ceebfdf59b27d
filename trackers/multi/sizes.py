"""The size of a new track, before any detection has shown it: that of a car or of a truck.

Equation: docs/methods/life-cycle-of-tracks.md, section 3.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from trackers.parameters import check_numbers


@dataclass(frozen=True)
class BirthSize:
    """Mean length and width, and standard deviations of their logarithms, by the length of the cell."""

    car: tuple[float, float] = (4.6, 1.86)  # [m]
    car_std: tuple[float, float] = (0.12, 0.06)
    truck: tuple[float, float] = (12.0, 2.5)  # [m]
    truck_std: tuple[float, float] = (0.25, 0.08)
    truck_above: float = 6.5  # [m]

    def __post_init__(self) -> None:
        check_numbers(self, positive=[field.name for field in fields(self)])

    def of(self, length: NDArray) -> tuple[NDArray, NDArray]:
        """Size (..., 2) [m] and its std (..., 2) [m] of a new track whose cell is length (...) [m] long."""
        truck = (np.asarray(length) > self.truck_above)[..., None]  # (LIFE.16)
        size = np.where(truck, self.truck, self.car)
        return size, size * np.where(truck, self.truck_std, self.car_std)
