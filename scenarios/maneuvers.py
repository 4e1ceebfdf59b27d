"""Scenarios in which vehicles change lanes on open roads.

The course is laid out relative to the ego at its initial speed. Traffic in the lanes that it uses is placed ahead of it
at no less than its speed, or behind it, where drivers react.
"""

import numpy as np

from scenarios.courses import Segment, Shift, follow_lane, integrate
from scenarios.drivers import steady_gap
from scenarios.longitudinal import AXIS, START, L, M, R
from scenarios.networks import SIX_RADAR_ORIGIN, gentle_curve, six_radar_bend, straight
from scenarios.networks import s_curve as s_curve_road
from scenarios.networks import tunnel as tunnel_road
from scenarios.stage import EGO_SIZE, Flow, Stage, World, phases


def cut_in(rng: np.random.Generator) -> World:
    """A car 25 m ahead in the left lane, 1 to 3 m/s slower, moves in within 3.5 to 4.5 s."""
    stage = Stage(straight(), rng)
    speed, onset, duration = rng.uniform(23.0, 27.0), rng.uniform(3.0, 6.0), rng.uniform(3.5, 4.5)
    stage.ego(M, START, speed)
    slower, size = rng.uniform(1.0, 3.0), stage.size("car")
    gap = rng.uniform(18.0, 24.0) + (EGO_SIZE[0] + size[0]) / 2 + slower * (onset + duration / 2)
    course = follow_lane(AXIS, START + gap, speed - slower, shifts=(Shift(onset, duration, 4.0),))
    stage.prescribe("car", course, size)
    stage.fill(Flow(M, START + gap + 75.0, speed, ("van",)))
    stage.fill(Flow(M, START - 50.0, speed, ("car", "truck")))
    stage.fill(Flow(L, START + gap + 60.0, speed + 1.0, ("car",)))
    stage.fill(Flow(L, START + gap - 55.0, speed, ("car", "motorcycle")))
    stage.fill(Flow(R, START + 70.0, speed - 2.0, ("bus", "car")))
    return stage.world(phases(onset, onset + duration))


def passed(rng: np.random.Generator) -> World:
    """The ego passes a car or a truck, on either side, that keeps its lane."""
    stage = Stage(straight(), rng)
    speed, kind, lane = rng.uniform(24.0, 26.0), ("car", "truck")[rng.integers(2)], (L, R)[rng.integers(2)]
    stage.ego(M, START, speed)
    size = stage.size(kind)
    place = START + EGO_SIZE[0] / 2 + rng.uniform(14.0, 22.0) + size[0] / 2
    stage.prescribe(kind, follow_lane(AXIS, place, speed - rng.uniform(5.7, 6.3), lateral={L: 0.0, R: 8.0}[lane]), size)
    return stage.world(phases(0.5, 7.0, 8.0))


def onset(rng: np.random.Generator) -> World:
    """A car 12 to 18 m ahead, as fast as the ego, begins to turn with 0.2 rad/s, to either side."""
    stage = Stage(straight(), rng)
    speed, side = 7.5, rng.choice([-1.0, 1.0])
    stage.ego(M, START, speed)
    turn = (Segment(3.0), Segment(2.5, 0.0, side * 0.2))
    stage.prescribe("car", integrate((START + rng.uniform(12.0, 18.0), 4.0, 0.0), speed, turn, ramp=0.5))
    return stage.world(phases(3.0, 5.0, 5.5))


def cut_out(rng: np.random.Generator) -> World:
    """The leader 40 m ahead swerves left in 3 s, 25 m before a van at 14 m/s that it had hidden."""
    stage = Stage(straight(), rng)
    speed, onset, duration = rng.uniform(23.0, 26.0), rng.uniform(3.0, 5.0), rng.uniform(3.0, 3.6)
    slow, lead = rng.uniform(13.0, 15.0), START + rng.uniform(42.0, 52.0)
    stage.ego(M, START, speed)
    stage.prescribe("car", follow_lane(AXIS, lead, speed, shifts=(Shift(onset, duration, -4.0),), lateral=4.0))
    hidden = lead + (speed - slow) * (onset + 0.75 * duration) + rng.uniform(14.0, 18.0)
    stage.fill(Flow(M, hidden - 2.5, slow, ("van",), from_rear=True))
    stage.fill(Flow(M, START - 60.0, speed, ("car",)))
    stage.fill(Flow(L, lead + 110.0, speed + 1.0, ("car",)))
    stage.fill(Flow(L, lead - 70.0, speed, ("car", "van")))
    stage.fill(Flow(R, START + 75.0, speed - 4.0, ("truck", "motorcycle")))
    return stage.world(phases(onset, onset + duration))


