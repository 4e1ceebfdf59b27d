"""The world of an episode of recorded traffic: straight lanes, and vehicles that enter, leave and react on them."""

from typing import Any

import numpy as np
from highway_env.road.lane import StraightLane
from highway_env.road.road import RoadNetwork
from highway_env.vehicle.kinematics import Vehicle
from numpy.typing import NDArray

from scenarios.courses import CourseTable
from scenarios.networks import OPEN, lines
from scenarios.roads import CachedRoad
from scenarios.stage import TARGET_SPEEDS, Phase, World
from scenarios.traffic.fitting import Lanes
from scenarios.traffic.plan import Part, Plan
from scenarios.vehicles import CourseVehicle, EgoVehicle, SizedIDM

STANDSTILL = 2.0  # [m] gap of a reacting driver at standstill
HEADWAYS = (0.5, 1.5)  # [s] least and greatest time gap of a reacting driver
BEHIND = 100.0  # [m] a driver farther than this behind stays on record
BEFORE, BEYOND = 200.0, 1000.0  # [m] of road before the first and beyond the last recorded place
CLEAR = 0.3  # [m] between the sides of two vehicles from which one is not in the other's way


class RecordedRoad(CachedRoad):
    """Plays a recording; set by `play`.

    Once the ego is farther than `react` [m] from its recorded place of the same time, who has the ego or somebody who
    reacts next ahead drives by IDM from then on. `events` has what happened, as (time [s], text).
    """

    events: list[tuple[float, str]]
    vehicles: list[Vehicle]

    def play(self, ego: Vehicle, record: CourseTable, parts: tuple[Part, ...], react: float | None) -> None:
        """Begin: an ego in the place of that on `record`, the others as their `parts` say; react None: never."""
        self.events = []
        self._ego, self._record, self._react = ego, record, react
        self._waiting = sorted(parts, key=lambda part: part.table[0, 0])
        self._playing: list[tuple[Vehicle, Part]] = []
        self._frames, self._dt, self._since = 0, 0.0, 0.0
        self._left_at: float | None = None
        self._enter()

    @property
    def time(self) -> float:
        """Time [s] since the ego's record began, counted in frames."""
        return self._since + self._frames * self._dt

    def step(self, dt: float) -> None:
        """Move every vehicle by dt [s], then let vehicles leave, enter and react."""
        super().step(dt)
        if dt != self._dt:
            self._since, self._frames, self._dt = self.time, 0, dt
        self._frames += 1
        self._leave()
        self._enter()
        if self._react is not None:
            self._let_react(self._react)

    def _enter(self) -> None:
        """Put those on the road whose record has begun; one whose place is taken stays away."""
        while self._waiting and self._waiting[0].table[0, 0] <= self.time + 1e-6:
            part = self._waiting.pop(0)
            if part.table[-1, 0] - self.time < 1e-3:
                continue
            table = CourseTable(part_from(part.table, self.time))
            length, width = part.size
            vehicle = CourseVehicle(self, table, length=length, width=width, contour=part.kind)
            vehicle.check_collisions = False  # recorded boxes may overlap a little; the ego checks for itself
            if self.time > 0 and self._taken(vehicle):
                self.events.append((self.time, f"vehicle {part.id} of the recording could not enter: place taken"))
                continue
            self._playing.append((vehicle, part))
            self.vehicles.append(vehicle)

    def _taken(self, vehicle: Vehicle) -> bool:
        """Whether a vehicle overlaps one that is not on record."""
        free = [v for v in self.vehicles if not isinstance(v, CourseVehicle)]
        return any(vehicle._is_colliding(v, 0.0)[0] for v in free)

    def _leave(self) -> None:
        """Take those off the road whose record is over."""
        over = {
            id(vehicle)
            for vehicle, part in self._playing
            if isinstance(vehicle, CourseVehicle) and part.table[-1, 0] <= self.time + 1e-6
        }
        if over:
            self.vehicles = [v for v in self.vehicles if id(v) not in over]
            self._playing = [pair for pair in self._playing if id(pair[0]) not in over]

    def _let_react(self, limit: float) -> None:
        if self._left_at is None:
            away = float(np.hypot(*(self._ego.position - self._record.at(self.time)[0][:2])))
            if away <= limit:
                return
            self._left_at = self.time
            self.events.append((self.time, f"ego is {away:.1f} m from its record: those behind it react"))
        for vehicle, part, gap in self._followers():
            take_over(vehicle, part, gap)
            self.events.append((self.time, f"vehicle {part.id} of the recording reacts"))

    def _followers(self) -> list[tuple[CourseVehicle, Part, float]]:
        """Who is on record, drives the ego's way and has somebody off record next ahead, with the gap [m] to it."""
        pairs = [(v, p) for v, p in self._playing if p.forward]
        everyone = [self._ego, *(v for v, _ in pairs)]
        free = np.array([not isinstance(v, CourseVehicle) for v in everyone])
        gap, leader = leaders(
            np.array([v.position for v in everyone]), np.array([[v.LENGTH, v.WIDTH] for v in everyone])
        )
        return [
            (vehicle, part, float(gap[k]))
            for k, (vehicle, part) in enumerate(pairs, 1)
            if not free[k] and leader[k] >= 0 and free[leader[k]] and gap[k] < BEHIND
        ]


