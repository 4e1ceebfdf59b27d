"""Speed, acceleration, jerk, time gaps and lane changes of vehicles, recorded and simulated by the same formulas."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.courses import Segment, follow_lane
from scenarios.drivers import Population
from scenarios.networks import WIDTH, straight
from scenarios.paths import along
from scenarios.stage import Flow, Stage, traffic
from scenarios.traffic.fitting import direction
from scenarios.traffic.motion import course
from scenarios.traffic.plan import WINDOW
from scenarios.traffic.reading import read
from studies.traffic.recorded import FILES, recorded

WAITED, COUNTED = 10.0, 10.0  # [s] before the motion of simulated vehicles counts, and of it
STEP = 0.1  # [s] of the recordings
ROAD, LANES, QUEUE = 1200.0, 5, 11  # [m], lanes, vehicles in a lane
HEAD = 800.0  # [m] where the head of a queue starts
LED = 4  # vehicles behind a head, whose motion is prescribed, that do not count
SLOWEST, BETWEEN = 1.5, 0.15  # [m/s] least speed of a head; share by which lanes differ
TIMED = 2.0  # [m/s] least speed of a follower that has a time gap
QUANTITIES = ("time_gap", "speed", "acceleration", "jerk")


class Motion(NamedTuple):
    """Of one vehicle."""

    id: str
    speed: NDArray  # (K,) [m/s] ten times a second
    acceleration: NDArray  # (K,) [m/s^2]
    jerk: NDArray  # (K,) [m/s^3]
    time_gap: NDArray  # (G,) [s] once a second, where it has one
    changes: int  # of the lane
    way: float  # [km]


def motion(name: str, table: NDArray, lane: NDArray, time_gap: Iterable[float] = ()) -> Motion:
    """From the smoothed places of a vehicle; half a window is left out at either end."""
    speed = np.hypot(*table[:, 4:6].T)
    acceleration = np.gradient(speed, STEP)
    jerk, half = np.gradient(acceleration, STEP), round(WINDOW / 2 / STEP)
    inner = slice(half, -half)
    way = float(np.hypot(*np.diff(table[:, 1:3], axis=0).T).sum()) / 1000
    changes = int((np.diff(lane) != 0).sum())
    return Motion(name, speed[inner], acceleration[inner], jerk[inner], np.array([*time_gap]), changes, way)


def of_recordings(data: Path) -> list[Motion]:
    """I-80 without time gaps, as its times are not of one clock, and the time gaps alone of US-101.

    US-101 are 26 vehicles on about 100 m with jerks three times those of I-80: noise.
    """
    recording = read(data / FILES["I-80"][0])
    steps = np.array([v.xy[-1] - v.xy[0] for v in recording.vehicles])
    way = direction(steps, steps.sum(0))
    found = [
        motion(v.id, course(v.time, v.xy, v.heading, WINDOW, way), v.lane)
        for v in sorted(recording.vehicles, key=lambda v: int(v.id))
    ]
    rows, _ = recorded("US-101", data)
    none = np.zeros(0)
    for name in sorted({row.vehicle for row in rows}, key=int):
        timed = [r.gap / r.speed for r in rows if r.vehicle == name and r.gap == r.gap and r.speed >= TIMED]
        if timed:
            found.append(Motion(f"US-101 {name}", none, none, none, np.array(timed), 0, 0.0))
    return found


def halves(found: Sequence[Motion]) -> tuple[list[Motion], list[Motion]]:
    """Every other vehicle in the order of numbers, of each road: to tune on, and to report on."""
    roads = [[m for m in found if m.way > 0], [m for m in found if not m.way > 0]]
    return tuple([m for road in roads for m in road[k::2]] for k in range(2))  # type: ignore[return-value]


class Flows(NamedTuple):
    """Of the traffic around drivers: no trait of theirs."""

    speeds: tuple[float, ...]  # [m/s] quantiles of the mean speeds of vehicles, evenly spaced
    braking: float  # [m/s^2] of the heads of queues while the motion counts


def of_population(population: Population, speed: float, braking: float, seed: int) -> list[Motion]:
    """Queues of drivers in five lanes at about a speed [m/s] behind heads on courses; the first few are left out."""
    rng = np.random.default_rng([33, seed])
    with traffic(population=population):
        stage = Stage(straight(LANES, ROAD), rng)
        axis = along((0.0, 0.0, 0.0), ((ROAD, 0.0),))
        for k in range(LANES):
            own = max(speed * (1 + BETWEEN * float(rng.standard_normal())), SLOWEST)
            plan = (Segment(WAITED), Segment(COUNTED, -min(braking, 0.8 * own / COUNTED)))
            stage.prescribe("car", follow_lane(axis, HEAD, own, plan, lateral=k * WIDTH))
            stage.fill(Flow(("a", "b", k), HEAD - 10.0 - 1.5 * own, own, ("car",) * QUEUE))
    road, places, lanes, gaps = stage.road, [], [], []
    drivers = [v for v in road.vehicles if hasattr(v, "lane_distance_to") and not hasattr(v, "table")]
    for frame in range(round((WAITED + COUNTED) / STEP) + 1):
        if frame * STEP >= WAITED - 1e-9:
            places.append([(*v.position, v.heading) for v in drivers])
            lanes.append([v.lane_index[2] for v in drivers])
            if frame % 10 == 0:
                gaps.append([_time_gap(v, road) for v in drivers])
        road.act()
        road.step(STEP)
    if any(v.crashed for v in road.vehicles):
        raise ValueError(f"two vehicles collide under seed {seed}")
    xy, lane, timed = np.array(places), np.array(lanes), np.array(gaps)
    time = STEP * np.arange(len(xy))
    return [
        motion(f"{seed} {k}", course(time, xy[:, k, :2], xy[:, k, 2], WINDOW, 0.0), lane[:, k],
               timed[np.isfinite(timed[:, k]), k])
        for k in range(len(drivers)) if k % QUEUE >= LED
    ]  # fmt: skip


def _time_gap(vehicle: object, road: object) -> float:
    ahead, _ = road.neighbour_vehicles(vehicle, vehicle.lane_index)  # type: ignore[attr-defined]
    if ahead is None or vehicle.speed < TIMED:  # type: ignore[attr-defined]
        return np.nan
    gap = ahead.position[0] - vehicle.position[0] - (ahead.LENGTH + vehicle.LENGTH) / 2  # type: ignore[attr-defined]
    return gap / vehicle.speed if gap < 100.0 else np.nan  # type: ignore[attr-defined]


def values(found: Sequence[Motion], quantity: str) -> NDArray:
    """All values of a quantity."""
    return np.concatenate([getattr(m, quantity) for m in found])


def per_km(found: Sequence[Motion]) -> float:
    """Lane changes per km and vehicle."""
    return sum(m.changes for m in found) / sum(m.way for m in found)
