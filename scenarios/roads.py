"""The cached road: the states of highway-env's Road, bit by bit, in a fraction of its time.

Positions do not change while vehicles decide, so one projection a lane and frame, sorted, serves all questions for
neighbours; one array of distances rules out most pairs of a collision, and most lanes where a vehicle looks for its
own. Every number comes from the same scalar call as in the stock road, and ties are resolved in its order.
"""

from bisect import bisect_left
from typing import Any, NamedTuple

import numpy as np
from highway_env.road.lane import AbstractLane, StraightLane
from highway_env.road.regulation import RegulatedRoad
from highway_env.road.road import LaneIndex, Road, RoadNetwork
from highway_env.vehicle.kinematics import Vehicle
from highway_env.vehicle.objects import Landmark
from numpy.typing import NDArray

from scenarios.bodies import is_kind, reach
from scenarios.scalars import AxisLane, act, in_scalars

SPACING = 2.0  # [m] between samples of a lane that is not straight; its box is widened by as much
SHARE = 0.8  # distance of a lane, as a share of that of its points: `SineLane` takes a chord for its arc
MARGIN = 2.0  # [m] that a distance to a lane may fall short: the foot on a `PathLane` is found in a few steps
FEW = 12  # lanes that are asked one by one
SLACK = 1e-6  # [m] far above the rounding of a distance: the stock check has the last word within it


class LaneBoxes(NamedTuple):
    """All L lanes of a network in its own order, and the boxes that hold their centre lines."""

    name: list[LaneIndex]
    lane: list[AbstractLane]
    low: NDArray  # (L, 2) [m]
    high: NDArray  # (L, 2) [m]


class SiftedNetwork(RoadNetwork):
    """A RoadNetwork that asks no lane whose bounding box is farther away than the nearest lane found so far."""

    _boxes: LaneBoxes | None = None
    _plain = False  # few lanes, all along the axes; known with the boxes

    def add_lane(self, _from: str, _to: str, lane: AbstractLane) -> None:
        """Add a lane, as `RoadNetwork.add_lane`."""
        super().add_lane(_from, _to, in_scalars(lane))
        self._boxes = None

    def get_closest_lane_index(self, position: NDArray, heading: float | None = None) -> LaneIndex:
        """Index of the lane closest to a position (2,) [m] and heading [rad], of equals the first, as RoadNetwork."""
        if self._boxes is None:
            self._boxes = lane_boxes(self)
            lanes = self._boxes.lane
            self._plain = len(lanes) <= FEW and all(type(lane) is AxisLane for lane in lanes)
        names, lanes, low, high = self._boxes
        if self._plain and heading is not None:
            return names[_closest(lanes, position, heading)]
        apart = np.maximum(np.maximum(low - position, position - high), 0.0)
        bound = SHARE * np.hypot(apart[:, 0], apart[:, 1]) - MARGIN
        least, found = np.inf, 0
        for k in bound.argsort(kind="stable").tolist():
            if bound[k] > least:
                break
            distance = lanes[k].distance_with_heading(position, heading)
            if distance < least or (distance == least and k < found):
                least, found = distance, k
        return names[found]


def _closest(lanes: list[Any], position: NDArray, heading: float) -> int:
    """The first of the closest lanes along the axes; the heading adds to the distance of the place."""
    least, found = np.inf, 0
    px, py = position.tolist() if isinstance(position, np.ndarray) else position
    for k, lane in enumerate(lanes):
        x, y, ux, uy, vx, vy = lane.frame
        dx, dy = px - x, py - y
        s, place = dx * ux + dy * uy, abs(dx * vx + dy * vy)  # as `AxisLane.local_coordinates`
        if s < 0 or s > lane.length:
            place += max(s - lane.length, 0) + max(0 - s, 0)
        if not place >= least:
            distance = place + 1.0 * abs(lane.local_angle(heading, s))
            if distance < least:
                least, found = distance, k
    return found


