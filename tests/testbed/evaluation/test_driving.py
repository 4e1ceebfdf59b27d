"""The drive measured on scenes that can be computed by hand, and against a slow simulation."""

import hypothesis.strategies as st
import numpy as np
import pytest
import shapely
from hypothesis import given

from scenarios.corridor import drive_value
from sensors.scene import Ego, boxes_scene
from testbed.evaluation.drive_evaluator import DriveEvaluator
from testbed.evaluation.driving import (
    BodyBoxes,
    body_boxes,
    box_distance,
    changed_decisions,
    contact_time,
    count_onsets,
    deceleration_needed,
    drive_score,
    extra_braking,
    headway_time,
    speed_difference,
)
from testbed.evaluation.metrics import areas
from trackers.geometry import box_corners, rotation, unit

CAR = np.array([4.0, 2.0])


def ego(x=0.0, speed=20.0, heading=0.0, crashed=False):
    pose = np.array([x, 0.0, heading])
    return Ego(pose, speed * unit(heading), 0.0, CAR, box_corners(pose, CAR), crashed)


def other(x, y, heading=0.0, speed=10.0, size=CAR):
    pose = np.array([[x, y, heading]], float)
    return BodyBoxes(pose, np.array([size], float), speed * unit(pose[:, 2]))


def drive(speeds, dt=0.1, crashed_from=None):
    """Summary of an ego alone on the road with these speeds, scan by scan."""
    return driven(speeds, dt, crashed_from).summary()


def driven(speeds, dt=0.1, crashed_from=None):
    """Evaluator of an ego alone on the road with these speeds, scan by scan."""
    evaluator, x = DriveEvaluator(), 0.0
    for k, speed in enumerate(speeds):
        crashed = crashed_from is not None and k >= crashed_from
        none = np.zeros((0, 3)), np.zeros((0, 2))
        evaluator.step(boxes_scene(*none, ego=ego(x, speed, crashed=crashed), time=k * dt, dt=dt))
        x += speed * dt
    return evaluator


def behind(gaps, speed=20.0, leader=10.0, dt=0.1):
    """Evaluator of an ego at these gaps [m] behind a leader, scan by scan."""
    evaluator = DriveEvaluator()
    for k, gap in enumerate(gaps):
        scene = boxes_scene([[gap + 4.0, 0, 0]], [CAR], [[leader, 0]], ego=ego(0.0, speed), time=k * dt)
        evaluator.step(scene)
    return evaluator


# name: other, distance [m], headway time [s], contact time [s]
CASES = {
    "slower ahead": (other(30, 0), 26.0, 2.6, 2.6),
    "faster ahead": (other(30, 0, speed=30), 26.0, np.inf, np.inf),
    "faster behind": (other(-30, 0, speed=30), 26.0, np.inf, 2.6),
    "neighbour lane": (other(30, 4), np.hypot(26, 2), np.inf, np.inf),
    "reaching into the lane": (other(30, 1.5), 26.0, 2.6, 2.6),
    "oncoming": (other(64, 0, np.pi, speed=10), 60.0, 2.0, 2.0),
    "abreast": (other(0, 3, speed=20), 1.0, np.inf, np.inf),
    # x: |20 - 20 t| <= 3 from 0.85 s, y: |10 - 10 t| <= 3 from 0.7 s
    "crossing": (other(20, 10, -np.pi / 2), np.hypot(17, 7), np.inf, 0.85),
    "crossed before": (other(60, 10, -np.pi / 2), np.hypot(57, 7), np.inf, np.inf),
    "touching": (other(3, 0), 0.0, 0.0, 0.0),
}


@pytest.mark.parametrize("name", CASES)
def test_distances_and_times_are_those_computed_by_hand(name):
    boxes, distance, headway, contact = CASES[name]
    found = [measure(ego(), boxes)[0] for measure in (box_distance, headway_time, contact_time)]
    assert found == pytest.approx([distance, headway, contact])


