"""Builders of the probes: the ego meets one thing for which it must brake, or, in `passing`, must not.

The ego starts in the middle lane at s = `START` where nothing else is said. Parameters vary by 5 % from seed to seed.
"""

import numpy as np

from scenarios import networks
from scenarios.courses import Segment, Shift, follow_lane
from scenarios.longitudinal import AXIS, START, L, M, R
from scenarios.paths import of_lanes
from scenarios.stage import EGO_SIZE, Stage, World, phases

SIDE = {L: -4.0, M: 0.0, R: 4.0}  # [m] of the lanes from the middle one, to the right
Y = 4.0  # [m] of the middle lane from the axis
FRONT = EGO_SIZE[0] / 2  # [m] from the ego's centre to its front bumper
ROAD = 1600.0  # [m] length of a straight road
JOIN, RAMP = 500.0, 220.0  # [m] where the lane of the ramp begins, and where on it the ego starts to merge
ON_RAMP = 40.0  # [m] where on it the ego starts that stays on it


def about(rng: np.random.Generator, value: float) -> float:
    """A value within 5 % of the given one."""
    return float(value * rng.uniform(0.95, 1.05))


def _beside(stage: Stage, kind: str, lane: tuple[str, str, int], ahead: float, speed: float) -> None:
    """A vehicle at constant speed [m/s] in a lane, its centre `ahead` [m] of the ego's at the start."""
    stage.prescribe(kind, follow_lane(AXIS, START + ahead, speed, lateral=Y + SIDE[lane]))


def brake(rng: np.random.Generator, gap: float) -> World:
    """The leader brakes with 8 m/s^2 by 16 m/s; a car and a truck beside."""
    stage = Stage(networks.straight(), rng)
    speed, onset = rng.uniform(24.0, 26.0), rng.uniform(3.0, 4.0)
    stage.ego(M, START, speed)
    size = stage.size("car")
    place = START + FRONT + about(rng, gap) + size[0] / 2
    plan = (Segment(onset), Segment(2.0, -8.0))
    stage.prescribe("car", follow_lane(AXIS, place, speed, plan, lateral=Y, onset=0.3), size)
    _beside(stage, "car", L, rng.uniform(4.0, 10.0), speed + 1.0)
    _beside(stage, "truck", R, rng.uniform(10.0, 20.0), speed - 2.0)
    return stage.world(phases(onset, onset + 2.3, 10.0))


def cut_in(rng: np.random.Generator, gap: float, slower: float) -> World:
    """A car from the left moves in within 3 s; it is slower from the start."""
    stage = Stage(networks.straight(), rng)
    speed, onset, duration = rng.uniform(24.0, 26.0), rng.uniform(2.5, 3.5), 3.0
    stage.ego(M, START, speed)
    size, slower = stage.size("car"), about(rng, slower)
    place = START + FRONT + about(rng, gap) + size[0] / 2 + slower * (onset + duration / 2)
    course = follow_lane(AXIS, place, speed - slower, (), (Shift(onset, duration, 4.0),), Y + SIDE[L])
    stage.prescribe("car", course, size)
    _beside(stage, "car", L, rng.uniform(-30.0, -22.0), speed - slower)
    _beside(stage, "truck", R, rng.uniform(15.0, 25.0), speed - 2.0)
    return stage.world(phases(onset, onset + duration, 10.0))


def reveal(rng: np.random.Generator, distance: float) -> World:
    """A truck 22 m ahead swerves left in 2.5 s; a car that it had hidden stands in the lane."""
    stage = Stage(networks.straight(), rng)
    speed, onset, duration = rng.uniform(19.0, 21.0), rng.uniform(2.5, 3.5), 2.5
    stage.ego(M, START, speed)
    size = stage.size("truck")
    place = START + FRONT + about(rng, 22.0) + size[0] / 2
    stage.prescribe("truck", follow_lane(AXIS, place, speed, (), (Shift(onset, duration, -4.0),), Y), size)
    size = stage.size("car")
    standing = START + speed * (onset + duration / 2) + FRONT + about(rng, distance) + size[0] / 2
    stage.prescribe("car", follow_lane(AXIS, standing, 0.0, lateral=Y), size)
    _beside(stage, "car", R, rng.uniform(-4.0, 4.0), speed + 2.0)
    return stage.world(phases(onset, onset + duration, 10.0))


