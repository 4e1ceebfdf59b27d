"""The lanes of a road network as plain polylines: for maps and for pictures."""

from typing import NamedTuple

import numpy as np
from highway_env.road.lane import AbstractLane, LineType, StraightLane
from highway_env.road.road import RoadNetwork
from numpy.typing import NDArray

from scenarios.scalars import AxisLane

STEP = 4.0  # [m] between the points of a bent lane


class LaneShape(NamedTuple):
    """One lane."""

    centre: NDArray  # (P, 2) [m] in the direction of travel
    width: float  # [m]
    borders: tuple[NDArray, NDArray]  # left and right line (P, 2) [m] as the driver sees them
    lines: tuple[int, int]  # their `LineType`


def lane_shapes(network: RoadNetwork) -> list[LaneShape]:
    """All lanes of a network."""
    return [_shape(lane) for lane in network.lanes_list()]


def _shape(lane: AbstractLane) -> LaneShape:
    points = 2 if type(lane) in (StraightLane, AxisLane) else max(2, int(np.ceil(lane.length / STEP)) + 1)
    s = np.linspace(0, lane.length, points)
    half = lane.width_at(0) / 2

    def line(offset: float) -> NDArray:
        return np.array([lane.position(x, offset) for x in s])

    left, right = lane.line_types
    return LaneShape(line(0.0), 2 * half, (line(-half), line(half)), (int(left), int(right)))


def is_dashed(line: int) -> bool:
    """Whether a line may be crossed."""
    return line == LineType.STRIPED


def is_drawn(line: int) -> bool:
    """Whether there is a line at all."""
    return line != LineType.NONE