@pytest.mark.parametrize("name", CASES)
def test_turning_the_world_changes_nothing(name):
    boxes, *expected = CASES[name]
    R = rotation(0.8)
    pose = np.concatenate([boxes.pose[:, :2] @ R.T, boxes.pose[:, 2:] + 0.8], -1)
    turned = BodyBoxes(pose, boxes.size, boxes.velocity @ R.T)
    found = [measure(ego(heading=0.8), turned)[0] for measure in (box_distance, headway_time, contact_time)]
    assert found == pytest.approx(expected, abs=1e-9)


def test_contact_time_agrees_with_moving_the_boxes_in_small_steps():
    rng, step = np.random.default_rng(5), 0.01
    me, time = ego(), np.arange(0, 8, step)
    pose = rng.uniform([-60, -40, -np.pi], [60, 40, np.pi], (60, 3))
    aim = rng.normal(0, 4, (60, 2)) - pose[:, :2]  # past the ego or into it, within 1 to 7 s
    boxes = BodyBoxes(pose, rng.uniform([3, 1.5], [12, 2.6], (60, 2)), me.velocity + aim / rng.uniform(1, 7, (60, 1)))
    shift = (boxes.velocity - me.velocity) * time[:, None, None]
    outlines = areas(box_corners(boxes.pose, boxes.size) + shift[:, :, None])  # (time, 60)
    touching = shapely.intersects(areas(me.outline), outlines)
    first = np.where(touching.any(0), time[touching.argmax(0)], np.inf)
    exact = contact_time(me, boxes)
    assert 10 < np.isfinite(first).sum() < 50
    hit = np.isfinite(first)
    assert ((exact[hit] <= first[hit] + 1e-9) & (exact[hit] > first[hit] - step - 1e-9)).all()
    grazing = np.isfinite(exact[~hit]) & (exact[~hit] < time[-1])  # contacts shorter than one step
    assert grazing.sum() <= 1


def test_a_body_of_a_bent_object_has_the_box_of_its_own_outline():
    scene = boxes_scene([[10.0, 5.0, 0.6]], [CAR], [[3.0, 1.0]], [0.5])
    shifted = scene.bodies.pose + np.array([[*unit(0.6), 0.0]])  # reference point 1 m ahead of the centre
    boxes = body_boxes(scene.bodies._replace(pose=shifted))
    np.testing.assert_allclose(boxes.pose, [[10.0, 5.0, 0.6]])
    np.testing.assert_allclose(boxes.size, [CAR])
    # the centre lies 1 m behind the reference point: w x (-u) = 0.5 * (sin, -cos)
    np.testing.assert_allclose(boxes.velocity, [[3 + 0.5 * np.sin(0.6), 1 - 0.5 * np.cos(0.6)]])


def test_an_empty_road_is_never_near():
    summary = drive([20.0, 20.0])
    assert [summary[name] for name in ("distance_min", "ttc_min", "ttc_plane_min")] == [np.inf, 10.0, 10.0]
    assert np.isnan(summary["distance_min_at"])
    assert summary["collisions"] == 0


def test_progress_and_mean_speed_follow_the_road_driven():
    summary = drive([10.0, 20.0, 30.0], dt=0.5)
    assert [summary[name] for name in ("progress", "elapsed", "speed_mean", "speed_max")] == [15.0, 1.0, 15.0, 30.0]
    assert drive([10.0])["progress"] == 0.0
    assert np.isnan(drive([10.0])["speed_mean"])


def test_closest_approach_is_kept_with_its_time():
    evaluator = DriveEvaluator()
    for k, x in enumerate([30.0, 12.0, 20.0]):
        evaluator.step(boxes_scene([[x, 0, 0]], [CAR], [[10, 0]], ego=ego(), time=k * 0.1))
    summary = evaluator.summary()
    assert [summary["distance_min"], summary["distance_min_at"]] == pytest.approx([8.0, 0.1])
    assert [summary["ttc_min"], summary["ttc_plane_min"]] == pytest.approx([0.8, 0.8])