def lane_boxes(network: RoadNetwork) -> LaneBoxes:
    """Bounding boxes of all lanes of a network."""
    found = [
        ((start, end, k), lane, *_box(lane))
        for start, ends in network.graph.items()
        for end, lanes in ends.items()
        for k, lane in enumerate(lanes)
    ]
    names, lanes, low, high = (list(column) for column in zip(*found, strict=True))
    return LaneBoxes(names, lanes, np.array(low), np.array(high))


def _box(lane: AbstractLane) -> tuple[NDArray, NDArray]:
    straight = type(lane) in (StraightLane, AxisLane)
    pieces = 1 if straight else int(np.ceil(lane.length / SPACING))
    points = np.array([lane.position(s, 0.0) for s in np.linspace(0.0, lane.length, pieces + 1)])
    widen = 0.0 if straight else SPACING
    return points.min(0) - widen, points.max(0) + widen


def sifted(network: RoadNetwork) -> RoadNetwork:
    """Turn a stock network into a sifted one in place and return it; all references to it see the change."""
    if type(network) is RoadNetwork:
        network.__class__ = SiftedNetwork
        for lane in network.lanes_list():
            in_scalars(lane)
    return network


class LaneOrder(NamedTuple):
    """Everything near one lane, by longitudinal coordinate; equal coordinates in list order."""

    s: list[float]  # [m]
    object: list[Any]


class CachedRoad(Road):
    """A Road that caches projections while its vehicles act, and tests only near pairs for collision."""

    _orders: dict[LaneIndex, LaneOrder] | None = None  # filled during `act` only
    _projections: dict[int, list[float | None]]
    _positions: NDArray  # (N, 2) [m] of vehicles and objects

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        """As Road; the network is sifted in place."""
        super().__init__(*args, **kwargs)
        sifted(self.network)

    def act(self) -> None:
        """Let every vehicle choose its action; none moves meanwhile."""
        self._orders, self._projections = {}, {}
        self._positions = np.array([v.position for v in self.vehicles + self.objects], float).reshape(-1, 2)
        try:
            for vehicle in self.vehicles:
                act(vehicle)
        finally:
            self._orders, self._projections = None, {}

    def neighbour_vehicles(self, vehicle: Vehicle, lane_index: LaneIndex | None = None) -> tuple[Any, Any]:
        """Nearest vehicle or obstacle ahead and behind on a lane, as in `Road`, which answers outside `act`."""
        lane_index = lane_index or vehicle.lane_index
        if self._orders is None or not lane_index:
            return super().neighbour_vehicles(vehicle, lane_index)
        s = self.network.get_lane(lane_index).local_coordinates(vehicle.position)[0]
        if s != s:  # NaN is neither ahead nor behind
            return None, None
        if lane_index not in self._orders:
            self._orders[lane_index] = self._order(lane_index)
        return neighbours(self._orders[lane_index], s, vehicle)

    def _order(self, lane_index: LaneIndex) -> LaneOrder:
        """All objects on a lane or its connected lanes; the first lane that holds an object counts."""
        lanes = self._search_lanes(lane_index)
        rows = []
        for k, v in enumerate(self.vehicles + self.objects):
            if is_kind(type(v), Landmark):
                continue
            for lane, offset in lanes:
                s = self._projected(lane)[k]
                if s is not None:
                    rows.append((s + offset, v))
                    break
        rows.sort(key=lambda row: row[0])  # stable
        return LaneOrder([s for s, _ in rows], [v for _, v in rows])

    def _projected(self, lane: AbstractLane) -> list[float | None]:
        """Longitudinal coordinate [m] of all vehicles and objects on one lane, None for those not on it."""
        known = self._projections.get(id(lane))
        if known is None:
            if type(lane) is AxisLane:
                known = lane.places(self._positions, margin=1)
            else:
                known = []
                for v in self.vehicles + self.objects:
                    s, lateral = lane.local_coordinates(v.position)
                    known.append(s if lane.on_lane(v.position, s, lateral, margin=1) else None)
            self._projections[id(lane)] = known
        return known

    def _search_lanes(self, lane_index: LaneIndex) -> list[tuple[AbstractLane, float]]:
        """The lane, then with connected lanes its successors and predecessors, and the offsets [m] of their s."""
        lane = self.network.get_lane(lane_index)
        lanes: list[tuple[AbstractLane, float]] = [(lane, 0)]
        if not self.neighbour_vehicles_connected_lanes:
            return lanes
        start, end, k = lane_index
        for following in self.network.graph.get(end, {}).values():
            if following:
                lanes.append((following[k if k < len(following) else 0], lane.length))
        for ends in self.network.graph.values():
            if ends.get(start):
                before = ends[start][k if k < len(ends[start]) else 0]
                lanes.append((before, -before.length))
        return lanes

    def step(self, dt: float) -> None:
        """Move every vehicle by dt [s], then collide the pairs that are near enough, in the stock order."""
        for vehicle in self.vehicles:
            vehicle.step(dt)
        others = self.vehicles + self.objects
        near = near_pairs(self.vehicles, self.objects, dt)
        for i, vehicle in enumerate(self.vehicles):
            for j in np.flatnonzero(near[i, i + 1 :]) + i + 1:
                other = others[j]
                if hasattr(other, "parts") and not hasattr(vehicle, "contour"):
                    other.handle_collisions(vehicle, dt)  # a stock vehicle does not see trailers: ask the truck
                else:
                    vehicle.handle_collisions(other, dt)


