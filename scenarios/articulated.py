"""Articulated trucks: one highway-env vehicle that drives as its tractor unit and pulls a trailer of any length.

The trailer hangs on it by one angle and its axle does not slip sideways. As a vehicle of its own it would be the
follower of its tractor for MOBIL, so it exists only in `parts`, in collisions and in the gaps of followers. Equations:
docs/methods/vehicles.md.

            trailer, here 13.6 m
    +-----------------------------+
    |        axle -- D -- kingpin-|--+---+     overall 2.9 m more than the trailer, (VEH.6)
    |                         |   |  |cab|     kingpin 1.5 m behind the centre of the tractor unit
    +-----------------------------+--+---+
"""

from collections.abc import Callable
from typing import Any, Self

import numpy as np
from highway_env.vehicle.kinematics import Vehicle
from numpy.typing import ArrayLike, NDArray

from scenarios.bodies import RigidPart, body_part, motion
from scenarios.contours import CONTOURS
from scenarios.vehicles import CourseVehicle, SizedIDM, keep_habits, known
from trackers.geometry import perpendicular, point_velocity, unit, wrap_angle

UNIT, TRAILER = "tractor-unit", "trailer"
KINGPIN = -1.5  # [m] of the kingpin from the centre of the tractor unit
OVERHANG = 1.6  # [m] of the trailer's front from the kingpin
AXLE = 7.7 / 12.0  # distance from the kingpin to the middle axle of the trailer, as a share of that to its end


class Articulated:
    """Mixin: a trailer behind a highway-env vehicle whose own size is that of the tractor unit."""

    heading: float  # [rad] of the tractor unit, not wrapped
    trailer_heading: float  # [rad], not wrapped
    LENGTH: float  # [m] of the tractor unit
    _take_size: Callable[..., None]

    def _hitch_trailer(self, hitch: float, size: ArrayLike | None) -> None:
        self._take_size(None, None, UNIT)
        self.trailer_size = CONTOURS[TRAILER].size if size is None else np.array(size, float)
        if not (self.trailer_size > (OVERHANG, 0.0)).all():
            raise ValueError(f"trailer must be longer than {OVERHANG} m and have a width, got {self.trailer_size} m")
        self.trailer_heading = float(self.heading + hitch)

    @property
    def hitch(self) -> float:
        """Heading of the trailer relative to the tractor unit [rad]."""
        return float(wrap_angle(self.trailer_heading - self.heading))

    @property
    def axle(self) -> float:
        """Distance D [m] from the kingpin back to the middle axle of the trailer."""
        return float(AXLE * (self.trailer_size[0] - OVERHANG))  # (VEH.7)

    @property
    def rear_extent(self) -> float:
        """Distance [m] from the centre of the tractor unit back to the trailer's end, along the tractor unit."""
        behind = self.trailer_size[0] - OVERHANG
        return float(max(self.LENGTH / 2, -KINGPIN + behind * np.cos(self.hitch)))

    @property
    def reach(self) -> float:
        """Radius [m] about the centre of the tractor unit that holds both bodies at any hitch."""
        length, width = self.trailer_size
        return float(-KINGPIN + np.hypot(length - OVERHANG, width / 2))

    def parts(self) -> list[RigidPart]:
        """Tractor unit and trailer, in this order."""
        unit_part = body_part(self)
        kingpin = KINGPIN * unit(self.heading)
        v_k, rate = self._trailer_motion()
        back = (OVERHANG - self.trailer_size[0] / 2) * unit(self.trailer_heading)
        pose = np.array([*(unit_part.pose[:2] + kingpin + back), self.trailer_heading])
        velocity = point_velocity(v_k, np.asarray(rate), back)
        return [unit_part, RigidPart(TRAILER, pose, velocity, rate, self.trailer_size.copy())]

    def _trailer_motion(self) -> tuple[NDArray, float]:
        """Velocity (2,) [m/s] of the kingpin and yaw rate of the trailer [rad/s]."""
        velocity, yaw_rate = motion(self)
        v_k = point_velocity(velocity, np.asarray(yaw_rate), KINGPIN * unit(self.heading))
        return v_k, float(v_k @ perpendicular(unit(self.trailer_heading)) / self.axle)  # (VEH.8)

    def step(self, dt: float) -> None:
        """Move the tractor unit by dt [s] and let the trailer follow, explicit Euler as highway-env."""
        _, rate = self._trailer_motion()
        super().step(dt)  # type: ignore[misc]
        self.trailer_heading += rate * dt


class ArticulatedIDM(Articulated, SizedIDM):
    """An articulated truck in traffic; `trailer` (2,) [m] is the size of its trailer, else that of the contour."""

    def __init__(self, *args: Any, hitch: float = 0.0, trailer: ArrayLike | None = None, **kwargs: Any) -> None:
        reject_size(kwargs)
        super().__init__(*args, **{"enable_lane_change": False, **kwargs})
        self._hitch_trailer(hitch, trailer)

    @classmethod
    def create_from(cls, vehicle: Vehicle) -> Self:
        """A truck in the same state with the same trailer."""
        habits = known(vehicle, "target_lane_index", "target_speed", "route", "timer", "enable_lane_change", "hitch")
        trailer = getattr(vehicle, "trailer_size", None)
        new = cls(vehicle.road, vehicle.position, vehicle.heading, vehicle.speed, **habits, trailer=trailer)
        if isinstance(vehicle, cls):
            keep_habits(new, vehicle)
        return new


class ArticulatedCourse(Articulated, CourseVehicle):
    """An articulated truck whose tractor unit follows a course table; `trailer` as above."""

    def __init__(self, *args: Any, hitch: float = 0.0, trailer: ArrayLike | None = None, **kwargs: Any) -> None:
        reject_size(kwargs)
        super().__init__(*args, **kwargs)
        self._hitch_trailer(hitch, trailer)


def reject_size(kwargs: dict[str, Any]) -> None:
    """Raise for a size or contour of the whole: an articulated truck is two bodies."""
    wrong = sorted(kwargs.keys() & {"length", "width", "contour"})
    if wrong:
        raise ValueError(f"an articulated truck takes the size of its `trailer`; leave out {', '.join(wrong)}")
