"""A learned policy: a neural network from the observation of the environment to the action of the greatest value.

`save_policy` writes the q-network of a DQN of stable-baselines3 as an `.npz` file. Training: docs/learning-to-drive.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike, NDArray

from testbed.files import read_arrays
from testbed.planners.idm import Choice, straight_on


@dataclass(frozen=True)
class Network:
    """A multi-layer perceptron with rectified linear units between its L layers."""

    weights: tuple[NDArray, ...]  # (out, in) of each layer
    biases: tuple[NDArray, ...]  # (out,)

    def __call__(self, x: NDArray) -> NDArray:
        """Outputs (out,) for an input of any shape, which is flattened."""
        x = np.asarray(x, np.float32).ravel()
        for W, b in zip(self.weights[:-1], self.biases[:-1]):
            x = np.maximum(W @ x + b, 0.0)
        return self.weights[-1] @ x + self.biases[-1]


@dataclass(frozen=True)
class Learned:
    """The action of the greatest value; the environment must have the observation and actions of the training."""

    file: str  # what `save_policy` wrote
    note: str = "a policy learned from rewards"
    knows_truth: bool = False
    _network: Network = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_network", read_policy(Path(self.file)))

    @property
    def name(self) -> str:
        """`learned-` and the name of the file."""
        return f"learned-{Path(self.file).stem}"

    def act(self, env: gym.Env) -> int:
        """The action for the next period.

        Raises:
            ValueError: the observation or the actions are not those of the training.
        """
        core: Any = env.unwrapped
        observation, network = np.asarray(core.observation_type.observe()), self._network
        inputs, outputs = network.weights[0].shape[1], len(network.biases[-1])
        actions = getattr(core.action_space, "n", None)
        if (observation.size, actions) != (inputs, outputs):
            raise ValueError(
                f"policy {self.file} needs an observation of {inputs} numbers and {outputs} discrete actions, got "
                f"{observation.size} and {core.action_space}; give the environment the config of the training"
            )
        return int(network(observation).argmax())

    def choose(self, env: gym.Env) -> Choice:
        """The action, and the path straight on."""
        core: Any = env.unwrapped
        return Choice(self.act(env), straight_on(core.vehicle))  # the network has no path


def save_policy(file: str | Path, layers: Sequence[tuple[ArrayLike, ArrayLike]]) -> None:
    """Write weights (out, in) and biases (out,) of the layers, from the observation to the values of the actions."""
    arrays: dict[str, Any] = {}
    for i, (weight, bias) in enumerate(layers):
        arrays |= {f"weight{i}": np.asarray(weight, np.float32), f"bias{i}": np.asarray(bias, np.float32)}
    np.savez(file, **arrays)


def read_policy(file: Path) -> Network:
    """The network in a file of `save_policy`; ValueError, in one sentence, for anything else."""
    try:
        arrays = read_arrays(file)
        count = len(arrays) // 2
        weights = tuple(arrays[f"weight{i}"] for i in range(count))
        biases = tuple(arrays[f"bias{i}"] for i in range(count))
    except (ValueError, KeyError) as error:
        raise ValueError(f"{file} holds no policy: {error}; `save_policy` writes one") from None
    fits = [w.ndim == 2 and b.shape == w.shape[:1] for w, b in zip(weights, biases)]
    chained = [a.shape[0] == b.shape[-1] for a, b in pairwise(weights)]
    if not (count and all(fits) and all(chained)):
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ValueError(f"{file} holds no policy: its layers do not fit each other: {shapes}")
    return Network(weights, biases)
