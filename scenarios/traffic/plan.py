"""What of a recording is played around an ego, on axes of the road: x the way that the ego drives, y to its right."""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenarios.traffic.fitting import Lanes, direction, fit
from scenarios.traffic.motion import course
from scenarios.traffic.reading import Trajectory, read
from trackers.geometry import rotation

SHORTEST = 1.0  # [s] on record that an ego needs
WINDOWS = {"NGSIM": 2.0}  # [s] of the smoothing, by layout
WINDOW = 1.0  # [s] of all others
LONG = 6.0  # [m] vehicles as long are no ego unless they are asked for
OVERLAP = np.array([0.5, 0.3])  # [m] along and across that recorded boxes may overlap by inaccuracy
FAR = 250.0  # [m] from the ego's recorded places: who never comes nearer while it is on record is left out


class Part(NamedTuple):
    """One vehicle, for as long as the ego is on record."""

    id: str  # as in the file
    table: NDArray  # (K, 7) rows of `CourseTable`, t = 0 when the ego's record begins
    size: NDArray  # (2,) length, width [m]
    kind: str  # contour
    forward: bool  # whether it drives the same way as the ego


class Plan(NamedTuple):
    """An episode of recorded traffic."""

    ego: Part
    others: tuple[Part, ...]
    lanes: Lanes  # of those that drive the ego's way
    opposite: Lanes | None  # of those that come towards it
    reach: tuple[float, float]  # [m] least and greatest x of any vehicle


@lru_cache(maxsize=8)
def plan_of(path: Path, changed: int, ego: str | None, window: float | None) -> Plan:
    """The episode of a file; `changed` is its time stamp, so that a new file under an old name is read.

    Raises:
        ValueError: the file cannot be used, or has no such vehicle, or has it for too short a time.
    """
    layout, vehicles = read(path)
    seconds = WINDOWS.get(layout.name, WINDOW) if window is None else window
    chosen = default_ego(vehicles, path.name) if ego is None else _asked_for(vehicles, ego, path.name)
    begin, end = _on_record(chosen, path.name)
    along = _direction(vehicles, chosen)
    local = [_turned(v, along) for v in vehicles]
    forward = {v.id: bool(v.xy[-1, 0] >= v.xy[0, 0]) for v in local} | {chosen.id: True}
    lanes, opposite = (_lanes([v for v in local if forward[v.id] == way]) for way in (True, False))
    assert lanes is not None  # the ego drives on one of them
    origin = np.array([min(v.xy[:, 0].min() for v in local), lanes.places[0]])
    parts = {}
    for v in local:
        if v.time[-1] > begin and v.time[0] < end and len(v.time) > 1:
            front = v.size[0] / 2 if layout.anchor == "front" else 0.0
            rest = 0.0 if forward[v.id] else np.pi  # [rad] the heading of one that never moves
            table = course(v.time - begin, v.xy - origin, v.heading, seconds, rest, front)
            parts[v.id] = Part(v.id, table, v.size, v.kind, forward[v.id])
    main = parts.pop(chosen.id)
    near = tuple(p for p in parts.values() if _comes_near(p.table, main.table))
    _check_free(main, near, path.name)
    xs = np.concatenate([p.table[:, 1] for p in (main, *near)])
    here = Lanes(lanes.places - origin[1], lanes.width)
    there = None if opposite is None else Lanes(opposite.places - origin[1], opposite.width)
    return Plan(main, near, here, there, (float(xs.min()), float(xs.max())))


def _on_record(ego: Trajectory, file: str) -> tuple[float, float]:
    """First and last time [s] of an ego; ValueError where they are too near to each other."""
    begin, end = (round(float(t), 6) for t in ego.time[[0, -1]])
    if end - begin < SHORTEST:
        raise ValueError(
            f"ego must be on record for {SHORTEST:g} s, got {ego.id} with {end - begin:.1f} s in {file}; "
            "choose another vehicle"
        )
    return begin, end


