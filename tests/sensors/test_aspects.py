"""What vehicles return by the side that they show: hand-worked cases, each against the sensor without the option."""

from dataclasses import replace

import numpy as np
import pytest

from sensors import RADARS, Radar
from sensors.aspects import Aspects, shares_of_sides, shown
from sensors.origin import VOLUME
from sensors.scene import boxes_scene
from trackers.geometry import to_frame, unit

IDEAL = RADARS["ideal"].sensors[0]
EVEN = {"count_max": (1e4,) * 3, "count_shape": (1e6,) * 3}
SIZE = np.array([4.6, 1.8])


def rig(aspects=None, **parameters):
    sensor = replace(IDEAL, count_at_15m=400.0, count_max=1e4, count_shape=1e6, aspects=aspects)
    return Radar("test", "for a test", (replace(sensor, **parameters),))


def local(radar, pose, seed=0, size=SIZE):
    """Detections (M, 2) [m] in the frame of one vehicle, and their origin."""
    scan, origin = radar.scan(boxes_scene(pose, size), np.random.default_rng(seed))
    return to_frame(np.array(pose), scan.xy), origin


def test_the_shares_of_the_sides_sum_to_one_and_a_corner_shows_two():
    angle = np.linspace(-3, 3, 41)
    np.testing.assert_allclose(shares_of_sides(unit(angle)).sum(-1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(
        shares_of_sides(unit(np.radians([0.0, 60.0, 180.0]))), [[1, 0, 0], [0.25, 0.75, 0], [0, 0, 1]], atol=1e-12
    )
    np.testing.assert_allclose(shown(np.array([20.0, 0.0, 0.0]), np.zeros(2)), [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(shown(np.array([20.0, 0.0, np.pi / 2]), np.zeros(2)), [0, 1, 0], atol=1e-12)


def test_neutral_aspects_change_no_expected_count():
    pose = [[20.0, 6.0, 0.4], [30.0, 6.0, 0.4], [15.0, -5.0, 2.0]]
    scene = boxes_scene(pose, np.tile(SIZE, (3, 1)))
    plain, even = (rig(a).scan(scene, np.random.default_rng(0))[1] for a in (None, Aspects(**EVEN)))
    np.testing.assert_allclose(even.expected, plain.expected, rtol=1e-12)


def test_each_side_has_a_limit_of_its_own():
    radar = rig(Aspects(count_max=(30.0, 50.0, 20.0), count_shape=(1e6,) * 3))
    got = [local(radar, [15.0, 0.0, heading])[1].expected[0] for heading in (np.pi, np.pi / 2, 0.0)]
    assert got == pytest.approx([30.0, 50.0, 20.0])
    assert local(radar, [15.0, 0.0, np.radians(60)])[1].expected[0] == pytest.approx(0.75 * 50 + 0.25 * 20)


def test_counts_of_a_side_spread_as_its_shape_says():
    radar = rig(Aspects(count_max=(40.0,) * 3, count_shape=(1e6, 1e6, 1.0)))
    rear, front = (
        np.array([len(local(radar, [15.0, 0.0, heading], seed)[0]) for seed in range(300)]) for heading in (0.0, np.pi)
    )
    assert rear.var() == pytest.approx(40 + 40**2, rel=0.45)  # standard error of the variance of a geometric: 16 %
    assert front.var() == pytest.approx(40, rel=0.3)  # of a Poisson count: 8 %


def test_a_half_hidden_object_returns_less_by_the_power_of_its_visible_share():
    pose = [[12.0, 1.2, 0.0], [30.0, 0.0, 0.0]]
    scene = boxes_scene(pose, np.tile(SIZE, (2, 1)))
    plain, hidden = (rig(Aspects(**EVEN, hidden=h)).scan(scene, np.random.default_rng(0))[1] for h in (0.0, 0.5))
    share = plain.visible[1]
    assert 0.1 < share < 0.9
    assert hidden.expected[1] == pytest.approx(plain.expected[1] * share**0.5)
    assert hidden.expected[0] == pytest.approx(plain.expected[0])


def test_a_bus_returns_more_than_a_car_of_the_same_outline():
    scene = boxes_scene([20.0, 0.0, 0.0], SIZE)
    tall = scene._replace(objects=scene.objects._replace(kind=("bus",)))
    radar = rig(Aspects(**EVEN, height=1.5))
    car, bus = (radar.scan(s, np.random.default_rng(0))[1].expected[0] for s in (scene, tall))
    assert bus / car == pytest.approx((3.1 / 1.5) ** 1.5)


def test_specular_faces_return_where_they_look_at_the_radar():
    turn = np.radians(70)
    pose = [100.0, 0.0, turn]  # so far away that all rays are parallel to x but for a degree
    share = []
    for exponent in (0.0, 2.0):
        e, _ = local(rig(Aspects(**EVEN, specular=exponent), count_at_15m=4e3), pose)
        share.append(np.isclose(e[:, 0], -SIZE[0] / 2, atol=1e-6).mean())
    odds = share[1] / (1 - share[1]) / (share[0] / (1 - share[0]))
    assert odds == pytest.approx((np.cos(turn) / np.sin(turn)) ** 2, rel=0.25)  # a degree makes 10 %


def test_a_plate_makes_the_middle_of_the_rear_brighter():
    pose = [20.0, 0.0, 0.0]
    middle = []
    for plate in (0.0, 3.0):
        e, _ = local(rig(Aspects(**EVEN, plate=plate), count_at_15m=4e3), pose)
        middle.append((np.abs(e[:, 1]) < 0.25).mean())
    bump, whole = 0.25 * np.sqrt(2 * np.pi), SIZE[1]  # .68 of a Gaussian lie within its standard deviation
    assert middle[0] == pytest.approx(0.5 / whole, abs=0.04)
    assert middle[1] == pytest.approx((0.5 + 3 * bump * 0.683) / (whole + 3 * bump), abs=0.04)


def test_returns_beneath_a_flank_come_from_four_wheels_and_turn_with_the_body():
    aspects = Aspects(**EVEN, under=(1.0, 1.0, 1.0), wheel_spread=0.0)
    e, origin = local(rig(aspects), [20.0, 0.0, np.pi / 2])
    wheels, count = np.unique(np.round(e, 6), axis=0, return_counts=True)
    wanted = SIZE / 2 - [0.8, 0.12]
    at_wheels = np.isclose(np.abs(wheels), wanted, atol=1e-5).all(-1)
    assert at_wheels.sum() == 4
    assert count[at_wheels].sum() > 0.98 * len(e)  # rays off the middle show a little of front or rear
    assert count[at_wheels].min() > 0.7 * count[at_wheels].mean()
    assert (origin.kind == VOLUME).all()


def test_returns_beneath_the_rear_come_from_all_of_both_axles():
    aspects = Aspects(**EVEN, under=(1.0, 1.0, 1.0), wheel_spread=0.0)
    e, _ = local(rig(aspects), [20.0, 0.0, 0.0])
    np.testing.assert_allclose(np.abs(e[:, 0]), SIZE[0] / 2 - 0.8, atol=1e-6)
    half = SIZE[1] / 2 - 0.12
    assert np.abs(e[:, 1]).max() <= half + 1e-9
    assert e[:, 1].std() == pytest.approx(half / np.sqrt(3), rel=0.15)


def test_weak_returns_fade_with_range():
    def inside(distance):
        radar = rig(Aspects(**EVEN, fade=20.0), share_volume=0.8, depth_volume=np.inf, count_falloff=0.0)
        return (local(radar, [distance, 0.0, 0.0])[1].kind == VOLUME).mean()

    assert inside(20.0) == pytest.approx(0.8 * np.exp(-(20.0 - SIZE[0] / 2) / 20), abs=0.09)
    assert inside(60.0) < 0.1


def test_a_sensor_without_the_option_is_as_ever_beside_one_that_has_it():
    """Expected counts of a Poisson sensor and of one with fixed counts, each beside one with aspects."""
    scene = boxes_scene([20.0, 6.0, 0.4], SIZE)
    for shape in (np.inf, 0.0):
        plain = replace(IDEAL, count_shape=shape)
        alone = Radar("test", "", (plain,)).scan(scene, np.random.default_rng(0))[1]
        special = replace(IDEAL, aspects=Aspects(**EVEN, under=(1.0, 1.0, 1.0), wheel_spread=0.0))
        scan, origin = Radar("test", "", (plain, special)).scan(scene, np.random.default_rng(0))
        even = Radar("test", "", (special,)).scan(scene, np.random.default_rng(0))[1]
        assert origin.expected == pytest.approx(alone.expected + even.expected)
        distance = np.abs(np.max(np.abs(to_frame(np.array([20.0, 6.0, 0.4]), scan.xy)) / (SIZE / 2), -1) - 1.0)
        assert distance[scan.sensor == 0].max() < 1e-9
        assert distance[scan.sensor == 1].min() > 0.1


def test_impossible_numbers_are_refused():
    for wrong in ({"under": (0.5, 1.5, 0.0)}, {"plate": -1.0}, {"fade": 0.0}, {"count_max": (1.0, -1.0, 1.0)}):
        with pytest.raises(ValueError, match=f"aspects.{next(iter(wrong))}"):
            Aspects(**(EVEN | wrong))


def test_an_empty_scene_before_a_sensor_with_aspects_gives_nothing():
    got, origin = rig(Aspects(**EVEN)).scan(boxes_scene(np.zeros((0, 3)), np.zeros((0, 2))), np.random.default_rng(0))
    assert got.polar.shape == (0, 3)
    assert origin.expected.shape == (0,)
