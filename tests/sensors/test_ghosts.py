"""Ghosts: geometry by hand, visibility, range rates against the path, shares, and that they are off by default."""

from dataclasses import replace

import numpy as np
import pytest

from sensors import RADARS, Ghosts, Radar, Sensor
from sensors.origin import DOUBLE, GHOSTS, MIRROR
from sensors.scene import Ego, boxes_scene
from trackers.geometry import box_corners

ALL_ROUND = Sensor(
    fov_deg=360.0, max_range=150.0, spacing_deg=0.1, sigma_range=0.0, sigma_azimuth_deg=0.0, sigma_rate=0.0,
    count_at_15m=20.0, count_falloff=0.0, count_shape=0.0, share_volume=0.0, depth_contour=0.0, clutter=0.0,
    static_density=0.0,
)  # fmt: skip
ONLY_MIRROR, ONLY_DOUBLE = Ghosts(mirror=1.0, double=0.0), Ghosts(mirror=0.0, double=1.0)


def rig(ghosts, **parameters):
    return Radar("test", "for a test", (replace(ALL_ROUND, **parameters),), ghosts=ghosts)


def ego(velocity=(25.0, 0.0), yaw_rate=0.0):
    size = np.array([4.7, 1.9])
    return Ego(np.zeros(3), np.array(velocity, float), yaw_rate, size, box_corners(np.zeros(3), size))


def road(pose, size=(4.6, 1.8), velocity=(20.0, 0.0), walls=(), **others):
    """A scene of boxes and long straight rails at these lateral places."""
    scene = boxes_scene(np.atleast_2d(pose), np.broadcast_to(size, (len(np.atleast_2d(pose)), 2)),
                        np.broadcast_to(velocity, (len(np.atleast_2d(pose)), 2)), ego=ego(), **others)  # fmt: skip
    pieces = [[[x, y], [x + 25.0, y]] for y in walls for x in range(-200, 200, 25)]
    return scene._replace(walls=np.array(pieces, float).reshape(-1, 2, 2))


def ghosts_of(radar, scene, kind, seed=0):
    scan, origin = radar.scan(scene, np.random.default_rng(seed))
    rows = origin.kind == kind
    return scan.xy[rows], scan.polar[rows], scan, origin


