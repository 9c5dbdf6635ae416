"""From a Stable-Baselines3 model to a policy that needs NumPy alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO

from prosthesis_gym.controller import require_one_action
from prosthesis_gym.policy import Normalisation, Policy
from prosthesis_gym.sb3 import OBSERVATION_EPSILON, ObservationMoments


def export_policy(model: PPO, moments: ObservationMoments, clip: float, env_config: Mapping[str, Any]) -> Policy:
    """Return the deterministic part of a PPO model whose actor is an MLP with tanh, with its observation scaling."""
    require_one_action(env_config)
    actor = [*model.policy.mlp_extractor.policy_net.children(), model.policy.action_net]
    kinds = [type(module).__name__ for module in actor]
    if kinds != ["Linear", "Tanh"] * (len(actor) // 2) + ["Linear"] or model.policy.squash_output:
        raise ValueError(f"an actor of {', '.join(kinds)} cannot be exported: linear layers and tanh must alternate")
    return Policy(
        layers=[(_array(layer.weight).T, _array(layer.bias)) for layer in actor if isinstance(layer, torch.nn.Linear)],
        normalisation=Normalisation(moments.mean, moments.variance, clip, OBSERVATION_EPSILON),
        config={section: dict(env_config[section]) for section in ("action", "observation")},
        device=env_config["device"]["kind"],
    )


def _array(tensor: torch.Tensor) -> NDArray[np.float32]:
    return tensor.detach().cpu().numpy().astype(np.float32)
