"""What training needs of the environment: a warm-up, vector environments, nothing written or kept unasked."""

import gc
import os
import tracemalloc

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import testbed

ID = "testbed/following-v0"
SHORT = {"duration": 1.0}


def test_a_warm_up_gives_the_first_observation_tracks_and_no_decision():
    blind, warm = gym.make(ID, tracker="rm-feldmann"), gym.make(ID, tracker="rm-feldmann", warm_up=1.0)
    _, before = blind.reset(seed=0)
    observation, after = warm.reset(seed=0)
    assert after["tracks"] > before["tracks"]
    assert observation[:, 0].sum() >= 3  # presence: the ego and some tracks
    assert warm.truth.time == 1.0
    assert warm.unwrapped.steps == 0


def test_truth_and_tracks_begin_in_the_same_state_and_the_episode_is_as_long():
    ends = []
    for tracker in ("truth", "rm-feldmann"):
        env = gym.make(ID, tracker=tracker, config=SHORT, warm_up=1.0)
        env.reset(seed=4)
        ends.append((env.truth.ego.pose.tolist(), env.truth.objects.pose.tolist()))
        done, decisions = False, 0
        while not done:
            *_, crashed, over, _ = env.step(1)
            done, decisions = crashed or over, decisions + 1
        assert decisions == 5
        assert env.truth.time == pytest.approx(2.0)
    assert ends[0] == ends[1]


def test_a_warm_up_is_the_traffic_without_actions():
    env, other = gym.make(ID, tracker="truth", warm_up=1.0), gym.make(ID, tracker="truth")
    env.reset(seed=1)
    other.reset(seed=1)
    for _ in range(5):
        other.step(None)
    np.testing.assert_array_equal(env.truth.objects.pose, other.truth.objects.pose)
    np.testing.assert_array_equal(env.truth.ego.pose, other.truth.ego.pose)


def test_observers_get_every_scan_of_the_warm_up():
    env = gym.make(ID, tracker="rm-feldmann", warm_up=0.4)
    times = []
    env.attach(lambda frame: times.append(frame.time))
    env.reset(seed=0)
    np.testing.assert_allclose(times, np.arange(7) / 15)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [({"warm_up": -1.0}, "warm_up must be"), ({"warm_up": np.nan}, "warm_up must be"),
     ({"every_episode": 0}, "every_episode must be"), ({"every_episode": 2.5}, "every_episode must be")],
)  # fmt: skip
def test_it_refuses_what_makes_no_sense(arguments, message):
    with pytest.raises(ValueError, match=message):
        gym.make(ID, **arguments)


def episodes(env, count):
    """Short episodes, the first one seeded."""
    for k in range(count):
        env.reset(seed=0 if k == 0 else None)
        done = False
        while not done:
            *_, crashed, over, _ = env.step(1)
            done = crashed or over
    env.close()


def test_every_third_episode_has_files(tmp_path):
    env = gym.make(ID, tracker="rm-feldmann", config=SHORT, out=str(tmp_path), log="off", every_episode=3)
    episodes(env, 5)
    assert len(list(tmp_path.glob("*.json"))) == 2
    assert [file.stem.endswith("episode3") for file in sorted(tmp_path.glob("*.json"))].count(True) == 1


def test_nothing_is_written_unasked(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    episodes(gym.make(ID, tracker="rm-feldmann", config=SHORT), 1)
    assert not list(tmp_path.iterdir())


def test_memory_and_handles_stay_flat_over_episodes():
    env = gym.make(ID, tracker="rm-feldmann", config={"duration": 0.4})
    handles, kept = [], []
    tracemalloc.start(1)
    try:
        for _ in range(3):
            for _ in range(4):
                env.reset()
                env.step(1)
            gc.collect()
            kept.append(tracemalloc.get_traced_memory()[0])
            handles.append(len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else 0)
    finally:
        tracemalloc.stop()
    assert handles[-1] == handles[1]
    assert kept[-1] - kept[1] < 100_000  # [bytes] over four episodes; one road with its vehicles has about 300 000


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_vector_environments_work_in_every_mode_of_autoreset(mode):
    env = gym.make_vec(
        ID, num_envs=2, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, tracker="rm-feldmann",
        config=SHORT, warm_up=0.4,
    )  # fmt: skip
    env.reset(seed=0)
    for step in range(7):
        if mode == AutoresetMode.DISABLED and step == 5:
            env.reset(options={"reset_mask": np.ones(2, bool)})
        _, _, _, truncated, info = env.step(np.ones(2, int))
        assert info["tracks"].shape == (2,) or mode == AutoresetMode.SAME_STEP
        assert truncated.all() == (step == 4)
    env.close()


def test_environments_run_in_processes_of_their_own_as_they_do_in_one():
    actions, found = np.ones(2, int), []
    for mode in ("sync", "async"):
        env = gym.make_vec(ID, num_envs=2, vectorization_mode=mode, tracker="rm-feldmann", config=SHORT, warm_up=0.4)
        observation, info = env.reset(seed=3)
        observations = [observation]
        for _ in range(6):
            observation, _, _, _, info = env.step(actions)
            observations.append(observation)
        found.append((np.array(observations), info["tracks"]))
        env.close()
    np.testing.assert_array_equal(found[0][0], found[1][0])
    np.testing.assert_array_equal(found[0][1], found[1][1])


def test_observations_of_tracks_are_stacked_with_their_ids():
    def make():
        return testbed.TrackObservation(gym.make(ID, tracker="rm-feldmann", config=SHORT, warm_up=1.0), size=6)

    env = gym.vector.SyncVectorEnv([make, make])
    observation, info = env.reset(seed=0)
    assert observation["tracks"].shape == (2, 6, 30)
    assert info["track_ids"].shape == (2, 6)
    _, _, _, _, later = env.step(np.ones(2, int))
    assert set(info["track_ids"][0]) & set(later["track_ids"][0]) - {-1}  # ids are kept
    env.close()


def test_an_episode_can_be_filmed(tmp_path):
    pytest.importorskip("moviepy", reason="moviepy is not installed")
    env = gym.make(ID, tracker="truth", config=SHORT, render_mode="rgb_array")
    episodes(gym.wrappers.RecordVideo(env, str(tmp_path)), 1)
    assert list(tmp_path.glob("*.mp4"))