def _direction(vehicles: Sequence[Trajectory], ego: Trajectory) -> float:
    """Direction [rad] of the road, the way that the ego drives; of one that stands, that of the longest way."""
    ahead = ego.xy[-1] - ego.xy[0]
    steps = np.array([v.xy[-1] - v.xy[0] for v in vehicles])
    return direction(steps, ahead if np.hypot(*ahead) > 1.0 else steps[np.hypot(*steps.T).argmax()])


def default_ego(vehicles: Sequence[Trajectory], file: str) -> Trajectory:
    """The car that is longest on record on a middle lane; of several the one that begins nearest to the middle.

    Middle lanes are all but the outermost, where there are three or more that way.
    """
    steps = np.array([v.xy[-1] - v.xy[0] for v in vehicles])
    cars = [v for v in vehicles if v.kind == "car" and v.size[0] < LONG] or list(vehicles)
    if not cars:
        raise ValueError(f"{file} has no vehicle with enough rows; give a recording with longer trajectories")
    along = direction(steps, steps[np.hypot(*steps.T).argmax()])
    local = {v.id: _turned(v, along) for v in vehicles}
    way = {v.id: bool(local[v.id].xy[-1, 0] >= local[v.id].xy[0, 0]) for v in vehicles}
    middle = np.median(np.concatenate([v.xy for v in local.values()]), axis=0)
    inner: list[Trajectory] = []
    for side in (True, False):
        lanes = _lanes([local[v.id] for v in vehicles if way[v.id] == side])
        if lanes is None or len(lanes.places) < 3:
            continue
        for v in cars:
            k = int(np.abs(lanes.places - np.median(local[v.id].xy[:, 1])).argmin())
            if way[v.id] == side and 0 < k < len(lanes.places) - 1:
                inner.append(v)
    longest = max(round(v.time[-1] - v.time[0], 3) for v in inner or cars)
    last = [v for v in inner or cars if round(v.time[-1] - v.time[0], 3) == longest]
    return min(last, key=lambda v: abs(local[v.id].xy[0, 0] - middle[0]))


def _asked_for(vehicles: Sequence[Trajectory], ego: str, file: str) -> Trajectory:
    if found := [vehicle for vehicle in vehicles if vehicle.id == ego]:
        return found[0]
    some = ", ".join(v.id for v in vehicles[:5])
    raise ValueError(f"ego must be a vehicle of {file}, got {ego!r}; it has {some} and others")


def _turned(vehicle: Trajectory, along: float) -> Trajectory:
    """The vehicle on axes of which x points into the direction `along` [rad]."""
    heading = None if vehicle.heading is None else vehicle.heading - along
    return vehicle._replace(xy=vehicle.xy @ rotation(along), heading=heading)


def _lanes(vehicles: Sequence[Trajectory]) -> Lanes | None:
    if not vehicles:
        return None
    return fit(np.concatenate([v.xy[:, 1] for v in vehicles]), np.concatenate([v.lane for v in vehicles]))


def _check_free(ego: Part, others: Sequence[Part], file: str) -> None:
    """Refuse an ego that begins inside of others: its first frame would be a collision."""
    inside = []
    for part in others:
        if part.table[0, 0] <= 0.0 < part.table[-1, 0]:
            where = [np.interp(0.0, part.table[:, 0], part.table[:, k]) for k in (1, 2)]
            apart = np.abs(where - ego.table[0, 1:3]) - (ego.size + part.size) / 2
            if (apart < -OVERLAP).all():
                inside.append(part.id)
    if inside:
        raise ValueError(
            f"ego: vehicle {ego.id} of {file} begins inside of {len(inside)} other, such as {inside[0]}; choose "
            "another vehicle, or give a recording whose times are all of one clock"
        )


def _comes_near(table: NDArray, ego: NDArray) -> bool:
    """Whether a course comes within `FAR` of another at the same time."""
    t = table[:, 0]
    inside = (t >= 0) & (t <= ego[-1, 0])
    where = np.column_stack([np.interp(t[inside], ego[:, 0], ego[:, k]) for k in (1, 2)])
    return bool((np.hypot(*(table[inside, 1:3] - where).T) < FAR).any())
