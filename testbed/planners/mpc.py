"""Model predictive control of the acceleration: the cheapest of 156 speed profiles over 4 s in the ego's lane.

A profile holds one acceleration, then another; the first of the cheapest is applied until the next decision. The
planner keeps its lane and route, and needs continuous actions. Equations: docs/methods/planners.md.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from highway_env.envs.common.action import ContinuousAction, DiscreteAction
from highway_env.vehicle.kinematics import Vehicle
from numpy.typing import NDArray

from scenarios.vehicles import SoftSteering
from testbed.limits import check_choice
from testbed.planners.futures import futures
from testbed.planners.hidden import first_unseen
from testbed.planners.idm import Choice, cruise_speed
from testbed.planners.prediction import (
    LanePath,
    Others,
    allowed_speed,
    along_path,
    offset_from,
    on_path,
    others_of,
    path_ahead,
    relate,
    relate_at,
    things_on,
)
from testbed.planners.track_vehicle import TrackVehicle, track_vehicles
from trackers.geometry import dot, perpendicular, unit, wrap_angle
from trackers.multi.tracks import REPORT_ABOVE

STEP = 0.2  # [s] between the instants of a prediction
FIRST = np.array([-8.0, -7, -6, -5, -4, -3, -2, -1, -0.5, 0, 0.5, 1, 2])  # [m/s^2] before the switch
THEN = np.array([-8.0, -5, -2.5, -1, 0, 1])  # [m/s^2] after it
SWITCH = np.array([0.6, 1.4])  # [s]
ASIDE = 1.0  # [m] between the middles of a lane that ends and the next one, from which it is another lane
COLLIDES = 0.5  # [m] gaps below this count as a collision
SLOWEST = 1.0  # [m/s] at lower speeds it steers with the gains of this one: a standing vehicle cannot turn
MOST = np.pi / 4  # [rad] of the angle towards the path
SOON = 1.0  # [s] for which what is unseen stays so: then it will have been looked at again
MARGINS = ("none", "covariance", "constant", "curve")
CURVE = (0.0, 2.0, 4.0), (0.63, 0.68, 0.78)  # [s], [m] mean margin by covariance before the nearest obstacle


class Obstacles(NamedTuple):
    """N vehicles and obstacles besides the ego."""

    others: Others
    existence: NDArray  # (N,) probability
    cov: NDArray  # (N, 4, 4) of x, y, vx, vy [m, m/s]
    edges: NDArray  # (N, 2) [m] standard deviations of front and rear

    def rows(self, index: NDArray) -> "Obstacles":
        """Those at index, (N,) bool or rows."""
        return Obstacles(self.others.rows(index), *(part[index] for part in self[1:]))

    def edge_std(self, times: NDArray, heading: float) -> NDArray:
        """Standard deviations (N, H) [m] of the bumper that faces an ego of a heading [rad], at times (H,) [s]."""
        along = unit(self.others.course)[:, None]  # (N, 1, 2)
        P = self.cov
        xv, vv = ((along @ block @ along.mT)[..., 0] for block in (P[:, :2, 2:], P[:, 2:, 2:]))
        near = np.where(np.cos(self.others.heading - heading) < 0, *self.edges.T)[:, None]
        return np.sqrt(np.maximum(near**2 + 2 * times * xv + times**2 * vv, 0.0))  # (PLAN.3)


class Ahead(NamedTuple):
    """K futures of obstacles at H instants, relative to the ego's path."""

    rear: NDArray  # (K, H) [m] along the path to the near end, inf while it is beside the path
    speed: NDArray  # (K, H) [m/s] along the path
    margin: NDArray  # (K, H) [m] kept free before it, beside the wanted gap
    weight: NDArray  # (K,) probability that it is there, and does that


class Decision(NamedTuple):
    """What the planner chose, and the profiles that it chose from."""

    acceleration: float  # [m/s^2] until the next decision
    path: LanePath
    arc: NDArray  # (H,) [m] predicted places of the ego along the path
    profiles: NDArray  # (C, H) [m/s^2]
    cost: NDArray  # (C,)


