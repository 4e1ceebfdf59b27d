"""Faults of radars: laws, hand-worked cases, and what they must leave alone."""

from dataclasses import replace

import numpy as np
import pytest

from sensors import RADARS, Radar, faults_of, parse_fault
from sensors.fault_text import KINDS, split_faults
from sensors.faults import PLACES, Fault, apply_faults, chosen, streams
from sensors.origin import CLUTTER
from sensors.scene import Ego, boxes_scene
from trackers.geometry import box_corners, rotation
from trackers.scan import Scan

SURROUND = RADARS["surround"]
TEXTS = (
    "front:outage:3:5", "corners:yaw:0.5", "clock:0.05", "drop:0.2", "burst:6:500", "blind:rain:0.5",
    "2:drop:0.5:1:4", "rear:burst:6:500:2", "left:blind:dirt:0.25:1:inf", "right:clock:-0.1:2:3",
)  # fmt: skip


def ego(pose=(0.0, 0.0, 0.0), velocity=(20.0, 0.0), yaw_rate=0.0):
    pose, size = np.array(pose, float), np.array([4.7, 1.9])
    return Ego(pose, np.array(velocity, float), yaw_rate, size, box_corners(pose, size))


def traffic(time=0.0, seed=3):
    rng = np.random.default_rng(seed)
    pose = np.stack([rng.uniform(-60, 90, 12), rng.choice([-7.2, -3.6, 3.6, 7.2], 12), np.zeros(12)], -1)
    walls = np.array([[[x, y], [x + 20.0, y]] for x in range(-200, 200, 20) for y in (-12.0, 12.0)])
    scene = boxes_scene(pose, np.tile([4.6, 1.8], (12, 1)), np.tile([25.0, 0.0], (12, 1)), ego=ego())
    return scene._replace(walls=walls, time=time)


def healthy(radar=SURROUND, scene=None, seed=0):
    scene = traffic() if scene is None else scene
    return scene, *radar.scan(scene, np.random.default_rng(seed))


def faulty(texts, radar=SURROUND, scene=None, seed=0):
    faults, (scene, scan, origin) = faults_of(texts), healthy(radar, scene, seed)
    return apply_faults(faults, streams(faults, seed), radar.models, scene, scan, origin)


def assert_equal(one, other):
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


def part(scan, origin, rows):
    """Detections in these rows, and where they come from."""
    return [scan.polar[rows], scan.sensor[rows], scan.pose[rows], origin.object[rows], origin.kind[rows]]


@pytest.mark.parametrize("text", TEXTS)
def test_a_fault_reads_back_as_it_was_written(text):
    assert str(parse_fault(text)) == text


def test_sensors_may_follow_the_kind_and_all_of_them_need_no_name():
    assert parse_fault("blind:surround:rain:0.5") == parse_fault("blind:rain:.5")
    assert parse_fault("outage:front:3:5") == parse_fault("front:outage:3:5")


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "KIND"), ("outge:3:5", "outage"), ("front", "KIND"), ("front:outage:3", "START:END"), ("drop:x", "number"),
        ("drop:1.5", "within 0 and 1"), ("drop:nan", "within 0 and 1"), ("outage:5:3", "before it ends"),
        ("outage:nan:3", "before it ends"), ("outage:-1:3", "0 s or later"), ("nose:drop:0.1", "left"),
        ("yaw:100", "90"), ("clock:2", "1 s"), ("burst:1:1e5", "10000"), ("burst:1:5:0", "longer"),
        ("blind:snow:0.5", "rain or dirt"), ("blind:rain:2", "within 0 and 1"), ("drop:0.1:1", "START:END"),
    ],
)  # fmt: skip
def test_a_wrong_fault_is_refused_in_one_sentence(text, word):
    with pytest.raises(ValueError, match="fault") as refused:
        parse_fault(text)
    assert word in str(refused.value)
    assert "\n" not in str(refused.value)


