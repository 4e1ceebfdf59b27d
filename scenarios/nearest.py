"""A road network that finds the lane under a vehicle without a projection on every lane there is.

highway-env asks every vehicle for its lane after every frame, each time of all lanes: half of a simulated frame where a
junction has thirty of them. A lane whose bounding box is farther away than the best one found cannot be the nearest.
"""

from typing import NamedTuple

import numpy as np
from highway_env.road.lane import AbstractLane, StraightLane
from highway_env.road.road import LaneIndex, RoadNetwork
from numpy.typing import NDArray

SPACING = 2.0  # [m] between samples of a lane that is not straight; its box is widened by as much
SHARE = 0.8  # distance of a lane, as a share of that of its points: `SineLane` takes a chord for its arc
MARGIN = 2.0  # [m] that a distance to a lane may fall short: the foot on a `PathLane` is found in a few steps


class LaneBoxes(NamedTuple):
    """All L lanes of a network in its own order, and the boxes that hold their centre lines."""

    name: list[LaneIndex]
    lane: list[AbstractLane]
    low: NDArray  # (L, 2) [m]
    high: NDArray  # (L, 2) [m]


class SiftedNetwork(RoadNetwork):
    """A RoadNetwork that leaves far lanes out of the search for the nearest."""

    _boxes: LaneBoxes | None = None

    def add_lane(self, _from: str, _to: str, lane: AbstractLane) -> None:
        """Add a lane, as `RoadNetwork.add_lane`."""
        super().add_lane(_from, _to, lane)
        self._boxes = None

    def get_closest_lane_index(self, position: NDArray, heading: float | None = None) -> LaneIndex:
        """Index of the lane closest to a position (2,) [m] and heading [rad], of equals the first, as RoadNetwork."""
        if self._boxes is None:
            self._boxes = lane_boxes(self)
        names, lanes, low, high = self._boxes
        apart = np.maximum(np.maximum(low - position, position - high), 0.0)
        bound = SHARE * np.hypot(apart[:, 0], apart[:, 1]) - MARGIN
        least, found = np.inf, 0
        for k in bound.argsort(kind="stable").tolist():
            if bound[k] > least:
                break
            distance = lanes[k].distance_with_heading(position, heading)
            if distance < least or (distance == least and k < found):
                least, found = distance, k
        return names[found]


def lane_boxes(network: RoadNetwork) -> LaneBoxes:
    """Bounding boxes of all lanes of a network."""
    found = [
        ((start, end, k), lane, *_box(lane))
        for start, ends in network.graph.items()
        for end, lanes in ends.items()
        for k, lane in enumerate(lanes)
    ]
    names, lanes, low, high = (list(column) for column in zip(*found, strict=True))
    return LaneBoxes(names, lanes, np.array(low), np.array(high))


def _box(lane: AbstractLane) -> tuple[NDArray, NDArray]:
    straight = type(lane) is StraightLane
    pieces = 1 if straight else int(np.ceil(lane.length / SPACING))
    points = np.array([lane.position(s, 0.0) for s in np.linspace(0.0, lane.length, pieces + 1)])
    widen = 0.0 if straight else SPACING
    return points.min(0) - widen, points.max(0) + widen


def sifted(network: RoadNetwork) -> RoadNetwork:
    """Turn a stock network into a sifted one in place and return it; all references to it see the change."""
    if type(network) is RoadNetwork:
        network.__class__ = SiftedNetwork
    return network
