"""Vehicles fit to be tracked: sized traffic with bumper-to-bumper gaps, prescribed courses, the ego vehicle.

IDM: Treiber, Hennecke, Helbing (2000), Phys. Rev. E 62, 1805. highway-env's own measures gaps between centres.
"""

import copy
import math
from collections import deque
from typing import Any, Self

import numpy as np
from highway_env.road.road import LaneIndex, Road, Route
from highway_env.utils import not_zero
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import MDPVehicle
from highway_env.vehicle.kinematics import Vehicle
from numpy.typing import ArrayLike, NDArray

from scenarios.bodies import Sized, contour_of, rear_extent
from scenarios.courses import CourseTable
from scenarios.drivers import Unrest
from scenarios.scalars import unhindered

FORESIGHT = (0.0, 3.0, 6.0, 9.0)  # [s] for which a driver of a population knows where vehicles on courses will be


class SoftSteering:
    """Mixin: lateral control of a human driver; a lane change of 4 m takes about 4 s."""

    TAU_LATERAL, TAU_HEADING = 2.0, 0.6  # [s]
    KP_LATERAL, KP_HEADING = 1 / TAU_LATERAL, 1 / TAU_HEADING  # [1/s]
    LENGTH: float  # [m]
    speed: float  # [m/s]

    @property
    def TAU_PURSUIT(self) -> float:
        """Look-ahead time [s]: the heading lag, less the time from the rear axle to the centre.

        With it the steering has no steady lateral error on a circle, at any speed and length, in first order.
        """
        return self.TAU_HEADING - self.LENGTH / 2 / not_zero(self.speed)


class SizedIDM(SoftSteering, Sized, IDMVehicle):
    """IDM and MOBIL traffic of any size. Its constants are its own: `intersection-*` rewrites those of IDMVehicle."""

    ACC_MAX = 6.0  # [m/s^2]
    COMFORT_ACC_MAX = 3.0  # [m/s^2]
    COMFORT_ACC_MIN = -5.0  # [m/s^2]
    DISTANCE_WANTED = 5.0  # [m] free road to the leader at standstill
    TIME_WANTED = 1.5  # [s]
    DELTA = 4.0
    DELTA_RANGE = (3.5, 4.5)
    POLITENESS = 0.0
    LANE_CHANGE_MIN_ACC_GAIN = 0.2  # [m/s^2]
    LANE_CHANGE_MAX_BRAKING_IMPOSED = 2.0  # [m/s^2]
    LANE_CHANGE_DELAY = 1.0  # [s]
    GAP_MIN = 0.1  # [m] shorter gaps, and overlaps, are taken as this
    UNREST: Unrest | None = None  # of a driver of a population
    CLEARANCE = 0.0  # [m] from vehicles on courses, which make no room, within which such a driver changes no lane
    driven = 0.0  # [s]

    def __init__(
        self,
        road: Road,
        position: ArrayLike,
        heading: float = 0.0,
        speed: float = 0.0,
        target_lane_index: LaneIndex | None = None,
        target_speed: float | None = None,
        route: Route | None = None,
        enable_lane_change: bool = True,
        timer: float | None = None,
        *,
        length: float | None = None,
        width: float | None = None,
        contour: str = "car",
    ) -> None:
        super().__init__(
            road, position, heading, speed, target_lane_index, target_speed, route, enable_lane_change, timer
        )
        if target_speed is not None:
            self.target_speed = target_speed  # highway-env takes 0 for "not given"
        self._take_size(length, width, contour)

    @classmethod
    def create_from(cls, vehicle: Vehicle) -> Self:
        """A vehicle in the same state, with the same size, contour and habits."""
        habits = known(vehicle, "target_lane_index", "target_speed", "route", "enable_lane_change", "timer")
        new = cls(vehicle.road, vehicle.position, vehicle.heading, vehicle.speed, **habits, **size_of(vehicle))
        keep_habits(new, vehicle)
        return new

    def step(self, dt: float) -> None:
        """Advance by dt [s]; at a standstill it stays, where highway-env would drive backwards."""
        if self.UNREST is not None:
            self.driven += dt
            unrest = self.UNREST.at(self.driven) * min(self.speed / 2.0, 1.0)  # none in a standing queue
            self.action["acceleration"] += min(unrest, max(self.action["acceleration"] + 1.0, 0.0))
        if not self.crashed and self.speed >= 0:
            self.action["acceleration"] = max(self.action["acceleration"], -self.speed / dt)
        super().step(dt)

    def mobil(self, lane_index: LaneIndex) -> bool:
        """Whether to change lane; never on a route, or beside a vehicle that makes no room."""
        if self.CLEARANCE and (self.route or any(self._near(v) for v in self.road.vehicles)):
            return False
        return bool(super().mobil(lane_index))

    def _near(self, vehicle: Vehicle) -> bool:
        if not isinstance(vehicle, CourseVehicle):
            return False
        there, _ = vehicle.predict_trajectory_constant_speed(FORESIGHT)
        here = self.position + np.outer(FORESIGHT, self.velocity)
        return bool((np.hypot(*(there - here).T) < self.CLEARANCE).any())

    def acceleration(
        self, ego_vehicle: Any, front_vehicle: Any | None = None, rear_vehicle: Any | None = None
    ) -> float:
        """IDM acceleration [m/s^2] of any vehicle behind a leader, gaps from bumper to bumper; an overlap is none."""
        free = unhindered(self, ego_vehicle)
        if front_vehicle is None or not isinstance(ego_vehicle, Vehicle):
            return free
        half_lengths = ego_vehicle.LENGTH / 2 + rear_extent(front_vehicle)
        # The lane coordinate of a leader on the next segment may wrap around: the sign of the distance means nothing
        gap = max(abs(ego_vehicle.lane_distance_to(front_vehicle)) - half_lengths, self.GAP_MIN)
        wanted = self.desired_gap(ego_vehicle, front_vehicle) - half_lengths
        return free - self.COMFORT_ACC_MAX * (wanted / gap) ** 2

    def desired_gap(self, ego_vehicle: Any, front_vehicle: Any = None, projected: bool = True) -> float:
        """Wanted distance [m] between the centres: both half lengths plus the IDM gap, never below the jam gap."""
        if projected:
            dv = np.dot(ego_vehicle.velocity - front_vehicle.velocity, ego_vehicle.direction)
        else:
            dv = ego_vehicle.speed - front_vehicle.speed
        braking = 2 * np.sqrt(-self.COMFORT_ACC_MAX * self.COMFORT_ACC_MIN)
        moving = max(0.0, ego_vehicle.speed * self.TIME_WANTED + ego_vehicle.speed * dv / braking)
        return float(self.DISTANCE_WANTED + moving + ego_vehicle.LENGTH / 2 + rear_extent(front_vehicle))