@dataclass(frozen=True)
class Mpc:
    """Model predictive control on tracks that keep their speed, or change their lane."""

    name: str = "mpc"
    note: str = "model predictive control of the acceleration on the estimates of the tracks"
    knows_truth: bool = False
    margin: str = "none"  # kept free besides before the near bumper: none, covariance, constant, curve
    quantile: float = 1.28  # standard deviations of the near bumper, of the margin by covariance: 90 % of a Gaussian
    above: float = REPORT_ABOVE  # existence from which a track counts; less than that of reported ones: in proportion
    unseen: bool = True  # whether it stays able to stop before what was never seen
    horizon: float = 4.0  # [s]
    reach: float = 150.0  # [m] range in which others matter, and length of the path
    standstill: float = 2.0  # [m] wanted gap at standstill
    headway: float = 0.9  # [s] wanted time gap
    lateral_accel: float = 3.0  # [m/s^2] in curves
    brake: float = 3.0  # [m/s^2] towards curves, speed limits and what is slower
    speed_cost: float = 0.04  # [1/(m/s)^2]
    speed_error: float = 3.0  # [m/s] beyond which that cost grows in proportion, so that it does not outweigh gaps
    accel_cost: float = 0.12  # [1/(m/s^2)^2]
    change_cost: float = 0.15  # [s/(m/s^2)^2] of a change of the acceleration
    gap_cost: float = 0.02  # [1/m^2] of what is missing of the wanted gap
    collision_cost: float = 60.0  # of an instant of a collision
    closing_cost: float = 15.0  # [1/(m/s)] of its closing speed
    doubt: float = 0.2  # changes of lane up to this probability are no reason to brake
    last_brake: float = 5.0  # [m/s^2] before what was never seen
    last_reaction: float = 0.4  # [s] before that braking
    merge_time: float = 4.0  # [s] before the end of a lane in which it moves over to the next one

    def __post_init__(self) -> None:
        check_choice("margin", self.margin, MARGINS)

    @property
    def action(self) -> dict[str, Any]:
        """`config["action"]` of the environments that it acts in: the pedals and limits of `EgoVehicle`."""
        return {"type": "ContinuousAction", "acceleration_range": [-8.0, 4.0]}

    def act(self, env: gym.Env) -> NDArray:
        """The action for the next period."""
        return self.choose(env).action

    def choose(self, env: gym.Env) -> Choice:
        """The action for the next period, and the predicted places of the ego."""
        decision, action_type = self.decide(env), _action_type(env)
        core: Any = env.unwrapped
        wanted = [(decision.acceleration, action_type.acceleration_range)] if action_type.longitudinal else []
        if action_type.lateral:
            wanted.append((steering_angle(decision.path, core.vehicle), action_type.steering_range))
        action = np.array([np.interp(value, limits, (-1.0, 1.0)) for value, limits in wanted], np.float32)
        arc = np.concatenate([[0.0], decision.arc])
        offset = offset_from(decision.path, core.vehicle) * np.exp(-arc / max(5.0, core.vehicle.speed))
        return Choice(action, along_path(decision.path, arc, offset)[0])

    def decide(self, env: gym.Env) -> Decision:
        """The cheapest profile."""
        core: Any = env.unwrapped
        ego, network = core.vehicle, core.road.network
        path = path_ahead(network, ego.lane_index, getattr(ego, "route", None), ego.position, self.reach)
        path = merging(path, self.merge_time * max(float(ego.speed), SLOWEST))
        ahead = self.ahead(ego, path, self.obstacles(env))
        lowest, highest = _action_type(env).acceleration_range
        profiles = np.clip(_profiles(self._times), lowest, highest)
        speed, arc = _drive(float(ego.speed), profiles)
        unseen = self.first_unseen(env, ego, path)
        target = min(cruise_speed(env, ego.speed), allowed_speed(path, self.lateral_accel, self.brake))
        comfort = self.speed_cost * huber(speed - target, self.speed_error) + self.accel_cost * profiles**2
        risk = self.risk(ego, ahead, speed, arc) + self.unseen_risk(ego, unseen + self.vouched(ahead), speed, arc)
        cost = STEP * (comfort + risk).sum(-1)  # (PLAN.6)
        cost += self.change_cost * (profiles[:, 0] - ego.action["acceleration"]) ** 2
        best = int(cost.argmin())
        return Decision(float(profiles[best, 0]), path, arc[best], profiles, cost)

    def obstacles(self, env: gym.Env) -> Obstacles:
        """What it keeps clear of."""
        if self.margin == "none" and self.above >= REPORT_ABOVE:
            return on_belief_road(env, self.reach)
        return among_tracks(env, self.reach, self.above)

    def ahead(self, ego: Vehicle, path: LanePath, obstacles: Obstacles) -> Ahead:
        """What will be on the path ahead of the ego within the horizon."""
        obstacles = obstacles.rows(relate(path, obstacles.others).along > 0)
        others = obstacles.others
        found = futures(path, others, relate(path, others), ego.LENGTH, ego.WIDTH)
        relation = relate_at(path, found.others, self._times)
        rear = np.where(on_path(relation, ego.WIDTH), relation.along - relation.half[..., 0], np.inf)
        near = np.isfinite(rear).any(-1)
        weight = obstacles.existence[found.of] * found.beyond(self.doubt)
        return Ahead(rear[near], relation.speed[near], self.margins(obstacles, path)[found.of][near], weight[near])

    def margins(self, obstacles: Obstacles, path: LanePath) -> NDArray:
        """What is kept free (N, H) [m] before each obstacle, beside the wanted gap."""
        if self.margin == "covariance":
            return self.quantile * obstacles.edge_std(self._times, float(path.heading[0]))  # (PLAN.2)
        curve = np.interp(self._times, *CURVE)
        margin = {"none": 0.0 * curve, "constant": 0.0 * curve + curve.mean(), "curve": curve}[self.margin]
        return np.broadcast_to(margin, (len(obstacles.existence), len(margin)))

    def first_unseen(self, env: gym.Env, ego: Vehicle, path: LanePath) -> float:
        """Place [m] along the path before which it stays able to stop, inf where all that matters was seen."""
        views = env.get_wrapper_attr("views") if env.has_wrapper_attr("views") else ()
        if not (self.unseen and views):
            return np.inf
        fastest = float(ego.speed) + FIRST.max() * SOON
        end = ego.LENGTH / 2 + SOON * fastest + self._stopping(np.asarray(fastest))
        return first_unseen(path, views, ego.LENGTH, float(end))

    def _stopping(self, speed: NDArray) -> NDArray:
        """Way [m] to a standstill from speeds [m/s], by the last braking."""
        return speed**2 / (2 * self.last_brake) + self.last_reaction * speed

    def vouched(self, ahead: Ahead) -> NDArray:
        """Way [m] at each instant (H,) that the nearest vehicle on the path clears, as long as it stays there."""
        if not np.isfinite(ahead.rear).any():
            return np.zeros(len(self._times))
        leader = int(ahead.rear[:, 0].argmin())
        there = np.logical_and.accumulate(np.isfinite(ahead.rear[leader]))
        return np.cumsum(STEP * np.maximum(ahead.speed[leader], 0.0) * there)

    def unseen_risk(self, ego: Vehicle, unseen: NDArray, speed: NDArray, arc: NDArray) -> NDArray:
        """Cost (C, H) of driving too fast to stop before an unseen place [m], while nothing more can be seen of it."""
        gap = unseen - (arc + ego.LENGTH / 2)
        missing = np.maximum(self._stopping(speed) - gap, 0.0)  # (PLAN.16)
        return np.where(self._times <= SOON, self.gap_cost * missing**2, 0.0)

    def risk(self, ego: Vehicle, ahead: Ahead, speed: NDArray, arc: NDArray) -> NDArray:
        """Cost (C, H) of the gaps to the worst obstacle, for speeds and places (C, H) of the ego."""
        gap = ahead.rear - (arc[:, None] + ego.LENGTH / 2)  # (C, K, H), (PLAN.1)
        speed = speed[:, None]
        closing = np.maximum(speed - ahead.speed, 0.0)
        stopping = np.maximum(speed**2 - np.maximum(ahead.speed, 0.0) ** 2, 0.0) / (2 * self.brake)
        wanted = self.standstill + ahead.margin + self.headway * speed + stopping  # (PLAN.4)
        missing = np.maximum(wanted - gap, 0.0)
        overlap = np.maximum(COLLIDES - gap, 0.0)
        cost = self.gap_cost * missing**2 + 2.0 * overlap  # (PLAN.5)
        cost += np.where(gap < COLLIDES, self.collision_cost, 0.0) + np.where(gap < 0, self.closing_cost * closing, 0.0)
        return (ahead.weight[:, None] * cost).max(-2, initial=0.0)

    @property
    def _times(self) -> NDArray:
        """The instants (H,) [s] of a prediction, the present left out."""
        return STEP * np.arange(1, round(self.horizon / STEP) + 1)


