"""What other detections hide of a body."""

from dataclasses import replace

import numpy as np
import pytest

from tests.trackers.size.bodies import DT, sized
from trackers import Scan, SensorModel, find, prior
from trackers.batch import stack
from trackers.geometry import unit
from trackers.scan import DepthProfile
from trackers.shade import Shade
from trackers.size.grid import LENGTH, WIDTH
from trackers.size.hidden import CELLS, Around, open_rooms
from trackers.size.hits import Boxes, depths, hits_of, lit, views
from trackers.size.profile import Profiles
from trackers.size.visible import room

STEP = np.radians(0.2)
OUTLINE = DepthProfile(inside=0.02, surface_std=0.05, weight=0.35, least_room=(0.5, 0.1), hides_within=0.7 * STEP)
GRIDS = (LENGTH, WIDTH)


def ray_ends(azimuths, boxes):
    """First points (M, 2) and box (M,) of rays from the origin that meet boxes (x from, x to, y from, y to)."""
    points, owners = [], []
    for a in azimuths:
        u = unit(a)
        best = (np.inf, -1)
        for k, (x0, x1, y0, y1) in enumerate(boxes):
            with np.errstate(divide="ignore"):
                t = np.sort([np.array([x0, x1]) / u[0], np.array([y0, y1]) / u[1]], axis=1)
            enter, leave = t[:, 0].max(), t[:, 1].min()
            if 0 < enter < leave:
                best = min(best, (enter, k))
        if best[1] >= 0:
            points.append(best[0] * u)
            owners.append(best[1])
    return np.array(points), np.array(owners)


def view(boxes, seam=0.0):
    """A scan of the boxes by rays, whose the detections are, and the sensor's share of it; the sensor may be turned."""
    xy, owner = ray_ends(np.arange(-0.6, 0.6, STEP), boxes)
    return Scan.from_xy(xy, pose=(0.0, 0.0, seam), noise=(0.02, 0.001, np.nan)), owner


BEHIND = (30.0, 34.5, -0.9, 0.9)  # a car
BEFORE = (10.0, 14.5, -3.0, 0.05)  # hides the right of its rear: of y < 0.15 at 30 m nothing is seen


@pytest.mark.parametrize("seam", [0.0, np.pi])
def test_of_a_rear_behind_another_car_the_part_that_is_not_hidden_is_open(seam):
    scan, owner = view([BEHIND, BEFORE], seam)
    mine = owner == 0
    boxes = Boxes(np.array([[32.25, 0.0, 0.0]]), np.array([[4.5, 1.8]]), np.array([[-1.0, 1.0]]))
    profiles = Profiles.of((SensorModel(max_range=200.0, fov=7.0, profile=OUTLINE),))
    hits = hits_of(scan, (np.flatnonzero(mine),), np.zeros(mine.sum(), int), boxes.pose, profiles, 0.2)
    of_length, of_width = open_rooms(GRIDS, hits, boxes, lit(hits, boxes), Around(scan, owner))
    assert of_length == []  # the sensor sees no side
    n = 5  # no offset
    got = of_width[0].far[0, len(GRIDS[1].sizes) - 1 - np.arange(len(GRIDS[1].sizes)) + n] - of_width[0].near[0, n]
    seen = 0.9 - 30.0 * 0.05 / 14.5
    np.testing.assert_allclose(got, np.minimum(GRIDS[1].sizes, seen), atol=0.15)
    alone, _ = view([BEHIND])
    nobody = np.zeros(alone.mask.shape, int)
    whole = open_rooms(GRIDS, hits, boxes, lit(hits, boxes), Around(alone, nobody))[1][0]
    lengths = GRIDS[1].sizes
    np.testing.assert_allclose(whole.far[0, len(lengths) - 1 - np.arange(len(lengths)) + n] - whole.near[0, n], lengths)
    assert whole.share[0] == pytest.approx(1.0)


def test_an_end_outside_of_the_field_of_view_has_no_room():
    """A car ahead to the right, its rear 1 degree outside: only the front part of its side is open."""
    boxes = Boxes(np.array([[17.25, -4.0, 0.0]]), np.array([[4.5, 1.8]]), np.array([[-1.0, 1.0]]))
    edge = np.arctan2(3.1, 15.0) - np.radians(1.0)  # of the field of view; the near corner is at (15, -3.1)
    profiles = Profiles.of((SensorModel(max_range=200.0, fov=2 * edge),))
    scan = Scan.from_xy(np.array([[18.5, -3.1], [19.0, -3.2]]), noise=(0.1, 0.001, np.nan))
    hits = hits_of(scan, (np.arange(2),), np.zeros(2, int), boxes.pose, profiles, 0.2)
    (of_length,), (of_width,) = open_rooms(GRIDS, hits, boxes, lit(hits, boxes), None)
    np.testing.assert_array_equal(of_width.share, 0.0)
    begins = 3.1 / np.tan(edge) - 15.0  # [m] behind the rear, where the side comes into view
    np.testing.assert_allclose(of_length.share, 1 - begins / 4.5, atol=0.06)
    whole = Profiles.of((SensorModel(max_range=200.0, fov=2.0),))
    inside = hits_of(scan, (np.arange(2),), np.zeros(2, int), boxes.pose, whole, 0.2)
    assert open_rooms(GRIDS, inside, boxes, lit(inside, boxes), None) == [[], []]


