"""Scenarios at ramps, crossings, roundabouts and on two-way roads.

Vehicles that would have to yield stand at their line, and vehicles that cross the ego's way are timed to be gone.
"""

import numpy as np
from highway_env.road.lane import StraightLane
from highway_env.road.road import RoadNetwork
from numpy.typing import NDArray

from scenarios import networks
from scenarios.bodies import rear_extent
from scenarios.courses import Segment, Shift, follow_lane
from scenarios.networks import RING, SLOW
from scenarios.paths import SmoothPath, of_lanes
from scenarios.stage import Flow, Stage, World, phases

LANES = tuple(("a", "b", i) for i in range(3))


def merge(rng: np.random.Generator) -> World:
    """A van from the ramp moves in 25 m ahead of the ego within 4 s, while it speeds up to 1 m/s less."""
    stage = Stage(networks.merge(), rng)
    speed, duration = rng.uniform(22.0, 25.0), rng.uniform(4.0, 5.0)
    join, onset = 500.0, rng.uniform(5.0, 6.5)
    ahead = rng.uniform(28.0, 34.0)
    start = join + 40.0 - ahead - speed * onset  # the van is 40 m into the parallel stretch at the onset
    stage.ego(LANES[1], start, speed, route="d")
    lanes = [stage.network.get_lane(("j", "k", 0)), stage.network.get_lane(("k", "b", 0))]
    path = of_lanes((*lanes, StraightLane([join, 8.0], [1600.0, 8.0])), smooth=4.0)
    slow, gain = speed - 5.0, 4.0
    speeding = (Segment(onset - 4.0), Segment(4.0, gain / 4.0))
    travelled = slow * onset + gain * 4.0 / 2
    place = path.project(np.array([join + 40.0, 8.0]))[0] - travelled
    stage.prescribe("van", follow_lane(path, place, slow, speeding, (Shift(onset, duration, -4.0),)))
    stage.drive("car", ("j", "k", 0), place - 45.0, slow, route="d")
    stage.fill(Flow(LANES[1], start + 120.0, speed, ("truck",)))
    stage.fill(Flow(LANES[1], start - 50.0, speed, ("car", "van")))
    stage.fill(Flow(LANES[0], start + 60.0, speed + 2.0, ("car", "bus", "car", "motorcycle")))
    _routes(stage, "d")
    return stage.world(phases(onset, onset + duration))


def exit_ramp(rng: np.random.Generator) -> World:
    """The leader 40 m ahead moves two lanes to the right, brakes by 7 m/s and drives off on the ramp."""
    stage = Stage(networks.exit_road(), rng)
    speed, onset = rng.uniform(23.0, 26.0), rng.uniform(3.5, 5.0)
    first, second = rng.uniform(3.5, 4.2), rng.uniform(3.5, 4.2)
    exit_at, y = 450.0, 12.0
    cross = onset + first + 0.5  # when the second change begins, 30 m into the parallel stretch
    lead = exit_at + 30.0 - speed * cross
    start = lead - rng.uniform(42.0, 52.0)
    ramp, off = (stage.network.get_lane(edge) for edge in (("x", "e", 0), ("e", "f", 0)))
    path = of_lanes((StraightLane([0.0, y], [ramp.position(0, 0)[0], y]), ramp, off), smooth=4.0)
    shifts = (Shift(onset, first, 4.0), Shift(cross, second, 4.0))
    braking = (Segment(cross + second - 1.0), Segment(4.0, -rng.uniform(1.5, 1.9)))
    stage.ego(LANES[1], start, speed, route="d")
    stage.prescribe("car", follow_lane(path, lead, speed, braking, shifts, -8.0))
    stage.fill(Flow(LANES[1], lead + 80.0, speed, ("van",)))
    stage.fill(Flow(LANES[1], start - 50.0, speed, ("car",)))
    stage.fill(Flow(LANES[0], start + 85.0, speed + 2.0, ("car", "car", "motorcycle")))
    stage.fill(Flow(LANES[2], lead + 75.0, speed, ("bus",)))
    stage.fill(Flow(LANES[2], lead - 60.0, speed - 2.0, ("truck", "car")))
    _routes(stage, "d")
    return stage.world(phases(onset, cross + second + 3.0))


