"""Scattering centres that stay: where they are as long as they last, anew after it, and as without in each scan."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import ks_2samp

from sensors import RADARS, Persistence, Radar
from sensors.origin import VOLUME
from sensors.persistence import Centres, cell_count, run_key
from sensors.radar import Sensor
from sensors.scene import Bodies, boxes_scene
from trackers.geometry import box_corners, to_frame

IDEAL = RADARS["ideal"].sensors[0]
CARS = np.array([[20.0, 3.0, 0.1], [35.0, -4.0, 0.0], [12.0, -7.0, 1.2]])
SIZE = np.tile([4.6, 1.8], (3, 1))
BEFORE = [
    37,
    692.2804879377985,
    9.083987602375553,
    -0.3460222576178409,
]  # number and sums of the detections of vehicles before there was the option


def rig(persistence, **parameters):
    usual = {"count_at_15m": 40.0, "count_max": 60.0, "share_volume": 0.3, "depth_contour": 0.1}
    return Radar("test", "for a test", (replace(IDEAL, persistence=persistence, **(usual | parameters)),))


def points(radar, rng, time=0.0, cars=CARS):
    """Detections in the frames of their cars, sorted, and whether each came from inside."""
    scan, origin = radar.scan(boxes_scene(cars, SIZE, time=time), rng)
    e = to_frame(cars[origin.object], scan.xy[:, None])[:, 0]
    order = np.lexsort((e[:, 1], e[:, 0], origin.object))
    return e[order], origin.object[order], origin.kind[order] == VOLUME


def common(a, b, within=1e-6):
    """Share of the points a (K, 2) that are also in b."""
    return float((np.hypot(*(a[:, None] - b).transpose(2, 0, 1)).min(-1) < within).mean())


def test_a_standing_scene_gives_the_same_points_as_long_as_centres_last_and_others_later():
    radar, rng = rig(Persistence(5.0)), np.random.default_rng(1)
    first, later, much_later = (points(radar, rng, t)[0] for t in (3.0, 3.05, 303.0))
    assert len(first) > 80
    assert common(first, later) > 0.95  # of centres of 5 s one in a hundred is renewed in 0.05 s
    assert common(first, much_later) < 0.02
    anew = rig(None)
    assert common(points(anew, rng, 3.0)[0], points(anew, rng, 3.05)[0]) < 0.02


def test_centres_are_renewed_one_by_one_each_after_its_lifetime():
    radar, rng = rig(Persistence(1.0)), np.random.default_rng(1)
    first = points(radar, rng, 3.0)[0]
    left = [common(first, points(radar, rng, 3.0 + t)[0]) for t in (0.25, 0.5, 0.75, 1.01)]
    np.testing.assert_allclose(left[:3], (0.75, 0.5, 0.25), atol=0.12)
    assert left[3] < 0.02


@pytest.mark.parametrize(("spacing", "least"), [(0.1, 0.85), (1.0, 0.7)])
def test_a_centre_stays_on_a_body_that_drives_and_turns(spacing, least):
    """Also where one ray stands for several cells."""
    lasting = rig(Persistence(50.0), share_volume=0.0, depth_contour=0.0, spacing_deg=spacing)
    moved = CARS + np.array([0.6, 0.1, 0.03])
    kept = []
    for radar in (lasting, with_persistence(lasting, None)):
        rng = np.random.default_rng(2)
        kept.append(common(*(points(radar, rng, 3.0, cars)[0] for cars in (CARS, moved)), within=0.02))
    assert kept[0] > least
    assert kept[1] < 0.65  # by chance alone


def test_centres_are_those_of_the_body_whichever_sensor_looks_at_it():
    one = replace(rig(Persistence(5.0)).sensors[0], count_shape=0.0)
    twins = Radar("twins", "for a test", (one, one))
    scan, _ = twins.scan(boxes_scene(CARS, SIZE), np.random.default_rng(1))
    a, b = (scan.xy[scan.sensor == s] for s in (0, 1))
    assert len(a) == len(b) > 80
    assert common(a, b) == 1.0


def test_sensors_without_the_option_draw_anew_beside_one_that_has_it():
    lasting = rig(Persistence(50.0)).sensors[0]
    both = Radar("both", "for a test", (lasting, replace(lasting, persistence=None)))
    rng = np.random.default_rng(1)
    scans = [both.scan(boxes_scene(CARS, SIZE, time=t), rng)[0] for t in (3.0, 3.05)]
    kept = [common(*(scan.xy[scan.sensor == s] for scan in scans)) for s in (0, 1)]
    assert kept[0] > 0.95
    assert kept[1] < 0.02


@pytest.mark.parametrize("name", ["surround", "imaging"])
def test_over_many_lifetimes_detections_are_distributed_as_without(name):
    def many(persistence):
        radar = with_persistence(RADARS[name], persistence)
        rng, found = np.random.default_rng(3), []
        radar = replace(radar, sensors=tuple(replace(s, clutter=0.0) for s in radar.sensors))
        for k in range(150):
            e, car, inside = points(radar, rng, time=10.0 * k)
            found.append(np.column_stack([e, car, inside, np.full(len(e), k)]))
        return np.concatenate(found)

    without, lasting = many(None), many(Persistence(1.0))
    for car in range(3):
        a, b = (rows[rows[:, 2] == car] for rows in (without, lasting))
        if not len(a):
            assert not len(b)
            continue
        counts = [np.bincount(rows[:, 4].astype(int), minlength=150) for rows in (a, b)]
        error = np.sqrt(sum(c.var() for c in counts) / 150)
        assert abs(counts[0].mean() - counts[1].mean()) < 4 * error
        share = [rows[:, 3].mean() for rows in (a, b)]
        assert abs(share[0] - share[1]) < 4 * np.sqrt(0.25 * (1 / len(a) + 1 / len(b)))
        for axis in (0, 1):
            assert ks_2samp(a[:, axis], b[:, axis]).pvalue > 1e-3
    a, b = (rows[rows[:, 2] == 0] for rows in (without, many(Persistence(1e6))))
    assert min(ks_2samp(a[:, axis], b[:, axis]).pvalue for axis in (0, 1)) < 1e-3  # one draw of centres is not that


def test_elements_longer_than_a_cell_are_spread_over_cells_as_without():
    """A flank seen at a flat angle by few rays: one ray stands for metres of it."""
    car = np.array([[30.0, 4.0, 0.0]])

    def along(persistence):
        radar = rig(persistence, spacing_deg=1.0, share_volume=0.0, depth_contour=0.0, count_shape=0.0)
        rng = np.random.default_rng(2)
        scans = [radar.scan(boxes_scene(car, SIZE[:1], time=10.0 * k), rng)[0] for k in range(100)]
        return np.concatenate([to_frame(car[0], scan.xy) for scan in scans])

    a, b = along(None), along(Persistence(1.0))
    assert np.ptp(a[:, 0]) > 2.0
    assert ks_2samp(a[:, 0], b[:, 0]).pvalue > 1e-3
    assert ks_2samp(a[:, 1], b[:, 1]).pvalue > 1e-3


def with_persistence(radar, persistence):
    return replace(radar, sensors=tuple(replace(s, persistence=persistence) for s in radar.sensors))


def test_off_it_is_off_in_every_rig_and_gives_the_detections_of_before():
    assert all(sensor.persistence is None for radar in RADARS.values() for sensor in radar.sensors)
    scan, origin = RADARS["surround"].scan(boxes_scene(CARS, SIZE), np.random.default_rng(4))
    found = scan.polar[origin.object >= 0]
    np.testing.assert_allclose([len(found), *found.sum(0)], BEFORE, rtol=1e-12)


def test_the_same_seed_gives_the_same_scans_and_another_seed_other_centres():
    radar = rig(Persistence(5.0))
    a, b, c = (points(radar, np.random.default_rng(seed), 3.0)[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(a, b)
    assert common(a, c) < 0.02


def test_bodies_of_one_object_have_centres_of_their_own_and_as_many_as_without():
    pose = np.array([[20.0, 4.0, 0.0], [28.0, 4.0, 0.0]])
    one = boxes_scene(np.array([[24.0, 4.0, 0.0]]), np.array([[12.6, 1.8]]))
    outline = tuple(box_corners(pose, np.tile([4.6, 1.8], (2, 1))))
    bodies = Bodies(np.zeros(2, int), pose, np.zeros((2, 2)), np.zeros(2), outline)
    share = []
    for persistence in (None, Persistence(1.0)):
        radar, rng = rig(persistence), np.random.default_rng(0)
        found = [radar.scan(one._replace(bodies=bodies, time=10.0 * k), rng)[1].body for k in range(150)]
        share.append(np.concatenate(found).mean())
    assert share[1] == pytest.approx(share[0], abs=4 * np.sqrt(0.5 / len(np.concatenate(found))))


def test_an_empty_scene_gives_nothing():
    scan, _ = rig(Persistence(1.0)).scan(boxes_scene(np.zeros((0, 3)), np.zeros((0, 2))), np.random.default_rng(0))
    assert scan.polar.shape == (0, 3)


def test_numbers_of_centres_are_uniform_normal_and_independent():
    centre = Centres(np.arange(20000, dtype=np.uint64))
    u, v, n = centre.random(20000), centre.random(20000), centre.standard_normal((20000, 2))
    assert ((u >= 0) & (u < 1)).all()
    assert abs(u.mean() - 0.5) < 0.01
    assert abs(u.var() - 1 / 12) < 0.003
    np.testing.assert_allclose(np.cov(n.T), np.eye(2), atol=0.05)
    assert np.abs(np.corrcoef([u, v, *n.T]) - np.eye(4)).max() < 0.03
    assert np.bincount(centre.integers(4, size=20000), minlength=4).min() > 4700


def test_cells_are_no_longer_than_a_tenth_of_a_metre_and_their_number_withstands_rounding():
    assert cell_count(np.array([[4.6, 0.0], [0.0, 1.85], [1e-4, 0.0]])).tolist() == [46, 19, 1]
    assert cell_count(np.array([[4.6 + 1e-12, 0.0]])).tolist() == [46]


@pytest.mark.parametrize("lifetime", [0.0, -1.0, np.nan, np.inf])
def test_a_lifetime_that_is_none_is_refused(lifetime):
    with pytest.raises(ValueError, match=r"persistence.lifetime must be positive and finite"):
        Persistence(lifetime)


def test_what_is_no_persistence_is_refused():
    with pytest.raises(ValueError, match=r"sensor.persistence must be a Persistence or None, got 1.0"):
        Sensor(persistence=1.0)


def test_a_generator_that_does_not_know_its_seed_is_refused():
    assert run_key(np.random.default_rng(1)) != run_key(np.random.default_rng(2))
    with pytest.raises(ValueError, match=r"rng must know its seed"):
        run_key(SimpleNamespace(bit_generator=SimpleNamespace()))
