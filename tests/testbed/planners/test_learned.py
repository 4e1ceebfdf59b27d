"""Learned policies: the network by hand, the file, and what does not fit it."""

import gymnasium as gym
import numpy as np
import pytest

from testbed.planners.learned import Learned, read_policy, save_policy
from testbed.planners.registry import find


def policy(folder, inputs, outputs, seed=0):
    """A file with a random network of one hidden layer."""
    rng = np.random.default_rng(seed)
    layers = [
        (rng.normal(size=(8, inputs)), rng.normal(size=8)),
        (rng.normal(size=(outputs, 8)), rng.normal(size=outputs)),
    ]
    save_policy(folder / "mine.npz", layers)
    return folder / "mine.npz", layers


def test_the_network_by_hand(tmp_path):
    """relu(x1 - x2), relu(x2 - x1 + 1), then their difference and their sum, of (3, 1): 2, 0 -> 2 - 0.5 and 2."""
    save_policy(tmp_path / "p.npz", [([[1, -1], [-1, 1]], [0, 1]), ([[1, -1], [1, 1]], [-0.5, 0])])
    np.testing.assert_allclose(read_policy(tmp_path / "p.npz")(np.array([[3.0], [1.0]])), [1.5, 2.0])
    np.testing.assert_allclose(read_policy(tmp_path / "p.npz")(np.array([1.0, 1.0])), [-1.5, 1.0])


def test_it_drives_by_the_observation_of_the_tracks(tmp_path):
    env = gym.make("testbed/cut-in-v0", tracker="rm-feldmann", warm_up=1.0)
    observation, _ = env.reset(seed=0)
    file, ((W, b), (U, c)) = policy(tmp_path, observation.size, env.action_space.n)
    planner = find(f"learned:{file}")
    assert planner.name == "learned-mine"
    for _ in range(3):
        values = U @ np.maximum(W @ observation.ravel() + b, 0.0) + c
        action, plan = planner.choose(env)
        assert action == values.argmax()
        np.testing.assert_allclose(plan[0], env.unwrapped.vehicle.position)
        observation, *_ = env.step(action)
    env.close()


def test_it_says_what_does_not_fit(tmp_path):
    env = gym.make("testbed/cut-in-v0", tracker="truth")
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"needs an observation of 25 numbers and 5 discrete actions, got 70"):
        Learned(str(policy(tmp_path, 25, 5)[0])).act(env)
    with pytest.raises(ValueError, match=r"nothing\.npz holds no policy: it is not a file"):
        find("learned:nothing.npz")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(ValueError, match="holds no policy"):
        find(f"learned:{tmp_path / 'other.npz'}")
    save_policy(tmp_path / "unchained.npz", [(np.zeros((4, 3)), np.zeros(4)), (np.zeros((2, 5)), np.zeros(2))])
    with pytest.raises(ValueError, match="its layers do not fit each other"):
        find(f"learned:{tmp_path / 'unchained.npz'}")


def test_a_network_of_stable_baselines_is_the_same_in_arrays(tmp_path):
    sb3 = pytest.importorskip("stable_baselines3", reason="the extra rl is not installed: it brings gigabytes of torch")
    model = sb3.DQN("MlpPolicy", "CartPole-v1", policy_kwargs={"net_arch": [16, 16]}, seed=1, device="cpu")
    parts = [part for part in model.policy.q_net.q_net if hasattr(part, "weight")]
    save_policy(tmp_path / "p.npz", [(part.weight.detach(), part.bias.detach()) for part in parts])
    network = read_policy(tmp_path / "p.npz")
    for x in np.random.default_rng(0).normal(size=(5, 4)).astype(np.float32):
        assert network(x).argmax() == model.predict(x, deterministic=True)[0]
