"""A stage on which a scenario places its vehicles, each with a size drawn for its class, and the world that comes out.

Every platoon starts at or beyond the gap at which the intelligent driver model (IDM) drives at constant speed, so what
happens later is caused by the maneuver.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from highway_env.road.road import LaneIndex
from highway_env.vehicle.kinematics import Vehicle
from numpy.typing import ArrayLike, NDArray

from scenarios.articulated import KINGPIN, OVERHANG, TRAILER, UNIT, ArticulatedCourse, ArticulatedIDM
from scenarios.bodies import rear_extent
from scenarios.contours import find
from scenarios.drivers import TARGET_RATIO, Driver, balanced_target, driving, steady_gap
from scenarios.networks import Layout
from scenarios.roads import CachedRoad
from scenarios.vehicles import CourseVehicle, EgoVehicle, SizedIDM

TARGET_SPEEDS = tuple(np.linspace(0.0, 40.0, 17).tolist())  # [m/s] what the ego's meta actions choose from
EGO_SIZE = (4.7, 1.9)  # [m]
ARTICULATED = "articulated"  # a kind of vehicle of two contours; all other kinds are contours
AFTER = "after"  # name of the phase in which the maneuver is over


class Phase(NamedTuple):
    """A part of the episode that metrics report by itself."""

    name: str
    start: float  # [s]
    end: float  # [s]


class World(NamedTuple):
    """One episode before its first frame."""

    road: CachedRoad
    ego: EgoVehicle
    walls: NDArray  # (W, 2, 2) [m]
    phases: tuple[Phase, ...]


class Flow(NamedTuple):
    """A platoon of background traffic in one lane."""

    lane: LaneIndex
    place: float  # [m] along the lane: where the first vehicle's front bumper is, give or take 4 m
    speed: float  # [m/s]
    kinds: tuple[str, ...]  # front to back
    spread: float = 0.5  # gaps are the steady one times 1 to 1 + spread
    headway: float = 1.2  # [s]
    from_rear: bool = False  # `place` is where the last vehicle's rear bumper is, give or take 4 m


def phases(onset: float, end: float, duration: float = 25.0) -> tuple[Phase, ...]:
    """Before, onset (its first second), during and after a maneuver from `onset` to `end` [s]; courses last 25 s."""
    cuts = (0.0, onset, onset + 1.0, end, duration)
    names = ("before", "onset", "during", AFTER)
    return tuple(Phase(n, a, b) for n, a, b in zip(names, cuts, cuts[1:], strict=False) if b > a)


def maneuver_end(parts: Sequence[Phase]) -> float | None:
    """Time [s] at which the maneuver is over: the start of `AFTER`, or else the end of all; None without phases."""
    over = [part.start for part in parts if part.name == AFTER] + [part.end for part in parts[-1:]]
    return over[0] if over else None


class Stage:
    """A road being populated; every draw comes from one generator, but sizes come from a stream of their own."""

    def __init__(self, layout: Layout, rng: np.random.Generator) -> None:
        self.rng = rng
        self._size_rng = rng.spawn(1)[0]
        self._population = driving.get()
        self._driver_rng = rng.spawn(1)[0] if self._population else rng
        self.walls = layout.walls
        self.network = layout.network
        self.road = CachedRoad(layout.network, np_random=rng, neighbour_vehicles_connected_lanes=True)

    def ego(self, lane: LaneIndex, s: float, speed: float, route: str | None = None) -> EgoVehicle:
        """Place the ego, 4.7 x 1.9 m, with the fine list of target speeds; `route` is the node it drives to."""
        at = self.network.get_lane(lane)
        length, width = EGO_SIZE
        vehicle = EgoVehicle(
            self.road, at.position(s, 0.0), at.heading_at(s), speed,
            target_lane_index=lane, target_speeds=TARGET_SPEEDS, length=length, width=width, contour="car",
        )  # fmt: skip
        return self._enter(vehicle, route)

    def drive(
        self,
        kind: str,
        lane: LaneIndex,
        s: float,
        speed: float,
        target: float | None = None,
        headway: float | None = None,
        route: str | None = None,
        size: ArrayLike | None = None,
        driver: Driver | None = None,
    ) -> SizedIDM:
        """Place an IDM driver who keeps its lane, of a drawn `size`, with its initial speed as target, unless given.

        One of a population has its own time gap, and unless it is given its own share of the target speed.
        """
        at = self.network.get_lane(lane)
        length, width = box = self.size(kind) if size is None else np.asarray(size, float)
        wanted = speed if target is None else target
        if driver is None and (driver := self.driver()) is not None:
            driver = driver.within(self._gap_ahead(lane, s + extent(kind, box)[0]), speed)
            wanted *= driver.speed / driver.median_speed
        pose = (self.road, at.position(s, 0.0), at.heading_at(s), speed, lane, wanted)
        changes = driver is not None and driver.gain < np.inf
        if kind == ARTICULATED:
            vehicle: SizedIDM = ArticulatedIDM(*pose, enable_lane_change=changes, trailer=box)
        else:
            vehicle = SizedIDM(*pose, enable_lane_change=changes, length=length, width=width, contour=kind)
        if headway is not None:
            vehicle.TIME_WANTED = headway
        if driver is not None:
            vehicle.__dict__.update(driver.habits(self._driver_rng))
        return self._enter(vehicle, route)

    def driver(self) -> Driver | None:
        """A driver of the population, from a stream of its own, so that all else is the same whoever drives."""
        return None if self._population is None else self._population.draw(self._driver_rng)

    def prescribe(self, kind: str, table: NDArray, size: ArrayLike | None = None) -> CourseVehicle:
        """Place a vehicle on a course; its size, as of `Stage.size`, is drawn unless given."""
        length, width = box = self.size(kind) if size is None else np.asarray(size, float)
        if kind == ARTICULATED:
            return self._enter(ArticulatedCourse(self.road, table, trailer=box))
        return self._enter(CourseVehicle(self.road, table, length=length, width=width, contour=kind))

    def size(self, kind: str) -> NDArray:
        """Length and width (2,) [m] drawn for one vehicle of a kind; those of its trailer for an articulated truck."""
        contour = find(TRAILER if kind == ARTICULATED else kind)
        return contour.size if contour.sizes is None else contour.sizes.draw(self._size_rng)

    def fill(self, flow: Flow) -> list[SizedIDM]:
        """Place a platoon at or above its steady gaps; its first driver keeps its speed where no vehicle is ahead."""
        sizes = [self.size(kind) for kind in flow.kinds]
        extents = [extent(kind, size) for kind, size in zip(flow.kinds, sizes, strict=True)]
        front = flow.place + self.rng.uniform(-4.0, 4.0)
        gaps = 1 + flow.spread * self.rng.uniform(size=len(sizes))
        gaps *= steady_gap(flow.speed, TARGET_RATIO * flow.speed, flow.headway)
        drivers = [self.driver() for _ in sizes]
        if own := [driver.gap(flow.speed) for driver in drivers if driver is not None]:
            gaps = np.array([*own[1:], 0.0])
        if flow.from_rear:
            front += np.sum(extents) + gaps[:-1].sum()
        placed: list[SizedIDM] = []
        for kind, size, (ahead, behind), gap, driver in zip(flow.kinds, sizes, extents, gaps, drivers, strict=True):
            free = self._gap_ahead(flow.lane, front)
            target = balanced_target(flow.speed, free, flow.headway)
            if driver is not None:
                driver = driver.within(free, flow.speed)
                target = driver.target(flow.speed, free)
                if front - ahead - behind < 0:
                    break  # the road begins here
            placed.append(
                self.drive(kind, flow.lane, front - ahead, flow.speed, target, flow.headway, None, size, driver)
            )
            front -= ahead + behind + gap
        return placed

    def _gap_ahead(self, lane: LaneIndex, front: float) -> float:
        """Free road [m] from a point of a lane to the rear of the next vehicle placed so far."""
        at = self.network.get_lane(lane)
        gap = np.inf
        for vehicle in self.road.vehicles:
            s, lateral = at.local_coordinates(vehicle.position)
            if abs(lateral) < at.width_at(s) / 2 and s > front:
                gap = min(gap, s - rear_extent(vehicle) - front)
        return gap

    def world(self, plan: tuple[Phase, ...]) -> World:
        """Everything placed so far; there must be an ego."""
        ego = next(v for v in self.road.vehicles if isinstance(v, EgoVehicle))
        return World(self.road, ego, self.walls, plan)

    def _enter(self, vehicle: Vehicle, route: str | None = None) -> Vehicle:
        if route is not None:
            vehicle.plan_route_to(route)
        self.road.vehicles.append(vehicle)
        return vehicle


def extent(kind: str, size: NDArray) -> tuple[float, float]:
    """Distances [m] from the position of a vehicle to its front and rear when straight; `size` as of `Stage.size`."""
    if kind == ARTICULATED:
        return find(UNIT).length / 2, float(size[0] - OVERHANG - KINGPIN)
    return float(size[0] / 2), float(size[0] / 2)
