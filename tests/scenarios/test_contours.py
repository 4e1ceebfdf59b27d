"""Contours: simple, oriented outlines whose bounding box is the unit box."""

import numpy as np
import pytest
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
