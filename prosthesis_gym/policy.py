"""A deterministic policy that needs NumPy alone, and the file pair it is exchanged as.

`policy.safetensors` holds the weights, `policy.json` everything else: what the layers are, how observations are
normalised, the environment that the policy was trained in and its `action` and `observation` sections. Neither can
carry code, unlike a pickle.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import safetensors.numpy
from numpy.typing import ArrayLike, NDArray
from safetensors import SafetensorError

from prosthesis_gym.arguments import file_path
from prosthesis_gym.config import Config, merge, resolve
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.files import atomic_write, read_json

FORMAT = 1
WEIGHTS_FILE = "policy.safetensors"
DESCRIPTION_FILE = "policy.json"
#: Folder of a training run that holds its best policy.
RUN_FOLDER = "policy"
_NEW_WEIGHTS_FILE = "policy.new.safetensors"


@dataclass(frozen=True)
class Normalisation:
    """Scaling of observations: (observation - mean) / sqrt(variance + epsilon), limited to +-clip."""

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    clip: float = 10.0
    epsilon: float = 1e-8

    def __post_init__(self) -> None:
        if self.mean.ndim != 1 or self.mean.shape != self.variance.shape:
            shapes = f"{self.mean.shape} and {self.variance.shape}"
            raise ValueError(f"observation.mean and observation.var must be lists of one length, got {shapes}")
        if not (np.isfinite(self.mean).all() and np.isfinite(self.variance).all() and (self.variance >= 0).all()):
            raise ValueError("observation.mean must be finite and observation.var finite and at least 0")
        for name in ("clip", "epsilon"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"observation.{name} = {getattr(self, name)} must be above 0 and finite")

    def __call__(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return normalised observations."""
        scaled = (observations - self.mean) / np.sqrt(self.variance + self.epsilon)
        return np.clip(scaled, -self.clip, self.clip).astype(np.float32)


