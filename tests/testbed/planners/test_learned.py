"""Learned policies: the network by hand, the file, and what does not fit it."""

import gymnasium as gym
import numpy as np
import pytest

import testbed
from testbed.limits import UnfitPolicy
from testbed.planners.learned import Learned, read_policy, save_policy
from testbed.planners.registry import find


def policy(folder, inputs, outputs, seed=0):
    """A file with a random network of one hidden layer."""
    rng = np.random.default_rng(seed)
    layers = [
        (rng.normal(size=(8, inputs)), rng.normal(size=8)),
        (rng.normal(size=(outputs, 8)), rng.normal(size=outputs)),
    ]
    save_policy(folder / "mine.npz", layers, activation="relu")
    return folder / "mine.npz", layers


def test_the_network_by_hand(tmp_path):
    """relu(x1 - x2), relu(x2 - x1 + 1), then their difference and their sum, of (3, 1): 2, 0 -> 2 - 0.5 and 2."""
    save_policy(tmp_path / "p.npz", [([[1, -1], [-1, 1]], [0, 1]), ([[1, -1], [1, 1]], [-0.5, 0])], activation="relu")
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
    save_policy(
        tmp_path / "unchained.npz",
        [(np.zeros((4, 3)), np.zeros(4)), (np.zeros((2, 5)), np.zeros(2))],
        activation="relu",
    )
    with pytest.raises(ValueError, match="its layers do not fit each other"):
        find(f"learned:{tmp_path / 'unchained.npz'}")


class Linear:
    """A layer as torch has it, as far as `save_policy` looks; so are the others by their names alone."""

    def __init__(self, rng, outputs, inputs):
        self.weight, self.bias = rng.normal(size=(outputs, inputs)), rng.normal(size=outputs)


Flatten, ReLU, Tanh, GELU, LayerNorm = (type(name, (), {}) for name in ("Flatten", "ReLU", "Tanh", "GELU", "LayerNorm"))


def modules(*activations, inputs=4):
    """Linear layers of 8 with some modules between each two."""
    rng = np.random.default_rng(3)
    hidden = [part for kind in activations for part in (kind(), Linear(rng, 8, 8))]
    return [Flatten(), Linear(rng, 8, inputs), *hidden, Tanh(), Linear(rng, 3, 8)]


def test_modules_keep_their_activations(tmp_path):
    layers = modules(ReLU)
    save_policy(tmp_path / "p.npz", layers)
    network = read_policy(tmp_path / "p.npz")
    assert network.activations == ("relu", "tanh")
    (W, a), (V, b), (U, c) = ((part.weight, part.bias) for part in layers if isinstance(part, Linear))
    x = np.array([0.3, -1.0, 2.0, 0.1])
    np.testing.assert_allclose(network(x), U @ np.tanh(V @ np.maximum(W @ x + a, 0) + b) + c, rtol=1e-5)


@pytest.mark.parametrize(
    ("layers", "words"),
    [
        (modules(GELU), "got Linear, GELU, Linear, Tanh, Linear"),
        (modules(LayerNorm), "got Linear, LayerNorm, Linear"),
        (modules(ReLU)[:-1], "with ReLU or Tanh between each two"),
        ([modules()[1], *modules()[1:]], "got Linear, Linear, Tanh"),
        ([(np.zeros((2, 3)), np.zeros(2))], "activation must be 'relu' or 'tanh' between pairs.*got None"),
    ],
)
def test_what_the_planner_does_not_have_is_refused_by_name(tmp_path, layers, words):
    with pytest.raises(ValueError, match=words):
        save_policy(tmp_path / "p.npz", layers)
    assert not list(tmp_path.iterdir())


