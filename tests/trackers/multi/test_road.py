"""What a map says of points on and off its lanes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from trackers.multi.road import RoadMap

BEND = [[0.0, 0.0], [100.0, 0.0], [100.0, 50.0]]
coordinates = st.floats(-200, 200)


def plain_locate(road, point):
    """Depth in the nearest piece, in a loop."""
    best = (-np.inf, 0.0)
    for a, b, half in zip(*road, strict=True):
        t = min(max((point - a) @ (b - a) / ((b - a) @ (b - a)), 0.0), 1.0)
        depth = half - np.linalg.norm(point - a - t * (b - a))
        if depth > best[0]:
            best = (depth, np.arctan2(*(b - a)[::-1]))
    return best


def test_depth_and_direction_by_hand():
    road = RoadMap.of([(BEND, 4.0)])
    depth, direction = road.locate(np.array([[50.0, 0.5], [50.0, -3.0], [99.0, 30.0], [-3.0, 4.0]]))
    np.testing.assert_allclose(depth, [1.5, -1.0, 1.0, -3.0])
    np.testing.assert_allclose(direction, [0.0, 0.0, np.pi / 2, 0.0])


def test_the_deepest_lane_wins_and_gives_the_direction():
    road = RoadMap.of([([[0, 0], [100, 0]], 4.0), ([[100, 3], [0, 3]], 4.0)])
    _, direction = road.locate(np.array([[50.0, 1.0], [50.0, 2.0]]))
    np.testing.assert_allclose(np.abs(direction), [0.0, np.pi])


@given(st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=8))
def test_it_agrees_with_a_loop(points):
    road = RoadMap.of([(BEND, 4.0), ([[0, 10], [-50, 90]], 3.0)])
    depth, _ = road.locate(np.array(points))
    np.testing.assert_allclose(depth, [plain_locate(road, np.array(p))[0] for p in points], atol=1e-9)


@given(st.floats(-np.pi, np.pi), coordinates, coordinates)
def test_turning_the_world_turns_the_answer(angle, x, y):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    line, point = np.array([[0.0, 0.0], [80.0, 30.0]]), np.array([[x, y]])
    depth, direction = RoadMap.of([(line, 4.0)]).locate(point)
    turned, new = RoadMap.of([(line @ turn.T, 4.0)]).locate(point @ turn.T)
    np.testing.assert_allclose(turned, depth, atol=1e-9)
    np.testing.assert_allclose(np.exp(1j * new), np.exp(1j * (direction + angle)), atol=1e-9)


def test_without_lanes_everything_is_off_the_road():
    for road in (RoadMap.of([]), RoadMap.of([([[1.0, 2.0]], 4.0)])):  # a point is no lane
        depth, direction = road.locate(np.zeros((3, 2)))
        assert (depth == -np.inf).all()
        assert direction.shape == (3,)


def test_no_points_give_no_answers():
    depth, direction = RoadMap.of([(BEND, 4.0)]).locate(np.zeros((0, 2)))
    assert depth.shape == direction.shape == (0,)


def test_a_repeated_point_of_a_centre_line_changes_nothing():
    clean = RoadMap.of([([[0, 0], [50, 0], [100, 0]], 4.0)])
    repeated = RoadMap.of([([[0, 0], [50, 0], [50, 0], [100, 0]], 4.0)])
    xy = np.array([[10.0, 1.0], [50.0, 0.5], [70.0, -3.0]])
    for one, other in zip(clean.locate(xy), repeated.locate(xy), strict=True):
        np.testing.assert_array_equal(one, other)