def test_harsh_braking_is_counted_once_until_the_brake_is_released():
    # accelerations: -5, -3, -5, -1, -5 m/s^2: the second dip belongs to the first, the last is a new one
    summary = drive(20.0 + np.cumsum([0, -0.5, -0.3, -0.5, -0.1, -0.5]))
    assert summary["harsh_braking"] == 2
    assert summary["deceleration_max"] == pytest.approx(5.0)
    assert drive(20.0 + np.cumsum([0, -0.39, -0.39]))["harsh_braking"] == 0


def test_a_crash_is_one_collision_and_its_jolt_is_not_braking():
    summary = drive([20.0, 20.0, 2.0, 0.0], crashed_from=2)
    assert [summary[name] for name in ("collisions", "harsh_braking", "deceleration_max")] == [1, 0, 0.0]


def test_onsets_need_both_thresholds_and_ignore_nan():
    assert count_onsets(np.array([np.nan, -5, np.nan, -5, 0, np.nan, -5]), -4, -2) == 2
    assert count_onsets(np.zeros(0), -4, -2) == 0


def test_impossible_inputs_are_refused():
    with pytest.raises(ValueError, match="released must lie above harsh"):
        DriveEvaluator(harsh=-2.0, released=-4.0)
    evaluator, scene = DriveEvaluator(), boxes_scene([[30, 0, 0]], [CAR])
    evaluator.step(scene)
    with pytest.raises(ValueError, match=r"scene\.time must grow"):
        evaluator.step(scene)


# Measures of a drive


def test_the_braking_needed_uses_up_the_gap_as_the_speeds_become_equal():
    assert deceleration_needed(np.array([10.0]), np.array([10.0])) == 5.0  # 10^2 / (2 * 10)
    gaps, closing = np.array([10.0, 0.1, 0.0, np.inf]), np.array([-3.0, 10.0, 10.0, 10.0])
    np.testing.assert_array_equal(deceleration_needed(gaps, closing), [0.0, 20.0, 20.0, 0.0])


def test_a_constant_time_to_collision_of_two_seconds_for_one_second_is_a_tit_of_one():
    row = behind([20.0] * 11).summary()  # 20 m over 10 m/s
    assert row["tit"] == pytest.approx(1.0)
    assert [row["ttc_min"], row["ttc_5"], row["drac_max"]] == pytest.approx([2.0, 2.0, 2.5])
    assert row["headway_min"] == pytest.approx(1.0)
    assert behind([40.0] * 11).summary()["tit"] == 0.0


def test_the_five_percent_quantile_is_not_ruled_by_one_frame():
    row = behind([5.0, *[20.0] * 99]).summary()
    assert row["ttc_min"] == pytest.approx(0.5)
    assert row["ttc_5"] == pytest.approx(2.0)


def test_the_row_of_an_empty_road_are_those_of_no_risk():
    row = driven([20.0] * 11).summary()
    assert [row["ttc_min"], row["ttc_5"], row["headway_min"]] == [10.0] * 3
    assert [row["drac_max"], row["tit"], row["deceleration_max"], row["jerk"]] == [0.0] * 4
    np.testing.assert_allclose(row["drive_value"], 20.0 / 30.0)


def test_the_jerk_is_the_slope_of_the_acceleration():
    t = 0.1 * np.arange(20)
    assert driven(10.0 + t**2).summary()["jerk"] == pytest.approx(2.0)  # a = 2 t
    assert driven(10.0 + 3 * t).summary()["jerk"] == pytest.approx(0.0, abs=1e-9)
    # one spike of -1 m/s^2: its mean over three frames steps by 1/3 twice within 14 differences, by 1/3 / 0.1 s
    speeds = 20.0 - 0.1 * (np.arange(18) > 8)
    assert driven(speeds).summary()["jerk"] == pytest.approx(np.sqrt(2 / 14) / 0.3)