def ramp(rng: np.random.Generator, distance: float) -> World:
    """On the lane of a ramp a truck 22 m ahead merges in 2.5 s; a motorcycle that it had hidden stands in the lane.

    The draws are those of `reveal`: the same seed differs by what stands, and by the road.
    """
    stage = Stage(networks.merge(), rng)
    speed, onset, duration, lane = rng.uniform(19.0, 21.0), rng.uniform(2.5, 3.5), 2.5, 8.0
    stage.ego(("b", "c", 2), ON_RAMP, speed, route="d")
    start, size = JOIN + ON_RAMP, stage.size("truck")
    place = start + FRONT + about(rng, 22.0) + size[0] / 2
    stage.prescribe("truck", follow_lane(AXIS, place, speed, (), (Shift(onset, duration, -4.0),), lane), size)
    size = stage.size("motorcycle")
    standing = start + speed * (onset + duration / 2) + FRONT + about(rng, distance) + size[0] / 2
    stage.prescribe("motorcycle", follow_lane(AXIS, standing, 0.0, lateral=lane), size)
    stage.prescribe("car", follow_lane(AXIS, start - rng.uniform(2.0, 8.0), speed, lateral=4.0))
    return stage.world(phases(onset, onset + duration, 10.0))


def jam(rng: np.random.Generator, gap: float) -> World:
    """A van brakes with 3 m/s^2 to a standstill, starts, and brakes with 3.6 m/s^2; queues beside do alike."""
    stage = Stage(networks.straight(), rng)
    speed, onset = 12.0, rng.uniform(2.5, 3.5)
    stage.ego(M, START, speed)
    size = stage.size("van")
    place = START + FRONT + about(rng, gap) + size[0] / 2
    stop = Segment(speed / 3.0, -3.0)
    start = (Segment(0.6), Segment(1.5, 2.0), Segment(3.0 / 3.6, -3.6))
    stage.prescribe("van", follow_lane(AXIS, place, speed, (Segment(onset), stop, *start), lateral=Y), size)
    for kind, lane, ahead in (("car", L, 14.0), ("car", L, 2.0), ("truck", R, 16.0)):
        plan = (Segment(onset + rng.uniform(0.0, 1.0)), Segment(speed / 2.5, -2.5))
        course = follow_lane(AXIS, START + ahead + rng.uniform(-1.0, 1.0), speed, plan, lateral=Y + SIDE[lane])
        stage.prescribe(kind, course)
    return stage.world(phases(onset, onset + 8.0, 12.0))


def pull_out(rng: np.random.Generator, gap: float) -> World:
    """A van at 6 m/s on the right, hidden by the truck behind it, pulls out in 2.6 s and accelerates with 2 m/s^2."""
    stage = Stage(networks.straight(), rng)
    speed, onset, duration = rng.uniform(19.0, 21.0), rng.uniform(2.5, 3.5), 2.6
    slow = 6.0
    stage.ego(M, START, speed)
    size, truck = stage.size("van"), stage.size("truck")
    travelled = slow * (onset + duration / 2) + 2.0 * (duration / 2) ** 2 / 2
    place = START + speed * (onset + duration / 2) + FRONT + about(rng, gap) + size[0] / 2 - travelled
    plan = (Segment(onset), Segment(4.0, 2.0))
    course = follow_lane(AXIS, place, slow, plan, (Shift(onset, duration, -4.0),), Y + SIDE[R])
    stage.prescribe("van", course, size)
    behind = place - size[0] / 2 - rng.uniform(4.0, 6.0) - truck[0] / 2
    stage.prescribe("truck", follow_lane(AXIS, behind, slow, lateral=Y + SIDE[R]), truck)
    _beside(stage, "car", L, rng.uniform(-4.0, 4.0), speed + 2.0)
    return stage.world(phases(onset, onset + duration, 10.0))


