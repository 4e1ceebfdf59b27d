"""The corridor ahead, against the clipping of polygons, and the reward that is built on it."""

import numpy as np
import pytest
import shapely

from scenarios.corridor import gap_ahead, time_to_collision
from scenarios.highway import ScenarioEnv
from tests.scenarios.episodes import ONE_NUMBER
from trackers.geometry import box_corners, to_frame

SIZE = np.array([4.7, 1.9])


def clipped(pose, corners):
    """Gaps (B,) [m] by clipping each box with the corridor."""
    front, half = SIZE / 2
    local = shapely.polygons(to_frame(pose, corners))
    inside = shapely.clip_by_rect(local, front, -half, 1e4, half)
    return np.where(shapely.area(inside) > 0, shapely.bounds(inside)[:, 0] - front, np.inf)


@pytest.mark.parametrize("turned", [True, False])
def test_a_gap_is_that_to_the_part_of_a_box_within_the_corridor(turned):
    rng = np.random.default_rng(3)
    for _ in range(300):
        pose = rng.uniform([-5, -5, -3], [5, 5, 3])
        boxes = rng.uniform([-20, -20, -3.2], [20, 20, 3.2], (5, 3))
        boxes[:, 2] = boxes[:, 2] if turned else pose[2]
        corners = box_corners(boxes, rng.uniform([1, 0.5], [15, 3], (5, 2)))
        np.testing.assert_allclose(gap_ahead(pose, SIZE, corners), clipped(pose, corners), atol=1e-9)


def test_without_others_there_is_no_gap():
    assert gap_ahead(np.zeros(3), SIZE, np.zeros((0, 4, 2))).shape == (0,)


def rewards(action, **config):
    """Rewards of five steps of one action in probe-brake, and the environment."""
    env = ScenarioEnv("probe-brake", config={"observation": ONE_NUMBER, **config})
    env.reset(seed=0)
    return [env.step(action)[1] for _ in range(5)], env


def test_the_reward_of_a_calm_step_is_its_speed_times_its_length():
    (first, *_), env = rewards(1, reward="drive", gap=60.0)
    assert first == pytest.approx(env.vehicle.speed / 30 / 5, abs=2e-3)  # at most 1 m/s^2 on the way to a target speed


def test_braking_is_worth_less_than_its_loss_of_speed():
    braked, env = rewards(0, reward="drive", gap=60.0)
    assert env.vehicle.action["acceleration"] < -4
    speed_alone, _ = rewards(0, gap=60.0)
    assert sum(braked) < sum(speed_alone) / 5 - 0.5 * 0.5**2 / 5


def test_an_unknown_reward_is_refused():
    with pytest.raises(ValueError, match="must be one of speed, drive, got 'fast'"):
        ScenarioEnv("cut-in", config={"reward": "fast"})


def test_a_crash_is_worth_what_the_config_says():
    env = ScenarioEnv("probe-brake", config={"observation": ONE_NUMBER, "reward": "drive", "collision_reward": -3.0})
    env.reset(seed=0)
    terminated = truncated = False
    while not (terminated or truncated):
        _, reward, terminated, truncated, _ = env.step(1)
    assert terminated
    assert reward == -3.0


def test_no_time_to_collision_comes_of_rounding():
    found = time_to_collision(np.array([30.0, 30.0, 30.0]), np.array([1e-14, 0.0, 3.0]))
    assert found.tolist() == [np.inf, np.inf, 10.0]
