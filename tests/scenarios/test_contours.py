"""Contours: simple, oriented outlines whose bounding box is the unit box, and what becomes of them at other sizes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon

from scenarios.contours import CONTOURS, Contour, find
from trackers.geometry import to_frame


@pytest.fixture(params=CONTOURS.values(), ids=CONTOURS.keys())
def contour(request):
    return request.param


def test_the_classes_of_the_issue_are_there():
    assert {"car", "van", "bus", "truck", "tractor", "tractor-unit", "trailer", "motorcycle"} <= CONTOURS.keys()


def test_outline_is_a_simple_polygon(contour):
    assert Polygon(contour.points).is_valid
    assert np.linalg.norm(np.diff(contour.points, axis=0, append=contour.points[:1]), axis=1).min() > 1e-3


def test_outline_runs_counter_clockwise(contour):
    assert Polygon(contour.points).exterior.is_ccw


def test_outline_touches_the_unit_box(contour):
    assert Polygon(contour.points).bounds == (-0.5, -0.5, 0.5, 0.5)


def test_outline_is_symmetric_about_its_axis(contour):
    mirrored = {(x, -y) for x, y in contour.outline}
    assert mirrored == set(contour.outline)


def test_outline_has_12_to_24_vertices_unless_it_is_a_box(contour):
    assert len(contour.outline) == 4 if contour.name == "box" else 12 <= len(contour.outline) <= 24


def test_placed_outline_has_the_size_of_the_vehicle(contour):
    pose, size = np.array([30.0, -7.0, 2.3]), np.array([6.1, 2.2])
    local = to_frame(pose, contour.place(pose, size))
    # 1e-12 m: rounding of coordinates near 30 m
    np.testing.assert_allclose(np.ptp(local, axis=0), size, atol=1e-12)
    np.testing.assert_allclose(local.max(0) + local.min(0), 0, atol=1e-12)


@given(st.sampled_from(sorted(CONTOURS)), st.floats(0.5, 2.0), st.floats(0.7, 1.4))
def test_at_any_size_the_outline_is_simple_counter_clockwise_and_fills_its_box(name, longer, wider):
    size = find(name).size * (longer, wider)
    xy = find(name).fit(size)
    body = Polygon(xy)
    assert body.is_valid
    assert body.exterior.is_ccw
    np.testing.assert_array_equal([xy.min(0), xy.max(0)], [-size / 2, size / 2])


def test_at_its_default_size_an_outline_has_the_written_proportions(contour):
    np.testing.assert_allclose(contour.fit(contour.size), contour.points * contour.size, atol=1e-12)


@pytest.mark.parametrize("length", [8.0, 10.0, 12.0])
def test_a_longer_truck_has_the_same_cab_and_a_longer_load(length):
    xy = find("truck").fit(np.array([length, 2.45]))
    cab, load = xy[xy[:, 0] > length / 2 - 2.3], xy[np.isclose(np.abs(xy[:, 1]), 2.45 / 2)]
    assert np.ptp(cab[:, 0]) == pytest.approx(0.265 * 8.1)  # as at 8.1 m
    assert np.ptp(load[:, 0]) == pytest.approx(length - 0.295 * 8.1)


@pytest.mark.parametrize("length", [5.0, 6.0])
def test_the_cab_of_a_short_truck_shrinks_with_it(length):
    xy = find("truck").fit(np.array([length, 2.2]))
    load = xy[np.isclose(np.abs(xy[:, 1]), 1.1)]
    assert np.ptp(load[:, 0]) == pytest.approx(length * (1 - 0.295 / 0.85))  # ends as at 85 % of 8.1 m, in proportion


def test_wheels_and_bonnet_of_a_farm_tractor_grow_with_it():
    small, large = (find("tractor").fit(np.array([length, 2.4])) for length in (4.2, 5.6))
    np.testing.assert_allclose(large[:, 0] / small[:, 0], 5.6 / 4.2)


def test_a_farm_tractor_is_narrow_in_front_and_wide_at_the_rear_wheels():
    xy = find("tractor").points
    front, rear = xy[xy[:, 0] > 0.45], xy[(xy[:, 0] < 0)]
    assert np.ptp(front[:, 1]) < 0.4 * np.ptp(rear[:, 1])


def test_a_sedan_fills_less_of_its_corners_than_a_bus():
    assert Polygon(find("car").points).area < Polygon(find("bus").points).area < 1


def test_find_suggests_the_nearest_name():
    with pytest.raises(LookupError, match="did you mean 'tractor-unit'"):
        find("tractor-unti")


def test_an_outline_that_leaves_a_side_of_the_box_free_is_refused():
    with pytest.raises(ValueError, match="unit box"):
        Contour("thin", 4.0, 2.0, ((0.5, 0.4), (-0.5, 0.4), (-0.5, -0.4), (0.5, -0.4)))


def test_a_clockwise_outline_is_refused():
    with pytest.raises(ValueError, match="counter-clockwise"):
        Contour("back", 4.0, 2.0, ((0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)))


@pytest.mark.parametrize("ends", [(-0.6, 0.5), (0.1, 0.0), (-0.05, 0.09)])
def test_ends_without_a_middle_are_refused(ends):
    with pytest.raises(ValueError, match="ends must be"):
        Contour("ends", 4.0, 2.0, find("box").outline, ends=ends)
