"""Lanes as polylines."""

import numpy as np
import pytest
from highway_env.road.lane import CircularLane, LineType, SineLane, StraightLane
from highway_env.road.road import RoadNetwork

from scenarios.lanes import STEP, is_dashed, is_drawn, lane_shapes


def shape(lane):
    network = RoadNetwork()
    network.add_lane("a", "b", lane)
    (found,) = lane_shapes(network)
    return found


def test_a_straight_lane_is_its_two_ends():
    lane = shape(StraightLane([0, 4], [100, 4], width=3.0, line_types=(LineType.CONTINUOUS, LineType.STRIPED)))
    np.testing.assert_allclose(lane.centre, [[0, 4], [100, 4]])
    left, right = lane.borders
    np.testing.assert_allclose(left, [[0, 2.5], [100, 2.5]])  # y points down: left of +x is -y
    np.testing.assert_allclose(right, [[0, 5.5], [100, 5.5]])
    assert lane.width == 3.0
    assert lane.lines == (LineType.CONTINUOUS, LineType.STRIPED)


@pytest.mark.parametrize("clockwise", [False, True])
def test_the_points_of_a_circular_lane_lie_on_their_circles(clockwise):
    turn = np.pi if clockwise else -np.pi
    lane = shape(CircularLane([5, -3], 20.0, 0.0, turn, clockwise=clockwise, width=4.0))
    radii = [np.hypot(*(line - [5, -3]).T) for line in (lane.centre, *lane.borders)]
    np.testing.assert_allclose(radii[0], 20.0)
    sides = (22.0, 18.0) if clockwise else (18.0, 22.0)
    np.testing.assert_allclose(radii[1], sides[0])
    np.testing.assert_allclose(radii[2], sides[1])
    assert np.hypot(*np.diff(lane.centre, axis=0).T).max() <= STEP


def test_a_bent_lane_that_looks_straight_by_its_class_is_sampled_all_the_same():
    """A sine lane is a StraightLane to isinstance."""
    lane = shape(SineLane([0, 0], [60, 0], amplitude=2.0, pulsation=np.pi / 30, phase=0.0))
    assert len(lane.centre) > 10
    assert np.ptp(lane.centre[:, 1]) == pytest.approx(4.0, abs=0.2)


def test_a_very_short_bent_lane_has_two_points():
    assert shape(SineLane([0, 0], [1, 0], 0.1, 1.0, 0.0)).centre.shape == (2, 2)


def test_a_network_gives_all_its_lanes():
    network = RoadNetwork.straight_road_network(lanes=3)
    shapes = lane_shapes(network)
    assert len(shapes) == 3
    assert len({float(lane.centre[0, 1]) for lane in shapes}) == 3


@pytest.mark.parametrize(
    ("line", "drawn", "dashed"),
    [
        (LineType.NONE, False, False),
        (LineType.STRIPED, True, True),
        (LineType.CONTINUOUS, True, False),
        (LineType.CONTINUOUS_LINE, True, False),
    ],
)
def test_kinds_of_lines(line, drawn, dashed):
    assert (is_drawn(line), is_dashed(line)) == (drawn, dashed)
