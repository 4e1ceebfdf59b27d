"""A stage on which a scenario places its vehicles, each with a size drawn for its class, and the world that comes out.

Every platoon starts at or beyond the gap at which the intelligent driver model (IDM) drives at constant speed, so what
happens later is caused by the maneuver.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import cycle, islice
from typing import Any, NamedTuple

import numpy as np
from highway_env.road.road import LaneIndex
from highway_env.vehicle.kinematics import Vehicle
from numpy.typing import ArrayLike, NDArray

from scenarios.articulated import KINGPIN, OVERHANG, TRAILER, UNIT, ArticulatedCourse, ArticulatedIDM
from scenarios.bodies import rear_extent
from scenarios.contours import find
from scenarios.drivers import TARGET_RATIO, Driver, Population, balanced_target, steady_gap
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


class Traffic(NamedTuple):
    """How a stage differs from what its builder says."""

    density: float = 1.0  # vehicles of a platoon, rounded and one at least, and the inverse of their headways
    speed: float = 1.0  # of everybody: all ways are the same, and are passed in another time
    population: Population | None = None  # of its drivers


AS_BUILT = Traffic()
_TRAFFIC = ContextVar("traffic", default=AS_BUILT)  # of the stages that are made now: builders make their own


@contextmanager
def traffic(**given: Any) -> Iterator[None]:
    """Within it, stages have a `Traffic` of these fields."""
    before = _TRAFFIC.set(Traffic(**given))
    try:
        yield
    finally:
        _TRAFFIC.reset(before)


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
        self.traffic = _TRAFFIC.get()
        self._size_rng = rng.spawn(1)[0]
        self._driver_rng = rng.spawn(1)[0] if self.traffic.population else rng
        self.walls = layout.walls
        self.network = layout.network
        self.road = CachedRoad(layout.network, np_random=rng, neighbour_vehicles_connected_lanes=True)

    def ego(self, lane: LaneIndex, s: float, speed: float, route: str | None = None) -> EgoVehicle:
        """Place the ego, 4.7 x 1.9 m, with the fine list of target speeds; `route` is the node it drives to."""
        at = self.network.get_lane(lane)
        length, width = EGO_SIZE
        vehicle = EgoVehicle(
            self.road, at.position(s, 0.0), at.heading_at(s), speed * self.traffic.speed,
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
        draw: bool = True,
    ) -> SizedIDM:
        """Place an IDM driver who keeps its lane, of a drawn `size`, with its initial speed as target, unless given.

        One of a population, drawn unless it is given or `draw` is false, has its own time gap, and unless it is given
        its own share of the target speed.
        """
        at = self.network.get_lane(lane)
        pace = self.traffic.speed
        length, width = box = self.size(kind) if size is None else np.asarray(size, float)
        wanted = speed if target is None else target
        if driver is None and draw and (driver := self.driver()) is not None:
            driver = driver.within(self._gap_ahead(lane, s + extent(kind, box)[0]), speed)
            wanted *= driver.speed / driver.median_speed
        pose = (self.road, at.position(s, 0.0), at.heading_at(s), speed * pace, lane, wanted * pace)
        changes = driver is not None and driver.gain < np.inf
        if kind == ARTICULATED:
            vehicle: SizedIDM = ArticulatedIDM(*pose, enable_lane_change=changes, trailer=box)
        else:
            vehicle = SizedIDM(*pose, enable_lane_change=changes, length=length, width=width, contour=kind)
        if headway is not None:
            vehicle.TIME_WANTED = headway
        if driver is not None:
            vehicle.__dict__.update(driver.habits(self._driver_rng))
        if pace != 1.0:
            vehicle.TIME_WANTED = vehicle.TIME_WANTED / pace
        return self._enter(vehicle, route)

    def driver(self) -> Driver | None:
        """A driver of the population, from a stream of its own, so that all else is the same whoever drives."""
        population = self.traffic.population
        return None if population is None else population.draw(self._driver_rng)

    def prescribe(self, kind: str, table: NDArray, size: ArrayLike | None = None) -> CourseVehicle:
        """Place a vehicle on a course; its size, as of `Stage.size`, is drawn unless given."""
        length, width = box = self.size(kind) if size is None else np.asarray(size, float)
        if (pace := self.traffic.speed) != 1.0:
            table = table * [1 / pace, 1, 1, 1, pace, pace, pace]
        if kind == ARTICULATED:
            return self._enter(ArticulatedCourse(self.road, table, trailer=box))
        return self._enter(CourseVehicle(self.road, table, length=length, width=width, contour=kind))

    def size(self, kind: str) -> NDArray:
        """Length and width (2,) [m] drawn for one vehicle of a kind; those of its trailer for an articulated truck."""
        contour = find(TRAILER if kind == ARTICULATED else kind)
        return contour.size if contour.sizes is None else contour.sizes.draw(self._size_rng)

    def fill(self, flow: Flow) -> list[SizedIDM]:
        """Place a platoon at or above its steady gaps; its first driver keeps its speed where no vehicle is ahead.

        At another density a vehicle that has no room is left out.
        """
        dense = self.traffic.density
        if dense != 1.0:
            kinds = tuple(islice(cycle(flow.kinds), max(1, int(len(flow.kinds) * dense + 0.5))))
            flow = flow._replace(kinds=kinds, headway=flow.headway / dense)
        sizes = [self.size(kind) for kind in flow.kinds]
        extents = [extent(kind, size) for kind, size in zip(flow.kinds, sizes, strict=True)]
        front = flow.place + self.rng.uniform(-4.0, 4.0)
        gaps = 1 + flow.spread * self.rng.uniform(size=len(sizes))
        gaps *= steady_gap(flow.speed, TARGET_RATIO * flow.speed, flow.headway)
        drivers = [None if flow.from_rear else self.driver() for _ in sizes]  # a maneuver relies on those ahead of it
        if own := [driver.gap(flow.speed) for driver in drivers if driver is not None]:
            gaps = np.array([*own[1:], 0.0]) / dense
        if flow.from_rear:
            front += np.sum(extents) + gaps[:-1].sum()
        placed: list[SizedIDM] = []
        for kind, size, (ahead, behind), gap, driver in zip(flow.kinds, sizes, extents, gaps, drivers, strict=True):
            if driver is not None and front - ahead - behind < 0:
                break  # the road begins here
            if dense == 1.0 or self._is_free(flow.lane, front, ahead + behind):
                free = self._gap_ahead(flow.lane, front)
                target = balanced_target(flow.speed, free, flow.headway)
                if driver is not None:
                    driver = driver.within(free, flow.speed)
                    target = driver.target(flow.speed, free)
                placed.append(
                    self.drive(
                        kind, flow.lane, front - ahead, flow.speed, target, flow.headway, None, size, driver, draw=False
                    )
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

    def _is_free(self, lane: LaneIndex, front: float, length: float) -> bool:
        """Whether a stretch of a lane [m], and 5 m before and behind it, has no vehicle."""
        at = self.network.get_lane(lane)
        for vehicle in self.road.vehicles:
            s, lateral = at.local_coordinates(vehicle.position)
            near = abs(lateral) < (at.width_at(s) + vehicle.WIDTH) / 2
            if near and front - length - 5.0 < s + vehicle.LENGTH / 2 and s - rear_extent(vehicle) < front + 5.0:
                return False
        return True

    def world(self, plan: tuple[Phase, ...]) -> World:
        """Everything placed so far; there must be an ego."""
        if (pace := self.traffic.speed) != 1.0:
            plan = tuple(Phase(part.name, part.start / pace, part.end / pace) for part in plan)
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
