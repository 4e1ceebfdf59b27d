"""The world of an episode of recorded traffic: straight lanes, the ego in its place, the road that plays the rest."""

import numpy as np
from highway_env.road.lane import StraightLane
from highway_env.road.road import RoadNetwork

from scenarios.networks import OPEN, lines
from scenarios.stage import TARGET_SPEEDS, Phase, World
from scenarios.table import CourseTable
from scenarios.traffic.fitting import Lanes
from scenarios.traffic.plan import Plan
from scenarios.traffic.road import RecordedRoad, place_ego

BEFORE, BEYOND = 200.0, 1000.0  # [m] of road before the first and beyond the last recorded place


def world(plan: Plan, react: float | None, rng: np.random.Generator) -> World:
    """The episode before its first frame; nothing but the choices of highway-env's vehicles is drawn."""
    road = RecordedRoad(network(plan), np_random=rng, neighbour_vehicles_connected_lanes=True)
    ego = place_ego(road, plan.ego, TARGET_SPEEDS)
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


def _add(
    network: RoadNetwork, edge: tuple[str, str], lanes: Lanes, places: np.ndarray, start: float, end: float
) -> None:
    for k, y in enumerate(places):
        lane = StraightLane([start, y], [end, y], lanes.width, lines(k, len(places)), speed_limit=OPEN)
        network.add_lane(*edge, lane)
