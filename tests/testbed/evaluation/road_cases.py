"""Worlds for the multi-object tracker: single cases, and five kinds of traffic."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sensors.origin import STATIC, Origin
from sensors.scene import Scene
from tests.testbed.evaluation.road_world import CAR, TRUCK, Road, Vehicle, World
from trackers import Scan

EGO = Vehicle(size=(4.7, 1.9))
RIGHT, AHEAD, LEFT = 1, 0, -1  # lanes

ABREAST = World((Vehicle(24, AHEAD, size=(14.0, 2.5)), Vehicle(24, RIGHT, size=(13.0, 2.5))))
TRUCK_AND_CAR = World((Vehicle(24, LEFT, size=TRUCK), Vehicle(22, AHEAD)))
HIDDEN = World((Vehicle(62, LEFT, changes=((0.5, AHEAD), (3.5, LEFT))), Vehicle(40, AHEAD, size=TRUCK)))
EMPTY = World()
OVERTAKING = World((Vehicle(-50, LEFT, 34.0),))
LEAVING = World((Vehicle(12, RIGHT, 27.0),))
ABEAM = World((Vehicle(0, RIGHT),))
CUT_IN = World((Vehicle(-12, LEFT, 29.0, changes=((4.5, AHEAD),)),))
TAILGATERS = World((Vehicle(25), Vehicle(33.6), Vehicle(42.2)))
PASSING_TRUCK = World((Vehicle(-30, LEFT, 28.0, size=(15.0, 2.5)),))
LEAD = World((Vehicle(30),))


def jam(seed: int) -> World:
    """22 vehicles and the ego in four lanes: from 12 m/s to rest within 7 s, the gaps shrinking from 9 to 2 or 3 m."""
    rng, vehicles = np.random.default_rng(seed), []
    for lane, (behind, ahead) in {-2: (2, 3), -1: (2, 4), 0: (2, 3), 1: (2, 4)}.items():
        offset = 0.0 if lane == 0 else rng.uniform(-4, 4)
        for side, count in ((1, ahead), (-1, behind)):
            place, rest, length = offset, offset, 4.7
            for k in range(count + (lane != 0 and side > 0)):
                size = (10.0, 2.5) if rng.random() < 0.15 else (rng.uniform(4.2, 5.0), 1.86)
                if lane == 0 or side < 0 or k:
                    place += side * ((length + size[0]) / 2 + 9.0)
                    rest += side * ((length + size[0]) / 2 + rng.uniform(2.0, 3.0))
                way = 42.0 + rest - place  # [m] until all stand
                vehicles.append(Vehicle(place, lane, way / 3.5, size, ((7.0, 0.0), (60.0, 0.0))))
                length = size[0]
    return World(tuple(vehicles), replace(EGO, speed=12.0, knots=((7.0, 0.0), (60.0, 0.0))))


def turn(seed: int) -> World:
    """Eight cars and two trucks around an ego that drives on a circle of 90 m at 12 m/s."""
    rng = np.random.default_rng(seed)
    vehicles = []
    for lane, speed in ((-2, 14.0), (-1, 13.0), (0, 12.0), (1, 11.0)):
        for s in (-25.0, 25.0, 55.0) if lane == 0 else (-30.0, 5.0, 45.0):
            truck = lane == 1 and s > 40
            vehicles.append(Vehicle(s + rng.uniform(-4, 4), lane, speed, (10.0, 2.5) if truck else CAR))
    return World(tuple(vehicles), replace(EGO, speed=12.0), Road(curvature=1 / 90))


def ghost(start: float, end: float) -> Callable[[float, Scene, Scan, Origin, np.random.Generator], Scan]:
    """Between two times, every third detection of object 0 comes a second time from 6 m farther, at the same rate."""

    def distort(time: float, scene: Scene, scan: Scan, origin: Origin, rng: np.random.Generator) -> Scan:
        if not start <= time < end:
            return scan
        again = np.flatnonzero(origin.object == 0)[::3]
        rows = np.concatenate([np.arange(len(scan.mask)), again])
        polar = scan.polar[rows].copy()
        polar[len(scan.mask) :, 0] += 6.0
        return Scan(polar, scan.mask[rows], scan.pose[rows], scan.velocity[rows], scan.noise[rows], scan.sensor[rows],
                    scan.platform)  # fmt: skip

    return distort


# Kind: vehicles, share of trucks in the two lanes right of the fast ones, gap [m] least and mean excess, lane changes.
KINDS = {
    "highway": (20, 0.25, (12.0, 18.0), 3),
    "curve": (18, 0.25, (12.0, 18.0), 0),
    "dense": (30, 0.12, (8.0, 8.0), 2),
    "convoy": (14, 0.8, (10.0, 8.0), 1),
    "cut-in": (14, 0.12, (14.0, 14.0), 6),
}
LANE_SPEED = {-2: 30.0, -1: 27.5, 0: 25.0, 1: 23.0}  # [m/s]


def traffic(kind: str, seed: int) -> World:
    """One of the five kinds of section 4: 10 s without a collision, drawn from the seed."""
    count, trucks, (least, excess), changes = KINDS[kind]
    rng = np.random.default_rng([seed, list(KINDS).index(kind)])
    road = Road(curvature=1 / 700) if kind == "curve" else Road()
    vehicles = [v for lane in LANE_SPEED for v in _column(lane, trucks, least, excess, rng)]
    nearest = sorted(vehicles, key=lambda v: abs(v.s - 15.0))[:count]  # more of them ahead than behind
    for i in rng.permutation(count):
        if changes == 0:
            break
        lane = nearest[i].lane + rng.choice([-1, 1])
        if kind == "cut-in":
            lane = AHEAD
        changed = replace(nearest[i], changes=((rng.uniform(0.5, 5.0), lane),))
        others = [*nearest[:i], *nearest[i + 1 :], EGO]
        if lane in LANE_SPEED and lane != nearest[i].lane and not _conflict(changed, others):
            nearest[i] = changed
            changes -= 1
    return World(tuple(nearest), EGO, road)


def _column(lane: int, trucks: float, least: float, excess: float, rng: np.random.Generator) -> list[Vehicle]:
    """Vehicles of one lane, all at its speed, from 120 m behind the ego to 160 m ahead, none on the ego."""
    column, s = [], -120.0 + rng.uniform(0, 20)
    while s < 160:
        truck = lane >= 0 and rng.random() < trucks
        size = (rng.uniform(9.0, 15.0), 2.5) if truck else (rng.uniform(4.1, 5.1), rng.uniform(1.75, 1.95))
        s += size[0] / 2
        vehicle = Vehicle(s, lane, LANE_SPEED[lane], size)
        if not (lane == 0 and abs(s) < (size[0] + 4.7) / 2 + least):
            column.append(vehicle)
        s += size[0] / 2 + least + rng.exponential(excess)
    return column


def _conflict(vehicle: Vehicle, others: list[Vehicle]) -> bool:
    """Whether it comes within 4 m along and 0.8 m across of another during 11 s."""
    for time in np.arange(0.0, 11.0, 0.25):
        s, d, *_ = vehicle.course(time)
        for other in others:
            t, e, *_ = other.course(time)
            near = abs(s - t) < (vehicle.size[0] + other.size[0]) / 2 + 4.0
            if near and abs(d - e) < (vehicle.size[1] + other.size[1]) / 2 + 0.8:
                return True
    return False


def static_rates(step_scan: Scan, origin: Origin) -> tuple[np.ndarray, np.ndarray]:
    """Ground range rates (J,) [m/s] of the returns of guard rails, and their standard deviations (J,)."""
    rail = origin.kind == STATIC
    u = step_scan.sight[rail]
    sideways = step_scan.velocity[rail, 1] * u[:, 0] - step_scan.velocity[rail, 0] * u[:, 1]
    sigma = np.hypot(step_scan.noise[rail, 2], sideways * step_scan.noise[rail, 1])
    return step_scan.ground_rate[rail], sigma
