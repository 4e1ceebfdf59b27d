"""The default planner: speed by the Intelligent Driver Model, lane changes by MOBIL, on the belief road.

MOBIL: Kesting, Treiber, Helbing (2007), "General lane-changing model MOBIL for car-following models". Actions for which
`collision` forecasts a contact are not chosen.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from highway_env.envs.common.action import DiscreteMetaAction
from highway_env.road.road import RoadNetwork
from highway_env.vehicle.controller import ControlledVehicle, MDPVehicle
from highway_env.vehicle.kinematics import Vehicle
from numpy.typing import NDArray

from scenarios.vehicles import EgoVehicle
from testbed.planners.car_following import CarFollowing
from testbed.planners.collision import distance_driven, first_contact, instants
from testbed.planners.futures import Futures, futures
from testbed.planners.prediction import (
    LaneIndex,
    LanePath,
    Others,
    Relation,
    allowed_speed,
    along_path,
    is_oncoming,
    offset_from,
    on_path,
    others_on,
    path_ahead,
    relate,
    without_followers,
)

SPEED_ACTIONS = ("IDLE", "SLOWER", "FASTER")  # the first of equals is taken


class Choice(NamedTuple):
    """What a planner chose."""

    action: Any
    plan: NDArray  # (P, 2) [m] in the world frame


class LaneOption(NamedTuple):
    """One lane that the ego may take: its path, and the others relative to it."""

    path: LanePath
    relation: Relation
    futures: Futures
    top: float  # [m/s] highest speed that the path allows now


class Decision(NamedTuple):
    """What a planner chose and why."""

    action: str  # name of a meta-action
    path: LanePath  # the path that goes with it
    offset: float  # [m] of the vehicle from that path
    acceleration: float  # [m/s^2] of the car-following model, before the collision check
    contact: float  # [s] until the forecast collides under that action, inf for never


@dataclass(frozen=True)
class IdmPlanner:
    """IDM and MOBIL on the tracks, with a collision check, in terms of highway-env's meta-actions."""

    name: str = "idm"
    note: str = "IDM and MOBIL on the tracks, with a collision check (Treiber 2000, Kesting 2007)"
    knows_truth: bool = False
    model: CarFollowing = field(default_factory=CarFollowing)
    hard_brake: float = 8.0  # [m/s^2] limit of the braking of the car-following model
    lateral_accel: float = 3.0  # [m/s^2] in curves
    patience: float = 0.3  # [m/s] by which another target speed must fit better than the present one
    reach: float = 150.0  # [m] range in which others matter, and length of the path
    horizon: float = 3.0  # [s] of the collision forecast
    clearance: tuple[float, float] = (1.0, 0.3)  # [m] added to length and width of the own box in the forecast
    change_gain: float = 1.0  # [m/s^2] a lane change must bring more than this
    change_after: float = 2.0  # [s] no lane change before, while tracks are still being confirmed
    rush: float = 2.0  # [m/s] a follower that is faster by this may change lane to pass, and blocks both lanes
    imposed_brake: float = 2.0  # [m/s^2] that a lane change may impose on the follower
    route_gain: float = 1.5  # [m/s^2] gain of a lane change for every lane width by which it reduces `jump`
    change_speed: float = 3.0  # [m/s] slower vehicles do not change lane
    change_bend: float = 0.01  # [1/m] lane changes only where the path is straighter

    def act(self, env: gym.Env) -> int:
        """The meta-action for the next period."""
        return self.choose(env).action

    def choose(self, env: gym.Env) -> Choice:
        """The meta-action for the next period, and the path that goes with it."""
        core: Any = env.unwrapped
        decision, speed = self.decide(env), core.vehicle.speed
        path = decision.path
        arc = path.arc[path.arc <= max(20.0, 3.0 * speed)]
        offset = decision.offset * np.exp(-arc / max(5.0, speed))
        action = meta_actions(env).actions_indexes[decision.action]
        return Choice(action, along_path(path, arc, offset)[0])

    def decide(self, env: gym.Env) -> Decision:
        """Lane first, then speed."""
        action_type = meta_actions(env)
        core: Any = env.unwrapped
        ego, network = core.vehicle, core.road.network
        others = others_on(core.road, ego, self.reach)
        here = self._option(network, ego, ego.target_lane_index, others)
        options = [here]
        if ego.lane_index[:2] == ego.target_lane_index[:2] and ego.lane_index != ego.target_lane_index:
            # During a lane change both lanes count, unless the target lane lies on the next road
            options.append(self._option(network, ego, ego.lane_index, others))
        cruise = cruise_speed(env, np.max(ego.target_speeds))
        acceleration = min(self.acceleration(ego, option, min(cruise, option.top)) for option in options)
        offset = network.get_lane(ego.target_lane_index).local_coordinates(ego.position)[1]
        settled = core.steps >= self.change_after * core.config["simulation_frequency"]
        change = None
        if action_type.lateral and settled:
            change = self._lane_change(network, ego, here, acceleration, cruise, others)
        if change is not None:
            action, option, there = change
            return Decision(action, option.path, offset_from(option.path, ego), there, np.inf)
        period = 1 / core.config["policy_frequency"]
        targets = np.array([_target_speed(ego, action) for action in SPEED_ACTIONS])
        contact = self._contacts(ego, here, targets, period, offset)
        best = self._nearest(targets, self._target(ego, options, cruise), contact)
        return Decision(SPEED_ACTIONS[best], here.path, offset, acceleration, float(contact[best]))

    def acceleration(self, ego: ControlledVehicle, option: LaneOption, target: float) -> float:
        """IDM acceleration [m/s^2] on a path: the least over all futures that are on it or about to enter it.

        `target` [m/s] is the speed on a free road.
        """
        r, half, chance = relate(option.path, option.futures.others), ego.LENGTH / 2, option.futures.chance
        gap = r.along - r.half[:, 0] - half
        now = on_path(r, ego.WIDTH)
        soon = ~now & np.logical_or.reduce([on_path(r, ego.WIDTH, later) for later in (0.5, 1.0, 1.5)])
        front = r.along > 0
        free = self.model.free(ego.speed, target)
        follow = self.model.follow(ego.speed, target, gap, r.speed)
        # One that is about to enter may still not do so: brake comfortably at most; the collision check does the rest
        yielding = np.minimum(free, np.where(gap > 0, np.maximum(follow, -self.model.brake), -self.model.brake))
        yielding = free + chance * (yielding - free)  # (PLAN.12)
        accelerations = np.where(now, follow, yielding)[front & (now | soon)]
        return float(np.clip(accelerations.min(initial=free), -self.hard_brake, self.model.accel))

    def _option(self, network: RoadNetwork, ego: ControlledVehicle, lane: LaneIndex, others: Others) -> LaneOption:
        path = path_ahead(network, lane, ego.route, ego.position, self.reach)
        now, top = relate(path, others), allowed_speed(path, self.lateral_accel, self.model.brake)
        return LaneOption(path, now, futures(path, others, now, ego.LENGTH, ego.WIDTH), top)

    def _lane_change(
        self, network: RoadNetwork, ego: ControlledVehicle, here: LaneOption, acceleration: float, cruise: float,
        others: Others,
    ) -> tuple[str, LaneOption, float] | None:  # fmt: skip
        """The best worthwhile and safe lane change: meta-action, the new lane, acceleration there."""
        if ego.lane_index != ego.target_lane_index or ego.speed < self.change_speed:
            return None
        if np.abs(here.path.bend[here.path.arc < 3 * ego.speed]).max() > self.change_bend:
            return None
        if here.path.jump == 0 and self.model.free(ego.speed, cruise) - acceleration <= self.change_gain:
            return None  # no lane can be better by so much
        best, found = self.change_gain, None
        for lane in network.side_lanes(ego.lane_index):
            if not network.get_lane(lane).is_reachable_from(ego.position) or is_oncoming(network, lane, ego.position):
                continue
            option = self._option(network, ego, lane, others)
            there = self.acceleration(ego, option, min(cruise, option.top))
            width = network.get_lane(lane).width_at(0.0)
            gain = there - acceleration + self.route_gain * (here.path.jump - option.path.jump) / width
            if gain > best and there > -self.imposed_brake and self._has_room(ego, here, option):
                best, found = gain, ("LANE_LEFT" if lane[2] < ego.lane_index[2] else "LANE_RIGHT", option, there)
        return found

    def _has_room(self, ego: ControlledVehicle, here: LaneOption, option: LaneOption) -> bool:
        """Whether a lane is free beside the vehicle, and no follower there has to brake harder than `imposed_brake`."""
        r, half = option.relation, ego.LENGTH / 2
        near = on_path(r, ego.WIDTH) | on_path(r, ego.WIDTH, 2.5)  # a lane change takes longer than a forecast holds
        room = np.abs(r.along) - r.half[:, 0] - half
        if (near & (room < self.model.gap)).any():
            return False
        rushing = on_path(here.relation, ego.WIDTH) & (here.relation.speed > ego.speed + self.rush)
        behind = (near | rushing) & (r.along < 0)
        imposed = self.model.imposed(r.speed, ego.speed, room, 0.5 * self.model.headway)
        return not (behind & (imposed > self.imposed_brake)).any()

    def _target(self, ego: MDPVehicle, options: Sequence[LaneOption], cruise: float) -> float:
        """The target speed [m/s] for which highway-env's speed control has the acceleration of IDM.

        On a free road it is the cruise speed itself: the acceleration of IDM fades out before that speed is reached.
        """
        lag = 1 / ego.KP_A
        behind = min(self.acceleration(ego, option, np.inf) for option in options)
        top = min(cruise, *(option.top for option in options))
        return max(0.0, min(ego.speed + behind * lag, max(top, ego.speed - self.model.brake * lag)))

    def _nearest(self, targets: NDArray, target: float, contact: NDArray) -> int:
        """Index of the speed nearest to the target, of A speeds (A,) [m/s], among those without a contact (A,) [s]."""
        if np.isfinite(contact).all():  # none avoids it: the latest contact, at the lowest speed
            return int(np.where(contact > contact.max() - 0.1, targets, np.inf).argmin())
        misfit = np.abs(targets - target) + np.where(targets == targets[0], 0.0, self.patience)
        return int(np.where(np.isinf(contact), misfit, np.inf).argmin())

    def _contacts(self, ego: MDPVehicle, option: LaneOption, targets: NDArray, period: float, offset: float) -> NDArray:
        """Time (A,) [s] until a collision for each of A target speeds, inf for none within the horizon.

        Of two continuations the later contact counts: the target is kept, or it is held for one period and followed by
        comfortable braking. Changes onto the path count where they are likelier than not.
        """
        likely = option.futures.others.rows(option.futures.chance > 0.5)
        checked = without_followers(likely, relate(option.path, likely), ego.WIDTH)
        times = instants(self.horizon)
        held = targets[:, None] + (ego.speed - targets[:, None]) * np.exp(-ego.KP_A * times)
        braked = np.where(times > period, held - self.model.brake * (times - period), held)
        arc = distance_driven(np.maximum(np.stack([held, braked]), 0.0))  # (2, A, H)
        own = np.array([ego.LENGTH, ego.WIDTH]) + self.clearance
        return first_contact(option.path, arc, offset, own, checked).max(0)


