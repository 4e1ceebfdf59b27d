"""A learned policy: a neural network from the observation of the environment to the action of the greatest value.

`save_policy` writes a network of stable-baselines3 as an `.npz` file. Training: docs/learning-to-drive.md.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from inspect import signature
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from testbed.files import read_arrays
from testbed.limits import UnfitPolicy
from testbed.planners.idm import Choice, straight_on

ACTIVATIONS: Mapping[str, Callable[[NDArray], NDArray]] = MappingProxyType(
    {"relu": lambda x: np.maximum(x, 0.0), "tanh": np.tanh}
)
USED_BEFORE = "relu"  # of files that name no activation, which older versions have written
SHAPELESS = ("Flatten", "Identity", "Dropout")  # parts of a network that change no value once it is trained
FITTING = ("FlattenObservation",)  # wrappers of observations whose numbers are those of the environment
TRACKS = "TrackObservation"  # the wrapper that the planner knows, inside of one that flattens


@dataclass(frozen=True)
class Network:
    """A multi-layer perceptron of L layers with an activation between each two."""

    weights: tuple[NDArray, ...]  # (out, in) of each layer
    biases: tuple[NDArray, ...]  # (out,)
    activations: tuple[str, ...]  # L - 1 names of `ACTIVATIONS`
    observation: Mapping[str, Any] | None = None  # what it was trained on, see `observation_of`; None: not known

    def __call__(self, x: NDArray) -> NDArray:
        """Outputs (out,) for an input of any shape, which is flattened; UnfitPolicy for one of another size."""
        x = np.asarray(x, np.float32)
        if x.size != self.weights[0].shape[1]:
            raise UnfitPolicy(f"the network takes {self.weights[0].shape[1]} numbers, got an input of shape {x.shape}")
        x = x.ravel()
        for W, b, name in zip(self.weights[:-1], self.biases[:-1], self.activations, strict=True):
            x = ACTIVATIONS[name](W @ x + b)
        return self.weights[-1] @ x + self.biases[-1]


def observation_of(env: gym.Env) -> dict[str, Any]:
    """Kind, contents and scale of the observation of an environment: its config with all defaults, as JSON types.

    Where a range of a feature is not set, highway-env scales by the road: y by the number of lanes.
    """
    if (tracks := _layer(env, TRACKS)) is not None:
        return {"type": TRACKS, **{name: getattr(tracks, name) for name in ("size", "existence", "scale")}}
    core: Any = env.unwrapped
    kind, config = core.observation_type, dict(core.config["observation"])
    known = {name: p.default for name, p in signature(type(kind)).parameters.items() if p.default is not p.empty}
    used = {name: getattr(kind, name, value) for name, value in known.items()}
    used |= {"features_range": None} if "features_range" in known else {}  # the one in use is of the road
    return json.loads(json.dumps({**used, **config}, default=np.ndarray.tolist))


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
            UnfitPolicy: the observation or the actions are not those of the training.
        """
        core: Any = env.unwrapped
        network = self._network
        observation = self._observed(env, network.observation)
        inputs, outputs = network.weights[0].shape[1], len(network.biases[-1])
        actions = getattr(core.action_space, "n", None)
        if (observation.size, actions) != (inputs, outputs):
            raise UnfitPolicy(
                f"policy {self.file} needs an observation of {inputs} numbers and {outputs} discrete actions, got "
                f"{observation.size} and {core.action_space}; give the environment the config of the training"
            )
        return int(network(observation).argmax())

    def _observed(self, env: gym.Env, trained: Mapping[str, Any] | None) -> NDArray:
        """The observation now, of the kind of the training."""
        if trained is not None and trained["type"] == TRACKS:
            if not env.has_wrapper_attr("observe_tracks"):
                raise UnfitPolicy(f"policy {self.file} was trained on tracks, got {env}; wrap it in testbed.TrackedEnv")
            found, _ = env.get_wrapper_attr("observe_tracks")(trained["size"], trained["existence"], trained["scale"])
            return np.concatenate([np.ravel(found[name]) for name in sorted(found)])  # as gymnasium flattens a dict
        if trained is not None:
            self._compare(trained, observation_of(env.unwrapped))
        core: Any = env.unwrapped
        return np.asarray(core.observation_type.observe())

    def _compare(self, trained: Mapping[str, Any], found: Mapping[str, Any]) -> None:
        """Raise UnfitPolicy where an observation is not that of the training."""
        for key in ("type", *sorted({*trained, *found})):
            if trained.get(key) != found.get(key):
                raise UnfitPolicy(
                    f"policy {self.file} was trained on an observation with {key} = {trained.get(key)!r}, got "
                    f"{found.get(key)!r}; give the environment the config of the training"
                )

    def choose(self, env: gym.Env) -> Choice:
        """The action, and the path straight on."""
        core: Any = env.unwrapped
        return Choice(self.act(env), straight_on(core.vehicle))  # the network has no path


