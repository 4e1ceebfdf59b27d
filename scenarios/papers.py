"""Scenarios that put the papers' courses on a road: one car, the ego with the radar, nobody else.

Courses of card htg_rm, section 8.2, and card rm_vmm, section 7, mirrored: y is to the driver's right here. The ego
drives itself, so the speeds are those among its target speeds that are nearest to the cards' 12 and 8 m/s, and turns
have smooth onsets. The size of the car is drawn.
"""

import numpy as np
from highway_env.road.lane import StraightLane
from highway_env.road.road import RoadNetwork

from scenarios.courses import Segment, follow_lane, integrate
from scenarios.longitudinal import START, M
from scenarios.networks import SLOW, WIDTH, Layout, curved, lines, straight
from scenarios.paths import PathLane, along
from scenarios.stage import Stage, World, phases

SPEED = 7.5  # [m/s] in the turns
LENGTHS, WIDTHS = (4.0, 5.4), (1.6, 2.1)  # [m] of the car
BEHIND = 60.0  # [m] of road behind the ego
RAMP = 0.5  # [s] onset of a turn
CLOTHOID = 8.0  # [m] onset of a bend


def xia_lane(rng: np.random.Generator) -> World:
    """A car 15 m behind, as fast as the ego, drifts 3 m to the left and back with 0.01 rad/s."""
    stage = Stage(straight(), rng)
    speed = 12.5
    stage.ego(M, START, speed)
    weave = (Segment(5.0, 0.0, -0.01), Segment(10.0, 0.0, 0.01), Segment(5.0, 0.0, -0.01))
    return _followed(stage, (START - 15.0, WIDTH - 0.3, 0.0), speed, weave, 15.0)


def xia_right_turn(rng: np.random.Generator) -> World:
    """A car 12 m behind in the left lane is in the right lane after a right turn through 89 degrees."""
    bend = 0.26 / SPEED
    pieces = ((BEHIND + 6.0 * SPEED, 0.0), (6.0 * SPEED, bend), (150.0, 0.0))
    stage = Stage(curved(along((0.0, 0.0, 0.0), pieces, CLOTHOID), (-WIDTH, 0.0, WIDTH), speed_limit=SLOW), rng)
    stage.ego(M, BEHIND, SPEED)
    turn = (Segment(7.0 - RAMP / 2), Segment(6.0, 0.0, 0.26), Segment(7.0))  # the ramp is centred on the joint
    return _followed(stage, (BEHIND - 12.0, -WIDTH, 0.0), SPEED, turn, 13.0)


def xia_s_curve(rng: np.random.Generator) -> World:
    """A car 14 m behind follows through a left and a right turn of 1 rad each."""
    bend, stretch = 0.2 / SPEED, 5.0 * SPEED
    pieces = ((BEHIND + 3.5 * SPEED, 0.0), (stretch, -bend), (stretch, bend), (150.0, 0.0))
    stage = Stage(curved(along((0.0, 0.0, 0.0), pieces, CLOTHOID), (-WIDTH, 0.0, WIDTH), speed_limit=SLOW), rng)
    stage.ego(M, BEHIND, SPEED)
    turns = (Segment(5.0 - RAMP / 2), Segment(5.0, 0.0, -0.2), Segment(5.0, 0.0, 0.2), Segment(5.0))
    return _followed(stage, (BEHIND - 14.0, 0.0, 0.0), SPEED, turns, 15.0)


def _followed(
    stage: Stage, start: tuple[float, float, float], speed: float, segments: tuple[Segment, ...], end: float
) -> World:
    """The world with a car on the course; its maneuver begins after a straight first segment."""
    onset = 1.0 if segments[0].yaw_rate else segments[0].duration
    size = float(stage.rng.uniform(*LENGTHS)), float(stage.rng.uniform(*WIDTHS))
    stage.prescribe("car", integrate(start, speed, segments, ramp=RAMP), size)
    return stage.world(phases(onset, end))


def hoher_u_turn(rng: np.random.Generator) -> World:
    """The ego stands; to its left a car passes 26 m away, turns back on a half circle of 10 m and passes at 6 m."""
    radius, far, leg, speed = 10.0, -26.0, 33.0, 5.0
    network = RoadNetwork()
    network.add_lane("a", "b", StraightLane([-100.0, 0.0], [100.0, 0.0], WIDTH, lines(0, 1), speed_limit=0.0))
    pieces = ((leg + 20.0, 0.0), (np.pi * radius, -1 / radius), (leg + 40.0, 0.0))
    way = along((45.0, far, np.pi), pieces, ramp=4.0)
    network.add_lane("c", "d", PathLane(way, WIDTH, lines(0, 1), speed_limit=SLOW))
    stage = Stage(Layout(network, np.zeros((0, 2, 2))), rng)
    stage.ego(("a", "b", 0), 100.0, 0.0)
    stage.prescribe("car", follow_lane(way, 20.0, speed), stage.size("car"))
    return stage.world(phases(leg / speed, (leg + np.pi * radius) / speed))
