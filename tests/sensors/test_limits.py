"""What a radar cannot: range rates that fold, merged power, wheels that turn, sensors that measure at other times."""

from dataclasses import replace

import numpy as np
import pytest

from sensors import Sensor, find
from sensors.returns import fold_rates
from sensors.rigs import staggered
from sensors.scene import boxes_scene
from tests.sensors.test_radar import rig, scan, traffic

SUMS = [  # of range, azimuth and range rate of a scan, written down before there were limits
    ("surround", [2457.134001762523, 5.05247380706403, 24.546724770000843]),
    ("nuscenes-like", [3980.8892915993824, -3.2818608131036613, 41.60918835415069]),
    ("imaging", [5508.603062650782, -2.6160040846428676, 4415.172757425796]),
]


@pytest.mark.parametrize(("name", "sums"), SUMS)
def test_a_radar_without_these_limits_scans_as_it_did_before_there_were_any(name, sums):
    got = scan(replace(find(name), compiled=False), traffic())[0]
    np.testing.assert_allclose(got.polar.sum(0), sums, rtol=0, atol=1e-9)


def test_range_rates_beyond_the_limit_come_back_at_the_other_end():
    polar = np.array([[9.0, 0.1, v] for v in (4.9, 5.2, -5.3, 25.0, 5.0)])
    folded = fold_rates(polar, np.full(5, 5.0))
    np.testing.assert_allclose(folded[:, 2], [4.9, -4.8, 4.7, -5.0, 5.0])
    np.testing.assert_array_equal(folded[:, :2], polar[:, :2])


def test_a_folding_radar_reports_the_same_places_and_its_sheet_says_so():
    scene = traffic()
    plain, folding = scan(rig(), scene)[0], scan(rig(fold_rate=5.0), scene)[0]
    np.testing.assert_array_equal(folding.polar[:, :2], plain.polar[:, :2])
    assert np.abs(plain.polar[:, 2]).max() > 5.0 >= np.abs(folding.polar[:, 2]).max()
    laps = (plain.polar[:, 2] - folding.polar[:, 2]) / 10.0
    np.testing.assert_allclose(laps, np.rint(laps), atol=1e-9)
    sheet = rig(fold_rate=5.0).models[0]
    assert sheet.max_rate == sheet.fold_rate == 5.0


def test_merged_returns_are_less_noisy_with_the_root_of_their_number():
    scene = boxes_scene([[30.0, 3.0, 0.0]], [[4.6, 1.8]])
    cells = {"cell_range": 500.0, "cell_azimuth_deg": 90.0, "count_at_15m": 16.0}
    true, plain, powered = (
        scan(rig(**cells, **more), scene)[0].polar[0, 0]
        for more in ({}, {"sigma_range": 0.5}, {"sigma_range": 0.5, "cell_power": 0.5})
    )
    number = len(scan(rig(count_at_15m=16.0), scene)[0].mask)
    assert number > 9
    assert (powered - true) * np.sqrt(number) == pytest.approx(plain - true)


def test_wheels_turn_with_up_to_twice_the_speed_and_only_where_the_side_is_seen():
    aside = boxes_scene([[20.0, 20.0, 0.0]], [[4.6, 1.8]], [[20.0, 0.0]])  # seen at 45 degrees
    ahead = boxes_scene([[30.0, 0.0, 0.0]], [[4.6, 1.8]], [[20.0, 0.0]])
    body = 20.0 * np.cos(np.pi / 4)
    found = np.concatenate([scan(rig(wheels=1.0), aside, seed)[0].polar for seed in range(40)])
    off = np.abs(found[:, 2] - body) > 2.5
    assert 0.2 < off.mean() < 0.6  # half of the returns, but for those near the rate of the hub
    assert found[:, 2].min() > -1.5
    assert found[:, 2].max() < 2 * body + 1.5
    x = found[off, 0] * np.cos(found[off, 1]) - 20.0
    y = found[off, 0] * np.sin(found[off, 1]) - 20.0
    assert (np.abs(np.abs(x) - (2.3 - 0.82)) < 0.7).all()  # at the axles
    assert (np.abs(y + 0.8) < 0.3).all()  # on the side that is seen
    for scene, parameters in ((ahead, {"wheels": 1.0}), (aside, {})):
        polar = scan(rig(**parameters), scene)[0].polar
        assert np.ptp(polar[:, 2]) < 2.5
    standing = boxes_scene([[20.0, 20.0, 0.0]], [[4.6, 1.8]])
    np.testing.assert_allclose(scan(rig(wheels=1.0), standing)[0].polar[:, 2], 0.0, atol=1e-9)


def test_staggered_sensors_measure_one_after_another_each_at_its_rate():
    rate, number = 10.0, 6
    radar = staggered(find("surround"), rate)
    frames = np.array([radar.due(k / 60.0, 1 / 60.0) for k in range(1, 61)])  # a second of 60 Hz
    assert (frames.sum(0) == rate).all()
    assert frames.sum(1).max() == 1  # six sensors in six frames: one in each
    assert frames[:number].any(0).all()
    scene = traffic()
    for frame, due in enumerate(frames[:number], 1):  # what is measured is of the instant of the frame
        some, every = (scan(r, scene._replace(time=frame / 60.0, dt=1 / 60.0))[0] for r in (radar, find("surround")))
        np.testing.assert_array_equal(some.delivered, due)
        np.testing.assert_array_equal(some.polar, every.polar[due[every.sensor]])


@pytest.mark.parametrize(("field", "value"), [("fold_rate", 0.0), ("wheels", 1.1), ("cell_power", -1.0)])
def test_limits_that_cannot_be_are_refused(field, value):
    with pytest.raises(ValueError, match=f"sensor.{field} must be"):
        Sensor(**{field: value})