def test_a_file_of_an_older_version_is_read_as_relu(tmp_path):
    arrays = {"weight0": -np.ones((2, 2)), "bias0": np.zeros(2), "weight1": np.ones((2, 2)), "bias1": np.zeros(2)}
    np.savez(tmp_path / "old.npz", **arrays)
    assert read_policy(tmp_path / "old.npz")(np.ones(2)).tolist() == [0.0, 0.0]
    np.savez(tmp_path / "new.npz", **arrays, activations=np.array(["gelu"]))
    with pytest.raises(ValueError, match="its activation 'gelu' is none of relu, tanh"):
        read_policy(tmp_path / "new.npz")


def test_an_observation_of_another_kind_or_scale_is_refused_in_one_sentence(tmp_path):
    def made(**observation):
        inner = gym.make("highway-fast-v0", config={"observation": {"type": "Kinematics", **observation}})
        env = testbed.TrackedEnv(inner, tracker="truth")
        env.reset(seed=0)
        return env

    save_policy(tmp_path / "p.npz", modules(inputs=25), made())
    planner = Learned(str(tmp_path / "p.npz"))
    with pytest.raises(UnfitPolicy, match="3 discrete actions"):
        planner.act(made(vehicles_count=5))  # the default, written out
    for key, value in (("normalize", False), ("absolute", True), ("features_range", {"x": [-50.0, 50.0]})):
        with pytest.raises(UnfitPolicy, match=f"trained on an observation with {key} = .*, got .*; give the env"):
            planner.act(made(**{key: value}))
    with pytest.raises(UnfitPolicy, match="type = 'Kinematics', got 'Lidar"):
        Learned(str(tmp_path / "p.npz")).act(
            testbed.TrackedEnv(gym.make("highway-fast-v0", config={"observation": {"type": "LidarObservation"}}))
        )
    with pytest.raises(UnfitPolicy, match=r"the network takes 25 numbers, got an input of shape \(5, 7\)"):
        read_policy(tmp_path / "p.npz")(np.zeros((5, 7)))


@pytest.mark.parametrize("wrap", [gym.wrappers.NormalizeObservation, testbed.TrackObservation])
def test_observations_that_a_wrapper_changes_are_not_those_of_the_planner(tmp_path, wrap):
    env = wrap(gym.make("testbed/cut-in-v0", tracker="truth"))
    with pytest.raises(ValueError, match=f"env has the wrapper {wrap.__name__}, which changes the observation"):
        save_policy(tmp_path / "p.npz", modules(), env)


def test_a_policy_of_tracks_gets_the_observation_of_its_training_from_any_environment_with_a_tracker(tmp_path):
    env = gym.make("testbed/cut-in-v0", tracker="rm-feldmann", warm_up=1.0)
    flat = gym.wrappers.FlattenObservation(testbed.TrackObservation(env, size=3, scale=True))
    seen, _ = flat.reset(seed=2)
    W = np.random.default_rng(0).normal(size=(flat.action_space.n, len(seen))).astype(np.float32)
    save_policy(tmp_path / "p.npz", [(W, np.zeros(len(W)))], flat, activation="relu")
    planner = Learned(str(tmp_path / "p.npz"))
    for _ in range(3):
        assert planner.act(env) == (W @ seen).argmax()
        seen, *_ = flat.step(1)
    with pytest.raises(UnfitPolicy, match="was trained on tracks"):
        planner.act(gym.make("highway-fast-v0"))


@pytest.mark.parametrize("kind", ["DQN", "PPO"])
def test_a_network_of_stable_baselines_is_the_same_in_arrays(tmp_path, kind):
    sb3 = pytest.importorskip("stable_baselines3", reason="the extra rl is not installed: it brings gigabytes of torch")
    model = getattr(sb3, kind)("MlpPolicy", "CartPole-v1", seed=1, device="cpu")
    policy = model.policy
    parts = policy.q_net.q_net if kind == "DQN" else [*policy.mlp_extractor.policy_net, policy.action_net]
    save_policy(tmp_path / "p.npz", list(parts))
    network = read_policy(tmp_path / "p.npz")
    for x in np.random.default_rng(0).normal(size=(100, 4)).astype(np.float32):
        assert network(x).argmax() == model.predict(x, deterministic=True)[0]