def straight_on(ego: Vehicle) -> NDArray:
    """Points (7, 2) [m] of the next three seconds of a vehicle that keeps its velocity: the plan of who has none."""
    return ego.position + np.linspace(0, 3, 7)[:, None] * ego.velocity


def cruise_speed(env: gym.Env, otherwise: float) -> float:
    """`TrackedEnv.cruise_speed` [m/s], or another one in an environment that has none."""
    return float(env.get_wrapper_attr("cruise_speed") if env.has_wrapper_attr("cruise_speed") else otherwise)


def meta_actions(env: gym.Env) -> DiscreteMetaAction:
    """The meta-actions of an environment; TypeError where its actions are others, or lateral only."""
    core: Any = env.unwrapped
    action_type = core.action_type
    if not (isinstance(action_type, DiscreteMetaAction) and action_type.longitudinal):
        raise TypeError(
            f"the planner needs config['action'] of type DiscreteMetaAction with longitudinal actions, got "
            f"{core.config['action']}; use planner 'idle' or another action type"
        )
    return action_type


def _target_speed(ego: MDPVehicle, action: str) -> float:
    """Target speed [m/s] that an action would set; vehicles of other classes try it on a copy, with its own route."""
    if isinstance(ego, EgoVehicle):
        return ego.target_after(action)
    twin = copy(ego)
    twin.route = ego.route and list(ego.route)
    twin.act(action)
    return float(twin.target_speed)
