"""What stands around the road: a landscape that stays, seen across guard rails, with range rates of the ego motion."""

from dataclasses import replace

import numpy as np
import pytest

from sensors import RADARS, Radar, Roadside
from sensors.origin import STATIC
from sensors.roadside import landscape, rail_crossings, wall_distance
from sensors.scene import Ego, boxes_scene
from trackers.geometry import box_corners, to_frame, unit

IDEAL = RADARS["ideal"].sensors[0]
ROAD = np.array([[[-400.0, y], [400.0, y]] for y in (-8.0, 8.0)])
SURE = Roadside(density=0.2, depth=1e9, reach=1e6, beam_deg=1e6, share_astray=0.0)


def rig(options, **parameters):
    return Radar("test", "for a test", (replace(IDEAL, max_range=80.0, roadside=options, **parameters),))


def road(x=0.0, heading=0.0, velocity=(0.0, 0.0), cars=((500.0, 0.0, 0.0),), walls=ROAD):
    pose, size = np.array([x, 0.0, heading]), np.array([4.7, 1.9])
    ego = Ego(pose, np.array(velocity), 0.0, size, box_corners(pose, size))
    return boxes_scene(np.array(cars), np.tile([4.6, 1.8], (len(cars), 1)), ego=ego)._replace(walls=walls)


def standing(radar, scene, seed=0):
    scan, origin = radar.scan(scene, np.random.default_rng(seed))
    chosen = origin.kind == STATIC
    return scan.xy[chosen], scan.polar[chosen]


def test_without_the_option_a_scan_is_the_one_that_it_was():
    scene = road(velocity=(20.0, 0.0), cars=((20.0, 3.0, 0.0),))
    off = RADARS["imaging"]
    none = Roadside(density=0.0, on_road=0.0, share_astray=0.0)
    on = replace(off, sensors=(replace(off.sensors[0], roadside=none),))
    for a, b in zip(
        off.scan(scene, np.random.default_rng(1))[0], on.scan(scene, np.random.default_rng(1))[0], strict=True
    ):
        np.testing.assert_array_equal(a, b)


def test_points_lie_beside_the_road_only_and_as_densely_as_asked():
    xy, _ = standing(rig(SURE), road())
    assert (np.abs(xy[:, 1]) > 8.0).all()
    area = np.pi * 80.0**2 - 2 * (8 * np.sqrt(80.0**2 - 8**2) + 80.0**2 * np.arcsin(8 / 80.0))
    assert len(xy) == pytest.approx(0.2 * area, rel=0.03)


def test_on_the_road_they_lie_within_the_rails_and_without_rails_there_are_none():
    option = replace(SURE, density=0.0, on_road=0.1)
    xy, _ = standing(rig(option), road())
    assert len(xy) > 200
    assert (np.abs(xy[:, 1]) < 8.0).all()
    assert len(standing(rig(option), road(walls=np.zeros((0, 2, 2))))[0]) == 0


def test_the_landscape_stays_where_it_is_as_the_ego_moves_and_turns_and_differs_by_seed():
    here, _ = standing(rig(SURE), road(), seed=1)
    there, _ = standing(rig(SURE), road(x=30.0, heading=0.7), seed=2)
    both = [p[np.hypot(p[:, 0], p[:, 1]) < 45.0] for p in (here, there)]
    for a, b in ((both[0], there), (both[1], here)):
        assert len(a) > 300
        assert np.hypot(*(a[:, None] - b).transpose(2, 0, 1)).min(-1).max() < 1e-6
    other, _ = standing(rig(replace(SURE, seed=1)), road())
    assert np.hypot(*(here[:, None] - other).transpose(2, 0, 1)).min() > 1e-6


def test_cells_far_off_and_below_zero_hold_one_point_each_of_uniform_place():
    points, cell = landscape(np.array([-5e5, -40.0]), np.array([-5e5 + 200.0, 60.0]), 0.25, seed=3)
    place = points / 2.0 - cell
    assert ((place >= 0) & (place < 1)).all()
    assert len(np.unique(cell, axis=0)) == len(cell)
    assert np.abs(place.mean(0) - 0.5).max() < 0.02  # 4 standard deviations of the mean of 5000
    assert abs(np.corrcoef(place.T)[0, 1]) < 0.06