def on_belief_road(env: gym.Env, within: float) -> Obstacles:
    """What is on the belief road within [m], taken for certain."""
    core: Any = env.unwrapped
    return _certain(things_on(core.road, core.vehicle, within))


def among_tracks(env: gym.Env, within: float, above: float) -> Obstacles:
    """The tracks within [m], with their uncertainty; the rest from the road.

    Reported tracks count in full, however sure their existence is: a doubt is no reason to brake later. Tentative ones,
    which are not on the road, count the less, the less likely they are, from `above` on. Without a tracker, as in a
    deep copy: what is on the road.
    """
    if not env.has_wrapper_attr("current_tracks"):
        return on_belief_road(env, within)
    core: Any = env.unwrapped
    tracks = env.get_wrapper_attr("current_tracks")
    tracks = tracks.rows(tracks.existence > above)
    twins = track_vehicles(core.road, np.arange(len(tracks.id)), tracks.estimate, core.controlled_vehicles)
    twins = [v for v in twins if np.hypot(*(v.position - core.vehicle.position)) < within]
    row = np.array([v.track_id for v in twins], int)
    estimate = tracks.estimate
    certain = _certain([v for v in things_on(core.road, core.vehicle, within) if not isinstance(v, TrackVehicle)])
    existence = np.minimum(tracks.existence[row] / REPORT_ABOVE, 1.0)  # (PLAN.14)
    parts = certain, Obstacles(others_of(twins), existence, estimate.cov[row], estimate.edges[row, :2])
    others = Others(*map(np.concatenate, zip(*(part.others for part in parts))))
    return Obstacles(others, *map(np.concatenate, zip(*(part[1:] for part in parts))))


