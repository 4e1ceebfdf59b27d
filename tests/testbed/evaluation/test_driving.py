"""The drive measured on scenes that can be computed by hand, and against a slow simulation."""

import numpy as np
import pytest
import shapely

from sensors.scene import Ego, boxes_scene
from testbed.evaluation.driving import (
    BodyBoxes,
    DriveEvaluator,
    body_boxes,
    box_distance,
    contact_time,
    count_onsets,
    headway_time,
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
    """An ego alone on the road with these speeds, scan by scan."""
    evaluator, x = DriveEvaluator(), 0.0
    for k, speed in enumerate(speeds):
        crashed = crashed_from is not None and k >= crashed_from
        none = np.zeros((0, 3)), np.zeros((0, 2))
        evaluator.step(boxes_scene(*none, ego=ego(x, speed, crashed=crashed), time=k * dt, dt=dt))
        x += speed * dt
    return evaluator.summary()


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
    assert [summary[name] for name in ("distance_min", "ttc_min", "ttc_plane_min")] == [np.inf] * 3
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