def _routes(stage: Stage, node: str) -> None:
    """Let all background drivers go straight on."""
    for vehicle in stage.road.vehicles:
        if hasattr(vehicle, "plan_route_to"):
            vehicle.plan_route_to(node)


def oncoming(rng: np.random.Generator) -> World:
    """An oncoming car passes a tractor in the ego's lane and is back 110 m before it would meet the ego."""
    stage = Stage(networks.two_way(), rng)
    ours, theirs = ("a", "b", 0), ("c", "d", 0)
    speed, start = rng.uniform(18.0, 20.0), 200.0
    stage.ego(ours, start, speed)
    way = of_lanes((stage.network.get_lane(theirs),), smooth=1.0)
    onset, there, out, back = rng.uniform(1.0, 1.6), rng.uniform(19.0, 20.0), 2.8, 2.8
    tractor = 7.5
    returns = onset + 5.0
    meeting = start + speed * (returns + back) + rng.uniform(115.0, 135.0)  # [m] where the car is back in its lane
    place = 1600.0 - meeting - there * (returns + back)
    shifts = (Shift(onset, out, -4.0), Shift(returns, back, 4.0))
    stage.prescribe("car", follow_lane(way, place, there, (), shifts))
    beside = place + there * (onset + out + (returns - onset - out) / 2)  # passes the tractor in mid-manoeuvre
    slow = follow_lane(way, beside - tractor * (onset + out + (returns - onset - out) / 2), tractor)
    stage.prescribe("tractor", slow)
    stage.fill(Flow(theirs, place - 50.0, there, ("truck", "car", "motorcycle")))
    stage.fill(Flow(ours, start + 45.0, speed, ("car",)))
    stage.fill(Flow(ours, start - 50.0, speed, ("van", "car")))
    return stage.world(phases(onset, returns + back))


def articulated_turn(rng: np.random.Generator) -> World:
    """A truck with trailer 25 m ahead slows to 5.5 m/s and turns right by 90 degrees; the ego goes straight on."""
    stage = Stage(networks.crossing(), rng)
    speed, turning = rng.uniform(11.0, 12.5), 5.5
    brake = rng.uniform(1.2, 1.5)
    seconds, onset = (speed - turning) / brake, rng.uniform(1.5, 3.0)
    right = ("a", "b", 1)
    path = of_lanes(tuple(stage.network.get_lane(e) for e in (right, ("b", "e", 1), ("e", "f", 1))), smooth=4.0)
    place = 298.0 - speed * onset - (speed + turning) / 2 * (seconds + 0.5)
    plan = (Segment(onset), Segment(seconds, -brake), Segment(7.5), Segment(3.0, 1.0))
    truck = stage.prescribe("articulated", follow_lane(path, place, speed, plan))
    start = place - rear_extent(truck) - rng.uniform(24.0, 30.0)
    stage.ego(right, start, speed, route="c")
    stage.fill(Flow(right, place + 45.0, speed + 1.0, ("car",)))
    stage.fill(Flow(right, start - 22.0, speed, ("van",)))
    stage.fill(Flow(("a", "b", 0), start + 50.0, speed + 1.0, ("car", "motorcycle")))
    stage.fill(Flow(("g", "h", 0), 900.0 - start - 100.0, speed, ("bus", "car")))
    _routes(stage, "c")
    up = stage.network.get_lane(("u", "v", 0))
    stage.prescribe("car", standing(of_lanes((up,), smooth=1.0), up.length - 3.0 - rng.uniform(0.0, 1.5)))
    return stage.world(phases(onset + seconds - 0.5, onset + seconds + 7.0))