def test_points_grow_rarer_behind_the_rail_and_with_range_and_off_the_axis():
    deep, _ = standing(rig(replace(SURE, density=2.0, depth=5.0)), road())
    assert (np.abs(deep[:, 1]) - 8.0).mean() == pytest.approx(5.0, rel=0.06)
    option = replace(SURE, density=2.0, reach=40.0)
    _, far = standing(rig(option), road())
    whole, _ = standing(rig(replace(SURE, density=2.0)), road())
    rings = [((r > 38) & (r < 42)).sum() for r in (far[:, 0], np.hypot(whole[:, 0], whole[:, 1]))]
    assert rings[0] / rings[1] == pytest.approx(np.exp(-1), abs=0.05)
    _, narrow = standing(rig(replace(option, beam_deg=60.0)), road())
    wide, cut = (p[np.abs(np.abs(np.degrees(p[:, 1])) - 60.0) < 5.0, 0] for p in (far, narrow))
    assert wide.max() > 40.0
    assert 10.0 < cut.max() < 26.0  # the reach there is 40 m / e


def test_range_rates_are_those_of_ego_motion_and_a_share_is_seen_astray():
    _, polar = standing(rig(SURE), road(velocity=(20.0, 0.0)))
    np.testing.assert_allclose(polar[:, 2], -unit(polar[:, 1]) @ [20.0, 0.0], atol=1e-9)
    _, polar = standing(rig(replace(SURE, share_astray=0.3, astray_deg=2.0)), road(velocity=(20.0, 0.0)))
    rest = polar[:, 2] + unit(polar[:, 1]) @ [20.0, 0.0]
    assert (np.abs(rest) > 1e-6).mean() == pytest.approx(0.3, abs=0.05)


def test_a_vehicle_hides_what_stands_behind_it():
    clear, _ = standing(rig(SURE), road(heading=np.pi / 2))
    hidden, _ = standing(rig(SURE), road(heading=np.pi / 2, cars=((0.0, 6.0, 0.0),)))
    shadow = [np.abs(np.degrees(np.arctan2(p[:, 0], p[:, 1]))) < 15 for p in (clear, hidden)]
    assert (shadow[0] & (clear[:, 1] > 0)).sum() > 50
    assert not (shadow[1] & (hidden[:, 1] > 0)).any()


def test_crossings_and_distances_of_rails_by_hand():
    points = np.array([[0.0, 5.0], [10.0, 9.0], [3.0, -20.0], [450.0, 9.0]])
    np.testing.assert_array_equal(rail_crossings(np.zeros(2), points, ROAD), [0, 1, 1, 0])
    np.testing.assert_allclose(wall_distance(points, ROAD), [3.0, 1.0, 12.0, np.hypot(50.0, 1.0)])
    assert np.isinf(wall_distance(points, np.zeros((0, 2, 2)))).all()
    bent = np.array([[[5.0, -1.0], [5.0, 1.0]], [[7.0, -1.0], [7.0, 1.0]]])
    np.testing.assert_array_equal(rail_crossings(np.zeros(2), np.array([[6.0, 0.0], [9.0, 0.0]]), bent), [1, 2])


@pytest.mark.parametrize(
    ("change", "name"),
    [({"density": -1.0}, "density"), ({"reach": 0.0}, "reach"), ({"beam_deg": 0.0}, "beam_deg"),
     ({"depth": np.inf}, "depth"), ({"share_astray": 1.5}, "share_astray"), ({"on_road": np.nan}, "on_road")],
)  # fmt: skip
def test_a_wrong_option_is_refused_by_name(change, name):
    with pytest.raises(ValueError, match=f"roadside.{name} must be"):
        Roadside(**change)


def test_it_works_on_a_rig_of_which_one_radar_has_the_option():
    surround = RADARS["surround"]
    some = replace(surround, sensors=(replace(surround.sensors[0], roadside=SURE), *surround.sensors[1:]))
    scan, origin = some.scan(road(velocity=(20.0, 0.0), cars=((20.0, 3.0, 0.0),)), np.random.default_rng(0))
    assert ((origin.kind == STATIC) & (scan.sensor == 0)).sum() > 100
    local = to_frame(scan.pose[scan.sensor == 0][0], scan.xy[scan.sensor == 0])
    assert (np.abs(np.degrees(np.arctan2(local[:, 1], local[:, 0]))) < 13).all()
