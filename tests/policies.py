"""A small policy on disk."""

from pathlib import Path

import numpy as np

from prosthesis_gym.policy import Normalisation, Policy


def save_policy(folder: Path, gain: float = 0.3) -> Policy:
    """Save a policy of the damper knee whose weights are all `gain`, and return it."""
    config = {"action": {"mode": "residual", "hold": 4}, "observation": {"frames": 1}}
    layer = (np.full((8, 1), gain, dtype=np.float32), np.zeros(1, np.float32))
    policy = Policy([layer], Normalisation(np.zeros(8), np.ones(8)), config)
    policy.save(folder)
    return policy
