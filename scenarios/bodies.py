"""What all our vehicles share: their own size and contour, their true motion, and the rigid parts they consist of.

The functions answer for any object of highway-env; the mixin `Sized` is for our own classes.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from highway_env.utils import are_polygons_intersecting
from highway_env.vehicle.dynamics import BicycleVehicle
from highway_env.vehicle.kinematics import Vehicle
from highway_env.vehicle.objects import RoadObject
from numpy.typing import NDArray

from scenarios.contours import find
from trackers.geometry import box_corners, rotation

# The check of an abstract class takes longer than what it decides about.
is_kind: Callable[[type, type], bool] = cache(issubclass)
LONG = 6.0  # [m] a stock vehicle without a contour is a truck from this length on


class RigidPart(NamedTuple):
    """One rigid body of a vehicle."""

    contour: str
    pose: NDArray  # (3,) centre x, y [m], heading [rad], not wrapped
    velocity: NDArray  # (2,) [m/s] of the centre
    yaw_rate: float  # [rad/s]
    size: NDArray  # (2,) length, width [m]


def resize(vehicle: RoadObject, length: float, width: float) -> RoadObject:
    """Give one object its own length and width [m], and the diagonal that goes along, and return it."""
    if not (length > 0 and width > 0):
        raise ValueError(f"length and width must be positive, got {length} and {width} m")
    vehicle.LENGTH, vehicle.WIDTH = float(length), float(width)
    vehicle.diagonal = float(np.hypot(length, width))
    return vehicle


def contour_of(vehicle: RoadObject) -> str:
    """Name of the outline: the vehicle's own, else a box for obstacles, a car below 6 m, a truck above."""
    own = getattr(vehicle, "contour", None)
    if own is not None:
        return own
    if not is_kind(type(vehicle), Vehicle):
        return "box"
    return "car" if vehicle.LENGTH < LONG else "truck"


def motion(vehicle: RoadObject) -> tuple[NDArray, float]:
    """True velocity (2,) [m/s] of the centre and yaw rate [rad/s] under the action the vehicle has now.

    The kinematic bicycle moves along heading + slip, which `vehicle.velocity` leaves out. Between `act` and `step` this
    is exactly the motion of the coming frame. Crashed vehicles do not steer; obstacles rest.
    """
    kind = type(vehicle)
    if not is_kind(kind, Vehicle):
        return np.zeros(2), 0.0
    if hasattr(vehicle, "course_motion"):
        return vehicle.course_motion()
    if is_kind(kind, BicycleVehicle):
        v = rotation(vehicle.heading) @ np.array([float(vehicle.speed), float(vehicle.lateral_speed)])
        return v, float(vehicle.yaw_rate)
    steering = 0.0 if vehicle.crashed else float(vehicle.action["steering"])
    beta, speed = math.atan(math.tan(steering) / 2), float(vehicle.speed)
    course = vehicle.heading + beta
    return np.array([speed * math.cos(course), speed * math.sin(course)]), speed * math.sin(beta) / (vehicle.LENGTH / 2)


def parts(vehicle: RoadObject) -> list[RigidPart]:
    """The rigid bodies of any object: one, or what its own `parts()` says."""
    if hasattr(vehicle, "parts"):
        return vehicle.parts()
    return [body_part(vehicle)]


def body_part(vehicle: RoadObject) -> RigidPart:
    """The rectangle that highway-env knows of an object, as a part."""
    velocity, yaw_rate = motion(vehicle)
    pose = np.array([*vehicle.position, vehicle.heading], float)
    return RigidPart(contour_of(vehicle), pose, velocity, yaw_rate, np.array([vehicle.LENGTH, vehicle.WIDTH], float))


def rear_extent(vehicle: RoadObject) -> float:
    """Distance [m] from the position of an object back to its rear end; a trailer counts."""
    return float(getattr(vehicle, "rear_extent", vehicle.LENGTH / 2))


def reach(vehicle: RoadObject) -> float:
    """Radius [m] about the position that holds all bodies of an object."""
    return float(getattr(vehicle, "reach", vehicle.diagonal / 2))


def colliding(a: RoadObject, b: RoadObject, dt: float) -> tuple[bool, bool, Any]:
    """Collision of all bodies of two objects over dt [s], in the terms of `RoadObject._is_colliding`.

    Returns whether they overlap, whether they will, and the translation (2,) [m] that parts the deepest pair.
    """
    overlap = will = False
    translation = np.zeros(2)
    if np.linalg.norm(b.position - a.position) > reach(a) + reach(b) + abs(a.speed) * dt:
        return overlap, will, translation
    for p in parts(a):
        for q in parts(b):
            now, soon, push = are_polygons_intersecting(_closed(p), _closed(q), p.velocity * dt, q.velocity * dt)
            overlap, will = overlap or now, will or soon
            if soon and np.linalg.norm(push) > np.linalg.norm(translation):
                translation = push
    return overlap, will, translation


def _closed(part: RigidPart) -> NDArray:
    """Rectangle (5, 2) [m] of a part, its first corner repeated."""
    corners = box_corners(part.pose, part.size)
    return np.vstack([corners, corners[:1]])


class Sized:
    """Mixin of a highway-env vehicle with its own size and contour that sees trailers when it collides."""

    contour: str

    def _take_size(self, length: float | None, width: float | None, contour: str) -> None:
        """Set contour and size [m]; what is not given is the default of the contour."""
        default = find(contour)
        self.contour = contour
        resize(self, default.length if length is None else length, default.width if width is None else width)

    def _is_colliding(self, other: RoadObject, dt: float) -> tuple[bool, bool, Any]:
        if hasattr(self, "parts") or hasattr(other, "parts"):
            return colliding(self, other, dt)
        return super()._is_colliding(other, dt)  # type: ignore[misc]
