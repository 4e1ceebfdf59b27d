"""What a planner sees: a highway-env road that holds the controlled vehicles and the tracks, and nothing else.

Its contents come from:

- odometry: the controlled vehicles themselves;
- the map: lanes, landmarks, and obstacles that mark where a lane ends or stand beside all lanes (`is_map`);
- the tracks: everything else, also an obstacle that stands in the middle of a lane.

Track vehicles are ordinary highway-env traffic, so that a copy of the environment can be stepped into the future. What
highway-env does and why this follows: docs/methods/environment.md.
"""

from collections.abc import Callable, Sequence
from copy import deepcopy
from typing import Any

import numpy as np
from highway_env.envs.common.abstract import AbstractEnv
from highway_env.envs.common.observation import ObservationType
from highway_env.road.regulation import RegulatedRoad
from highway_env.road.road import Road
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle
from highway_env.vehicle.objects import RoadObject
from numpy.typing import NDArray

from scenarios.adapter import bounding_box
from scenarios.bodies import parts
from testbed.environment.observation import every_part
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
        road: Road,
        position: Any,
        heading: float = 0.0,
        speed: float = 0.0,
        target_lane_index: Any = None,
        target_speed: float | None = None,
        route: Any = None,
        enable_lane_change: bool = True,
        timer: float | None = None,
        *,
        size: Sequence[float] | NDArray = (5.0, 2.0),
        velocity: NDArray | None = None,
        drift_std: float = 0.0,
        track_id: int = -1,
    ) -> None:
        super().__init__(
            road, position, heading, speed, target_lane_index, target_speed, route, enable_lane_change, timer
        )
        self.LENGTH, self.WIDTH = float(size[0]), float(size[1])
        self.diagonal = float(np.hypot(self.LENGTH, self.WIDTH))
        self.track_id = track_id
        self.drift_std = drift_std  # [m/s] of the velocity across the heading, for planners that care
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
    """Which of T estimates a planner can use, (T,) bool.

    Left out are values that are not finite, speeds above `MAX_SPEED`, positions beyond `MAX_DISTANCE`, and centres
    inside a controlled vehicle.
    """
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
    across = unit(pose[:, 2] + np.pi / 2)[:, None]
    drift_std = np.sqrt((across @ nearest.cov[:, 2:, 2:] @ across.mT)[:, 0, 0])  # (ENV.2)
    return [
        TrackVehicle(
            road,
            pose[i, :2],
            heading=float(pose[i, 2]),
            speed=float(speed[i]),
            size=size[i],
            velocity=velocity[i],
            drift_std=float(drift_std[i]),
            track_id=int(ids[row]),
        )
        for i, row in enumerate(rows)
    ]


def mirror_vehicle(road: Road, vehicle: Vehicle) -> TrackVehicle:
    """A perfect track: a vehicle for which highway-env's observations equal those of the original bit by bit.

    A vehicle of several bodies becomes their bounding box: highway-env's own state is that of the first body only.
    """
    position, heading, velocity, speed = vehicle.position, vehicle.heading, vehicle.velocity, vehicle.speed
    size = np.array([vehicle.LENGTH, vehicle.WIDTH])
    bodies = parts(vehicle)
    if len(bodies) > 1:
        box = bounding_box(bodies)
        position, heading, velocity, size = box.pose[:2], float(box.pose[2]), box.velocity, box.size
        speed = float(velocity @ unit(heading))
    twin = TrackVehicle(road, position, heading=heading, speed=speed, size=size, velocity=velocity)
    twin.crashed, twin.solid, twin.check_collisions = vehicle.crashed, vehicle.solid, vehicle.check_collisions
    if hasattr(vehicle, "color"):
        twin.color = vehicle.color
    return twin


def is_map(road: Road, thing: RoadObject) -> bool:
    """Whether an object of the road belongs to the map: not solid, beside all lanes, or where a lane ends."""
    if not thing.solid:
        return True
    reach = thing.diagonal / 2
    for lane in road.network.lanes_list():
        s, lateral = lane.local_coordinates(thing.position)
        beside = abs(lateral) > lane.width_at(s) / 2 or not -reach <= s <= lane.length + reach
        if not beside and s < lane.length - reach:
            return False
    return True