def leaders(xy: NDArray, size: NDArray) -> tuple[NDArray, NDArray]:
    """Gap (N,) [m] to the next vehicle ahead of each in its way, inf for none, and its index (N,), -1 for none.

    Args:
        xy: places of the centres (N, 2) [m], all driving along +x.
        size: length, width (N, 2) [m].
    """
    ahead = xy[:, 0] - xy[:, None, 0]  # (N, N): of the second index ahead of the first
    beside = np.abs(xy[:, 1] - xy[:, None, 1]) < (size[:, 1] + size[:, None, 1]) / 2 + CLEAR
    distance = np.where((ahead > 0) & beside, ahead, np.inf)
    leader = distance.argmin(1)
    rows = np.arange(len(xy))
    nearest = distance[rows, leader]
    gap = nearest - (size[:, 0] + size[leader, 0]) / 2
    return gap, np.where(np.isfinite(nearest), leader, -1)


def part_from(table: NDArray, time: float) -> NDArray:
    """Rows of a course from a time [s] on, which lies before its last row; the first row is that of the time."""
    if time <= table[0, 0]:
        return table
    pose, rate = CourseTable(table).at(time)
    later = table[table[:, 0] > time + 1e-6]
    return np.vstack([[time, *pose, *rate], later])


def take_over(vehicle: CourseVehicle, part: Part, gap: float) -> None:
    """Turn a vehicle on record into an IDM driver: the same object, so it keeps its number.

    It wants the highest speed of its record, keeps the time gap that it has, within limits, and its lane.
    """
    speed = float(np.hypot(*part.table[:, 4:6].T).max())
    driver: Any = SizedIDM(
        vehicle.road, vehicle.position, vehicle.heading, vehicle.speed, None, max(speed, 1.0),
        enable_lane_change=False, length=vehicle.LENGTH, width=vehicle.WIDTH, contour=vehicle.contour,
    )  # fmt: skip
    driver.DISTANCE_WANTED = STANDSTILL
    driver.TIME_WANTED = float(np.clip((gap - STANDSTILL) / max(vehicle.speed, 1.0), *HEADWAYS))
    vehicle.__class__ = SizedIDM
    vehicle.__dict__ = driver.__dict__


def place_ego(road: RecordedRoad, part: Part) -> EgoVehicle:
    """The ego as its record begins, first on the road."""
    _, x, y, heading, vx, vy, _ = part.table[0]
    length, width = part.size
    ego = EgoVehicle(
        road, (x, y), heading, float(np.hypot(vx, vy)),
        target_speeds=TARGET_SPEEDS, length=length, width=width, contour=part.kind,
    )  # fmt: skip
    road.vehicles.append(ego)
    return ego


def world(plan: Plan, react: float | None, rng: np.random.Generator) -> World:
    """The episode before its first frame; nothing but the choices of highway-env's vehicles is drawn."""
    road = RecordedRoad(network(plan), np_random=rng, neighbour_vehicles_connected_lanes=True)
    ego = place_ego(road, plan.ego)
    road.play(ego, CourseTable(plan.ego.table), plan.others, react)
    return World(road, ego, np.zeros((0, 2, 2)), (Phase("during", 0.0, float(plan.ego.table[-1, 0])),))


def network(plan: Plan) -> RoadNetwork:
    """Lanes a -> b the way that the ego drives, and c -> d against it, each leftmost first for its drivers."""
    found = RoadNetwork()
    start, end = plan.reach[0] - BEFORE, plan.reach[1] + BEYOND
    _add(found, ("a", "b"), plan.lanes, plan.lanes.places, start, end)
    if plan.opposite is not None:
        _add(found, ("c", "d"), plan.opposite, plan.opposite.places[::-1], end, start)
    return found


def _add(network: RoadNetwork, edge: tuple[str, str], lanes: Lanes, places: NDArray, start: float, end: float) -> None:
    for k, y in enumerate(places):
        lane = StraightLane([start, y], [end, y], lanes.width, lines(k, len(places)), speed_limit=OPEN)
        network.add_lane(*edge, lane)