def standing(path: SmoothPath, s: float, onset: float = 60.0) -> NDArray:
    """Course that waits at arc length s [m] and starts gently at `onset` [s]."""
    return follow_lane(path, s, 0.0, (Segment(onset), Segment(4.0, 1.5)))


def roundabout(rng: np.random.Generator) -> World:
    """The ego follows a car from the south arm round to the north arm at 7.5 m/s; two vehicles circle inside."""
    stage = Stage(networks.roundabout(), rng)
    arm, bend, start = ("s:far-in", "s:near-in", 0), ("s:near-in", "s:enter", 0), rng.uniform(88.0, 94.0)
    further = start + rng.uniform(23.0, 27.0) - stage.network.get_lane(arm).length
    stage.ego(arm, start, SLOW, route="n:far-out")
    stage.drive("car", bend, further, SLOW, headway=1.0, route="n:far-out")
    stage.drive("van", arm, start - rng.uniform(20.0, 24.0), SLOW, 1.2 * SLOW, headway=1.0, route="n:far-out")
    phase, inner = rng.uniform(0.0, 2 * np.pi), _circle(stage.network)
    for kind, turn in (("car", 0.0), ("truck", rng.uniform(0.8, 1.2) * np.pi)):
        s = (phase + turn) % (2 * np.pi) * RING[0]
        stage.prescribe(kind, follow_lane(inner, s, rng.uniform(6.8, 7.5)))
    for name, kind in (("e", "car"), ("n", "motorcycle"), ("w", "bus")):
        lanes = (stage.network.get_lane((f"{name}:far-in", f"{name}:near-in", 0)),)
        entry = of_lanes((*lanes, stage.network.get_lane((f"{name}:near-in", f"{name}:enter", 0))), smooth=2.0)
        size = stage.size(kind)
        stage.prescribe(kind, standing(entry, entry.length - rng.uniform(9.0, 12.0) - size[0] / 2), size)
    stage.drive("van", ("e:near-out", "e:far-out", 0), rng.uniform(10.0, 30.0), SLOW)
    return stage.world(phases(4.0, 18.0))


def _circle(network: RoadNetwork) -> SmoothPath:
    """Three rounds of the inner ring."""
    arms = list(networks.ARMS)
    edges = []
    for name, following in zip(arms, (*arms[1:], arms[0]), strict=True):
        edges += [(f"inner {name}:leave", f"inner {name}:enter"), (f"inner {name}:enter", f"inner {following}:leave")]
    return of_lanes(tuple(network.get_lane((*edge, 0)) for edge in edges * 3), smooth=2.0)


def u_turn(rng: np.random.Generator) -> World:
    """A car 25 m ahead in the inner lane and the ego in the outer one turn back; others follow and come after."""
    stage = Stage(networks.u_turn(), rng)
    start = rng.uniform(135.0, 145.0)
    ahead = start + rng.uniform(16.0, 22.0)
    stage.ego(("a", "b", 1), start, SLOW, route="d")
    inner = of_lanes(tuple(stage.network.get_lane(e) for e in (("a", "b", 0), ("b", "c", 0), ("c", "d", 0))))
    speed = rng.uniform(6.8, 7.4)
    stage.prescribe("car", follow_lane(inner, ahead, speed))
    stage.drive("van", ("a", "b", 0), ahead - rng.uniform(24.0, 28.0), speed, 1.2 * SLOW, 1.2, "d")
    stage.drive("motorcycle", ("a", "b", 1), start + rng.uniform(24.0, 28.0), SLOW, 1.2 * SLOW, 1.2, "d")
    stage.drive("car", ("a", "b", 1), start - rng.uniform(22.0, 26.0), SLOW, 1.2 * SLOW, 1.2, "d")
    stage.drive("truck", ("c", "d", 0), rng.uniform(30.0, 45.0), SLOW, route="d")
    stage.drive("bus", ("c", "d", 1), rng.uniform(60.0, 80.0), SLOW, route="d")
    onset = (200.0 - ahead) / speed
    return stage.world(phases(onset, min(onset + 80.0 / speed, 19.0)))
