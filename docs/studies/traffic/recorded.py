"""Rows of recorded traffic, and whether the times of its vehicles are of one clock."""

from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenarios.traffic import commonroad
from scenarios.traffic.fitting import direction
from scenarios.traffic.motion import course
from scenarios.traffic.plan import OVERLAP, WINDOW, WINDOWS
from scenarios.traffic.reading import Recording, Trajectory, kind_of, read
from studies.traffic.rows import EVERY, FARTHEST, Row
from trackers.geometry import rotation

FILES = {
    "I-80": ("ngsim_i80/i80_0400_200_vehicles_10s.csv.gz",),
    "US-101": ("ngsim_us101/USA_US101-3_3_T-1.xml", "ngsim_us101/USA_US101-4_1_T-1.xml"),
}
LANE = 3.66  # [m] width of a lane of both roads: 12 feet
ONE_CLOCK = 0.05  # share of vehicles inside of others from which the times are not of one clock


def recorded(source: str, data: Path) -> tuple[list[Row], float]:
    """All rows of a source, and the share of its vehicles that are inside of another one at some time.

    Gaps are given where that share is below `ONE_CLOCK`, of the way that most vehicles drive.

    Raises:
        ValueError: a file is missing or cannot be used.
    """
    rows: list[Row] = []
    inside: list[bool] = []
    for file in FILES[source]:
        found, collided = _rows(source, data / file)
        rows += found
        inside += collided
    share = float(np.mean(inside))
    return ([row._replace(gap=np.nan) for row in rows] if share >= ONE_CLOCK else rows), share


def _rows(source: str, path: Path) -> tuple[list[Row], list[bool]]:
    """Rows of a file, and of each vehicle whether it is inside of another one at some time."""
    recording = read(path)
    places = [(v, *_sampled(v, recording, _along(recording.vehicles))) for v in recording.vehicles]
    moments = sorted(
        ((float(t), k, x) for k, (_, times, xs) in enumerate(places) for t, x in zip(times, xs, strict=True)),
        key=lambda moment: moment[:2],
    )
    rows: list[Row] = []
    inside = np.zeros(len(places), bool)
    for time, group in groupby(moments, key=lambda moment: moment[0]):
        _, which, states = zip(*group, strict=True)
        here = [places[k][0] for k in which]
        state, size = np.array(states), np.array([v.size for v in here])
        inside[list(which)] |= overlapping(state[:, :2], size)
        for v, (_, _, speed), gap in zip(here, states, gaps(state[:, :2], size), strict=True):
            length, width = v.size.tolist()
            rows.append(Row(source, path.stem, 0, v.id, _kind(v, recording), time, length, width, speed, float(gap)))
    return rows, inside.tolist()


def _along(vehicles: tuple[Trajectory, ...]) -> float:
    """Direction [rad] that most vehicles drive."""
    steps = np.array([v.xy[-1] - v.xy[0] for v in vehicles])
    return direction(steps, steps.sum(0))


def _sampled(vehicle: Trajectory, recording: Recording, along: float) -> tuple[NDArray, NDArray]:
    """Times (K,) [s], multiples of `EVERY`, and place along and across [m], speed [m/s] (K, 3), smoothed."""
    layout = recording.layout
    front = vehicle.size[0] / 2 if layout.anchor == "front" else 0.0
    table = course(
        vehicle.time, vehicle.xy, vehicle.heading, WINDOWS.get(layout.name, WINDOW), along, front
    )  # t, x, y, heading, vx, vy
    first, last = np.ceil(table[0, 0] / EVERY - 1e-6), np.floor(table[-1, 0] / EVERY + 1e-6)
    times = np.arange(first, last + 1) * EVERY + 0.0  # no negative zero
    xy = table[:, 1:3] @ rotation(along)
    state = np.column_stack([xy, np.hypot(*table[:, 4:6].T)])
    return times, np.column_stack([np.interp(times, table[:, 0], column) for column in state.T])


def _kind(vehicle: Trajectory, recording: Recording) -> str:
    """The class as recorded; by the size in CommonRoad, which calls trucks of US-101 cars."""
    return kind_of("", *vehicle.size.tolist()) if recording.layout is commonroad.LAYOUT else vehicle.kind


def overlapping(xy: NDArray, size: NDArray) -> NDArray:
    """Whether each box (N,) is inside of another, by more than the inaccuracy of recorded boxes.

    Args:
        xy: centres along and across the road (N, 2) [m].
        size: length, width (N, 2) [m].
    """
    apart = np.abs(xy[:, None] - xy) - (size[:, None] + size) / 2  # (N, N, 2)
    inside = (apart < -OVERLAP).all(-1)
    np.fill_diagonal(inside, False)
    return inside.any(-1)


def gaps(xy: NDArray, size: NDArray) -> NDArray:
    """Gap (N,) [m] to the next vehicle ahead whose centre is within half a lane across, NaN for none; as above."""
    ahead, across = np.moveaxis(xy - xy[:, None], -1, 0)  # (N, N): of the second index from the first
    free = ahead - (size[:, None, 0] + size[:, 0]) / 2
    there = (ahead > 0) & (np.abs(across) < LANE / 2) & (free < FARTHEST)
    gap = np.where(there, free, np.inf).min(1)
    return np.where(np.isfinite(gap), gap, np.nan)
