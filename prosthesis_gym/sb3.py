"""Stable-Baselines3 on the native batch: `ProsthesisVecEnv`, without a Python loop over the environments that go on."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from prosthesis_gym import _core
from prosthesis_gym.config import CONTROL_PERIOD_S
from prosthesis_gym.vector_env import ProsthesisVectorEnv

OBSERVATION_EPSILON = 1e-8
"""Added to the variance that normalised observations are divided by the root of."""


class ObservationMoments(NamedTuple):
    """Statistics of D-dimensional observations."""

    #: How many observations.
    number: float
    #: (D,) float64.
    mean: NDArray[np.float64]
    #: (D,) float64.
    variance: NDArray[np.float64]


class ProsthesisVecEnv(VecEnv):
    """Many walkers as one Stable-Baselines3 environment.

    Where an episode ends, the info says what a wrapper per environment would: `terminal_observation`,
    `TimeLimit.truncated`, `episode` (return "r", env steps "l", seconds "t" since the environment was made: no
    VecMonitor is needed), and beyond that `episode_terms` (sum of each reward term before its weight) and
    `termination_reason`. The other environments hand out the same info dict every step, because thousands of fresh
    ones would cost more than the step itself.

    With `normalise_observations`, observations (terminal ones too) come less their running mean, over their running
    standard deviation and within +-`clip_observation`: what SB3's VecNormalize does, done in the core. Their statistics
    are `observation_moments`.

    With `staggered`, `reset` lets each walker walk for a different part of an episode first, so that a rollout sees
    all parts of an episode at any time instead of all walkers starting, walking and ending in step.
    """

    def __init__(
        self,
        num_envs: int,
        config: Mapping[str, Any] | str | Path | None = None,
        *,
        threads: int | None = None,
        staggered: bool = False,
        normalise_observations: bool = False,
        clip_observation: float = 10.0,
    ) -> None:
        self.envs = ProsthesisVectorEnv(num_envs, config, autoreset_mode=AutoresetMode.SAME_STEP, threads=threads)
        #: Wall time spent in the native core since the environment was made, s.
        self.core_seconds = 0.0
        self._staggered = staggered
        self._began = time.perf_counter()
        self._infos: list[dict[str, Any]] = [{"TimeLimit.truncated": False} for _ in range(num_envs)]
        self._actions: NDArray[np.float64] = np.zeros(num_envs)
        space = self.envs.single_observation_space
        if normalise_observations:
            self.envs.batch.normalise_observations(clip_observation, OBSERVATION_EPSILON)
            space = Box(-clip_observation, clip_observation, space.shape, np.float32)
        super().__init__(num_envs, space, self.envs.single_action_space)

    @property
    def observation_moments(self) -> ObservationMoments:
        """Statistics of the observations so far.

        Raises:
            ValueError: observations are not normalised.

        """
        return ObservationMoments(*self.envs.batch.moments())

    def set_observation_moments(self, moments: ObservationMoments, *, learns: bool = True) -> None:
        """Replace the statistics; without `learns` they stay as they are from now on."""
        self.envs.batch.set_moments(*moments, learns)

    def reset(self) -> NDArray[np.float32]:
        """Return first observations (N, D) of new episodes; takes the seeds of the last call of `seed`."""
        seeded = any(seed is not None for seed in self._seeds)
        observations, _ = self.envs.reset(seed=list(self._seeds) if seeded else None)
        self._reset_seeds()
        self._reset_options()
        self.reset_infos = [{} for _ in range(self.num_envs)]
        return self._stagger() if self._staggered else observations

    def _stagger(self) -> NDArray[np.float32]:
        """Spread the ages of the walkers evenly over the length of an episode, with action 0."""
        limits = self.envs.config
        steps = round(limits["scenario"]["duration_s"] / CONTROL_PERIOD_S / limits["action"]["hold"])
        starts = np.arange(self.num_envs) * steps // self.num_envs
        actions = np.zeros(self.num_envs)
        for step in range(steps):
            self.envs.batch.step(actions)
            self.envs.batch.reset(None, starts == step)
        return self.envs.batch.step(actions).observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions (N, 1) for `step_wait`."""
        self._actions = np.asarray(actions, dtype=np.float64).reshape(self.num_envs)

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Advance every walker by `action.hold` control periods."""
        began = time.perf_counter()
        step = self.envs.batch.step(self._actions)
        now = time.perf_counter()
        self.core_seconds += now - began
        truncated = step.truncated
        dones = step.terminated | truncated
        infos = self._infos.copy()
        ended = np.flatnonzero(dones)
        if ended.size:
            returns, steps, terms = step.episode_returns, step.episode_steps, step.episode_terms
            final, reasons = step.final_observations, step.reasons
            assert final is not None  # autoreset "same_step" always hands it out
            for index in ended:
                infos[index] = {
                    "TimeLimit.truncated": bool(truncated[index]),
                    "terminal_observation": final[index].copy(),
                    "episode": {
                        "r": round(float(returns[index]), 6),
                        "l": int(steps[index]),
                        "t": round(now - self._began, 6),
                    },
                    "episode_terms": dict(zip(_core.TERMS, terms[index].tolist(), strict=True)),
                    "termination_reason": _core.REASONS[reasons[index]],
                }
        return step.observations, step.rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        """Free the native batch."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return the attribute of the batch once per index: all walkers share it."""
        return [getattr(self.envs, attr_name)] * len(self._selected(indices))

    def set_attr(self, attr_name: str, value: object, indices: VecEnvIndices = None) -> None:
        """Set an attribute that all walkers share, so `indices` must name them all."""
        if set(self._selected(indices)) != set(range(self.num_envs)):
            raise ValueError(f"indices must name all {self.num_envs} walkers: they share the attribute {attr_name!r}")
        setattr(self.envs, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: object, indices: VecEnvIndices = None, **method_kwargs: object
    ) -> list[Any]:
        """Call the batch's method once and hands out its result per index."""
        selected = self._selected(indices)
        return [getattr(self.envs, method_name)(*method_args, **method_kwargs)] * len(selected)

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Return True for SB3's Monitor alone: infos hold what it would add."""
        return [issubclass(wrapper_class, Monitor)] * len(self._selected(indices))

    def get_images(self) -> Sequence[NDArray[Any] | None]:
        """Return None for each: walkers in a batch are not rendered."""
        return [None] * self.num_envs

    def _selected(self, indices: VecEnvIndices) -> list[int]:
        selected = list(self._get_indices(indices))
        for index in selected:
            if not -self.num_envs <= index < self.num_envs:
                raise ValueError(f"index = {index} is outside its allowed range [0, {self.num_envs - 1}]")
        return [index % self.num_envs for index in selected]
