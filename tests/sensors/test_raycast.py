"""The ray caster against a slow, obvious reference, and against geometry worked out by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sensors.raycast import cast, cast_bodies, crossings, outline_edges
from sensors.scene import boxes_scene
from trackers.geometry import box_corners


def slow_cast(origin, bearing, a, b):
    """One ray and one segment at a time; the rules of `sensors.raycast` in plain Python."""
    best, hit = math.inf, -1
    ux, uy = float(np.cos(bearing)), float(np.sin(bearing))
    for s in range(len(a)):
        ax, ay = a[s][0] - origin[0], a[s][1] - origin[1]
        bx, by = b[s][0] - origin[0], b[s][1] - origin[1]
        sa, sb = ux * ay - uy * ax, ux * by - uy * bx
        if (sa >= 0) == (sb >= 0):
            continue
        t = sa / (sa - sb)
        r = ux * (ax + t * (bx - ax)) + uy * (ay + t * (by - ay))
        if r > 1e-9 and r < best:
            best, hit = r, s
    return best, hit


def agree(origin, bearing, a, b):
    r, segment = cast(origin, bearing, a, b)
    expected = [slow_cast(origin, angle, a, b) for angle in bearing]
    np.testing.assert_array_equal(segment, [hit for _, hit in expected])
    np.testing.assert_array_equal(r, [best for best, _ in expected])


def random_polygons(rng, count):
    """Star-shaped polygons of 3 to 9 vertices, some of them on a coarse grid so that they touch and share vertices."""
    outlines = []
    for _ in range(count):
        n = rng.integers(3, 10)
        angle = np.sort(rng.uniform(0, 2 * np.pi, n))
        xy = rng.uniform(-8, 8, 2) + rng.uniform(0.5, 4, (n, 1)) * np.stack([np.cos(angle), np.sin(angle)], -1)
        outlines.append(np.round(xy) if rng.random() < 0.5 else xy)
    return outlines


@pytest.mark.parametrize("seed", range(4))
def test_every_hit_object_and_edge_agrees_with_the_slow_reference_in_random_scenes(seed):
    rng = np.random.default_rng(seed)
    for _ in range(600):
        edges = outline_edges(random_polygons(rng, rng.integers(1, 5)))
        origin = np.round(rng.uniform(-8, 8, 2)) if rng.random() < 0.5 else rng.uniform(-8, 8, 2)
        through = edges.a[rng.integers(len(edges.a), size=4)] - origin  # rays through vertices
        bearing = np.concatenate([np.arctan2(through[:, 1], through[:, 0]), rng.uniform(-4, 4, 4), [np.pi, -np.pi, 0]])
        agree(origin, bearing, edges.a, edges.b)


GRID = st.integers(-3, 3).map(float)


@given(
    arrays(float, (2,), elements=GRID),
    arrays(float, (6, 2, 2), elements=GRID),
    st.lists(st.integers(-16, 16).map(lambda k: k * np.pi / 8), min_size=1, max_size=8),
)
def test_segments_on_a_grid_agree_with_the_slow_reference_in_every_degenerate_place(origin, segments, bearing):
    agree(origin, np.array(bearing), segments[:, 0], segments[:, 1])


def test_a_box_ahead_is_hit_at_its_near_side():
    bodies = boxes_scene([[10.0, 0.0, 0.0]], [[4.0, 2.0]]).bodies
    hits = cast_bodies(np.zeros(2), np.array([0.0, np.arctan2(0.5, 8.0), np.pi]), bodies)
    np.testing.assert_allclose(hits.range, [8.0, math.hypot(8.0, 0.5), np.inf], rtol=1e-12)
    assert hits.edge.tolist() == [1, 1, -1]  # from rear left to rear right
    assert hits.body.tolist() == [0, 0, -1]


def test_no_ray_from_inside_a_polygon_escapes_even_through_a_vertex():
    corners = box_corners(np.array([0.3, -0.2, 0.7]), np.array([4.0, 2.0]))
    origin = np.array([0.31, -0.15])
    d = corners - origin
    bearing = np.concatenate([np.linspace(-np.pi, np.pi, 3600), np.arctan2(d[:, 1], d[:, 0])])
    edges = outline_edges([corners])
    assert np.isfinite(cast(origin, bearing, edges.a, edges.b)[0]).all()


def test_between_touching_bodies_no_ray_slips_through():
    bodies = boxes_scene([[10.0, 1.0, 0.0], [10.0, -1.0, 0.0]], [[4.0, 2.0]] * 2).bodies
    hits = cast_bodies(np.zeros(2), np.linspace(-0.2, 0.2, 4001), bodies)
    assert np.isfinite(hits.range).all()
    assert set(hits.body[np.linspace(-0.2, 0.2, 4001) > 1e-6]) == {0}


def test_of_two_equal_segments_the_lower_index_is_reported():
    a, b = np.array([[5.0, 1.0]] * 3), np.array([[5.0, -1.0]] * 3)
    r, segment = cast(np.zeros(2), np.zeros(1), a, b)
    assert (r[0], segment[0]) == (5.0, 0)


def test_turning_a_full_turn_changes_no_hit():
    edges = outline_edges(list(boxes_scene([[-10.0, 0.0, 0.4], [7, 3, 1]], [[4.0, 2.0]] * 2).bodies.outline))
    bearing = np.linspace(-np.pi, np.pi, 721) + 0.001
    base = cast(np.zeros(2), bearing, edges.a, edges.b)
    turned = cast(np.zeros(2), bearing + 2 * np.pi, edges.a, edges.b)
    np.testing.assert_array_equal(base[1], turned[1])
    np.testing.assert_allclose(base[0], turned[0], rtol=1e-9)


def test_a_scene_without_bodies_hits_nothing():
    hits = cast_bodies(np.zeros(2), np.linspace(-3, 3, 10), boxes_scene(np.zeros((0, 3)), np.zeros((0, 2))).bodies)
    assert np.isinf(hits.range).all()
    assert (hits.body == -1).all()
    assert (hits.edge == -1).all()


def test_a_sensor_on_a_vertex_sees_the_far_sides_only():
    edges = outline_edges([np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]])])
    r, segment = cast(np.zeros(2), np.radians([10.0, 80.0, 200.0]), edges.a, edges.b)
    assert segment.tolist() == [1, 2, -1]
    np.testing.assert_allclose(r[:2], [4 / math.cos(math.radians(10)), 2 / math.sin(math.radians(80))])


def test_segments_out_of_reach_are_left_out_and_no_crossing_within_it_is_lost():
    rng, left_out = np.random.default_rng(8), 0
    for _ in range(40):
        edges = outline_edges(random_polygons(rng, 12))
        a, b = 3.0 * edges.a, 3.0 * edges.b
        a[0], b[0] = [-40.0, 0.5], [40.0, 0.5]  # both ends far away, its middle near
        origin, reach = rng.uniform(-5, 5, (3, 2)), rng.uniform(1, 25, 3)
        view = np.repeat(np.arange(3), 90)
        bearing = rng.uniform(-4, 4, len(view))
        every = crossings(origin, view, bearing, a, b)
        near = crossings(origin, view, bearing, a, b, reach)
        left_out += len(every.ray) - len(near.ray)
        for found in (every, near):
            assert len(found.ray)
        inside = [np.flatnonzero(found.range <= reach[view[found.ray]]) for found in (every, near)]
        for column, shorter in zip(every, near, strict=True):
            np.testing.assert_array_equal(shorter[inside[1]], column[inside[0]])
    assert left_out > 1000