@dataclass(frozen=True)
class Policy:
    """A multi-layer perceptron with tanh between its layers, on normalised observations.

    `layers` holds (weights (inputs, outputs), biases (outputs,)) from first to last; `config` the sections `action` and
    `observation` of the environment that the policy was trained in, `device` its knee unit (`device.kind`).
    """

    layers: Sequence[tuple[NDArray[np.float32], NDArray[np.float32]]]
    normalisation: Normalisation
    config: Mapping[str, Any] = field(default_factory=dict)
    device: str = "damper"

    def __post_init__(self) -> None:
        if self.device not in DEVICES:
            raise ValueError(f"device = {self.device!r} must be one of {', '.join(DEVICES)}")
        if not self.layers:
            raise ValueError("a policy needs at least one layer")
        # One memory layout: products of transposed views differ in the last bit.
        layers = [
            (np.ascontiguousarray(weights, dtype=np.float32), np.ascontiguousarray(biases, dtype=np.float32))
            for weights, biases in self.layers
        ]
        object.__setattr__(self, "layers", layers)
        for index, (weights, biases) in enumerate(self.layers):
            if weights.ndim != 2 or biases.shape != weights.shape[1:]:
                raise ValueError(f"layer {index}: weights {weights.shape} and biases {biases.shape} do not fit")
            if not (np.isfinite(weights).all() and np.isfinite(biases).all()):
                raise ValueError(f"layer {index}: weights and biases must be finite")
        sizes = [self.normalisation.mean.size, *(weights.shape[0] for weights, _ in self.layers[1:]), 1]
        if self.layer_sizes != sizes:
            raise ValueError(
                f"layers of sizes {self.layer_sizes} must chain from the observation to one action: {sizes}"
            )

    @property
    def layer_sizes(self) -> list[int]:
        """Number of inputs of the first layer, then of outputs of each."""
        return [self.layers[0][0].shape[0], *(weights.shape[1] for weights, _ in self.layers)]

    def configure(self, config: Mapping[str, Any]) -> Config:
        """Return `config` with what the policy brings: its knee unit and its sections `action` and `observation`.

        Raises:
            ValueError: `config` names another knee unit.

        """
        configured = merge(merge({"device": {"kind": self.device}}, config), self.config)
        kind = resolve(configured)["device"]["kind"]
        if kind != self.device:
            raise ValueError(f"device.kind = {kind!r} contradicts the policy, which was trained with {self.device!r}")
        return configured

    def act(self, observations: ArrayLike) -> NDArray[np.float64]:
        """Return actions (N,) in [-1, 1] for observations (N, D), each the same whatever batch it comes in."""
        rows = np.asarray(observations, dtype=np.float32)
        if rows.ndim != 2 or rows.shape[1] != self.layer_sizes[0]:
            raise ValueError(f"observations must have the shape (N, {self.layer_sizes[0]}), got {rows.shape}")
        # One product per row: in a product of all rows, BLAS sums in an order that depends on how many they are and
        # where a row stands among them, and a walker's fate may hang on the last bit.
        values = self.normalisation(rows)[:, None, :]
        for index, (weights, biases) in enumerate(self.layers):
            values = values @ weights + biases
            if index < len(self.layers) - 1:
                values = np.tanh(values)
        return np.clip(values[:, 0, 0], -1.0, 1.0).astype(np.float64)

    def save(self, folder: str | Path) -> None:
        """Write the file pair into `folder`: whenever this is interrupted, the old or the new one can be loaded."""
        folder = Path(folder)
        tensors = {}
        for index, (weights, biases) in enumerate(self.layers):
            tensors[f"layer{index}.weights"], tensors[f"layer{index}.biases"] = weights, biases
        data = safetensors.numpy.save(tensors)
        description = {
            "format": FORMAT,
            "env_id": DEVICES[self.device].env_id,
            "package_version": version("prosthesis_gym"),
            "layer_sizes": self.layer_sizes,
            "activation": "tanh",
            "observation": {
                "mean": self.normalisation.mean.tolist(),
                "var": self.normalisation.variance.tolist(),
                "clip": self.normalisation.clip,
                "epsilon": self.normalisation.epsilon,
            },
            "config": dict(self.config),
            "weights_sha256": hashlib.sha256(data).hexdigest(),
        }
        # The description says which weights are its own: new ones wait beside the old until it names them, so that a
        # policy can be read whenever this is interrupted.
        if (folder / _NEW_WEIGHTS_FILE).exists():
            _finish_saving(folder)
        with atomic_write(folder / _NEW_WEIGHTS_FILE) as path:
            path.write_bytes(data)
        with atomic_write(folder / DESCRIPTION_FILE) as path:
            path.write_text(json.dumps(description, indent=2) + "\n", encoding="utf-8")
        (folder / _NEW_WEIGHTS_FILE).replace(folder / WEIGHTS_FILE)

    @classmethod
    def load(cls, folder: str | Path) -> Policy:
        """Read the file pair from `folder`, or from `policy` in it, where a training run keeps its best.

        Raises:
            ValueError: no policy there, or a damaged or foreign file; names it.

        """
        found = _policy_folder(file_path("folder", folder))
        path = found / DESCRIPTION_FILE
        description = read_json(path)
        try:
            return cls._decode(description, _weights(found, description))
        except (ValueError, TypeError, KeyError, AttributeError, SafetensorError) as error:
            reason = f"missing key {error}" if isinstance(error, KeyError) else error
            raise ValueError(f"{path}: the policy cannot be used: {reason}") from error

    @classmethod
    def _decode(cls, description: dict[str, Any], data: bytes) -> Policy:
        for key, expected in {"format": FORMAT, "activation": "tanh"}.items():
            if description[key] != expected:
                raise ValueError(f"{key} = {description[key]!r}, expected {expected!r}")
        kinds = {device.env_id: kind for kind, device in DEVICES.items()}
        if description["env_id"] not in kinds:
            raise ValueError(f"env_id = {description['env_id']!r}, expected one of {', '.join(kinds)}")
        tensors = safetensors.numpy.load(data)
        layers = [
            (tensors[f"layer{index}.weights"], tensors[f"layer{index}.biases"])
            for index, _ in enumerate(pairwise(description["layer_sizes"]))
        ]
        scaling = description["observation"]
        normalisation = Normalisation(
            np.asarray(scaling["mean"], dtype=np.float64),
            np.asarray(scaling["var"], dtype=np.float64),
            float(scaling["clip"]),
            float(scaling["epsilon"]),
        )
        config = description["config"]
        if not {"action", "observation"} <= set(config):
            raise ValueError("config needs the sections action and observation")
        policy = cls(layers, normalisation, config, kinds[description["env_id"]])
        if policy.layer_sizes != description["layer_sizes"]:
            raise ValueError(f"layer_sizes = {description['layer_sizes']}, but the weights have {policy.layer_sizes}")
        return policy


def _policy_folder(folder: Path) -> Path:
    for place in (folder, folder / RUN_FOLDER):
        if (place / DESCRIPTION_FILE).is_file():
            return place
    raise ValueError(f"no policy in {folder}: neither it nor its folder {RUN_FOLDER!r} has a {DESCRIPTION_FILE}")


def _weights(folder: Path, description: Mapping[str, Any]) -> bytes:
    """Return the weights that the description names by their hash, from wherever an interrupted `save` left them."""
    for name in (WEIGHTS_FILE, _NEW_WEIGHTS_FILE):
        path = folder / name
        if path.is_file() and hashlib.sha256(data := path.read_bytes()).hexdigest() == description["weights_sha256"]:
            return data
    raise ValueError(f"{WEIGHTS_FILE} is missing, or not the one that {DESCRIPTION_FILE} describes")


def _finish_saving(folder: Path) -> None:
    """Give the weights that an interrupted `save` left under their temporary name their own, if they are in use."""
    try:
        data = _weights(folder, read_json(folder / DESCRIPTION_FILE))
    except (ValueError, KeyError, OSError):
        return  # nothing there that could be lost
    with atomic_write(folder / WEIGHTS_FILE) as path:
        path.write_bytes(data)