def edge_of_view(distance, beyond, noise=0.0087):
    """Shares of the side of a car, its heading 5 degrees off the line of sight, that are open at the edge of a view.

    The middle of its box lies so many metres beyond the edge; and by how much the field of view is wider.
    """
    edge = np.radians(10.0)
    centre = distance * unit(edge) + beyond * unit(edge + np.pi / 2)
    boxes = Boxes(np.array([[*centre, edge + np.radians(5.0)]]), np.array([[4.5, 1.8]]), np.array([[-1.0, -1.0]]))
    scan = Scan.from_xy(np.array([(distance - 2.0) * unit(edge - 0.001)]), noise=(0.1, noise, np.nan))
    hits = hits_of(scan, (np.zeros(1, int),), np.zeros(1, int), boxes.pose, NARROW, 0.2)
    (of_length,), _ = open_rooms(GRIDS, hits, boxes, lit(hits, boxes), None)
    return of_length.share[0], views(hits, boxes)[0] - 2 * edge


NARROW = Profiles.of((SensorModel(max_range=200.0, fov=np.radians(20.0)),))


def test_far_away_noise_hides_where_a_view_ends_and_near_by_it_does_not():
    """The side of a car lies 0.2 m beyond the edge; at 130 m that may as well be the noise of its place."""
    for distance, beyond, seen in ((130.0, -0.7, True), (130.0, 4.0, False), (12.0, -0.7, False)):
        share, wider = edge_of_view(distance, beyond)
        assert bool(share > 0.9) is seen
        assert seen or share < 0.1
        noise, half = 0.0087 * (distance - 2.0), 0.5 * (4.5 * np.sin(np.radians(5.06)) + 1.8 * np.cos(np.radians(5.06)))
        assert wider == pytest.approx(2 * 0.0087 * noise**2 / (noise**2 + half**2 / 3), rel=1e-3)  # (ENDS.49)
    assert edge_of_view(130.0, -0.7, noise=1e-4)[0] < 0.5  # the twin: a radar without noise knows


@pytest.mark.parametrize("size", [0.8, np.nextafter(0.8, 1.0)])
def test_a_face_of_which_rounding_is_in_view_is_not_seen(size):
    """A motorcycle as wide as thirteen cells, where the sensor sees what is beyond: width and last cell may differ."""
    beyond = CELLS[1].edges[None] > 0.75
    got = room(GRIDS[1], CELLS[1], beyond, np.array([0]), np.array([size]), np.zeros(1, bool))
    np.testing.assert_array_equal(got.share, 0.0)


def test_owners_are_those_of_the_objects_that_count():
    around = Around(Scan.from_xy(np.zeros((5, 2))), np.array([3, -1, 0, 2, 5])).among(np.array([0, 3, 5]))
    np.testing.assert_array_equal(around.owner, [1, -1, 0, -1, 2])


def width_after(profile, scans=25):
    """Width and its std of a car of which 0.75 m are seen, between the others of the scan.

    The inner filter is one of contours: the others take the part that is seen for the middle of the rear.
    """
    f = sized(find("pmht-spline"), sensors=(SensorModel(max_range=200.0, fov=7.0, profile=profile),))
    scan, owner = view([BEHIND, BEFORE])
    share = Scan.from_xy(scan.xy[owner == 0][None], noise=(0.02, 0.001, np.nan))
    state = f.init(stack([prior((32.25, 0.0, 0.0), size=(4.5, 1.8))]))
    for _ in range(scans):
        state = f.update_among(f.predict(state, DT), share, scan, np.where(owner == 0, 0, -1))[0]
    e = f.estimate(state)
    return e.size[0, 1], e.size_std[0, 1]


def test_a_car_whose_rear_is_partly_hidden_is_no_narrower():
    width, _ = width_after(OUTLINE)
    assert width > 1.6


def test_where_nothing_hides_the_same_car_is_taken_for_a_narrow_vehicle():
    width, _ = width_after(replace(OUTLINE, hides_within=0.0))
    assert width < 1.3


ASLANT = np.array([32.25, 4.0, 0.0])  # a car to the left ahead, whose right side is seen, from 30 to 34.5 m at y = 3.1
SPARSE = SensorModel(max_range=200.0, fov=2.0, profile=DepthProfile(inside=0.2))


