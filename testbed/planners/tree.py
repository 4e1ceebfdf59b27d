"""Tree search over meta-actions: optimistic planning of deterministic systems with a budget of expansions.

Hren, Munos (2008), "Optimistic planning of deterministic systems", EWRL: of all leaves the one that may still be worth
most is expanded next. The forecast of the tracks is made once a decision. Equations: docs/methods/planners.md.
"""

from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from math import exp
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from highway_env.vehicle.controller import MDPVehicle
from numpy.typing import NDArray

from testbed.planners.futures import UNLIKELY, futures
from testbed.planners.idm import Choice, cruise_speed, meta_actions
from testbed.planners.prediction import (
    LANE_MARGIN,
    LanePath,
    Relation,
    allowed_speed,
    along_path,
    is_oncoming,
    offset_from,
    others_on,
    path_ahead,
    relate,
    relate_at,
    without_followers,
)

STEP = 0.2  # [s] between the instants of a prediction
SIDES = {"IDLE": 0, "FASTER": 0, "SLOWER": 0, "LANE_LEFT": -1, "LANE_RIGHT": 1}  # by the lane index
PEDALS = {"FASTER": 1, "SLOWER": -1}
TOWARDS = 1 - exp(-STEP)  # of the way to the wanted lane, in a step
SETTLED = 0.5  # [m] from the centre of the lane within which a lane change may begin


class EgoState(NamedTuple):
    """The ego in the prediction."""

    step: int  # steps of the prediction since now
    arc: float  # [m] along the path
    speed: float  # [m/s]
    target: float  # [m/s] of its speed control
    offset: float  # [m] across the path
    lane: int  # lanes to the side of the path, towards higher lane indices
    free: float = 1.0  # probability of no contact on the way here, with the braking that was possible


class Leaf(NamedTuple):
    """A state that has not been expanded."""

    state: EgoState
    actions: tuple[str, ...]  # from the root
    worth: float  # discounted rewards so far
    depth: int


class Scene(NamedTuple):
    """What stays the same while a tree grows."""

    relation: Relation  # (F, M) of the futures of the tracks to the path, at M steps
    chance: NDArray  # (F,) probability of each
    size: NDArray  # (2,) [m] of the ego
    lanes: range  # lanes that the ego may take, relative to that of the path
    width: float  # [m] between lanes
    cruise: float  # [m/s]
    gain: float  # [1/s] of the speed control
    step: float  # [m/s] between target speeds
    top: float  # [m/s] highest target speed
    presses: int  # decisions during which an action is held
    actions: tuple[str, ...]


