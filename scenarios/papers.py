"""Scenarios that put the papers' courses on a road: one vehicle, the ego with the radar, nobody else.

Courses of Xia et al. (2020), Hoher et al. (2022), Xu et al. (2023), Table I, and Yao et al. (2021); docs/studies/papers
has the experiments themselves. The courses of the first two are mirrored: y is to the driver's right here. Turns have
smooth onsets. The size is drawn: from the range of the experiment where the paper has one, else as in traffic.
"""

import numpy as np
from highway_env.road.lane import StraightLane
from highway_env.road.road import RoadNetwork
from numpy.typing import NDArray

from scenarios.courses import RATE, VX, VY, Push, Segment, X, Y, follow_lane, integrate, pushed
from scenarios.longitudinal import START, M
from scenarios.networks import SLOW, WIDTH, Layout, curved, lines, straight
from scenarios.paths import PathLane, SmoothPath, along, from_nodes
from scenarios.stage import Phase, Stage, World, phases

SPEED = 7.5  # [m/s] in the turns
LENGTHS, WIDTHS = (4.0, 5.4), (1.6, 2.1)  # [m] of the car
BEHIND = 60.0  # [m] of road behind the ego
RAMP = 0.5  # [s] onset of a turn
CLOTHOID = 8.0  # [m] onset of a bend
TABLE_1 = (  # of Xu et al. (2023); ends the straight parts at (20, 0) m/s
    Push(10.0),
    Push(5.0, (-3.0, -2.0)),
    Push(5.0, (-3.0, -4.0)),
    Push(10.0, (2.0, 3.0)),
    Push(10.0),
    Push(10.0, yaw_rate=np.pi / 20),
)
STAGES = (Phase("CV", 0.0, 10.0), Phase("CA", 10.0, 30.0), Phase("CV again", 30.0, 40.0), Phase("CT", 40.0, 50.0))
YAO_SPEED, YAO_SIZE = 11.2, (5.0, 2.0)  # [m/s], [m]
YAO_LIMIT = 12.5  # [m/s] target speed of the ego above that of who it follows, or it falls back
YAO_TURNS = ((101.0, np.pi / 101), (121.0, -np.pi / 121), (20.0, 0.0))  # [s], [rad/s]


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
    stage = Stage(Layout(network), rng)
    stage.ego(("a", "b", 0), 100.0, 0.0)
    stage.prescribe("car", follow_lane(way, 20.0, speed))
    return stage.world(phases(leg / speed, (leg + np.pi * radius) / speed))


def xu_maneuvers(rng: np.random.Generator) -> World:
    """The maneuvers of Table I: straight on, three accelerations across and along, straight on, a quarter turn."""
    course = pushed((0.0, 0.0), (30.0, 0.0), TABLE_1)
    behind = float(rng.uniform(40.0, 50.0))
    stage = Stage(curved(_path_of(course, 100.0), (-WIDTH, 0.0, WIDTH)), rng)
    stage.ego(M, 100.0 - behind, 30.0)
    stage.prescribe("car", course)
    return stage.world(STAGES)


def yao_truck(rng: np.random.Generator) -> World:
    """A light truck drives half circles of 360 m to the right and 431 m to the left."""
    return _yao("truck", rng)


def yao_tractor(rng: np.random.Generator) -> World:
    """A tractor on the same course."""
    return _yao("tractor", rng)


def _yao(kind: str, rng: np.random.Generator) -> World:
    turns = tuple(Segment(duration, 0.0, yaw_rate) for duration, yaw_rate in YAO_TURNS)
    course = integrate((0.0, 0.0, 0.0), YAO_SPEED, turns)
    stage = Stage(curved(_path_of(course, 60.0), (-WIDTH, 0.0, WIDTH), speed_limit=YAO_LIMIT), rng)
    stage.ego(M, 60.0 - float(rng.uniform(22.0, 28.0)), YAO_SPEED)
    length, width = YAO_SIZE * (1 + rng.uniform(-1, 1, 2) * (0.06, 0.02))
    stage.prescribe(kind, course, (float(length), float(width)))
    first, second, rest = np.cumsum([duration for duration, _ in YAO_TURNS]).tolist()
    return stage.world((Phase("right", 0.0, first), Phase("left", first, second), Phase("straight", second, rest)))


def _path_of(course: NDArray, before: float, after: float = 200.0) -> SmoothPath:
    """The way of a course (n, 7) with straight pieces [m] before and after it."""
    travelled = np.cumsum(np.hypot(course[:, VX], course[:, VY])) / RATE
    nodes = course[np.searchsorted(travelled, np.arange(1.0, travelled[-1]))]
    xy, v = nodes[:, X : Y + 1], nodes[:, VX : VY + 1]
    first, last = (u / np.linalg.norm(u) for u in (course[0, VX : VY + 1], v[-1]))
    lead = course[0, X : Y + 1] + np.arange(-before, 0.0)[:, None] * first
    tail = xy[-1] + np.arange(1.0, after)[:, None] * last
    tangents = (np.tile(first, (len(lead), 1)), v, np.tile(last, (len(tail), 1)))
    return from_nodes(np.vstack([lead, xy, tail]), np.vstack(tangents))