def between(x0, x1, row=7, nearest=10.0):
    """What hides the part of that side from x0 to x1 [m]."""
    low, high = np.arctan2(3.1, [x1, x0])
    one = ([[(low + high) / 2]], [[(high - low) / 2]], [[0.0]], [[nearest]])
    return Shade(np.array([row]), *map(np.array, one))


def rooms_of(shade, model=SPARSE, row=3):
    """Rooms of length and width of the car, which is track `row`, its hits, boxes and lit ends."""
    boxes = Boxes(ASLANT[None], np.array([[4.5, 1.8]]), np.array([[-1.0, -1.0]]))
    scan = Scan.from_xy(np.array([[30.1, 4.0], [30.2, 3.2]]), noise=(0.1, 0.001, np.nan))
    hits = hits_of(scan, (np.arange(2),), np.zeros(2, int), boxes.pose, Profiles.of((model,)), 0.2)
    around = Around(scan, np.zeros(2, int), shade, np.array([row]))
    return open_rooms(GRIDS, hits, boxes, lit(hits, boxes), around), hits, boxes


def test_of_a_side_in_the_shade_the_rest_is_open():
    (of_length, of_width), *_ = rooms_of(between(31.0, 33.0))
    assert of_width == []
    n = 10  # no offset
    L = GRIDS[0].sizes
    got = of_length[0].far[0, len(L) - 1 - np.arange(len(L)) + n] - of_length[0].near[0, n]
    np.testing.assert_allclose(got, np.minimum(L, 1.0) + np.maximum(L - 3.0, 0.0), atol=0.13)
    np.testing.assert_allclose(of_length[0].share, 2.5 / 4.5, atol=0.03)
    assert of_length[0].shaded.all()


@pytest.mark.parametrize(
    ("shade", "model"),
    [
        (between(31.0, 33.0, row=3), SPARSE),  # itself
        (between(31.0, 33.0, nearest=34.0), SPARSE),  # no nearer
        (between(70.0, 80.0), SPARSE),  # beyond what any vehicle reaches
        (between(31.0, 33.0), replace(SPARSE, profile=OUTLINE)),  # a sensor whose detections say what hides
        (None, SPARSE),
    ],
)
def test_what_no_other_track_hides_has_no_room_for_it(shade, model):
    rooms, *_ = rooms_of(shade, model)
    assert not any(room.shaded.any() for some in rooms for room in some)
    assert model is not SPARSE or rooms == [[], []]


def test_what_is_made_through_the_end_is_seen_wherever_the_side_is_in_the_shade():
    """(ENDS.51): nu eta of what is even over the body, where the side counts as far as it is seen."""
    rooms, hits, boxes = rooms_of(between(31.0, 33.0))
    facing = lit(hits, boxes)
    z = depths(hits, boxes, facing, rooms)
    end, side = facing.shown.T * [[1.0], [rooms[0][0].share[0]]]
    eta = end / (end + side)
    np.testing.assert_allclose(z[0].through, 0.2 * eta / (1 - 0.8 * eta))
    np.testing.assert_allclose(z[0].face, 0.8 * eta)
    np.testing.assert_array_equal(z[1].through, 0.0)
    one_of_two = [[rooms[0][0]._replace(shaded=np.array([True, False]))], []]  # a view cuts off the other one
    np.testing.assert_array_equal(depths(hits, boxes, facing, one_of_two)[0].through > 0, [True, False])
    np.testing.assert_array_equal(depths(hits, boxes, facing, [[], []])[0].through, 0.0)


def truck_of_which_the_rear_is_seen(shade, scans=80):
    """Length and its std of a truck aslant, of which only the rear has detections, by a radar that shows no inside."""
    rng, f = np.random.default_rng(3), sized(sensors=(replace(SPARSE, profile=DepthProfile(inside=0.01)),))
    state = f.init(stack([prior((32.25, 4.35, 0.0), size=(4.5, 2.5))]))
    for _ in range(scans):
        xy = np.c_[30.0 + rng.exponential(0.12, 3), 4.35 + rng.uniform(-1.25, 1.25, 3)] + rng.normal(0, 0.1, (3, 2))
        scan = Scan.from_xy(xy, noise=(0.1, 0.003, np.nan))
        share = Scan.from_xy(xy[None], noise=(0.1, 0.003, np.nan))
        state = f.update_among(f.predict(state, DT), share, scan, np.zeros(3, int), shade)[0]
    e = f.estimate(state)
    return e.size[0, 0], e.size_std[0, 0]


def test_a_truck_of_which_others_leave_only_the_rear_in_view_may_be_long():
    """It was 2 m long, and sure of it: its side has no detections, for it cannot have any."""
    length, std = truck_of_which_the_rear_is_seen(between(30.3, 60.0))
    assert length + 2 * std > 12.0
    assert std > 1.0
    short, sure = truck_of_which_the_rear_is_seen(None)
    assert short + 3 * sure < 3.0  # the twin