def save_policy(
    file: str | Path, layers: Sequence[Any], env: gym.Env | None = None, activation: str | None = None
) -> None:
    """Write a network from the observation to the values of the actions.

    Args:
        file: an `.npz` file.
        layers: the modules of torch in their order, activations among them; or pairs of weights (out, in) and biases
            (out,).
        env: that of the training, whose observation the policy must find again; None: only its size is compared.
        activation: "relu" or "tanh", between each two of the pairs; modules say themselves what they are.

    Raises:
        ValueError: an activation or another module that the planner does not have, or wrappers of the environment that
            change the observation: the planner reads that of the environment, or of `TrackObservation`, flattened.
    """
    arrays: dict[str, Any] = {}
    pairs, names = _parsed(list(layers), activation)
    for i, pair in enumerate(pairs):
        weight, bias = (np.asarray(getattr(x, "detach", lambda x=x: x)(), np.float32) for x in pair)
        arrays |= {f"weight{i}": weight, f"bias{i}": bias}
    if env is not None:
        _check_wrappers(env)
        arrays["observation"] = json.dumps(observation_of(env))
    np.savez(file, activations=np.array(names, "U8"), **arrays)


def _parsed(layers: list[Any], activation: str | None) -> tuple[list[Any], list[str]]:
    """Pairs of weights and biases, and the activations between them."""
    if all(isinstance(layer, tuple | list) for layer in layers):
        if activation not in ACTIVATIONS:
            known = " or ".join(map(repr, ACTIVATIONS))
            raise ValueError(f"activation must be {known} between pairs of weights and biases, got {activation!r}")
        return layers, [str(activation)] * (len(layers) - 1)
    kinds = [type(layer).__name__ for layer in layers if type(layer).__name__ not in SHAPELESS]
    names = [kind.lower() for kind in kinds[1::2]]
    unknown = [kind for kind in kinds if kind != "Linear" and kind.lower() not in ACTIVATIONS]
    if unknown or len(kinds) % 2 == 0 or {*kinds[::2]} != {"Linear"} or not {*names} <= {*ACTIVATIONS}:
        raise ValueError(
            f"layers must be Linear with ReLU or Tanh between each two, got {', '.join(kinds)}; "
            "train with one of these as policy_kwargs['activation_fn'], or write a planner of your own"
        )
    return [(layer.weight, layer.bias) for layer in layers if type(layer).__name__ == "Linear"], names


def _layer(env: gym.Env, name: str) -> gym.Env | None:
    """The wrapper of a name around an environment, or None."""
    while isinstance(env, gym.Wrapper):
        if type(env).__name__ == name:
            return env
        env = env.env
    return None


def _check_wrappers(env: gym.Env) -> None:
    """Raise ValueError for a wrapper whose observation is not that of the environment."""
    inner = env
    while isinstance(inner, gym.Wrapper):
        kind = type(inner)
        if kind.__name__ == TRACKS and isinstance(env, gym.wrappers.FlattenObservation):
            return
        plain = issubclass(kind, gym.ObservationWrapper) and kind.__name__ not in FITTING
        if plain or inner.observation_space.dtype != inner.unwrapped.observation_space.dtype:
            raise ValueError(
                f"env has the wrapper {kind.__name__}, which changes the observation; the planner reads that of "
                "env.unwrapped: train on it"
            )
        inner = inner.env


def read_policy(file: Path) -> Network:
    """The network in a file of `save_policy`; ValueError, in one sentence, for anything else.

    A file of an older version names neither activations, which were ReLU, nor the observation, which is not compared.
    """
    try:
        arrays = read_arrays(file)
        stored = arrays.pop("activations", None)
        observation = json.loads(str(arrays.pop("observation", "null")))
        count = len(arrays) // 2
        weights = tuple(arrays[f"weight{i}"] for i in range(count))
        biases = tuple(arrays[f"bias{i}"] for i in range(count))
    except (ValueError, KeyError) as error:
        raise ValueError(f"{file} holds no policy: {error}; `save_policy` writes one") from None
    names = [USED_BEFORE] * (count - 1) if stored is None else [str(name) for name in stored.ravel()]
    if unknown := [name for name in names if name not in ACTIVATIONS]:
        known = ", ".join(ACTIVATIONS)
        raise ValueError(f"{file} holds no policy of ours: its activation {unknown[0]!r} is none of {known}")
    fits = [w.ndim == 2 and b.shape == w.shape[:1] for w, b in zip(weights, biases)]
    chained = [a.shape[0] == b.shape[-1] for a, b in pairwise(weights)]
    if not (count and all(fits) and all(chained) and len(names) == count - 1):
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ValueError(f"{file} holds no policy: its layers do not fit each other: {shapes}")
    return Network(weights, biases, tuple(names), observation)