@dataclass(frozen=True)
class TreeSearch:
    """Optimistic planning with meta-actions, each held for some tenths of a second."""

    name: str = "tree"
    note: str = "optimistic tree search over meta-actions on predicted tracks (Hren and Munos 2008)"
    knows_truth: bool = False
    budget: int = 60  # expansions for a decision
    discount: float = 0.8  # for every action
    hold: float = 0.6  # [s] at least, of an action
    depth: int = 8  # actions in a row at most
    braking: float = 3.0  # [s] after an action in which the ego must be able to brake without a contact
    hard_brake: float = 8.0  # [m/s^2] of that braking
    accel: float = 4.0  # [m/s^2] most
    comfort: float = 3.0  # [m/s^2] in the wanted gap
    standstill: float = 2.0  # [m] wanted gap at standstill
    headway: float = 0.9  # [s] wanted time gap
    room_share: float = 0.7  # of the reward: room ahead; the rest is speed
    change_price: float = 0.05  # of a lane change
    clearance: tuple[float, float] = (1.0, 0.4)  # [m] added to length and width of the ego in the contact test
    doubt: float = 0.0  # changes of lane up to this probability are no reason to brake
    reach: float = 150.0  # [m]

    def act(self, env: gym.Env) -> int:
        """The meta-action for the next period."""
        return self.choose(env).action

    def choose(self, env: gym.Env) -> Choice:
        """The first action of the best sequence, and its path."""
        action_type = meta_actions(env)
        core: Any = env.unwrapped
        ego = core.vehicle
        path = path_ahead(core.road.network, ego.target_lane_index, ego.route, ego.position, self.reach)
        scene = self._scene(env, path)
        root = EgoState(0, 0.0, float(ego.speed), float(ego.target_speed), offset_from(path, ego), 0)
        best = self.search(scene, root)
        return Choice(action_type.actions_indexes[best[0]], self._places(scene, root, best, path))

    def search(self, scene: Scene, root: EgoState) -> tuple[str, ...]:
        """The sequence of actions of the greatest worth that was found; at least one action."""
        order = count()
        heap = [(0.0, next(order), Leaf(root, (), 0.0, 0))]
        best = Leaf(root, ("SLOWER",), 0.0, 0)  # where nothing is worth anything
        for _ in range(self.budget):
            if not heap:
                break
            leaf = heappop(heap)[-1]
            for action in self._possible(scene, leaf.state):
                state, reward, lost = self.after(scene, leaf.state, action)
                worth = leaf.worth + self.discount**leaf.depth * reward
                child = Leaf(state, (*leaf.actions, action), worth, leaf.depth + 1)
                if worth > best.worth:
                    best = child
                if not lost and child.depth < self.depth:
                    bound = worth + state.free * self.discount**child.depth / (1 - self.discount)  # (PLAN.8)
                    heappush(heap, (-bound, next(order), child))
        return best.actions

    def after(self, scene: Scene, state: EgoState, action: str) -> tuple[EgoState, float, bool]:
        """The state after an action, its reward in [0, 1], and whether no braking can avoid a contact any more."""
        places, new = self._move(scene, state, action, self.hold)
        braked, _ = self._move(scene, new, "SLOWER", self.braking)
        free = min(state.free, self._free(scene, state.step, *np.concatenate([places, braked]).T))
        if free < UNLIKELY:
            return new, 0.0, True
        new = new._replace(free=free)
        price = self.change_price if new.lane != state.lane else 0.0
        room = self._room(scene, new)
        speed = min(new.speed / scene.cruise, 1.0)
        reward = (1 - self.room_share) * speed + self.room_share * room - price  # (PLAN.7)
        return new, free * max(reward, 0.0), False

    def _move(self, scene: Scene, state: EgoState, action: str, hold: float) -> tuple[NDArray, EgoState]:
        """Places (H, 2) [m] along and across the path while an action is held for hold [s], and the state after it."""
        _, arc, speed, target, offset, lane, free = state
        lane += SIDES[action]
        held = round(hold / STEP)
        every = max(round(self.hold / STEP) // scene.presses, 1)
        places = []
        for k in range(held):
            if k % every == 0 and action in PEDALS:
                base = min(target, speed) if action == "SLOWER" else target
                target = min(max(base + PEDALS[action] * scene.step, 0.0), scene.top)
            speed += STEP * min(max(scene.gain * (target - speed), -self.hard_brake), self.accel)
            speed = max(speed, 0.0)
            arc += STEP * speed
            offset += (lane * scene.width - offset) * TOWARDS
            places.append((arc, offset))
        return np.array(places), EgoState(state.step + held, arc, speed, target, offset, lane, free)

    def _free(self, scene: Scene, step: int, arc: NDArray, offset: NDArray) -> float:
        """Probability of no contact at the places along arc (H,) and across offset (H,) [m], from a step on."""
        r = scene.relation
        part = slice(step, step + len(arc))
        along = np.abs(r.along[:, part] - arc) < r.half[:, part, 0] + (scene.size[0] + self.clearance[0]) / 2
        across = np.abs(r.across[:, part] - offset) < r.half[:, part, 1] + (scene.size[1] + self.clearance[1]) / 2
        contact = (along & across).any(-1)
        return 1.0 - float(scene.chance[contact].max(initial=0.0))  # (PLAN.13)

    def _room(self, scene: Scene, state: EgoState) -> float:
        """Free road ahead as a share of the wanted gap, at most 1, in the lanes that the ego is in and enters."""
        r, k = scene.relation, state.step - 1
        gap = r.along[:, k] - r.half[:, k, 0] - state.arc - scene.size[0] / 2
        beside = np.minimum(np.abs(r.across[:, k] - state.offset), np.abs(r.across[:, k] - state.lane * scene.width))
        ahead = (r.along[:, k] > state.arc) & (beside < r.half[:, k, 1] + scene.size[1] / 2 + LANE_MARGIN)
        slower = np.maximum(state.speed**2 - np.maximum(r.speed[:, k], 0.0) ** 2, 0.0) / (2 * self.comfort)
        wanted = self.standstill + self.headway * state.speed + slower
        missing = scene.chance * (1.0 - np.clip(gap / wanted, 0.0, 1.0))  # (PLAN.13)
        return 1.0 - float(missing[ahead].max(initial=0.0))

    def _possible(self, scene: Scene, state: EgoState) -> list[str]:
        """Actions in a state: lane changes only from the centre of a lane, into lanes that there are."""
        settled = abs(state.offset - state.lane * scene.width) < SETTLED
        return [a for a in scene.actions if SIDES[a] == 0 or (settled and state.lane + SIDES[a] in scene.lanes)]

    def _scene(self, env: gym.Env, path: LanePath) -> Scene:
        action_type = meta_actions(env)
        core: Any = env.unwrapped
        ego, network = core.vehicle, core.road.network
        others = others_on(core.road, ego, self.reach)
        others = without_followers(others, relate(path, others), ego.WIDTH)
        all_futures = futures(path, others, relate(path, others), ego.LENGTH, ego.WIDTH)
        held = round(self.hold / STEP)
        times = STEP * np.arange(1, self.depth * held + round(self.braking / STEP) + 1)
        speeds = np.asarray(ego.target_speeds, float)
        return Scene(
            relation=relate_at(path, all_futures.others, times),
            chance=all_futures.beyond(self.doubt),
            size=np.array([ego.LENGTH, ego.WIDTH]),
            lanes=_lanes(network, ego) if action_type.lateral else range(1),
            width=float(network.get_lane(ego.target_lane_index).width_at(0.0)),
            cruise=min(cruise_speed(env, speeds.max()), max(allowed_speed(path, self.comfort, self.comfort), 1.0)),
            gain=float(ego.KP_A),
            step=float(speeds[-1] - speeds[0]) / max(len(speeds) - 1, 1),
            top=float(speeds[-1]),
            presses=max(round(self.hold * core.config["policy_frequency"]), 1),
            actions=tuple(a for a in SIDES if a in action_type.actions_indexes),
        )

    def _places(self, scene: Scene, root: EgoState, actions: tuple[str, ...], path: LanePath) -> NDArray:
        """The path (P, 2) [m] of a sequence of actions, in the world."""
        places, state = [np.array([[root.arc, root.offset]])], root
        for action in actions:
            piece, state = self._move(scene, state, action, self.hold)
            places.append(piece)
        arc, offset = np.concatenate(places).T
        return along_path(path, arc, offset)[0]


def _lanes(network: Any, ego: MDPVehicle) -> range:
    """Lanes beside the target lane that lead the same way, relative to it; none during a lane change."""
    lane = ego.target_lane_index
    if lane[:2] != ego.lane_index[:2] or lane != ego.lane_index:
        return range(1)
    beside = {
        other[2] - lane[2]
        for other in network.side_lanes(lane)
        if network.get_lane(other).is_reachable_from(ego.position) and not is_oncoming(network, other, ego.position)
    }
    return range(-1 if -1 in beside else 0, 2 if 1 in beside else 1)
