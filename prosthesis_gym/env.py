"""Single environment: the vector environment's walker, one at a time."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium.spaces import Space
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.rendering.canvas import Frame
from prosthesis_gym.rendering.gym import RENDER_MODES, BatchRendering, check_render_mode
from prosthesis_gym.reward_terms import RewardTerm
from prosthesis_gym.vector_env import check_actions, env_steps_per_s
from prosthesis_gym.walkers import Observations, Walkers, environment_config, observation_groups, spaces


class ProsthesisEnv(gymnasium.Env[Observations, NDArray[np.floating[Any]]]):
    """One walker with a prosthetic knee, stepped at 200 Hz.

    Seeded with s, it gives bit for bit the trajectory of any environment of `ProsthesisVectorEnv` seeded with s.
    The info of a step holds `reward_terms` (name -> float, unweighted) and, at the end of an episode,
    `termination_reason`.

    Args:
        config: TOML file, nested mapping or None; overrides scenario and reward.
        scenario: what the walker meets: one of `prosthesis_gym.SCENARIOS`, or the path of a file.
        reward: weights of the reward's terms: one of `prosthesis_gym.REWARDS`, or the path of a file.
        reward_terms: terms of one's own beside the core's; their functions get arrays of one entry.
        device: knee unit (a key of `prosthesis_gym.devices.DEVICES`); None leaves it to the configuration.
        max_episode_steps: replaces `scenario.duration_s`, in env steps.
        render_mode: None; "rgb_array", pictures when `render` is called; or "human", a window that follows every
            reset and step. Needs the extra `render`; trajectories do not depend on it.
        render_size: width and height in pixels, by default 640x360, of a window 960x540. From a height of 480 on,
            pictures have plots of the last 3 s.

    Raises:
        ValueError: impossible configuration; names key, value and range.
        ModuleNotFoundError: rendering without the extra `render`.

    """

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES}  # noqa: RUF012 - as Gymnasium declares it

    def __init__(
        self,
        config: str | Path | Mapping[str, Any] | None = None,
        *,
        scenario: str | Path | None = None,
        reward: str | Path | None = None,
        reward_terms: Sequence[RewardTerm] = (),
        device: str | None = None,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        render_size: tuple[int, int] | None = None,
    ) -> None:
        mode = check_render_mode(render_mode)
        self.config = environment_config(config, device, max_episode_steps, scenario=scenario, reward=reward)
        self.walkers = Walkers(1, self.config, reward_terms, "disabled", 1)
        self.batch = self.walkers.batch
        observation_space, action_space = spaces(self.config)
        self.observation_space = cast("Space[Observations]", observation_space)
        self.action_space = cast("Space[NDArray[np.floating[Any]]]", action_space)
        self.render_mode = mode
        self.metadata = {"render_modes": RENDER_MODES, "render_fps": env_steps_per_s(self.config)}
        self._rendering = None if mode is None else BatchRendering(self.batch, self.config, mode, render_size)
        self._seeded = False

    @property
    def observation_groups(self) -> dict[str, NDArray[np.intp]]:
        """Indices of each group of channels in an observation, over all frames."""
        return observation_groups(self.config)

    @property
    def difficulty(self) -> float:
        """Share of disturbances and randomisation, in [0, 1], that episodes have from their next start on."""
        return self.batch.difficulty

    @difficulty.setter
    def difficulty(self, difficulty: float) -> None:
        self.batch.difficulty = difficulty

    def get_state(self) -> bytes:
        """Return the state of the walker; put back, it goes on bit for bit.

        `ProsthesisVectorEnv.get_state` says what is included.
        """
        return self.walkers.get_state()

    def set_state(self, state: bytes) -> Observations:
        """Put a saved walker in place of this one and return its observation (D,), the newest it had handed out.

        Raises:
            ValueError: a state of another configuration or version, of several walkers, or a damaged one.

        """
        observation: Observations = self.walkers.set_state(state)[0]
        self._seeded = True
        if self._rendering is not None:
            self._rendering.reset()
        return observation

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
        observation = self.walkers.reset(seeds)[0]
        if self._rendering is not None:
            self._rendering.reset()
        return observation, {}

    def step(self, action: NDArray[np.floating[Any]]) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Advance by one action of `action.hold` control periods: (1,) float32 or float64, (3,) in mode "impedance".

        Numbers beyond [-1, 1] are limited, infinite ones too.

        Raises:
            ValueError: wrong shape or dtype, NaN, or the episode has ended.

        """
        step = self.walkers.step(check_actions(action, self.action_space.shape or ()))
        if self._rendering is not None:
            self._rendering.step()
        terms = zip(self.walkers.terms.names, step.terms[0].tolist(), strict=True)
        info: dict[str, Any] = {"reward_terms": dict(terms)}
        reason = step.reasons[0]
        if reason:
            info["termination_reason"] = _core.REASONS[reason]
        return step.observations[0], float(step.rewards[0]), bool(step.terminated[0]), bool(step.truncated[0]), info

    def render(self) -> Frame | None:
        """Return a picture (height, width, 3) uint8 in mode "rgb_array"; draw into the window in mode "human".

        Raises:
            ValueError: before the first reset.

        """
        if self._rendering is None:
            gymnasium.logger.warn("render() without a render_mode draws nothing; choose one when making the env")
            return None
        if self.render_mode == "human":
            self._rendering.show()
            return None
        return self._rendering.frames()[0]

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._rendering is not None:
            self._rendering.close()