def truck_cut_in(rng: np.random.Generator) -> World:
    """A rigid truck whose rear is 30 m ahead in the right lane, 3 m/s slower, moves in within 5 to 6 s."""
    stage = Stage(straight(), rng)
    speed, onset, duration = rng.uniform(22.0, 25.0), rng.uniform(3.0, 5.0), rng.uniform(5.0, 6.0)
    slower, size = rng.uniform(2.0, 3.5), stage.size("truck")
    stage.ego(M, START, speed)
    place = START + rng.uniform(30.0, 36.0) + size[0] / 2 + slower * (onset + duration / 2)
    course = follow_lane(AXIS, place, speed - slower, (), (Shift(onset, duration, -4.0),), 8.0)
    stage.prescribe("truck", course, size)
    stage.fill(Flow(M, place + 85.0, speed, ("car",)))
    stage.fill(Flow(M, START - 55.0, speed, ("van", "car")))
    stage.fill(Flow(L, START + 90.0, speed + 3.0, ("car", "car", "motorcycle")))
    stage.fill(Flow(R, place + 45.0, speed - slower + 0.5, ("truck",)))
    stage.fill(Flow(R, place - 55.0, speed - slower, ("articulated",)))
    return stage.world(phases(onset, onset + duration))


def lane_change(rng: np.random.Generator) -> World:
    """In a bend of 500 m radius to the right, the leader 50 m ahead moves to the right lane."""
    stage = Stage(gentle_curve(), rng)
    network = stage.network
    speed, onset, duration = rng.uniform(23.0, 26.0), rng.uniform(4.0, 7.0), rng.uniform(4.0, 5.0)
    stage.ego(M, 200.0, speed)
    lead = 200.0 + rng.uniform(50.0, 60.0)
    path = network.get_lane(M).path
    stage.prescribe("car", follow_lane(path, lead, speed, shifts=(Shift(onset, duration, 4.0),)))
    stage.fill(Flow(M, lead + 90.0, speed + 0.5, ("car",)))
    stage.fill(Flow(M, 145.0, speed, ("truck",)))
    stage.fill(Flow(L, 310.0, speed + 2.0, ("car", "car", "bus")))
    stage.fill(Flow(R, lead + 75.0, speed, ("van",)))
    stage.fill(Flow(R, lead - 65.0, speed - 1.0, ("motorcycle", "car")))
    return stage.world(phases(onset, onset + duration))


def double_lane_change(rng: np.random.Generator) -> World:
    """A car 45 m ahead on the right swerves by 4 m to the left and back, 3 s each."""
    stage = Stage(straight(), rng)
    speed, onset = rng.uniform(22.0, 26.0), rng.uniform(3.0, 6.0)
    out, hold, back = rng.uniform(2.8, 3.4), rng.uniform(0.5, 1.5), rng.uniform(2.8, 3.4)
    place = START + rng.uniform(42.0, 52.0)
    stage.ego(M, START, speed)
    swerve = (Shift(onset, out, -4.0), Shift(onset + out + hold, back, 4.0))
    stage.prescribe("car", follow_lane(AXIS, place, speed, (), swerve, 8.0))
    stage.fill(Flow(M, place + 65.0, speed, ("van",)))
    stage.fill(Flow(M, START - 50.0, speed, ("car", "van")))
    stage.fill(Flow(L, START + 80.0, speed + 2.0, ("car", "bus", "car")))
    stage.fill(Flow(R, place + 75.0, speed, ("truck",)))
    stage.fill(Flow(R, place - 60.0, speed - 1.0, ("car",)))
    return stage.world(phases(onset, onset + out + hold + back))