def test_faults_come_as_texts_objects_or_one_text_and_none_twice():
    drop = parse_fault("drop:0.2")
    assert faults_of("drop:.2+clock:.1") == faults_of(["drop:0.2", parse_fault("clock:0.1")])
    assert faults_of("") == faults_of(()) == ()
    assert split_faults("cut-in+drop:.2+clock:.1") == ("cut-in", ("drop:0.2", "clock:0.1"))
    assert split_faults("cut-in") == ("cut-in", ())
    with pytest.raises(ValueError, match="differ"):
        faults_of([drop, "drop:0.2"])
    for wrong in (3, [3], [Fault], [type(drop)]):
        with pytest.raises(TypeError, match="faults must be"):
            faults_of(wrong)


def test_words_for_sensors_follow_their_headings():
    masks = {word: np.flatnonzero(chosen(word, SURROUND.models)).tolist() for word in (*PLACES, "3")}
    assert masks == {
        "surround": [0, 1, 2, 3, 4, 5], "front": [0], "rear": [1], "corners": [2, 3, 4, 5],
        "right": [2, 4], "left": [3, 5], "3": [3],
    }  # fmt: skip
    assert np.flatnonzero(chosen("rear", RADARS["nuscenes-like"].models)).tolist() == [3, 4]


def test_a_rig_without_such_sensors_says_which_it_has():
    with pytest.raises(ValueError, match="no 'front'; it has surround, corners, left, right, and the numbers 0 to 3"):
        chosen("front", RADARS["corners"].models)
    with pytest.raises(ValueError, match="no '6'"):
        chosen("6", SURROUND.models)


def test_no_fault_and_faults_of_another_time_change_no_bit():
    scene, scan, origin = healthy(scene=traffic(time=2.0))
    for texts in ((), ("front:outage:3:5", "drop:0.5:0:2", "burst:2.5:50")):
        faults = faults_of(texts)
        got = apply_faults(faults, streams(faults, 0), SURROUND.models, scene, scan, origin)
        assert got[0] is scan
        assert got[1] is origin


def test_a_fault_lasts_from_its_start_to_just_before_its_end():
    sizes = [len(faulty("outage:3:5", scene=traffic(time=t))[0].mask) for t in (2.9, 3.0, 4.9, 5.0)]
    assert sizes[1] == sizes[2] == 0
    assert sizes[0] == sizes[3] > 0


@pytest.mark.parametrize("kind", KINDS)
def test_detections_of_other_sensors_and_what_was_there_to_see_stay(kind):
    text = next(t for t in TEXTS if kind in t.split(":"))
    values = text.split(f"{kind}:")[1]
    scene, scan, origin = healthy(scene=traffic(time=4.0 if kind == "outage" else 6.0))
    fault = faults_of(f"right:{kind}:{values}")
    got, known = apply_faults(fault, streams(fault, 0), SURROUND.models, scene, scan, origin)
    others = ~chosen("right", SURROUND.models)
    assert_equal(part(scan, origin, others[scan.sensor]), part(got, known, others[got.sensor]))
    assert_equal([origin.expected, origin.visible], [known.expected, known.visible])
    touched = len(got.mask) != len(scan.mask) or not np.array_equal(got.polar, scan.polar)
    assert touched or not got.delivered[2]


def test_a_sensor_that_is_out_delivers_nothing():
    scan, origin = faulty("front:outage:0:5")
    assert not (scan.sensor == 0).any()
    assert scan.delivered.tolist() == [False, True, True, True, True, True]
    assert len(origin.kind) == len(scan.polar) > 0


def test_scans_of_single_sensors_are_lost_with_their_probability():
    fault, (scene, scan, origin) = faults_of("drop:0.2"), healthy()
    rngs = streams(fault, 1)
    lost = [~apply_faults(fault, rngs, SURROUND.models, scene, scan, origin)[0].delivered for _ in range(400)]
    share = np.mean(lost)  # of 2400: standard deviation 0.0082
    assert 0.2 - 4 * 0.0082 < share < 0.2 + 4 * 0.0082
    assert 0 < np.any(lost, -1).mean() < 0.95  # each sensor by itself


