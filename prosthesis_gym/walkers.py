"""What single and vector environments share: the core's batch, reward terms of one's own, and saved states."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.arguments import whole_number
from prosthesis_gym.config import CONTROL_PERIOD_S, Config, merge, read_config, resolve
from prosthesis_gym.layers import Layer, laid_over
from prosthesis_gym.reward_terms import RewardTerm, RewardTerms, Step
from prosthesis_gym.rewards import load_reward
from prosthesis_gym.scenarios import load_scenario
from prosthesis_gym.state import seal, unseal

Observations = NDArray[np.float32]

MOST_THREADS = 1024


def environment_config(
    source: str | Path | Mapping[str, Any] | None,
    device: str | None = None,
    max_episode_steps: int | None = None,
    *,
    scenario: str | Path | None = None,
    reward: str | Path | None = None,
) -> Config:
    """Return the complete configuration of an environment; what is given later in this list counts.

    Args:
        scenario: one of `prosthesis_gym.SCENARIOS`, or a file (`prosthesis_gym.scenarios.load_scenario`).
        reward: one of `prosthesis_gym.REWARDS`, or a file (`prosthesis_gym.rewards.load_reward`).
        source: TOML file, nested mapping or None for the defaults.
        device: replaces `device.kind`, if given.
        max_episode_steps: replaces `scenario.duration_s`, in env steps, if given.

    Raises:
        ValueError: impossible configuration, or a setting of `source` that has no effect.

    """
    config = laid_over(
        [
            Layer({} if scenario is None else load_scenario(scenario), given=False),
            Layer({} if reward is None else load_reward(reward), given=False),
            Layer(read_config(source)),
            Layer({} if device is None else {"device": {"kind": device}}),
        ]
    )
    if max_episode_steps is not None:
        config = _limited(config, max_episode_steps)
    return resolve(config)


def _limited(config: Config, max_episode_steps: int) -> Config:
    if max_episode_steps < 1:
        raise ValueError(f"max_episode_steps = {max_episode_steps} must be at least 1")
    duration = max_episode_steps * resolve(config)["action"]["hold"] * CONTROL_PERIOD_S
    return merge(config, {"scenario": {"duration_s": duration}})


def spaces(config: Mapping[str, Any]) -> tuple[Box, Box]:
    """Return observation and action space of one environment with the given complete configuration.

    The observation is `observation.frames` frames of the channels in `_core.channels(config)`, newest first, float32.
    The action is one number in [-1, 1], or three with `action.mode = "impedance"`; what they mean is `action.mode`.
    """
    frames = config["observation"]["frames"]
    channels = _core.channels(config)
    low = np.tile(np.array([channel[1] for channel in channels], dtype=np.float32), frames)
    high = np.tile(np.array([channel[2] for channel in channels], dtype=np.float32), frames)
    return Box(low, high, dtype=np.float32), Box(-1.0, 1.0, (_core.action_size(config),), dtype=np.float32)


def observation_groups(config: Mapping[str, Any]) -> dict[str, NDArray[np.intp]]:
    """Return where each group of `observation.groups` stands in an observation, over all of its frames.

    The indices (int, ascending) of all groups together are 0 ... D - 1. A group without channels, such as `motor` of
    a leg without one, is left out.
    """
    of_channels = np.array(_core.channel_groups(config))
    of_entries = np.tile(of_channels, config["observation"]["frames"])
    return {str(group): np.flatnonzero(of_entries == group) for group in dict.fromkeys(of_channels)}


class Walkers:
    """N walkers of the core, with reward terms of one's own.

    Args:
        num_envs: N.
        config: complete configuration.
        reward_terms: their hidden channels are added to the core's observations, and cut off what is handed out.
        autoreset: what happens after an episode's end.
        threads: worker threads; None takes all cores.

    Raises:
        ValueError: impossible configuration or terms.

    """

    def __init__(
        self,
        num_envs: int,
        config: Config,
        reward_terms: Sequence[RewardTerm] = (),
        autoreset: Literal["next_step", "same_step", "disabled"] = "next_step",
        threads: int | None = None,
    ) -> None:
        whole_number("num_envs", num_envs, 1, _core.MOST_ENVIRONMENTS)  # before terms of one's own make room for them
        if threads is not None:
            whole_number("threads", threads, 1, MOST_THREADS)
        self.terms = RewardTerms(config, reward_terms, num_envs)
        self.batch = _core.Batch(num_envs, self.terms.core_config, autoreset, threads)
        self.num_envs = num_envs
        self._none = np.zeros(num_envs, dtype=np.bool_)

    def reset(self, seeds: NDArray[np.uint64] | None, mask: NDArray[np.bool_] | None = None) -> Observations:
        """Begin episodes of the walkers in `mask`, all by default, and return the observations (N, D) of all."""
        observations = self.batch.reset(seeds, mask)
        self.terms.reset(~self._none if mask is None else mask)
        return self.terms.visible(observations)

    def step(self, actions: NDArray[np.float64]) -> _core.Step | Step:
        """Advance all walkers by one action each, flat (N * action size,) float64."""
        return self.terms.applied(self.batch.step(actions))

    def get_state(self, indices: Sequence[int] | None = None) -> bytes:
        """Return the state of the walkers at `indices`, of all by default."""
        selected = self._selected(indices)
        return seal(self.batch.get_state(selected), self.terms.sums(selected))

    def set_state(self, state: bytes, indices: Sequence[int] | None = None) -> Observations:
        """Put saved walkers at `indices`, at all by default, and return the observations (N, D) of all."""
        selected = self._selected(indices)
        core, sums = unseal(state)
        self.terms.check_sums(sums)
        restarted = self._none.copy()
        restarted[selected] = self.batch.set_state(core, selected)
        self.terms.set_sums(sums, selected)
        self.terms.reset(restarted)
        # Resetting none of the walkers hands out the newest observations of all.
        return self.terms.visible(self.batch.reset(None, self._none))

    def _selected(self, indices: Sequence[int] | None) -> list[int]:
        if indices is None:
            return list(range(self.num_envs))
        selected = [int(index) for index in indices]
        if not selected:
            raise ValueError("indices = [] must name at least one walker")
        for index in selected:
            if not 0 <= index < self.num_envs:
                raise ValueError(f"index = {index} is outside its allowed range [0, {self.num_envs - 1}]")
        return selected