def known(vehicle: Vehicle, *names: str) -> dict[str, Any]:
    """Those of the attributes that a vehicle has, as arguments of its class."""
    return {name: getattr(vehicle, name) for name in names if hasattr(vehicle, name)}


def size_of(vehicle: Vehicle) -> dict[str, Any]:
    """Size [m] and contour of a vehicle, as arguments of a class with `Sized`."""
    return {"length": vehicle.LENGTH, "width": vehicle.WIDTH, "contour": contour_of(vehicle)}


def keep_habits(new: Vehicle, old: Vehicle) -> None:
    """Copy what was set on one vehicle over the constants of its class: DELTA, TIME_WANTED ..."""
    for name, value in vars(old).items():
        if name.isupper():
            setattr(new, name, value)


PEDALS = {"FASTER": 1, "SLOWER": -1}  # meta-actions that change the target speed, and their direction


class EgoVehicle(SoftSteering, Sized, MDPVehicle):
    """The vehicle under test: meta-actions over target speeds, with the limits of a real car.

    FASTER and SLOWER move the target speed by one step, SLOWER from no higher than the present speed: a single press is
    gentle, repeated ones add up to an emergency stop. The target stays where it still makes a difference.
    """

    TAU_ACC = 0.8  # [s]
    KP_A = 1 / TAU_ACC  # [1/s]
    ACC_LIMITS = (-8.0, 4.0)  # [m/s^2]

    def __init__(
        self, *args: Any, length: float | None = None, width: float | None = None, contour: str = "car", **kwargs: Any
    ) -> None:
        super().__init__(*args, **kwargs)
        self._take_size(length, width, contour)

    @classmethod
    def create_from(cls, vehicle: Vehicle) -> Self:
        """A vehicle in the same state, with the same size, contour and target speeds."""
        habits = known(vehicle, "target_lane_index", "target_speed", "target_speeds", "route")
        return cls(vehicle.road, vehicle.position, vehicle.heading, vehicle.speed, **habits, **size_of(vehicle))

    def act(self, action: dict | str | None = None) -> None:
        """Take a meta-action (LANE_LEFT, FASTER ...), then control speed and lane within the limits."""
        if action in PEDALS:
            self.speed_index = self._pressed(PEDALS[action])
            self.target_speed = self.index_to_speed(self.speed_index)
            action = None
        super().act(action)
        self.action["acceleration"] = float(np.clip(self.action["acceleration"], *self.ACC_LIMITS))

    def target_after(self, action: str) -> float:
        """Target speed [m/s] that a meta-action would set."""
        return float(self.index_to_speed(self._pressed(PEDALS[action])) if action in PEDALS else self.target_speed)

    def _pressed(self, side: int) -> int:
        """Index of the target speed after FASTER (side 1) or SLOWER (side -1)."""
        first, last = self.target_speeds[[0, -1]]
        step = (last - first) / (self.target_speeds.size - 1)
        here, now = (self.speed - first) / step, int(self.speed_index)
        full = [limit * self.TAU_ACC / step for limit in self.ACC_LIMITS]  # the offset that asks for all there is
        if side > 0:
            index = max(now, min(now + 1, math.ceil(here + full[1])))
        else:
            index = min(now, max(min(now, math.ceil(here)) - 1, math.floor(here + full[0])))
        return int(np.clip(index, 0, self.target_speeds.size - 1))