def test_a_misaligned_sensor_measures_what_a_turned_one_does():
    turned = np.radians(6.0)
    sensor = replace(RADARS["front"].sensors[0], clutter=0.0, fov_deg=60.0)
    x, y, heading = sensor.mount
    rigs = [Radar("r", "for a test", (replace(sensor, mount=(x, y, h)),)) for h in (heading, heading + turned)]
    scene = boxes_scene(np.array([[30.0, 4.0, 0.0]]), np.array([[4.6, 1.8]]), ego=ego())
    azimuths = []
    for radar, texts in ((rigs[0], "front:yaw:6"), (rigs[1], ())):
        scans = [faulty(texts, radar, scene, seed)[0] for seed in range(60)]
        azimuths.append(np.concatenate([scan.polar[:, 1] for scan in scans]))
    assert abs(azimuths[0].mean() - azimuths[1].mean()) < 0.005
    assert abs(azimuths[0].mean() - faulty((), rigs[0], scene)[0].polar[:, 1].mean()) > 0.05
    outside = faulty("front:yaw:60", rigs[0], scene)[0]
    assert len(outside.mask) == 0
    assert outside.delivered.all()


def test_no_misalignment_moves_nothing_and_false_alarms_never_turn():
    scene, scan, origin = healthy()
    same, _ = faulty("yaw:0")
    assert_equal([scan.polar], [same.polar])
    turned, known = faulty("yaw:5")
    np.testing.assert_array_equal(turned.polar[known.kind == CLUTTER], scan.polar[origin.kind == CLUTTER])


def test_a_late_clock_shows_what_was_there_before():
    tau, yaw_rate, omega = 0.05, 0.3, 0.2
    v, w = np.array([22.0, 3.0]), np.array([30.0, -2.0])
    scene = boxes_scene([[40.0, 3.0, 0.1]], [[4.6, 1.8]], [w], [yaw_rate], ego=ego((5, 1, 0.2), v, omega))
    _, scan, origin = healthy(RADARS["ideal"], scene)
    late, _ = faulty(f"clock:{tau}", RADARS["ideal"], scene)
    body = scene.bodies.pose[0]
    inside = (scan.xy - body[:2]) @ rotation(body[2])  # in the frame of the body

    def seen(t):
        """Exact range and azimuth of these points at a time t [s], with constant yaw rates."""
        point = body[:2] + w * t + inside @ rotation(body[2] + yaw_rate * t).T
        d = point - (np.array([5.0, 1.0]) + v * t)
        return np.hypot(*d.T), np.arctan2(d[:, 1], d[:, 0]) - (0.2 + omega * t)

    r, azimuth = seen(-tau)
    rate = (seen(-tau + 1e-4)[0] - seen(-tau - 1e-4)[0]) / 2e-4
    np.testing.assert_allclose(late.polar[:, 0], r, atol=1e-3)  # the body turns by 0.015: 1e-4 of its half length
    np.testing.assert_allclose(late.polar[:, 1], azimuth, atol=1e-4)
    np.testing.assert_allclose(late.polar[:, 2], rate, atol=2e-2)
    assert np.abs(late.polar[:, 0] - scan.polar[:, 0]).min() > 0.2
    assert_equal([late.pose, late.platform], [scan.pose, scan.platform])


def test_standing_returns_are_late_by_the_motion_of_the_ego_alone():
    scene = traffic()._replace(bodies=boxes_scene(np.zeros((0, 3)), np.zeros((0, 2))).bodies)
    scene = scene._replace(objects=boxes_scene(np.zeros((0, 3)), np.zeros((0, 2))).objects)
    scan, origin = faulty("clock:0.1", scene=scene)
    before = healthy(scene=scene)[1]
    still = origin.kind != CLUTTER
    np.testing.assert_allclose((scan.xy - before.xy)[still], np.tile([2.0, 0.0], (still.sum(), 1)), atol=1e-9)
    np.testing.assert_array_equal(scan.polar[~still], before.polar[~still])