class CachedRegulatedRoad(RegulatedRoad, CachedRoad):
    """The cached road with the priority rules of intersections."""


def neighbours(order: LaneOrder, s: float, vehicle: Vehicle) -> tuple[Any, Any]:
    """Ahead: least coordinate >= s [m], of equals the last in the list. Behind: greatest < s, of equals the first."""
    split = bisect_left(order.s, s)
    ahead, behind = range(split, len(order.s)), range(split - 1, -1, -1)
    return _first_group(order, ahead, vehicle), _first_group(order, behind, vehicle)


def _first_group(order: LaneOrder, rows: range, vehicle: Vehicle) -> Any:
    """The last object of the first run of equal coordinates along `rows`, the vehicle itself left out."""
    found = None
    for k in rows:
        if found is not None and order.s[k] != order.s[found]:
            break
        if order.object[k] is not vehicle:
            found = k
    return None if found is None else order.object[found]


def near_pairs(vehicles: list[Any], objects: list[Any], dt: float) -> NDArray:
    """Which pairs (N, N + K) of N vehicles with all, K objects last, `_is_colliding` might find near in dt [s]."""
    everyone = vehicles + objects
    if not vehicles:
        return np.zeros((0, len(everyone)), bool)
    p = np.array([o.position for o in everyone], float)
    r = np.array([reach(o) + abs(o.speed) * dt for o in everyone])
    n = len(vehicles)
    with np.errstate(invalid="ignore"):
        distance = np.linalg.norm(p[:n, None] - p, axis=-1)
        return ~(distance > r[:n, None] + r + SLACK)  # a NaN distance goes to the stock check


CACHED = {Road: CachedRoad, RegulatedRoad: CachedRegulatedRoad}


def cacheable(road: Road) -> bool:
    """Whether `cached` takes a road: one of a stock class, or a cached one."""
    return isinstance(road, CachedRoad) or type(road) in CACHED


def cached(road: Road) -> Road:
    """Turn a stock road into a cached one in place and return it; all references to it see the change."""
    if isinstance(road, CachedRoad):
        return road
    if not cacheable(road):
        raise TypeError(f"road must be a Road or RegulatedRoad, got {type(road).__name__}; derive it from CachedRoad")
    road.__class__ = CACHED[type(road)]
    sifted(road.network)
    return road
