"""What a map says of points on and off its lanes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from trackers.geometry import rotation
from trackers.multi.road import Bends, RoadMap

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


def arc(radius, turn=1.0, step=4.0):
    """Points (P, 2) on a circle to the left, from the origin eastwards."""
    angle = np.linspace(0.0, turn, round(turn * radius / step) + 1)
    return radius * np.c_[np.sin(angle), 1 - np.cos(angle)]


def on(line, share=0.5, offset=0.0):
    """The pose (1, 3) of a body that drives along a line, at a share of it, so far [m] to the left."""
    k = round(share * (len(line) - 2))
    d = line[k + 1] - line[k]
    course = np.arctan2(d[1], d[0])
    return np.array([[*((line[k] + line[k + 1]) / 2 + offset * np.array([-np.sin(course), np.cos(course)])), course]])


@given(st.floats(25, 2000), st.sampled_from([-1, 1]), st.floats(-np.pi, np.pi), st.floats(0, 1))
def test_the_curvature_of_a_circle_is_one_over_its_radius(radius, side, angle, share):
    line = (arc(radius, min(1.0, 200 / radius)) * [1, side]) @ rotation(angle).T + [30.0, -70.0]
    road = RoadMap.of([([[500.0, 0], [900.0, 0]], 4.0), (line, 4.0)])
    bends, pose = Bends.of(road), on(line, share)
    np.testing.assert_allclose(bends.at(pose), side / radius, rtol=0.05)  # of pieces of 4 m
    np.testing.assert_allclose(
        bends.at(pose + np.array([0, 0, np.pi])), -side / radius, rtol=0.05
    )  # the other way round
    np.testing.assert_array_equal(bends.at(pose + np.array([0, 0, np.pi / 2])), 0.0)  # across
    np.testing.assert_array_equal(bends.at(np.array([[700.0, 0.0, 0.0]])), 0.0)  # the straight lane


def test_off_the_lane_there_is_no_curvature_unless_asked_for():
    line = arc(100.0)
    bends = Bends.of(RoadMap.of([(line, 4.0)]))
    assert abs(bends.at(on(line, offset=1.9)) - 0.01) < 1e-4
    assert bends.at(on(line, offset=2.5)) == 0.0
    assert abs(bends.at(on(line, offset=2.5), beside=1.0) - 0.01) < 1e-4


def test_lanes_of_a_map_do_not_bend_into_each_other():
    """Each has the curvature that it has alone, also where one begins at the other's end, or is one piece."""
    lines = [arc(50.0), [[0.0, 200.0], [0.0, 300.0]], arc(80.0) * [1, -1] + [300.0, 0.0]]
    together = Bends.of(RoadMap.of([(line, 4.0) for line in lines])).curvature
    alone = [Bends.of(RoadMap.of([(line, 4.0)])) for line in lines]
    np.testing.assert_allclose(together, np.concatenate([alone[0].curvature, [0.0], alone[2].curvature]))
    assert alone[1] is None


def test_a_rough_line_is_nearly_straight_and_a_corner_is_no_circle_of_nothing():
    rng = np.random.default_rng(0)
    rough = np.c_[np.arange(0.0, 400.0), 0.02 * rng.standard_normal(400)]  # a lane that was measured each metre
    assert np.abs(Bends.of(RoadMap.of([(rough, 4.0)])).curvature[10:-10]).max() < 0.003
    corner = Bends.of(RoadMap.of([(np.array([[0.0, 0], [4, 0], [8, 0], [8, 4], [8, 8]]), 4.0)])).curvature
    assert 0.05 < np.abs(corner).max() <= 0.15


def test_where_all_lanes_are_straight_there_are_no_bends():
    for road in (None, RoadMap.of([]), RoadMap.of([([[0, 0], [50, 20], [100, 40]], 4.0)])):
        assert Bends.of(road) is None
