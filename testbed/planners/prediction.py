"""Prediction on a highway-env road, of vehicles or of tracks: the ego's path, and who is or will be on it.

A path is the centre line along the route, sampled evenly from the vehicle on.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from highway_env.road.lane import AbstractLane, StraightLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.kinematics import Vehicle
from numpy.typing import NDArray

from trackers.geometry import cross, perpendicular, unit, wrap_angle

LaneIndex = tuple[str, str, int]

SPACING = 2.0  # [m] between the points of a path
NODES = 1.0  # [m] between the nodes of a tabulated lane; the chord of a 15 m circle is off by 8 mm
DRIFT = 0.5  # [m/s] slower motion across the lane is weaving
FOLLOWS = np.cos(np.pi / 6)  # cosine of the angle to a lane up to which a vehicle is taken to follow it
FADE = 1.5  # [s] time constant with which motion across a lane decays: no vehicle drifts over many lanes
LANE_MARGIN = 0.3  # [m] beyond both widths, to call a vehicle on the path
EXACT = np.zeros((2, 2))  # covariance of what is known without error


class LanePath(NamedTuple):
    """P points on the centre line ahead of a vehicle."""

    points: NDArray  # (P, 2) [m]
    heading: NDArray  # (P,) [rad]
    arc: NDArray  # (P,) [m] from the vehicle
    bend: NDArray  # (P,) [1/m] curvature
    limit: NDArray  # (P,) [m/s] speed limits, inf for none
    jump: float  # [m] sum of the sideways steps where one lane ends and the next begins: left to lane changes


class Others(NamedTuple):
    """N vehicles and obstacles besides the ego."""

    position: NDArray  # (N, 2) [m]
    heading: NDArray  # (N,) [rad]
    velocity: NDArray  # (N, 2) [m/s], without the motion across the lane of those that weave
    size: NDArray  # (N, 2) [m]
    course: NDArray  # (N,) [rad] heading of the lane that they follow, direction of motion of those that cross it
    bend: NDArray  # (N,) [1/m] curvature of that lane, 0 for those that cross it
    lean: NDArray  # (N, 2) [m, m/s] offset from the middle of that lane and speed across, NaN for those that cross it
    lean_cov: NDArray  # (N, 2, 2) of the same

    def rows(self, index: NDArray) -> "Others":
        """Those at index, (N,) bool or rows."""
        return Others(*(column[index] for column in self))


class Relation(NamedTuple):
    """N others relative to a path: along it (positive ahead) and across (positive to the left of the heading)."""

    along: NDArray  # (N,) [m] of the centre
    across: NDArray  # (N,) [m] of the centre
    speed: NDArray  # (N,) [m/s] along
    drift: NDArray  # (N,) [m/s] across
    half: NDArray  # (N, 2) [m] half of length and width as seen along and across


def _route_from(lane: LaneIndex, route: Sequence[Any] | None) -> list[Any]:
    """The part of a route that begins on the road of a lane; empty where the route does not lead over it."""
    steps = list(route or ())
    matches = [i for i, step in enumerate(steps) if step[:2] == lane[:2]]
    return steps[matches[0] :] if matches else []


class LaneTable(NamedTuple):
    """The centre line of a lane by its longitudinal coordinate, to be interpolated."""

    s: NDArray  # (L,) [m]
    points: NDArray  # (L, 2) [m]
    heading: NDArray  # (L,) [rad], unwrapped

    def at(self, s: NDArray) -> tuple[NDArray, NDArray]:
        """Points (..., 2) [m] and headings (...) [rad] at s (...) [m]; straight on beyond both ends."""
        heading = np.interp(s, self.s, self.heading)
        over = s - np.clip(s, self.s[0], self.s[-1])
        points = over[..., None] * unit(heading)
        for k in (0, 1):
            points[..., k] += np.interp(s, self.s, self.points[:, k])
        return points, heading


_TABLES: "WeakKeyDictionary[AbstractLane, LaneTable]" = (
    WeakKeyDictionary()
)  # lanes do not change, and their own methods are slow


def lane_table(lane: AbstractLane) -> LaneTable:
    """The table of a lane, made once."""
    if lane not in _TABLES:
        pieces = 1 if type(lane) is StraightLane else int(np.ceil(lane.length / NODES))
        s = np.linspace(0.0, lane.length, pieces + 1)
        points = np.array([lane.position(x, 0.0) for x in s], float)
        _TABLES[lane] = LaneTable(s, points, np.unwrap([float(lane.heading_at(x)) for x in s]))
    return _TABLES[lane]


def path_ahead(
    network: RoadNetwork, lane: LaneIndex, route: Sequence[Any] | None, at: NDArray, reach: float
) -> LanePath:
    """Path of reach [m] from the position at (2,) [m] on, along a lane and then the route, or the straightest road."""
    todo = _route_from(lane, route)
    segment = network.get_lane(lane)
    s, jump = float(segment.local_coordinates(at)[0]), 0.0
    arc = SPACING * np.arange(int(reach // SPACING) + 1)
    points, heading, limit = np.empty((len(arc), 2)), np.empty(len(arc)), np.empty(len(arc))
    done = 0
    while done < len(arc):
        following = lane
        if s + arc[-1] - arc[done] > segment.length:
            end = segment.position(segment.length, 0)
            following = network.next_lane(lane, route=todo, position=end)
        last = following == lane  # of the road: straight on from there
        count = len(arc) - done if last else min(len(arc) - done, max(0, int((segment.length - s) // SPACING) + 1))
        part = slice(done, done + count)
        points[part], heading[part] = lane_table(segment).at(s + SPACING * np.arange(count))
        limit[part] = np.inf if segment.speed_limit is None else segment.speed_limit
        done += count
        if not last:
            over = s + SPACING * count - segment.length
            lane, segment = following, network.get_lane(following)
            start, aside = segment.local_coordinates(end)
            s, jump = float(start + over), jump + abs(aside)
    heading = np.unwrap(heading)
    return LanePath(points, heading, arc, np.gradient(heading, arc), limit, jump)


def things_on(road: Road, ego: Vehicle, within: float) -> list[Any]:
    """All solid vehicles and objects on the road but the ego, not farther than within [m]."""
    things = (*road.vehicles, *road.objects)
    return [v for v in things if v is not ego and v.solid and np.hypot(*(v.position - ego.position)) < within]


def others_on(road: Road, ego: Vehicle, within: float) -> Others:
    """All solid vehicles and objects on the road but the ego, not farther than within [m]."""
    return others_of(things_on(road, ego, within))


def others_of(things: Sequence[Any]) -> Others:
    """Vehicles and objects; slow motion across the lane is left out of their velocity."""
    position = np.array([v.position for v in things]).reshape(-1, 2)
    velocity = np.array([v.velocity for v in things]).reshape(-1, 2)
    heading = np.array([v.heading for v in things], float)
    size = np.array([(v.LENGTH, v.WIDTH) for v in things]).reshape(-1, 2)
    course, bend, offset = np.array([_lane_under(v) for v in things], float).reshape(-1, 3).T
    cov = np.array([getattr(v, "across_cov", EXACT) for v in things], float).reshape(-1, 2, 2)
    drift = cross(unit(course), velocity)
    velocity = np.where((np.abs(drift) > DRIFT)[:, None], velocity, along_course(velocity, course))
    return Others(position, heading, velocity, size, course, bend, np.stack([offset, drift], -1), cov)


def along_course(velocity: NDArray, course: NDArray) -> NDArray:
    """The part of velocities (N, 2) along courses (N,) [rad]."""
    along = unit(course)
    return (velocity * along).sum(-1)[:, None] * along


def _lane_under(vehicle: Vehicle) -> tuple[float, float, float]:
    """Heading [rad] and curvature [1/m] of the lane under a vehicle, and its offset [m] from the middle.

    Those of its straight course, and NaN, if it crosses the lane.
    """
    lane, (vx, vy) = vehicle.lane, vehicle.velocity
    s, offset = lane.local_coordinates(vehicle.position)
    here = lane.heading_at(s)
    if np.cos(vehicle.heading - here) > FOLLOWS:
        return here, float(wrap_angle(lane.heading_at(s + SPACING) - here)) / SPACING, offset
    moving = vx * vx + vy * vy > DRIFT**2
    return (float(np.arctan2(vy, vx)) if moving else vehicle.heading), 0.0, np.nan


def relate(path: LanePath, others: Others) -> Relation:
    """Where the others are relative to a path, which is continued straight at both ends."""
    nearest = np.linalg.norm(others.position[:, None] - path.points, axis=-1).argmin(-1)
    tangent = unit(path.heading[nearest])
    d = others.position - path.points[nearest]
    turn = np.abs(unit(others.heading - path.heading[nearest]))  # |cos|, |sin|
    half = 0.5 * np.stack([(others.size * turn).sum(-1), (others.size * turn[:, ::-1]).sum(-1)], -1)
    return Relation(
        along=path.arc[nearest] + (d * tangent).sum(-1),
        across=cross(tangent, d),
        speed=(others.velocity * tangent).sum(-1),
        drift=cross(tangent, others.velocity),
        half=half,
    )


def on_path(relation: Relation, width: float, later: float = 0.0) -> NDArray:
    """Which others (N,) bool are on the path of a vehicle of width [m], or will be later [s] if they drift on."""
    return np.abs(relation.across + later * relation.drift) < relation.half[..., 1] + width / 2 + LANE_MARGIN


def without_followers(others: Others, relation: Relation, width: float) -> Others:
    """The others but those behind on the path of a vehicle of width [m]: these keep their distance by themselves."""
    return others.rows(~((relation.along < 0) & on_path(relation, width) & (relation.speed > 0)))


def allowed_speed(path: LanePath, lateral_accel: float, brake: float) -> float:
    """Highest speed [m/s] that the limits and curves of a path allow, braking [m/s^2] towards them included."""
    allowed = np.minimum(path.limit**2, lateral_accel / np.maximum(np.abs(path.bend), 1e-6))
    return float(np.sqrt((allowed + 2 * brake * path.arc).min()))


def offset_from(path: LanePath, ego: Vehicle) -> float:
    """Offset [m] of a vehicle across a path that begins beside it."""
    return float(cross(unit(path.heading[0]), ego.position - path.points[0]))


def forecast(others: Others, times: NDArray) -> tuple[NDArray, NDArray]:
    """Positions (N, H, 2) [m] and headings (N, H) [rad] at times (H,) [s].

    Speed and curvature of the lane are kept; motion across decays with the time constant `FADE`.
    """
    along = unit(others.course)
    speed, drift = (others.velocity * along).sum(-1), cross(along, others.velocity)
    half_turn = (speed * others.bend)[:, None] * times / 2
    chord = speed[:, None] * times * np.sinc(half_turn / np.pi)
    aside = drift[:, None] * FADE * (1 - np.exp(-times / FADE))
    ahead = unit(others.course[:, None] + half_turn)
    position = others.position[:, None] + chord[..., None] * ahead + aside[..., None] * perpendicular(ahead)
    return position, others.heading[:, None] + 2 * half_turn


def relate_at(path: LanePath, others: Others, times: NDArray) -> Relation:
    """Where the others will be relative to a path at times (H,) [s]: every field (N, H), and `half` (N, H, 2)."""
    position, heading = forecast(others, times)
    n, h = heading.shape
    kept = (np.repeat(part, h, 0) for part in others[2:])
    relation = relate(path, Others(position.reshape(-1, 2), heading.ravel(), *kept))
    return Relation(*(part.reshape(n, h, *part.shape[1:]) for part in relation))


def along_path(path: LanePath, arc: NDArray, offset: NDArray) -> tuple[NDArray, NDArray]:
    """Positions (..., 2) [m] and headings (...) [rad] at arc (...) [m] along and offset (...) [m] across a path."""
    heading = np.interp(arc, path.arc, path.heading)
    beyond = np.maximum(arc - path.arc[-1], 0.0)
    centre = np.stack([np.interp(arc, path.arc, path.points[:, k]) for k in (0, 1)], -1)
    side = unit(heading + np.pi / 2)
    return centre + beyond[..., None] * unit(heading) + offset[..., None] * side, heading


def is_oncoming(network: RoadNetwork, lane: LaneIndex, at: NDArray) -> bool:
    """Whether a lane of the opposite direction overlaps this lane at the position at (2,) [m]."""
    own = network.get_lane(lane)
    s = own.local_coordinates(at)[0]
    place, heading = own.position(s, 0), own.heading_at(s)
    for other in network.lanes_list():
        t, across = other.local_coordinates(place)
        here = abs(across) < other.width_at(t) / 2 and 0 <= t <= other.length
        if here and np.cos(other.heading_at(t) - heading) < -0.5:
            return True
    return False
