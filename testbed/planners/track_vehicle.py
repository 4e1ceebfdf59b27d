"""A track as a highway-env vehicle: what planners see of it, and how it moves in their copies of the road."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from highway_env.road.road import Road
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle
from numpy.typing import NDArray

from trackers.batch import take
from trackers.estimate import Estimate
from trackers.geometry import rotation, unit

MAX_SPEED = 80.0  # [m/s] no road vehicle is faster
MAX_DISTANCE = 500.0  # [m] from every controlled vehicle; twice the reach of a long range radar
MIN_SIZE = np.array([0.3, 0.3])  # [m] sizes are clipped to these limits: a track of implausible size is kept
MAX_SIZE = np.array([30.0, 5.0])  # [m]


class TrackVehicle(IDMVehicle):
    """A track as traffic: it has the state of the estimate until it is first stepped, then moves by IDM and MOBIL.

    It defines all constants, because `intersection-*` overwrites those of IDMVehicle for the whole process.
    """

    DISTANCE_WANTED = 5.0  # [m] from bumper to bumper
    COMFORT_ACC_MAX = 3.0  # [m/s^2]
    COMFORT_ACC_MIN = -5.0  # [m/s^2]
    KP_LATERAL = 1 / 2.0  # [1/s] a lane change in about 4 s; with highway-env's gains it takes 1.2 s
    KP_HEADING = 1 / 0.6  # [1/s]

    def __init__(
        self,
        *args: Any,
        size: Sequence[float] | NDArray = (5.0, 2.0),
        velocity: NDArray | None = None,
        across_cov: NDArray | None = None,
        track_id: int = -1,
        **kwargs: Any,
    ) -> None:
        super().__init__(*args, **kwargs)
        self.LENGTH, self.WIDTH = float(size[0]), float(size[1])
        self.diagonal = float(np.hypot(self.LENGTH, self.WIDTH))
        self.track_id = track_id
        # (2, 2) covariance of place and velocity across the heading [m, m/s], for planners that care
        self.across_cov = np.zeros((2, 2)) if across_cov is None else across_cov
        self._estimated = None if velocity is None else np.array(velocity, float)

    @classmethod
    def create_from(cls, vehicle: Vehicle) -> "TrackVehicle":
        """A vehicle in the state, and of the size, of another one."""
        twin = super().create_from(vehicle)
        twin.LENGTH, twin.WIDTH, twin.diagonal = vehicle.LENGTH, vehicle.WIDTH, vehicle.diagonal
        return twin

    @property
    def velocity(self) -> NDArray:
        """Velocity (2,) [m/s]: as estimated, or along the heading once the vehicle was stepped."""
        return self.speed * self.direction if self._estimated is None else self._estimated.copy()

    def step(self, dt: float) -> None:
        """Move on by dt [s]; from here on the velocity is that of the motion model, not the estimate."""
        super().step(dt)
        self._estimated = None

    def desired_gap(self, ego_vehicle: Vehicle, front_vehicle: Vehicle = None, projected: bool = True) -> float:
        """IDM gap [m] between centres: highway-env's, with DISTANCE_WANTED as a gap between bumpers."""
        halves = (ego_vehicle.LENGTH + front_vehicle.LENGTH) / 2
        return super().desired_gap(ego_vehicle, front_vehicle, projected) + halves  # (ENV.3)


def plausible(estimate: Estimate, egos: Sequence[Vehicle]) -> NDArray:
    """Mask (T,) of estimates fit for planning: finite, within MAX_SPEED and MAX_DISTANCE, centre outside every ego."""
    rows = np.column_stack([estimate.pose, estimate.velocity, estimate.size])
    finite = np.isfinite(rows).all(-1)
    with np.errstate(invalid="ignore"):
        usable = finite & (np.hypot(*estimate.velocity.T) < MAX_SPEED)
        for ego in egos:
            offset = (estimate.pose[:, :2] - ego.position) @ rotation(ego.heading)
            inside = (np.abs(offset) < [ego.LENGTH / 2, ego.WIDTH / 2]).all(-1)
            usable &= ~inside & (np.hypot(*offset.T) < MAX_DISTANCE)
    return usable


def track_vehicles(road: Road, ids: NDArray, estimate: Estimate, egos: Sequence[Vehicle]) -> list[TrackVehicle]:
    """Vehicles for the plausible of T tracks with ids (T,), nearest to the first controlled vehicle first."""
    usable = np.flatnonzero(plausible(estimate, egos))
    distance = np.hypot(*(estimate.pose[usable, :2] - egos[0].position).T)
    rows = usable[np.argsort(distance, kind="stable")]
    pose, velocity, _, size, *_ = nearest = take(estimate, rows)
    size, speed = np.clip(size, MIN_SIZE, MAX_SIZE), nearest.speed
    across = np.kron(np.eye(2), unit(pose[:, 2] + np.pi / 2)[:, None])  # (K, 2, 4)
    across_cov = across @ nearest.cov @ across.mT  # (ENV.2)
    return [
        TrackVehicle(
            road,
            pose[i, :2],
            heading=float(pose[i, 2]),
            speed=float(speed[i]),
            size=size[i],
            velocity=velocity[i],
            across_cov=across_cov[i],
            track_id=int(ids[row]),
        )
        for i, row in enumerate(rows)
    ]