def test_a_second_is_worth_its_speed_less_risk_and_braking():
    values = drive_value(np.array([30.0, 30.0, 15.0]), np.array([np.inf, 1.5, 3.0]), np.array([0.0, 0.0, 4.0]))
    np.testing.assert_allclose(values, [1.0, 1.0 - 2 * 0.25, 0.5 - 0.5 * 0.25])
    # 30 m/s, then one frame of braking with 8 m/s^2: 0.1 s (30 / 30) + 0.1 s (29.2 / 30 - 0.5)
    np.testing.assert_allclose(driven([30.0, 30.0, 29.2]).summary()["drive_value"], 0.1 + 0.1 * (29.2 / 30 - 0.5))


def scores(aim=100.0, **drive):
    usual = {"progress": 100.0, "ttc_min": 10.0, "deceleration_max": 0.0, "collisions": 0, "off_road": 0.0}
    return float(drive_score(usual | drive, aim))


def test_a_score_by_hand():
    assert scores() == 1.0
    assert scores(progress=60.0) == pytest.approx(10 / 12)  # 5 (0.6) + 5 + 2
    assert scores(ttc_min=1.975) == pytest.approx(9.5 / 12)  # half way from 0.95 to 3 s
    assert scores(deceleration_max=8.0, ttc_min=0.5) == pytest.approx(5 / 12)
    assert np.isnan(scores(aim=np.nan))


@given(ttc=st.floats(0.0, 10.0), braking=st.floats(0.0, 12.0), share=st.floats(0.01, 2.0), other=st.floats(0.0, 100.0))
def test_a_crash_is_below_every_drive_without_one_and_going_farther_earns_nothing(ttc, braking, share, other):
    drive = {"ttc_min": ttc, "deceleration_max": braking, "progress": 100.0 * share}
    assert 0.0 < scores(**drive) <= 1.0
    for failed in ({"collisions": 1}, {"off_road": 0.1}):
        assert scores(ttc_min=10.0, progress=other, **failed) == 0.0
    assert scores(**drive) <= scores(**{**drive, "progress": 100.0})


def test_time_off_the_road_is_counted():
    evaluator = DriveEvaluator()
    for k, on in enumerate([True, True, False, False]):
        none = np.zeros((0, 3)), np.zeros((0, 2))
        evaluator.step(boxes_scene(*none, ego=ego(2.0 * k)._replace(on_road=on), time=0.1 * k, dt=0.1))
    assert evaluator.summary()["off_road"] == pytest.approx(0.2)


def test_a_crash_ends_the_braking_but_not_the_risk():
    evaluator = behind([10.0, 9.0])
    last = boxes_scene([[4.0, 0, 0]], [CAR], [[10.0, 0]], ego=ego(0.0, 2.0, crashed=True), time=0.2)
    evaluator.step(last)
    row = evaluator.summary()
    assert row["collisions"]
    assert row["deceleration_max"] == 0.0
    assert row["drac_max"] == pytest.approx(10.0**2 / (2 * 9.0))  # in the crash the ego is slower than the leader


def test_extra_braking_counts_what_is_harder_than_in_the_other_drive():
    hard, soft = driven([20.0, 19.7, 19.4, 19.4]).curves, driven([20.0, 19.9, 19.8, 19.4, 19.0]).curves
    assert extra_braking(hard, soft) == pytest.approx(0.4)  # 3 against 1 m/s^2 for 0.2 s; later softer
    assert extra_braking(soft, hard) == pytest.approx(0.4)  # 4 against 0 m/s^2 for 0.1 s
    assert extra_braking(hard, hard) == 0.0
    assert speed_difference(hard, soft) == pytest.approx(np.sqrt((0.2**2 + 0.4**2) / 4))


def test_changed_decisions_are_a_share_of_those_that_both_drives_made():
    assert changed_decisions([1, 1, 0], [1, 0, 0, 2]) == pytest.approx(1 / 3)
    assert changed_decisions([np.array([0.1, 0.0])], [np.array([0.1, 0.0])]) == 0.0
    assert changed_decisions([], [1]) == 0.0


def test_a_drive_without_a_frame_has_no_metrics():
    assert all(np.isnan(value) for value in DriveEvaluator().summary().values())