def _empty_belief(truth: Road, objects: list[RoadObject], rng: np.random.Generator) -> Road:
    """A road with the map of the true one; its class is highway-env's own, a subclass may cache vehicles."""
    kind = RegulatedRoad if isinstance(truth, RegulatedRoad) else Road
    return kind(truth.network, [], objects, rng, False, truth.neighbour_vehicles_connected_lanes)


def belief_road(
    truth: Road, egos: Sequence[Vehicle], ids: NDArray, estimate: Estimate, rng: np.random.Generator
) -> Road:
    """The belief road: map, controlled vehicles, then the tracks with ids (T,) by distance.

    Of `truth` only the map is used. rng is for the random choices of vehicles when a copy of the road is stepped.
    """
    road = _empty_belief(truth, [o for o in truth.objects if is_map(truth, o)], rng)
    road.vehicles = [*egos, *track_vehicles(road, ids, estimate, egos)]
    return road


def mirror_road(truth: Road, egos: Sequence[Vehicle], rng: np.random.Generator) -> Road:
    """The belief road with perfect tracks: all vehicles and objects, in the order of the true list of vehicles."""
    road = _empty_belief(truth, list(truth.objects), rng)
    road.vehicles = [v if any(v is ego for ego in egos) else mirror_vehicle(road, v) for v in truth.vehicles]
    return road


class BeliefView:
    """What observation types get in place of the environment: all attributes are the environment's, but `road`."""

    def __init__(self, env: AbstractEnv, road: Callable[[], Road]) -> None:
        self._env, self._road = env, road

    @property
    def road(self) -> Road:
        """The belief road of this instant."""
        return self._road()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name in ("_env", "_road"):  # copy and pickle read these before __init__
            raise AttributeError(name)
        return getattr(self._env, name)

    def __deepcopy__(self, memo: dict) -> Any:
        """The copied environment, so that a copy observes its own road."""
        return deepcopy(self._env, memo)


def attach_view(observation_type: ObservationType, view: BeliefView) -> None:
    """Give an observation type, and all its parts, the view in place of the environment."""
    for part in every_part(observation_type):
        part.env = view
        if hasattr(part, "viewer"):  # the camera of GrayscaleObservation
            part.viewer.env = view


class CopyOf:
    """What a deep copy of one road makes instead: a copy of another; a class, because functions cannot be pickled."""

    def __init__(self, road: Road) -> None:
        self._road = road

    def __call__(self, memo: dict) -> Road:
        """The copy."""
        return deepcopy(self._road, memo)


class RoadSwap:
    """Switches an environment between its true road, while it simulates, and the belief road, between calls.

    A deep copy of the environment holds None in its place. While the true road is hidden, a deep copy of it is one of
    the belief road, so that nothing that still refers to the true road copies the truth.
    """

    def __init__(self, env: AbstractEnv) -> None:
        self._env = env
        self._truth: Road | None = None
        self._belief: Road | None = None

    def __deepcopy__(self, memo: dict) -> None:
        return None

    @property
    def hidden(self) -> bool:
        """Whether the belief road is in place."""
        return self._truth is not None

    def hide(self, belief: Road) -> None:
        """Put the belief road in the place of the true one."""
        self._truth, self._belief = self._env.road, belief
        self._truth.__deepcopy__ = CopyOf(belief)
        self._point(belief)

    def show(self) -> None:
        """Put the true road back, unless the environment was given another road meanwhile."""
        if self._truth is None:
            return
        del self._truth.__deepcopy__
        if self._env.road is self._belief:
            self._point(self._truth)
        self._truth = self._belief = None

    def _point(self, road: Road) -> None:
        """Let the environment, its vehicles with their recorded past, and the objects on the map refer to a road."""
        self._env.road = road
        for thing in (*self._env.controlled_vehicles, *road.objects):
            thing.road = road
            for past in getattr(thing, "history", ()):
                past.road = road
