"""Policies in files of stable-baselines3, read without that library and without torch: `sb3:FILE`.

A file says which algorithm it is of, and the shape of its observation. Of its pickles only arrays are made: any other
object is refused, so that nothing of a file runs. Networks of layers alone are read, those of `MlpPolicy`.
"""

import io
import json
import pickle
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile, ZipFile

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from testbed.limits import UnfitPolicy
from testbed.planners.idm import Choice, straight_on
from testbed.planners.learned import Network

PREFIX = "sb3:"
WRITES = "`model.save` of stable-baselines3 writes one"
STORED = {"FloatStorage": "<f4", "DoubleStorage": "<f8", "LongStorage": "<i8", "BoolStorage": "?"}  # little endian


class Form(NamedTuple):
    """How an algorithm calls the layers of its policy."""

    layers: tuple[str, ...]  # beginnings of the names, in their order
    activation: str  # between them, unless the file says another
    squashed: bool = False  # actions are the hyperbolic tangent of the last layer, as shares of their range


FORMS = {
    "DQN": Form(("q_net.q_net.",), "relu"),
    "PPO": Form(("mlp_extractor.policy_net.", "action_net."), "tanh"),
    "A2C": Form(("mlp_extractor.policy_net.", "action_net."), "tanh"),
    "SAC": Form(("actor.latent_pi.", "actor.mu."), "relu", True),
    "TD3": Form(("actor.mu.",), "relu", True),
}


class Policy(NamedTuple):
    """What a file holds."""

    algorithm: str
    network: Network
    shape: tuple[int, ...]  # of the observation, nothing where the file does not say it
    discrete: bool


@dataclass(frozen=True)
class StableBaselines:
    """The action that a policy of stable-baselines3 takes without drawing; the observation must have its shape."""

    file: str  # what `model.save` wrote
    knows_truth: bool = False
    _policy: Policy = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_policy", read(Path(self.file)))

    @property
    def name(self) -> str:
        """`sb3-` and the name of the file."""
        return f"sb3-{Path(self.file).stem}"

    @property
    def note(self) -> str:
        """The algorithm."""
        return f"a policy of {self._policy.algorithm}, by stable-baselines3"

    def act(self, env: gym.Env) -> Any:
        """The action for the next period; UnfitPolicy where observation or actions are not those of the training."""
        core: Any = env.unwrapped
        policy, observation = self._policy, np.asarray(core.observation_type.observe())
        inputs, outputs = policy.network.weights[0].shape[1], len(policy.network.biases[-1])
        space = core.action_space
        actions = getattr(space, "n", None) if policy.discrete else int(np.prod(space.shape or (0,)))
        if (policy.shape or observation.shape) != observation.shape or (observation.size, actions) != (inputs, outputs):
            kind = "discrete actions" if policy.discrete else "numbers as action"
            raise UnfitPolicy(
                f"policy {self.file} needs an observation of shape {policy.shape or (inputs,)} and {outputs} {kind}, "
                f"got {observation.shape} and {space}; "
                "give the environment the config of the training"
            )
        found = policy.network(observation)
        if policy.discrete:
            return int(found.argmax())
        if FORMS[policy.algorithm].squashed:
            found = space.low + (np.tanh(found) + 1) / 2 * (space.high - space.low)
        return np.clip(found, space.low, space.high).astype(space.dtype)

    def choose(self, env: gym.Env) -> Choice:
        """The action, and the path straight on."""
        core: Any = env.unwrapped
        return Choice(self.act(env), straight_on(core.vehicle))


