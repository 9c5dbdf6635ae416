"""From a Stable-Baselines3 model to a policy that needs NumPy alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecNormalize

from prosthesis_gym.policy import Normalisation, Policy


def export_policy(model: PPO, normaliser: VecNormalize, env_config: Mapping[str, Any]) -> Policy:
    """Return the deterministic part of a PPO model whose actor is an MLP with tanh, with its observation scaling."""
    actor = [*model.policy.mlp_extractor.policy_net.children(), model.policy.action_net]
    kinds = [type(module).__name__ for module in actor]
    if kinds != ["Linear", "Tanh"] * (len(actor) // 2) + ["Linear"] or model.policy.squash_output:
        raise ValueError(f"an actor of {', '.join(kinds)} cannot be exported: linear layers and tanh must alternate")
    statistics = observation_statistics(normaliser)
    return Policy(
        layers=[(_array(layer.weight).T, _array(layer.bias)) for layer in actor if isinstance(layer, torch.nn.Linear)],
        normalisation=Normalisation(
            statistics.mean.copy(), statistics.var.copy(), float(normaliser.clip_obs), float(normaliser.epsilon)
        ),
        config={section: dict(env_config[section]) for section in ("action", "observation")},
        device=env_config["device"]["kind"],
    )


def observation_statistics(normaliser: VecNormalize) -> RunningMeanStd:
    """Return mean and variance of the observations, which are one array, not a dict of arrays."""
    assert isinstance(normaliser.obs_rms, RunningMeanStd)
    return normaliser.obs_rms


def _array(tensor: torch.Tensor) -> NDArray[np.float32]:
    return tensor.detach().cpu().numpy().astype(np.float32)