class PedalEgo(Sized, Vehicle):
    """The vehicle under test where actions are acceleration and steering angle themselves, not meta-actions."""

    route: Route | None

    @classmethod
    def create_from(cls, vehicle: Vehicle) -> Self:
        """A vehicle in the same state, with the same size, contour and route."""
        new = cls(vehicle.road, vehicle.position, vehicle.heading, vehicle.speed)
        new._take_size(**size_of(vehicle))
        new.route = getattr(vehicle, "route", None)
        return new

    def step(self, dt: float) -> None:
        """Advance by dt [s]; at a standstill it stays, where highway-env would drive backwards."""
        if not self.crashed and self.speed >= 0:
            self.action["acceleration"] = max(self.action["acceleration"], -self.speed / dt)
        super().step(dt)


class CourseVehicle(Sized, Vehicle):
    """Follows a course table whatever happens: it is not controlled, does not swerve and is not pushed aside."""

    def __init__(
        self,
        road: Road,
        table: CourseTable | ArrayLike,
        length: float | None = None,
        width: float | None = None,
        contour: str = "car",
    ) -> None:
        self.table = table if isinstance(table, CourseTable) else CourseTable(table)
        self._origin, self._frames, self._dt = self.table.start, 0, 0.0
        pose, self._rate = self.table.at(self._origin)
        super().__init__(road, pose[:2], float(pose[2]), 0.0)
        self._take_size(length, width, contour)
        self._place()

    @property
    def time(self) -> float:
        """Time [s] on the table, counted in frames: a sum of dt would drift by rounding."""
        return self._origin + self._frames * self._dt

    @property
    def velocity(self) -> NDArray:
        """Velocity (2,) [m/s] of the table; highway-env derives it from speed and heading."""
        return self._rate[:2]

    @property
    def yaw_rate(self) -> float:
        """Yaw rate [rad/s] of the table."""
        return float(self._rate[2])

    @property
    def target_speed(self) -> float:
        """Present speed [m/s]: MOBIL asks followers for it and would take one without for standing."""
        return self.speed

    def course_motion(self) -> tuple[NDArray, float]:
        """Velocity (2,) [m/s] and yaw rate [rad/s], for `motion`."""
        return self._rate[:2].copy(), self.yaw_rate

    def act(self, action: dict | str | None = None) -> None:
        """Ignore all actions."""

    def step(self, dt: float) -> None:
        """Go on along the table by dt [s]."""
        if dt != self._dt:
            self._origin, self._frames, self._dt = self.time, 0, dt
        self._frames += 1
        self._place()
        self.impact = None
        self.on_state_update()

    def _place(self) -> None:
        pose, self._rate = self.table.at(self.time)
        self.position, self.heading = pose[:2].copy(), float(pose[2])
        self.speed = float(self._rate[:2] @ self.direction)

    def predict_trajectory_constant_speed(self, times: ArrayLike) -> tuple[list[NDArray], list[float]]:
        """Positions (2,) [m] and headings [rad] on the course, `times` [s] from now."""
        poses = [self.table.at(self.time + float(t))[0] for t in np.atleast_1d(times)]
        return [p[:2] for p in poses], [float(p[2]) for p in poses]

    @classmethod
    def create_from(cls, vehicle: Vehicle) -> Self:
        """A vehicle at the same place of the same course; other vehicles have no course to give."""
        if not isinstance(vehicle, cls):
            raise TypeError(
                f"{cls.__name__}.create_from needs a {cls.__name__}, got {type(vehicle).__name__}; "
                f"construct {cls.__name__}(road, table) with a table of its own"
            )
        new = copy.copy(vehicle)
        new.position, new.action = vehicle.position.copy(), dict(vehicle.action)
        new.history = deque(maxlen=cls.HISTORY_SIZE)
        return new