def _certain(things: list[Any]) -> Obstacles:
    n = len(things)
    return Obstacles(others_of(things), np.ones(n), np.zeros((n, 4, 4)), np.zeros((n, 2)))


def huber(error: NDArray, bound: float) -> NDArray:
    """The square of an error up to a bound, then its tangent.

    >>> huber(np.array([-1.0, 3.0]), 2.0)
    array([1., 8.])
    """
    small = np.minimum(np.abs(error), bound)
    return small * (2 * np.abs(error) - small)


def merging(path: LanePath, way: float) -> LanePath:
    """The path, which leaves a lane that ends for the next one within the last way [m]; itself where none ends."""
    left = perpendicular(unit(path.heading[:-1]))
    aside = dot(left, np.diff(path.points, axis=0))
    k = int(np.abs(aside).argmax())  # the last point on a lane that ends
    if np.abs(aside[k]) < ASIDE:
        return path
    done = np.clip(1 - (path.arc[k] - path.arc[: k + 1]) / way, 0.0, 1.0)
    points = path.points.copy()
    points[: k + 1] += (aside[k] * done**2 * (3 - 2 * done))[:, None] * left[: k + 1]  # (PLAN.18)
    heading = np.unwrap(np.arctan2(*np.gradient(points, path.arc, axis=0).T[::-1]))
    return path._replace(points=points, heading=heading, bend=np.gradient(heading, path.arc))


def _profiles(times: NDArray) -> NDArray:
    """Accelerations (C, H) [m/s^2] in the steps that end at times (H,) [s]; each pair of equal values once."""
    first, then, switch = (part.reshape(-1, 1) for part in np.meshgrid(FIRST, THEN, SWITCH, indexing="ij"))
    return np.where(times <= switch + 1e-9, first, then)


def _drive(speed: float, profiles: NDArray) -> tuple[NDArray, NDArray]:
    """Speeds [m/s] and places [m] (C, H) at the end of each step under accelerations (C, H); no speed is negative."""
    after = np.maximum(speed + np.cumsum(STEP * profiles, -1), 0.0)
    before = np.concatenate([np.full((len(after), 1), speed), after[:, :-1]], -1)
    return after, np.cumsum(STEP * (before + after) / 2, -1)


def steering_angle(path: LanePath, ego: Vehicle) -> float:
    """Angle of the front wheels [rad] that leads a kinematic bicycle back to a path that begins beside it.

    The gains are those of `SoftSteering`, so that the ego turns alike under every action type.
    """
    speed, half = max(float(ego.speed), SLOWEST), ego.LENGTH / 2
    lead = speed * SoftSteering.TAU_HEADING - half  # [m] cancels the lag of the heading and the slip of the centre
    towards = np.arcsin(np.clip(-SoftSteering.KP_LATERAL * offset_from(path, ego) / speed, -1, 1))
    wanted = np.interp(max(lead, 0.0), path.arc, path.heading) + np.clip(towards, -MOST, MOST)
    turn = SoftSteering.KP_HEADING * float(wrap_angle(wanted - ego.heading))  # [rad/s]
    slip = np.arcsin(np.clip(turn * half / speed, -1, 1))
    return float(np.arctan(2 * np.tan(slip)))


def _action_type(env: gym.Env) -> ContinuousAction:
    core: Any = env.unwrapped
    action_type = core.action_type
    if not isinstance(action_type, ContinuousAction) or isinstance(action_type, DiscreteAction):
        raise TypeError(
            f"the planner needs config['action'] of type ContinuousAction, got {core.config['action']}; "
            "`testbed.planners.settings(planner)` is the config that it needs"
        )
    return action_type
