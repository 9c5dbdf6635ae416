"""Checkpoints: a folder per checkpoint that is complete or absent, and that nothing in it can make run code.

The model is an ordinary Stable-Baselines3 zip; on resuming, its weights and optimiser state alone are read, which are
plain tensors, never its pickled attributes. The folder is a loadable policy as well.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecNormalize

from prosthesis_gym.policy import Policy
from prosthesis_gym.sb3 import ObservationMoments, ProsthesisVecEnv

_MODEL_FILE = "model.zip"
_PROGRESS_FILE = "progress.json"


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
    """Write `folder`/<steps> under a temporary name and renames it."""
    target = folder / f"{progress.steps:012d}"
    temporary = folder / f".{target.name}.partial"
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir(parents=True)
    model.save(temporary / _MODEL_FILE)
    policy.save(temporary)
    moments = walkers(normaliser).observation_moments._asdict()
    state = {
        **asdict(progress),
        "observation_statistics": {name: np.asarray(value).tolist() for name, value in moments.items()},
        "return_statistics": _to_json(normaliser.ret_rms),
    }
    (temporary / _PROGRESS_FILE).write_text(json.dumps(state), encoding="utf-8")
    # Only a checkpoint at the very same step can be in the way: a run that was resumed and stopped at once.
    shutil.rmtree(target, ignore_errors=True)
    temporary.rename(target)
    return target


def walkers(normaliser: VecNormalize) -> ProsthesisVecEnv:
    """Return the environment under its wrappers."""
    env = normaliser.unwrapped
    assert isinstance(env, ProsthesisVecEnv)
    return env


def latest_checkpoint(folder: Path) -> Path:
    """Return the checkpoint of most steps."""
    found = sorted(path for path in folder.glob("[0-9]*") if path.is_dir())
    if not found:
        raise ValueError(f"nothing to resume: no checkpoint in {folder}")
    return found[-1]


def load_checkpoint(checkpoint: Path, model: PPO, normaliser: VecNormalize) -> Progress:
    """Put a checkpoint's weights, optimiser state and statistics in place and return its progress."""
    try:
        state = json.loads((checkpoint / _PROGRESS_FILE).read_text(encoding="utf-8"))
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
