"""What a planner gets: a highway-env road that holds the controlled vehicles and the tracks, and nothing else.

Its contents come from:

- odometry: the controlled vehicles themselves;
- the map: lanes, landmarks, and obstacles that mark where a lane ends or stand beside all lanes (`is_map`);
- the tracks: everything else, also an obstacle that stands in the middle of a lane.

Track vehicles are ordinary highway-env traffic, so that a copy of the environment can be stepped into the future. What
highway-env does and why this follows: docs/methods/environment.md.
"""

from collections.abc import Callable, Sequence
from copy import deepcopy
from typing import Any, NoReturn

import numpy as np
from gymnasium.error import ResetNeeded
from highway_env.envs.common.abstract import AbstractEnv
from highway_env.envs.common.graphics import EnvViewer
from highway_env.envs.common.observation import ObservationType
from highway_env.road.regulation import RegulatedRoad
from highway_env.road.road import Road
from highway_env.vehicle.kinematics import Vehicle
from highway_env.vehicle.objects import RoadObject
from numpy.typing import NDArray

from scenarios.adapter import bounding_box
from scenarios.bodies import parts
from testbed.environment.observation import every_part
from testbed.planners.track_vehicle import TrackVehicle, track_vehicles
from trackers.estimate import Estimate
from trackers.geometry import unit


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


class NoReset:
    """Takes the place of `reset` of the inner environment, which would show the truth; copies of it have it too."""

    def __call__(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> NoReturn:
        """Raise ResetNeeded."""
        raise ResetNeeded(
            "reset goes around radar and tracker here, and would show the truth; "
            "call it on the tracked environment, or on a deep copy of that"
        )


class BeliefPictures:
    """Takes the place of `render` of the inner environment: pictures for programs are of the belief road."""

    def __init__(self, env: AbstractEnv, view: BeliefView) -> None:
        self._env, self._view = env, view

    def __call__(self) -> NDArray:
        """Picture (height, width, 3)."""
        if self._env.viewer is None:
            self._env.viewer = EnvViewer(self._view)
        self._env.viewer.env = self._view  # a wrapper below may have rendered before
        return type(self._env).render(self._env)


class CopyOf:
    """What a deep copy of one road makes instead: a copy of another; a class, because functions cannot be pickled."""

    def __init__(self, road: Road) -> None:
        self._road = road

    def __call__(self, memo: dict) -> Road:
        """The copy."""
        return deepcopy(self._road, memo)


class RoadSwap:
    """Switches an environment between its true road, while it simulates, and the belief road, between calls.

    While the true road is hidden, a deep copy of it is one of the belief road, so that nothing that still refers to the
    true road copies the truth.
    """

    def __init__(self, env: AbstractEnv) -> None:
        self._env = env
        self._truth: Road | None = None
        self._belief: Road | None = None

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