def overtake(rng: np.random.Generator) -> World:
    """A car 55 m behind in the ego's lane pulls out, passes 8 m/s faster and moves in 30 m ahead."""
    stage = Stage(straight(), rng)
    speed, faster = rng.uniform(22.0, 24.0), rng.uniform(7.5, 9.0)
    behind, onset = rng.uniform(52.0, 60.0), rng.uniform(0.8, 1.6)
    stage.ego(M, START, speed)
    moves_in = (behind + rng.uniform(26.0, 32.0)) / faster
    shifts = (Shift(onset, 3.6, -4.0), Shift(moves_in, 4.0, 4.0))
    slow_down = (Segment(moves_in + 1.0), Segment(4.0, -(faster - 2.0) / 4.0))
    course = follow_lane(AXIS, START - behind, speed + faster, slow_down, shifts, 4.0)
    stage.prescribe("car", course)
    stage.fill(Flow(M, START + 135.0, speed + 3.0, ("truck",)))
    stage.fill(Flow(M, START - behind - 60.0, speed + 2.0, ("car",)))
    stage.fill(Flow(L, START + 190.0, speed + 7.0, ("car",)))
    stage.fill(Flow(L, START - behind - 75.0, speed + 6.0, ("car",)))
    stage.fill(Flow(R, START + 80.0, speed - 3.0, ("bus", "van", "car")))
    return stage.world(phases(onset, moves_in + 4.0))


def dense_traffic(rng: np.random.Generator) -> World:
    """Thirty vehicles over 400 m; a car ahead squeezes from the right lane into the ego's."""
    stage = Stage(straight(), rng)
    speed, onset, duration = rng.uniform(17.0, 20.0), rng.uniform(4.0, 7.0), rng.uniform(4.0, 5.0)
    stage.ego(M, START, speed)
    mixed = ("car", "van", "car", "motorcycle", "car", "truck", "car", "bus", "car", "van")
    gap = steady_gap(speed, 1.2 * speed, 0.7)
    ahead = ("van", "car", "car", "car")
    lead = stage.fill(Flow(M, START + 1.85 * gap + 4.0, speed, ahead, 0.1, 0.7, from_rear=True))
    nearest = min(v.position[0] for v in lead)
    place = nearest - rng.uniform(18.0, 22.0)
    stage.prescribe("car", follow_lane(AXIS, place, speed, (), (Shift(onset, duration, -4.0),), 8.0))
    stage.fill(Flow(M, START - gap, speed, ("car", "van", "car", "truck", "car"), 0.2, 0.7))
    stage.fill(Flow(L, START + 210.0, speed + 2.0, mixed, 0.2, 0.7))
    stage.fill(Flow(R, place + 0.9 * gap, speed, ("bus", "truck", "car"), 0.1, 0.7, from_rear=True))
    stage.fill(
        Flow(R, place - gap, speed - 0.5, ("truck", "car", "motorcycle", "van", "car", "car", "truck"), 0.2, 0.7)
    )
    return stage.world(phases(onset, onset + duration))


def truck_convoy(rng: np.random.Generator) -> World:
    """The ego passes trucks on the right, 4 m/s faster; a car hidden in front of the last two pulls out ahead."""
    stage = Stage(straight(), rng)
    speed, slow = rng.uniform(23.0, 25.0), rng.uniform(19.0, 20.0)
    onset, duration = rng.uniform(4.0, 6.0), rng.uniform(4.5, 5.5)
    stage.ego(M, START, speed)
    place = START + rng.uniform(72.0, 80.0)
    plan = (Segment(onset), Segment(4.0, (speed - slow) / 4.0))
    stage.prescribe("car", follow_lane(AXIS, place, slow, plan, (Shift(onset, duration, -4.0),), 8.0))
    stage.fill(Flow(R, place + 32.0, slow, ("articulated", "truck"), 0.1, 0.6, from_rear=True))
    stage.fill(Flow(R, place - 26.0, slow, ("truck", "articulated", "bus"), 0.1, 0.6))
    stage.fill(Flow(M, place + 100.0, speed, ("car",)))
    stage.fill(Flow(M, START - 60.0, speed, ("car",)))
    stage.fill(Flow(L, START + 60.0, speed + 2.0, ("car", "van")))
    return stage.world(phases(onset, onset + duration))


def tunnel(rng: np.random.Generator) -> World:
    """In the right of two lanes between walls; the leader 30 m ahead moves to the left lane within 4 to 5 s."""
    stage = Stage(tunnel_road(), rng)
    speed, onset, duration = rng.uniform(20.0, 23.0), rng.uniform(3.0, 6.0), rng.uniform(4.0, 5.0)
    stage.ego(M, START, speed)
    lead = START + rng.uniform(32.0, 40.0)
    stage.prescribe("car", follow_lane(AXIS, lead, speed, shifts=(Shift(onset, duration, -4.0),), lateral=4.0))
    stage.fill(Flow(M, lead + 75.0, speed, ("van",)))
    stage.fill(Flow(M, START - 50.0, speed, ("car",)))
    stage.fill(Flow(L, lead + 50.0, speed + 1.0, ("car", "truck"), from_rear=True))
    stage.fill(Flow(L, START - 55.0, speed, ("car",)))
    return stage.world(phases(onset, onset + duration))


