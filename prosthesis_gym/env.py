"""Single environment: the vector environment's walker, one at a time."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium.spaces import Space
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.vector_env import CONTROL_PERIOD_S, Observations, check_actions, environment_config, spaces


class ProsthesisEnv(gymnasium.Env[Observations, NDArray[np.floating[Any]]]):
    """One walker with a prosthetic knee, stepped at 200 Hz.

    Seeded with s, it gives bit for bit the trajectory of any environment of `ProsthesisVectorEnv` seeded with s.
    The info of a step holds `reward_terms` (name -> float, unweighted) and, at the end of an episode,
    `termination_reason`.

    Args:
        config: TOML file, nested mapping or None for the defaults.
        device: knee unit (a key of `prosthesis_gym.devices.DEVICES`); None leaves it to the configuration.
        max_episode_steps: replaces `scenario.duration_s`, in env steps.
        render_mode: must be None; there is no renderer yet.

    Raises:
        ValueError: impossible configuration; names key, value and range.

    """

    def __init__(
        self,
        config: str | Path | Mapping[str, Any] | None = None,
        *,
        device: str | None = None,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        if render_mode is not None:
            raise ValueError(f"render_mode = {render_mode!r} must be None")
        self.config = environment_config(config, device, max_episode_steps)
        self.batch = _core.Batch(1, self.config, "disabled", 1)
        observation_space, action_space = spaces(self.config)
        self.observation_space = cast("Space[Observations]", observation_space)
        self.action_space = cast("Space[NDArray[np.floating[Any]]]", action_space)
        self.render_mode = None
        self.metadata = {
            "render_modes": [],
            "render_fps": round(1.0 / (CONTROL_PERIOD_S * self.config["action"]["hold"])),
        }
        self._seeded = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start an episode: the first of `seed`, or the next one. There are no options."""
        if options:
            raise ValueError(f"unknown reset option {next(iter(options))!r}; there are none")
        super().reset(seed=seed)
        if seed is None and not self._seeded:
            seed = int(self.np_random.integers(2**63))
        self._seeded = True
        seeds = None if seed is None else np.array([seed], dtype=np.uint64)
        return self.batch.reset(seeds)[0], {}

    def step(self, action: NDArray[np.floating[Any]]) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Advance by one action of `action.hold` control periods: (1,) float32 or float64, (3,) in mode "impedance".

        Raises:
            ValueError: wrong shape or dtype, NaN, or the episode has ended.

        """
        step = self.batch.step(check_actions(action, self.action_space.shape or ()))
        info: dict[str, Any] = {"reward_terms": dict(zip(_core.TERMS, step.terms[0].tolist(), strict=True))}
        reason = step.reasons[0]
        if reason:
            info["termination_reason"] = _core.REASONS[reason]
        return step.observations[0], float(step.rewards[0]), bool(step.terminated[0]), bool(step.truncated[0]), info