def passing(rng: np.random.Generator, weave: float) -> World:
    """The ego passes two trucks on the right, 6 m/s slower, that weave towards its lane and back; a car on the left."""
    stage = Stage(networks.straight(), rng)
    speed, onset, weave = rng.uniform(24.4, 25.6), rng.uniform(2.5, 3.5), about(rng, weave)
    stage.ego(M, START, speed)
    place = START + rng.uniform(26.0, 32.0)
    for k in range(2):
        start = onset + 1.5 * k
        shifts = (Shift(start, 1.5, -weave), Shift(start + 1.5, 1.5, weave))
        stage.prescribe("truck", follow_lane(AXIS, place + 22.0 * k, speed - 6.0, (), shifts, Y + SIDE[R]))
    _beside(stage, "car", L, rng.uniform(-16.0, -10.0), speed)
    return stage.world(phases(onset, onset + 4.5, 10.0))


def merge(rng: np.random.Generator, gap: float) -> World:
    """The ego is on the lane of a ramp that ends, beside the gap between a truck and a slower car that lets it in.

    Close before the truck drives another, so that there is no way past them.
    """
    stage = Stage(networks.merge(), rng)
    speed, beside = rng.uniform(19.0, 21.0), 2.5
    slow = speed - rng.uniform(2.5, 3.5)
    stage.ego(("b", "c", 2), RAMP, speed, route="d")
    truck, car, gap = stage.size("truck"), stage.size("car"), about(rng, gap)
    middle = JOIN + RAMP + (speed - slow) * beside
    for ahead in (0.0, truck[0] + 4.0):
        stage.prescribe("truck", follow_lane(AXIS, middle + (gap + truck[0]) / 2 + ahead, slow, lateral=Y), truck)
    yielding = (Segment(beside + 2.0), Segment(2.0, -2.0))
    stage.prescribe("car", follow_lane(AXIS, middle - (gap + car[0]) / 2, slow, yielding, lateral=Y), car)
    stage.prescribe("car", follow_lane(AXIS, middle + rng.uniform(-20.0, 20.0), speed + 2.0, lateral=0.0))
    return stage.world(phases(beside, beside + 4.0, 12.0))


def oncoming(rng: np.random.Generator, room: float) -> World:
    """An oncoming car passes a tractor in the ego's lane and returns late; on its own lane a van follows."""
    stage = Stage(networks.two_way(), rng)
    speed, there, tractor = rng.uniform(26.5, 28.0), rng.uniform(7.5, 8.5), 3.0
    onset, out, back, beside = rng.uniform(0.5, 1.0), 2.6, 2.4, 2.4
    returns = onset + out + beside  # [s] when it begins to
    stage.ego(("a", "b", 0), START, speed)
    way = of_lanes((stage.network.get_lane(("c", "d", 0)),), smooth=1.0)
    size = stage.size("car")
    half_out = returns + back / 2
    meets = START + speed * half_out + FRONT + about(rng, room) + size[0] / 2
    place = ROAD - meets - there * half_out
    shifts = (Shift(onset, out, -4.0), Shift(returns, back, 4.0))
    stage.prescribe("car", follow_lane(way, place, there, (), shifts), size)
    passes = onset + out + beside / 2
    stage.prescribe("tractor", follow_lane(way, place + (there - tractor) * passes, tractor))
    stage.prescribe("van", follow_lane(way, place - rng.uniform(35.0, 45.0), there))
    return stage.world(phases(onset, returns + back, 10.0))