def test_interference_adds_false_alarms_evenly_and_in_no_order():
    more = [faulty("corners:burst:0:200", seed=seed) for seed in range(30)]
    counts = np.array([np.bincount(scan.sensor, minlength=6) for scan, _ in more])
    usual = np.array([np.bincount(healthy(seed=seed)[1].sensor, minlength=6) for seed in range(30)])
    added = (counts - usual).mean(0)
    assert (added[:2] == 0).all()
    np.testing.assert_allclose(added[2:], 50.0, atol=4 * np.sqrt(50 / 30))
    scan, origin = more[0]
    assert np.lexsort((scan.polar[:, 0], scan.sensor)).tolist() == list(range(len(scan.mask)))
    np.testing.assert_allclose(scan.pose, [SURROUND.models[s].poses(scan.platform) for s in scan.sensor])
    assert len(origin.kind) == len(scan.mask)
    assert (np.abs(scan.polar[:, 1]) <= np.pi / 4 + 0.1).all()


def test_a_sensor_that_is_out_has_no_interference():
    scan, _ = faulty("front:outage:0:5+front:burst:0:200")
    assert not (scan.sensor == 0).any()


def test_rain_takes_range_and_weakens_the_rest():
    radar = Radar("r", "for a test", (replace(RADARS["front"].sensors[0], static_density=0.0),))
    pose = np.array([[30.0, 0.0, 0.0], [120.0, 1.0, 0.0]])
    scene = boxes_scene(pose, np.tile([4.6, 1.8], (2, 1)), ego=ego())
    near = [0, 0]
    for seed in range(300):
        for k, texts in enumerate(((), "blind:rain:0.5")):
            scan, origin = faulty(texts, radar, scene, seed)
            near[k] += (origin.object == 0).sum()
            assert k == 0 or (scan.polar[:, 0] < 87.0).all()
            assert k == 0 or scan.delivered.all()
    p = 0.5 ** radar.models[0].count_falloff
    assert abs(near[1] - p * near[0]) < 4 * np.sqrt(near[0] * p * (1 - p))
    blind, known = faulty("blind:rain:0", radar, scene)
    assert len(blind.mask) == len(known.kind) == 0
    assert blind.delivered.all()


def test_dirt_takes_a_share_at_any_range_and_no_false_alarm():
    kept, clutter = [0, 0], [0, 0]
    for seed in range(60):
        for k, texts in enumerate(((), "blind:dirt:0.25")):
            kind = faulty(texts, seed=seed)[1].kind
            kept[k] += (kind != CLUTTER).sum()
            clutter[k] += (kind == CLUTTER).sum()
    assert abs(kept[1] - 0.25 * kept[0]) < 4 * np.sqrt(kept[0] * 0.25 * 0.75)
    assert clutter[0] == clutter[1] > 0


def test_one_fault_draws_alike_beside_another():
    with_other = faulty("drop:0.5+rear:yaw:1", seed=5)[0]
    alone = faulty("drop:0.5", seed=5)[0]
    assert 0 < alone.delivered.sum() < 6
    assert_equal([with_other.delivered], [alone.delivered])


def test_a_scan_with_one_pose_for_all_detections_is_taken():
    scene = boxes_scene(np.zeros((0, 3)), np.zeros((0, 2)), ego=ego())
    xy = np.array([[10.0, 0.0], [20.0, 1.0]])
    scan = Scan.from_xy(xy)
    origin = healthy(RADARS["front"], scene)[2]._replace(
        object=np.full(2, -1), body=np.full(2, -1), edge=np.full(2, -1), kind=np.zeros(2, int)
    )
    fault = faults_of("yaw:1")
    got, _ = apply_faults(fault, streams(fault, 0), RADARS["lidar-1deg"].models, scene, scan, origin)
    np.testing.assert_allclose(got.polar[:, 1], scan.polar[:, 1] - np.radians(1))
    assert got.sensor.shape == (2,)
