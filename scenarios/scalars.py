"""Stock lanes and drivers in scalars, bit by bit the same: numpy takes microseconds to clip one number.

What is not exactly the stock method is called as it is.
"""

from functools import cache, cached_property
from typing import Any

import numpy as np
from highway_env.road.lane import AbstractLane, StraightLane
from highway_env.utils import not_zero, wrap_to_pi
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import ControlledVehicle
from highway_env.vehicle.kinematics import Vehicle
from numpy.typing import NDArray

from scenarios.bodies import is_kind

AXES = (-1.0, 0.0, 1.0)


class AxisLane(StraightLane):
    """A straight lane along an axis of the plane: products with its directions are exact, whoever adds them up."""

    @cached_property
    def frame(self) -> tuple[float, ...]:
        """Start and both directions, as numbers of Python."""
        return tuple(map(float, (*self.start, *self.direction, *self.direction_lateral)))

    def local_coordinates(self, position: NDArray) -> tuple[float, float]:
        """Coordinates [m] along and across the lane, as `StraightLane`."""
        x, y, ux, uy, vx, vy = self.frame
        px, py = position.tolist() if isinstance(position, np.ndarray) else position
        dx, dy = px - x, py - y
        return dx * ux + dy * uy, dx * vx + dy * vy

    def on_lane(
        self, position: NDArray, longitudinal: float | None = None, lateral: float | None = None, margin: float = 0
    ) -> bool:
        """Whether a position is on the lane, as `AbstractLane`."""
        if longitudinal is None or lateral is None:
            longitudinal, lateral = self.local_coordinates(position)
        length = self.VEHICLE_LENGTH
        return abs(lateral) <= self.width / 2 + margin and -length <= longitudinal < self.length + length

    def places(self, positions: NDArray, margin: float) -> list[float | None]:
        """Coordinates [m] along the lane of positions (N, 2), None for those that are not on it."""
        x, y, ux, uy, vx, vy = self.frame
        dx, dy = positions[:, 0] - x, positions[:, 1] - y
        s, length = dx * ux + dy * uy, self.VEHICLE_LENGTH
        on = (np.abs(dx * vx + dy * vy) <= self.width / 2 + margin) & (-length <= s) & (s < self.length + length)
        return [one if there else None for one, there in zip(s.tolist(), on.tolist(), strict=True)]


def in_scalars(lane: AbstractLane) -> AbstractLane:
    """Turn a straight lane along an axis into an `AxisLane` in place; any lane is returned."""
    if type(lane) is StraightLane and set(lane.direction) <= {*AXES}:
        lane.__class__ = AxisLane
    return lane


def within(x: float, least: float, most: float) -> float:
    """The number, or the bound that it is beyond; NaN stays."""
    return min(max(x, least), most)


@cache
def stock(kind: type, *names: str) -> bool:
    """Whether a class of vehicles has these methods as `IDMVehicle` has them."""
    return all(getattr(kind, name) is getattr(IDMVehicle, name) for name in names)


def act(vehicle: Any) -> None:
    """`vehicle.act()`, in scalars where it is the method of `IDMVehicle`."""
    kind: Any = type(vehicle)
    if not (is_kind(kind, IDMVehicle) and stock(kind, "act")):
        vehicle.act()
        return
    if vehicle.crashed:
        return
    steering = steered if stock(kind, "steering_control") else kind.steering_control
    accelerate = accelerated if stock(kind, "acceleration", "desired_gap", "lane_distance_to") else _accelerated
    vehicle.follow_road()
    if vehicle.enable_lane_change:
        vehicle.change_lane_policy()
    angle, most = vehicle.MAX_STEERING_ANGLE, vehicle.ACC_MAX
    action = {"steering": within(steering(vehicle, vehicle.target_lane_index), -angle, angle)}
    acceleration = accelerate(vehicle, *vehicle.road.neighbour_vehicles(vehicle, vehicle.lane_index))
    if vehicle.lane_index != vehicle.target_lane_index:
        others = vehicle.road.neighbour_vehicles(vehicle, vehicle.target_lane_index)
        acceleration = min(acceleration, accelerate(vehicle, *others))
    action["acceleration"] = within(acceleration, -most, most)
    Vehicle.act(vehicle, action)


def steered(vehicle: ControlledVehicle, lane_index: Any) -> float:
    """`ControlledVehicle.steering_control`."""
    lane, speed = vehicle.road.network.get_lane(lane_index), vehicle.speed
    s, lateral = lane.local_coordinates(vehicle.position)
    heading, forward = lane.heading_at(s + speed * vehicle.TAU_PURSUIT), not_zero(speed)
    command = np.arcsin(within(-vehicle.KP_LATERAL * lateral / forward, -1, 1))
    towards = heading + within(command, -np.pi / 4, np.pi / 4)
    rate = vehicle.KP_HEADING * wrap_to_pi(towards - vehicle.heading)
    slip = np.arcsin(within(vehicle.LENGTH / 2 / forward * rate, -1, 1))
    return float(within(np.arctan(2 * np.tan(slip)), -vehicle.MAX_STEERING_ANGLE, vehicle.MAX_STEERING_ANGLE))


def _accelerated(vehicle: IDMVehicle, front: Any, rear: Any) -> float:
    return vehicle.acceleration(ego_vehicle=vehicle, front_vehicle=front, rear_vehicle=rear)


def unhindered(driver: IDMVehicle, vehicle: Any) -> float:
    """`IDMVehicle.acceleration` of a vehicle [m/s^2] without a leader."""
    if not vehicle or not is_kind(type(vehicle), Vehicle):
        return 0
    target, lane = getattr(vehicle, "target_speed", 0), vehicle.lane
    if lane and lane.speed_limit is not None:
        target = within(target, 0, lane.speed_limit)
    return driver.COMFORT_ACC_MAX * (1 - np.power(max(vehicle.speed, 0) / abs(not_zero(target)), driver.DELTA))


def accelerated(vehicle: IDMVehicle, front: Any, rear: Any) -> float:
    """`IDMVehicle.acceleration` of the vehicle itself."""
    acceleration = unhindered(vehicle, vehicle)
    if front:
        gap = vehicle.desired_gap(vehicle, front) / not_zero(vehicle.lane_distance_to(front))
        acceleration -= vehicle.COMFORT_ACC_MAX * np.power(gap, 2)
    return acceleration