def read(file: Path) -> Policy:
    """The policy of a file; LookupError or ValueError, in one sentence, for what is none, or none of layers alone."""
    try:
        with ZipFile(file) as archive:
            about, weights = json.loads(archive.read("data")), _tensors(archive.read("policy.pth"))
    except OSError as error:
        raise LookupError(f"policy {str(file)!r} cannot be read: {error.strerror or error}") from None
    except (BadZipFile, KeyError, ValueError, EOFError, IndexError, TypeError, pickle.UnpicklingError) as error:
        raise ValueError(f"{file} holds no policy of stable-baselines3: {error}; {WRITES}") from None
    algorithm = _algorithm(about)
    if algorithm not in FORMS:
        raise ValueError(f"{file} is of {algorithm or 'an unknown algorithm'}; known are {', '.join(FORMS)}")
    form = FORMS[algorithm]
    names = [name.removesuffix("weight") for start in form.layers for name in _of(weights, start)]
    if not names or any("features_extractor" in name for name in weights):
        raise ValueError(f"{file} has a policy of {algorithm} that is not of layers alone; train MlpPolicy")
    given = str(about.get("policy_kwargs", {}).get("activation_fn", "")).lower()
    activation = next(
        (name for name in ("relu", "tanh") if f"activation.{name}" in given), None if given else form.activation
    )
    if activation is None:
        raise ValueError(f"{file} has the activation {given}; train with ReLU or Tanh")
    layers = tuple(weights[f"{name}weight"] for name in names), tuple(weights[f"{name}bias"] for name in names)
    network = Network(*layers, (activation,) * (len(names) - 1))
    shape = about.get("observation_space", {}).get("_shape") or ()
    return Policy(algorithm, network, tuple(map(int, shape)), "n" in about.get("action_space", {}))


def _of(weights: Mapping[str, NDArray], start: str) -> list[str]:
    """Names of the weights below a beginning, in the order of the layers."""
    found = [name for name in weights if name.startswith(start) and name.endswith("weight")]
    return sorted(found, key=lambda name: [int(part) for part in name.split(".") if part.isdigit()])


def _algorithm(about: Mapping[str, Any]) -> str:
    """The algorithm by the module of its policies, or where several have one by what only one of them has."""
    module = str(about.get("policy_class", {}).get("__module__", ""))
    own = module.removeprefix("stable_baselines3.").partition(".")[0].upper()
    return ("PPO" if "n_epochs" in about else "A2C") if own == "COMMON" else own


class _Arrays(pickle.Unpickler):
    """Makes arrays of what torch has written, and refuses everything else."""

    def __init__(self, archive: ZipFile, pickled: str) -> None:
        super().__init__(io.BytesIO(archive.read(pickled)))
        self.archive, self.root = archive, pickled.removesuffix("data.pkl")

    def find_class(self, module: str, name: str) -> Any:
        """An array, a dict, or the type of what is stored; UnpicklingError for any other object."""
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return _array
        if (module, name) == ("collections", "OrderedDict"):
            return OrderedDict
        if module == "torch" and name in STORED:
            return STORED[name]
        raise pickle.UnpicklingError(f"it has an object {module}.{name}, which is no array")

    def persistent_load(self, pid: Any) -> NDArray:
        """All numbers of one storage."""
        _, dtype, key, _, _ = pid
        return np.frombuffer(self.archive.read(f"{self.root}data/{key}"), dtype)


def _array(stored: NDArray, offset: int, size: tuple[int, ...], stride: tuple[int, ...], *_: Any) -> NDArray:
    """An array of a storage; ValueError where it would lie outside of it."""
    reach = offset + sum((n - 1) * step for n, step in zip(size, stride, strict=True)) if all(size) else offset
    if min((offset, *size, *stride)) < 0 or reach >= max(len(stored), 1):
        raise ValueError("an array lies outside of what is stored")
    bytes_each = tuple(step * stored.itemsize for step in stride)
    return np.lib.stride_tricks.as_strided(stored[offset:], size, bytes_each).copy()


def _tensors(content: bytes) -> dict[str, NDArray]:
    """The arrays of a file of torch by name."""
    with ZipFile(io.BytesIO(content)) as archive:
        pickled = next(name for name in [*archive.namelist(), ""] if name.endswith("data.pkl") or not name)
        found = _Arrays(archive, pickled).load()
    return {str(name): value for name, value in found.items() if isinstance(value, np.ndarray)}
