"""Checkpoints: a folder per checkpoint that is complete or absent, and that nothing in it can make run code.

`progress.json` names the other files with their hashes, so that a damaged checkpoint is known as such.
The model is an ordinary Stable-Baselines3 zip; on resuming, its weights and optimiser state alone are read, which are
plain tensors, never its pickled attributes. The folder is a loadable policy as well.
"""

from __future__ import annotations

import hashlib
import io
import json
import shutil
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecNormalize

from prosthesis_gym.files import atomic_folder, read_json
from prosthesis_gym.policy import Policy
from prosthesis_gym.sb3 import ObservationMoments, ProsthesisVecEnv

_MODEL_FILE = "model.zip"
_PROGRESS_FILE = "progress.json"
_DIGITS = 12
#: Pattern of the names, which are the steps.
_NAME = "[0-9]" * _DIGITS


@dataclass
class Progress:
    """How far a run has come."""

    #: Env steps of all walkers.
    steps: int = 0
    #: Wall time of training, over all resumptions.
    seconds: float = 0.0
    #: Times that the run was resumed.
    resumptions: int = 0


def save_checkpoint(folder: Path, model: PPO, normaliser: VecNormalize, policy: Policy, progress: Progress) -> Path:
    """Write `folder`/<steps>, complete or not at all, and return it.

    Raises:
        OSError: the disk is full, or else cannot be written to; names the checkpoint.

    """
    target = folder / f"{progress.steps:0{_DIGITS}d}"
    if target.exists():
        # A run that was resumed here and stopped at once has nothing new to say; one that was resumed further back,
        # because this one is damaged, has.
        if _damage(target) is None:
            return target
        shutil.rmtree(target)
    moments = walkers(normaliser).observation_moments._asdict()
    with atomic_folder(target) as temporary:
        # By way of memory, because torch tells no disk that is full from other mishaps.
        model.save(buffer := io.BytesIO())
        (temporary / _MODEL_FILE).write_bytes(buffer.getbuffer())
        policy.save(temporary)
        state = {
            **asdict(progress),
            "observation_statistics": {name: np.asarray(value).tolist() for name, value in moments.items()},
            "return_statistics": _to_json(normaliser.ret_rms),
            "sha256": {path.name: _sha256(path) for path in temporary.iterdir()},
        }
        (temporary / _PROGRESS_FILE).write_text(json.dumps(state), encoding="utf-8")
    return target


def has_checkpoints(folder: Path) -> bool:
    """Whether the folder has checkpoints, whole or damaged."""
    return any(folder.glob(f"{_NAME}/{_PROGRESS_FILE}"))


def latest_checkpoint(folder: Path, tell: Callable[[str], None]) -> Path | None:
    """Return the whole checkpoint of most steps, if there is one; `tell` which damaged ones have more."""
    for checkpoint in sorted(folder.glob(_NAME), reverse=True):
        damage = _damage(checkpoint)
        if damage is None:
            return checkpoint
        tell(f"skipping the damaged checkpoint {checkpoint}: {damage}")
    return None


def _damage(checkpoint: Path) -> str | None:
    """Return what is wrong with a checkpoint, None if it is as it was written."""
    try:
        expected = read_json(checkpoint / _PROGRESS_FILE)["sha256"]
        wrong = [name for name, sha256 in expected.items() if _sha256(checkpoint / name) != sha256]
    except KeyError:
        return f"{_PROGRESS_FILE} has no hashes"
    except (OSError, ValueError, AttributeError) as error:
        return str(error)
    return f"{wrong[0]} is not what was written" if wrong else None


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def walkers(normaliser: VecNormalize) -> ProsthesisVecEnv:
    """Return the environment under its wrappers."""
    env = normaliser.unwrapped
    assert isinstance(env, ProsthesisVecEnv)
    return env


def load_checkpoint(checkpoint: Path, model: PPO, normaliser: VecNormalize) -> Progress:
    """Put a checkpoint's weights, optimiser state and statistics in place and return its progress."""
    try:
        state = read_json(checkpoint / _PROGRESS_FILE)
        del state["sha256"]
        model.set_parameters(str(checkpoint / _MODEL_FILE), exact_match=True, device="cpu")
        moments = state.pop("observation_statistics")
        mean, variance = (np.asarray(moments[name], dtype=np.float64) for name in ("mean", "variance"))
        walkers(normaliser).set_observation_moments(ObservationMoments(float(moments["number"]), mean, variance))
        _from_json(state.pop("return_statistics"), normaliser.ret_rms)
        return Progress(**state)
    except (OSError, ValueError, KeyError, TypeError, RuntimeError) as error:
        raise ValueError(f"cannot resume from {checkpoint}: {error}") from error


def _to_json(statistics: RunningMeanStd) -> dict[str, Any]:
    return {"mean": statistics.mean.tolist(), "var": statistics.var.tolist(), "count": float(statistics.count)}


def _from_json(values: dict[str, Any], statistics: RunningMeanStd) -> None:
    mean, var = np.asarray(values["mean"], dtype=np.float64), np.asarray(values["var"], dtype=np.float64)
    if mean.shape != statistics.mean.shape or var.shape != mean.shape:
        raise ValueError(f"statistics have the shape {mean.shape}, expected {statistics.mean.shape}")
    statistics.mean, statistics.var, statistics.count = mean, var, float(values["count"])
