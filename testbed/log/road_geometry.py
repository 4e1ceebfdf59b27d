"""The lanes of a road as the log draws them."""

from collections.abc import Sequence

from scenarios.lanes import LaneShape, is_dashed, is_drawn
from testbed.log.record import RoadGeometry


def road_geometry(lanes: Sequence[LaneShape]) -> RoadGeometry:
    """Lines and surfaces of a road, for the log to draw."""
    lines = [pair for lane in lanes for pair in zip(lane.borders, lane.lines, strict=True)]
    return RoadGeometry(
        edges=tuple(line for line, kind in lines if is_drawn(kind) and not is_dashed(kind)),
        lane_lines=tuple(line for line, kind in lines if is_dashed(kind)),
        surface=tuple(lane.centre for lane in lanes),
        half_width=tuple(lane.width / 2 for lane in lanes),
    )
