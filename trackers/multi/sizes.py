"""The size prior: mean and spread of length and width by class, to which the sizes of all tracks revert.

Equations: docs/methods/multi-object-tracking.md, sections 2, 7 and 8.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from trackers.estimate import Estimate
from trackers.geometry import unit
from trackers.linalg import outer
from trackers.parameters import check_numbers


@dataclass(frozen=True)
class SizePrior:
    """Mean reversion of log length and log width to their class; car below `truck_above`, else truck."""

    car: tuple[float, float] = (4.6, 1.86)  # [m]
    car_std: tuple[float, float] = (0.08, 0.05)  # of the logarithms
    truck: tuple[float, float] = (12.0, 2.5)
    truck_std: tuple[float, float] = (0.25, 0.05)
    birth_std: tuple[float, float] = (0.12, 0.06)
    truck_birth_std: tuple[float, float] = (0.25, 0.08)
    truck_above: float = 6.5  # [m]
    tau: float = 3.0  # [s]
    least: tuple[float, float] = (2.0, 0.8)  # [m] smallest length and width, of a motorcycle
    most: tuple[float, float] = (20.0, 2.9)  # [m] greatest length and width

    def __post_init__(self) -> None:
        check_numbers(self, positive=[field.name for field in fields(self)])

    def of(self, size: NDArray) -> tuple[NDArray, NDArray]:
        """Mean size [m] of the class, and std of its logarithms, (..., 2) each, of objects with size (..., 2) [m]."""
        truck = (size[..., 0] > self.truck_above)[..., None]
        return np.where(truck, self.truck, self.car), np.where(truck, self.truck_std, self.car_std)

    def at_birth(self, length: NDArray) -> tuple[NDArray, NDArray]:
        """Size (..., 2) [m] and its std (..., 2) [m] of a new track whose cell is length (...) [m] long."""
        truck = (np.asarray(length) > self.truck_above)[..., None]  # (LIFE.16)
        size = np.where(truck, self.truck, self.car)
        return size, size * np.where(truck, self.truck_birth_std, self.birth_std)

    def relax(
        self, size: NDArray, size_std: NDArray, dt: float, of_class: tuple[NDArray, NDArray] | None = None
    ) -> tuple[NDArray, NDArray]:
        """Size and std (..., 2) [m] after dt [s], the size clipped to `least` and `most`.

        of_class is the mean size (..., 2) [m] and the std of its logarithms (..., 2) of the class that a filter found,
        NaN where it found none; there, and for None, the class follows from the length.
        """
        mean, std = self.of(size)
        if of_class is not None:
            known = np.isfinite(of_class[0])
            mean, std = np.where(known, of_class[0], mean), np.where(known, of_class[1], std)
        a = np.exp(-dt / self.tau)
        log_size = np.log(mean) + a * (np.log(size) - np.log(mean))  # (MOT.7)
        log_std = np.sqrt(a**2 * (size_std / size) ** 2 + (1 - a**2) * std**2)  # (MOT.7)
        size = np.clip(np.exp(log_size), self.least, self.most)
        return size, size * log_std


def stretch(estimate: Estimate, reach: NDArray, log_std: float) -> Estimate:
    """Boxes made longer by reach (..., 2) [m] at the front and at the rear.

    The centre moves along the heading by half of the difference, and its covariance grows by the square of that shift.
    log_std is the least standard deviation of the logarithm of the new lengths.
    """
    along = unit(estimate.pose[..., 2])
    shift = ((reach[..., 0] - reach[..., 1]) / 2)[..., None] * along
    pose, size, size_std, cov = (a.copy() for a in (estimate.pose, estimate.size, estimate.size_std, estimate.cov))
    pose[..., :2] += shift
    size[..., 0] += reach.sum(-1)
    size_std[..., 0] = np.maximum(size_std[..., 0], log_std * size[..., 0])
    cov[..., :2, :2] += outer(shift)
    return estimate._replace(pose=pose, size=size, size_std=size_std, cov=cov, contour=None)