def beside_truck(rng: np.random.Generator) -> World:
    """A truck with trailer on the right, little slower; the leader 24 m ahead swerves to the left lane and back."""
    stage = Stage(straight(), rng)
    speed, onset = rng.uniform(22.0, 24.0), rng.uniform(3.0, 5.0)
    stage.ego(M, START, speed)
    stage.prescribe("articulated", follow_lane(AXIS, START + rng.uniform(14.0, 20.0), speed - 0.5, lateral=8.0))
    swerve = (Shift(onset, 3.5, -4.0), Shift(onset + 5.0, 3.5, 4.0))
    stage.prescribe("car", follow_lane(AXIS, START + rng.uniform(24.0, 29.0), speed, (), swerve, 4.0))
    stage.fill(Flow(M, START + 110.0, speed, ("van",)))
    stage.fill(Flow(M, START - 50.0, speed, ("car",)))
    stage.fill(Flow(L, START + 115.0, speed + 1.0, ("car",)))
    stage.fill(Flow(L, START - 60.0, speed, ("motorcycle",)))
    return stage.world(phases(onset, onset + 8.5))


def lone_leader(rng: np.random.Generator) -> World:
    """Nobody but a leader 30 m ahead, who moves to the left lane and then to the right one, near each rail once."""
    stage = Stage(straight(), rng)
    speed, onset = rng.uniform(22.0, 25.0), rng.uniform(3.0, 5.0)
    stage.ego(M, START, speed)
    aside = (Shift(onset, 4.0, -4.0), Shift(onset + 6.0, 5.0, 8.0))
    stage.prescribe("car", follow_lane(AXIS, START + rng.uniform(26.0, 34.0), speed, (), aside, 4.0))
    return stage.world(phases(onset, onset + 11.0))


def s_curve(rng: np.random.Generator) -> World:
    """At 22 m/s through bends of 260 m radius; the leader 45 m ahead moves to the left lane within them."""
    stage = Stage(s_curve_road(), rng)
    speed, onset, duration = rng.uniform(20.0, 22.0), rng.uniform(6.0, 9.0), rng.uniform(4.5, 5.5)
    stage.ego(M, 130.0, speed)
    lead = 130.0 + rng.uniform(46.0, 56.0)
    path = stage.network.get_lane(M).path
    stage.prescribe("car", follow_lane(path, lead, speed, shifts=(Shift(onset, duration, -4.0),)))
    stage.fill(Flow(M, lead + 70.0, speed, ("van",)))
    stage.fill(Flow(M, 75.0, speed, ("car",)))
    stage.fill(Flow(L, lead + 80.0, speed + 1.0, ("bus",)))
    stage.fill(Flow(L, lead - 55.0, speed, ("car", "motorcycle")))
    stage.fill(Flow(R, 200.0, speed - 1.5, ("truck", "car")))
    return stage.world(phases(onset, onset + duration))


def six_radar_highway(rng: np.random.Generator) -> World:
    """The published scene, the same for every seed: positions and speeds are given, not drawn.

    Published coordinates have y to the left, here it is to the right. The car behind the ego follows as a driver,
    because the ego may brake.
    """
    stage = Stage(six_radar_bend(), rng)
    path = stage.network.get_lane(M).path
    base = SIX_RADAR_ORIGIN
    stage.ego(M, base + 50.0, 25.0)
    passing = follow_lane(path, base, 35.0, shifts=(Shift(0.1, 2.1, -1.8),), lateral=-1.8)
    stage.prescribe("car", passing, size=(4.7, 1.8))
    stage.prescribe("truck", follow_lane(path, base + 86.0, 25.0, lateral=3.6), size=(8.1, 2.45))
    stage.prescribe("car", follow_lane(path, base + 75.0, 25.0), size=(4.7, 1.8))
    stage.drive("car", M, base + 30.0, 25.0, target=31.7, headway=0.3, size=(4.7, 1.8))
    return stage.world(phases(1.5, 6.5))
