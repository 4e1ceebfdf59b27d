"""Scenarios in which vehicles brake and accelerate but keep their lane.

Offsets are to the ego's centre. L, M, R are the lanes of a straight three-lane road, left to right.
"""

import numpy as np

from scenarios.courses import Segment, follow_lane
from scenarios.networks import straight, two_way
from scenarios.paths import along
from scenarios.stage import Flow, Stage, World, phases

L, M, R = ("a", "b", 0), ("a", "b", 1), ("a", "b", 2)
AXIS = along((0.0, 0.0, 0.0), ((1600.0, 0.0),))
START = 300.0  # [m] where the ego starts


def following(rng: np.random.Generator) -> World:
    """Leader 45 m ahead slows down and speeds up twice by 3 to 5 m/s."""
    stage = Stage(straight(), rng)
    speed, onset = rng.uniform(23.0, 27.0), rng.uniform(2.0, 4.0)
    swing = rng.uniform(1.0, 1.6)
    stage.ego(M, START, speed)
    wave = [Segment(onset), Segment(3.0, -swing), Segment(2.0), Segment(3.0, swing), Segment(1.5)]
    wave += [Segment(2.5, -swing), Segment(1.0), Segment(2.5, swing)]
    course = follow_lane(AXIS, START + rng.uniform(46.0, 56.0), speed, wave, lateral=4.0)
    stage.prescribe("car", course)
    _neighbours(stage, speed)
    stage.fill(Flow(M, START - 55.0, speed, ("van",)))
    return stage.world(phases(onset, onset + 15.5))


def hard_brake(rng: np.random.Generator) -> World:
    """Leader 60 m ahead brakes with 8 m/s^2 by about 18 m/s, rolls, and drives on."""
    stage = Stage(straight(), rng)
    speed, onset = rng.uniform(23.0, 26.0), rng.uniform(4.0, 7.0)
    stage.ego(M, START, speed)
    plan = [Segment(onset), Segment(rng.uniform(2.1, 2.4), -8.0), Segment(3.0), Segment(5.0, 2.5)]
    stage.prescribe("car", follow_lane(AXIS, START + rng.uniform(58.0, 70.0), speed, plan, lateral=4.0, onset=0.3))
    _neighbours(stage, speed)
    stage.fill(Flow(M, START - 60.0, speed, ("car",)))
    return stage.world(phases(onset, onset + 5.5))


def _neighbours(stage: Stage, speed: float) -> None:
    """Faster traffic on the left, slower on the right, of all sizes: seven vehicles beside the ego's lane."""
    stage.fill(Flow(L, START + 95.0, speed + 3.0, ("car", "van", "car", "motorcycle"), headway=0.9))
    stage.fill(Flow(R, START + 110.0, speed - 3.0, ("truck", "car", "bus"), headway=1.2))


def stop_and_go(rng: np.random.Generator) -> World:
    """The heads of three queues stop and start, each in its own rhythm; everybody behind reacts."""
    stage = Stage(straight(), rng)
    speed = rng.uniform(8.0, 10.0)
    onset = rng.uniform(2.0, 3.5)
    stage.ego(M, START, speed)
    kinds = {L: ("car", "van", "motorcycle", "car"), M: ("van",), R: ("truck", "car", "bus", "car")}
    heads = {L: 60.0, M: 56.0, R: 68.0}
    for lane, head in heads.items():
        begin = onset + (0.0 if lane == M else rng.uniform(0.0, 3.0))
        brake = rng.uniform(1.8, 2.4)
        wave = [Segment(begin), Segment(speed / brake, -brake), Segment(rng.uniform(1.5, 3.0)), Segment(4.0, 1.6)]
        wave += [Segment(1.0), Segment(6.4 / 1.6, -1.6), Segment(1.5), Segment(3.0, 1.5)]
        s = START + head + rng.uniform(-3.0, 3.0)
        stage.prescribe(str(rng.choice(("car", "van"))), follow_lane(AXIS, s, speed, wave, lateral=4.0 * lane[2]))
        stage.fill(Flow(lane, s - 24.0, speed, kinds[lane], 0.2, headway=0.8))
    stage.fill(Flow(M, START - 25.0, speed, ("van", "car"), 0.2, headway=0.8))
    return stage.world(phases(onset, 18.0))


def column(rng: np.random.Generator) -> World:
    """Eight cars on the left and nine on the right with 3 m between their bumpers, the ego in between 1 m/s faster."""
    stage = Stage(straight(), rng)
    onset = rng.uniform(2.0, 3.0)
    stage.ego(M, START, 26.0)
    for lane, count in ((L, 8), (R, 9)):
        end = START - rng.uniform(30.0, 45.0)
        for _ in range(count):
            size = stage.size("car")
            stage.prescribe("car", follow_lane(AXIS, end + size[0] / 2, 25.0, lateral=4.0 * lane[2]), size)
            end += size[0] + 3.0
    stage.fill(Flow(M, START + 90.0, 26.0, ("van",)))
    return stage.world(phases(onset, onset + 10.0))


def slow_tractor(rng: np.random.Generator) -> World:
    """A tractor 130 m ahead at 8 m/s on a country road; the road the other way is busy."""
    stage = Stage(two_way(), rng)
    speed = rng.uniform(19.0, 21.0)
    ours, theirs = ("a", "b", 0), ("c", "d", 0)
    stage.ego(ours, START, speed)
    weave = follow_lane(
        AXIS, START + rng.uniform(125.0, 140.0), rng.uniform(7.5, 8.5), lateral=4.0 + rng.uniform(-0.2, 0.4)
    )
    stage.prescribe("tractor", weave)
    stage.fill(Flow(ours, START - 60.0, speed, ("car", "van")))
    far = 1600.0 - START  # the ego's place in the coordinate of the opposite lane
    stage.fill(Flow(theirs, far - 90.0, rng.uniform(17.0, 20.0), ("car", "truck", "motorcycle", "car")))
    return stage.world(phases(4.0, 12.0))
