"""Ego motion from range rates, and statistics of what stands, on scans made by hand."""

from pathlib import Path

import numpy as np
import pytest

from sensors import RADARS
from sensors.scene import boxes_scene
from studies.standing.scans import FRAMES, POINTS, RadarScan, at_speed, read_real, simulate
from studies.standing.statistics import Judged, fit_motion, judge, spread, statistics
from trackers.geometry import unit

REAL = Path(__file__).resolve().parents[4] / "shared/data/raflow"


def polar(rng, velocity, standing, moving):
    n = standing + moving
    r, a = rng.uniform(5, 70, n), rng.uniform(-0.8, 0.8, n)
    rate = -unit(a) @ velocity + 0.03 * rng.standard_normal(n)
    rate[standing:] += rng.uniform(3.0, 20.0, moving)
    return np.stack([r, a, rate], -1)


def test_ego_motion_is_found_among_as_many_moving_things_and_not_where_these_are_one_block():
    v = np.array([9.0, -0.6])
    z = polar(np.random.default_rng(0), v, 60, 60)
    np.testing.assert_allclose(fit_motion(z), v, atol=0.06)  # 4 standard deviations of the lateral component
    z[:90, 2] = -unit(z[:90, 1]) @ (v - [7.0, 0.0])
    assert np.hypot(*(fit_motion(z) - v)) > 5


def test_one_detection_is_refused():
    with pytest.raises(ValueError, match="two detections or more, got 1"):
        fit_motion(np.zeros((1, 3)))


def test_statistics_of_a_scan_by_hand():
    a = np.radians([0.0, 25.0, -45.0, 3.0])
    rate = -unit(a) @ [10.0, 0.0] + [0.0, 0.15, -0.25, 8.0]
    one = Judged(RadarScan("x", np.stack([[15.0, 35.0, 5.0, 60.0], a, rate], -1), np.array([10.0, 0.0])), np.zeros(2))
    found = statistics([one, one])
    assert (found["scans"], found["detections a scan"], found["standing a scan"]) == (2, 4, 3)
    assert found["standing, share"] == 0.75
    assert [found[f"{r}"] for r in ("0 to 10 m", "10 to 20 m", "30 to 40 m", "60 to 70 m")] == [1, 1, 1, 0]
    assert [found[f"{d} deg"] for d in ("0 to 10", "20 to 30", "40 to 55")] == [1, 1, 1]
    assert (found["own lane, up to 30 m"], found["strip ahead, all ranges"]) == (1, 1)
    assert found["rest beyond 0.1 m/s, share"] == pytest.approx(2 / 3)
    assert found["rest, middle [m/s]"] == pytest.approx(1.4826 * 0.15)
    assert found["ego motion found, share of scans"] == 0.0
    assert np.isnan(spread(np.zeros(0)))


def test_a_scene_at_another_speed_keeps_its_directions():
    scene = boxes_scene([[20.0, 0.0, 0.0]], [[4.6, 1.8]], velocity=[[30.0, 2.0]])
    scene = scene._replace(ego=scene.ego._replace(velocity=np.array([15.0, 0.0]), yaw_rate=0.3))
    slow = at_speed(scene, 5.0)
    np.testing.assert_allclose(slow.ego.velocity, [5.0, 0.0])
    np.testing.assert_allclose(slow.bodies.velocity, [[10.0, 2 / 3]])
    assert slow.ego.yaw_rate == pytest.approx(0.1)
    assert scene.ego.velocity[0] == 15.0


def test_a_simulated_scan_knows_the_velocity_of_its_radar_in_its_own_frame():
    scene = boxes_scene([[20.0, 0.0, 0.0]], [[4.6, 1.8]])
    scene = scene._replace(ego=scene.ego._replace(velocity=np.array([10.0, 0.0])))
    (scan,) = simulate(RADARS["corners"], [("x", scene)])
    np.testing.assert_allclose(scan.velocity, [5.0, -10 * np.sin(np.pi / 3)], atol=1e-9)


def test_repeated_frames_are_left_out_and_y_is_mirrored(tmp_path):
    row = [10.0, 4.0, 1.0, -3.0, 2.0, 60.0]
    moved = [9.0, 4.0, 1.0, -3.0, 2.0, 60.0]
    other = [10.0, 4.0, 1.0, -2.0, 2.0, 60.0]
    points = np.array([[0, k, *values] for k, values in enumerate((row, moved, other))])
    np.savez(tmp_path / "frames.npz", **{POINTS: points, FRAMES: np.array([[0, k, 0.1] for k in range(3)])})
    scans, frames = read_real(tmp_path)
    assert (len(scans), frames, scans[0].run) == (2, 3, "run 0")
    np.testing.assert_allclose(scans[0].polar, [[np.sqrt(117.0), -np.arctan2(4.0, 10.0), -3.0]])


def test_a_folder_without_them_is_refused(tmp_path):
    with pytest.raises(ValueError, match="has no frames of a real radar"):
        read_real(tmp_path)


@pytest.mark.skipif(not REAL.is_dir(), reason="the frames of the real radar are not part of the project")
def test_the_real_frames_are_read_and_most_of_what_they_show_stands():
    scans, frames = read_real(REAL)
    assert (len(scans), frames) == (91, 110)
    judged = [judge(scan) for scan in scans[::9]]
    assert np.mean([one.still.mean() for one in judged]) > 0.7