def test_without_ghosts_a_scan_is_the_same_bit_for_bit_and_ghosts_come_beside_what_is_real():
    scene = road([[20.0, 3.5, 0.0], [40.0, 0.0, 0.0]], walls=(-6.0, 6.0))
    off = RADARS["surround"].scan(scene, np.random.default_rng(0))
    none = replace(RADARS["surround-ghosts"], ghosts=None).scan(scene, np.random.default_rng(0))
    for a, b in zip((*off[0], *off[1]), (*none[0], *none[1]), strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.isin(off[1].kind, GHOSTS).any()
    kinds = [RADARS["surround-ghosts"].scan(scene, np.random.default_rng(s))[1].kind for s in range(10)]
    assert {MIRROR, DOUBLE} <= set(np.concatenate(kinds).tolist())
    _, _, _, origin = ghosts_of(RADARS["surround-ghosts"], scene, MIRROR)
    assert (origin.object[np.isin(origin.kind, GHOSTS)] == -1).all()
    np.testing.assert_array_equal(origin.expected, off[1].expected)


def test_a_car_beside_a_rail_is_seen_again_behind_it_where_its_mirror_image_lies():
    scene = road([[30.0, 2.0, 0.0]], walls=(6.0,))
    xy, _, _, _ = ghosts_of(rig(ONLY_MIRROR), scene, MIRROR)
    assert len(xy) >= 10
    x, y = xy.T
    assert (np.abs(x - 30.0) < 2.3 + 0.15).all()  # jitter of half a followed ray at 31 m: 0.4 degrees, 0.2 m across it
    assert (np.abs(y - 10.0) < 0.9 + 0.25).all()
    near_faces = np.minimum(np.abs(x - 27.7), np.abs(y - 9.1))  # of the image, those that look at the sensor
    assert (near_faces < 0.25).all()


def test_the_range_rate_is_that_of_the_path_also_in_a_mirror_that_moves():
    """A truck on the right, a car ahead: the way sensor, side of the truck, car, a moment later."""
    truck, car = np.array([14.0, 5.0]), np.array([30.0, 0.5])
    moves = np.array([[22.0, -0.8], [27.0, 1.0]])
    scene = boxes_scene(
        np.array([[*truck, 0.0], [*car, 0.0]]), np.array([[24.0, 2.5], [4.6, 1.8]]), moves, ego=ego((25.0, 0.4))
    )
    _, polar, _, _ = ghosts_of(rig(ONLY_MIRROR), scene, MIRROR)
    face = 5.0 - 1.25
    image = polar[:, :1] * np.stack([np.cos(polar[:, 1]), np.sin(polar[:, 1])], -1)
    mine = (image[:, 1] > face) & (np.abs(image[:, 0] - 30.0) < 2.6)
    assert mine.sum() >= 5
    point = image[mine] * [1, -1] + [0, 2 * face]  # of the car itself

    def path(t):
        y = face + moves[0, 1] * t
        there = (point + moves[1] * t) * [1, -1] + [0, 2 * y]
        return np.hypot(*(there - np.array([25.0, 0.4]) * t).T)

    np.testing.assert_allclose(path(0.0), polar[mine, 0], atol=1e-9)
    np.testing.assert_allclose(polar[mine, 2], (path(1e-4) - path(-1e-4)) / 2e-4, atol=0.05)


def test_what_hides_the_mirror_or_the_object_hides_the_ghost():
    open_road = road([[30.0, 2.0, 0.0]], walls=(6.0,))
    assert len(ghosts_of(rig(ONLY_MIRROR), open_road, MIRROR)[0]) >= 10
    before_the_rail = road([[30.0, 2.0, 0.0], [16.0, 4.2, 0.0]], walls=(6.0,))
    between = ghosts_of(rig(ONLY_MIRROR), before_the_rail, MIRROR)[0]
    assert not ((np.abs(between[:, 0] - 30.0) < 3.0) & (between[:, 1] > 8.0)).any()
    assert len(ghosts_of(rig(ONLY_MIRROR), road([[30.0, 2.0, 0.0]]), MIRROR)[0]) == 0
    assert len(ghosts_of(rig(ONLY_MIRROR, max_range=29.0), open_road, MIRROR)[0]) == 0


def test_what_stands_behind_a_mirror_is_not_seen_in_it():
    scene = road([[7.0, 9.5, 0.0]], walls=(6.0,))
    scan, origin = rig(ONLY_MIRROR).scan(scene, np.random.default_rng(0))
    assert (origin.object == 0).sum() > 5  # over the rail, as no rail hides a vehicle
    assert not (origin.kind == MIRROR).any()


def test_short_sides_do_not_mirror():
    pose = [[14.0, 5.0, 0.0], [30.0, 0.5, 0.0]]
    for length, there in ((3.9, False), (24.0, True)):
        scene = boxes_scene(np.array(pose), np.array([[length, 2.5], [3.9, 1.8]]), ego=ego())
        found = [len(ghosts_of(rig(ONLY_MIRROR), scene, MIRROR, seed)[0]) for seed in range(3)]
        assert (sum(found) > 0) == there


def test_a_double_reflection_is_twice_as_far_away_with_twice_the_range_rate():
    scene = road([[20.0, 0.0, 0.0]], velocity=(20.0, 0.0))
    xy, polar, _, _ = ghosts_of(rig(ONLY_DOUBLE), scene, DOUBLE)
    assert len(xy) >= 5
    np.testing.assert_allclose(polar[:, 0] * np.cos(polar[:, 1]), 2 * 17.7, atol=0.05)
    np.testing.assert_allclose(polar[:, 2], 2 * (20.0 - 25.0) * np.cos(polar[:, 1]), atol=0.05)


@pytest.mark.parametrize(("x", "y", "heading"), [(20.0, 0.0, 0.5), (20.0, 12.0, 0.0), (80.0, 0.0, 0.0)])
def test_faces_that_do_not_look_at_each_other_and_far_ones_give_no_double_reflection(x, y, heading):
    scene = road([[x, y, heading]])
    assert len(ghosts_of(rig(ONLY_DOUBLE), scene, DOUBLE)[0]) == 0


def test_ghosts_have_their_share_of_the_detections_that_a_direct_view_would_give():
    scene = road([[30.0, 2.0, 0.0]], walls=(6.0,))
    counts = {}
    for share in (0.25, 1.0):
        radar = rig(Ghosts(mirror=share, double=0.0), count_shape=np.inf)
        counts[share] = np.mean([len(ghosts_of(radar, scene, MIRROR, seed)[0]) for seed in range(200)])
    assert counts[1.0] > 10
    assert counts[0.25] == pytest.approx(counts[1.0] / 4, abs=4 * np.sqrt(counts[1.0] / 4 / 200))


@pytest.mark.parametrize("name", ["mirror", "double"])
def test_shares_are_shares(name):
    for wrong in (-0.1, 1.1, np.nan):
        with pytest.raises(ValueError, match=f"ghosts.{name} must be within 0 and 1"):
            Ghosts(**{name: wrong})
