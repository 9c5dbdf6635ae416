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

from prosthesis_gym import _core
from prosthesis_gym.config import CONTROL_PERIOD_S
from prosthesis_gym.extras import missing
from prosthesis_gym.reward_terms import RewardTerm
from prosthesis_gym.vector_env import ProsthesisVectorEnv

try:
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.running_mean_std import RunningMeanStd
    from stable_baselines3.common.vec_env import VecEnv
    from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices
except ModuleNotFoundError as error:
    raise missing(error.name or "stable_baselines3", "train") from error

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


class _Normaliser:
    """What the core's normaliser does, after reward terms have seen the observations as they are."""

    def __init__(self, shape: tuple[int, ...], clip: float) -> None:
        self._moments = RunningMeanStd(epsilon=0.0, shape=shape)
        self._clip = clip
        self._learns = True

    def moments(self) -> ObservationMoments:
        return ObservationMoments(float(self._moments.count), self._moments.mean.copy(), self._moments.var.copy())

    def set_moments(self, moments: ObservationMoments, learns: bool) -> None:
        shape = self._moments.mean.shape
        for name, values in (("mean", moments.mean), ("variance", moments.variance)):
            if np.shape(values) != shape:
                raise ValueError(f"{name} has shape {np.shape(values)}, must have {shape}")
        self._moments.count, self._learns = moments.number, learns
        self._moments.mean, self._moments.var = moments.mean.copy(), moments.variance.copy()

    def see(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Learn from observations (N, D) and return them normalised."""
        if self._learns:
            self._moments.update(observations.astype(np.float64))
        return self.normalised(observations)

    def normalised(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        scaled = (observations - self._moments.mean) / np.sqrt(self._moments.var + OBSERVATION_EPSILON)
        return np.clip(scaled, -self._clip, self._clip).astype(np.float32)


class ProsthesisVecEnv(VecEnv):
    """Many walkers as one Stable-Baselines3 environment.

    `config`, `scenario`, `reward` and `reward_terms` are those of `ProsthesisVectorEnv`, whose attributes and methods
    `get_attr`, `set_attr` and `env_method` reach: `set_attr("difficulty", 0.5)`.

    Where an episode ends, the info says what a wrapper per environment would: `terminal_observation`,
    `TimeLimit.truncated`, `episode` (return "r", env steps "l", seconds "t" since the environment was made: no
    VecMonitor is needed), and beyond that `episode_terms` (sum of each reward term before its weight) and
    `termination_reason`. The other environments hand out the same info dict every step, because thousands of fresh
    ones would cost more than the step itself.

    With `normalise_observations`, observations (terminal ones too) come less their running mean, over their running
    standard deviation and within +-`clip_observation`: what SB3's VecNormalize does, done in the core (with
    `reward_terms`, which see observations as they are, in NumPy). Their statistics are `observation_moments`.

    With `staggered`, `reset` lets each walker walk for a different part of an episode first, so that a rollout sees
    all parts of an episode at any time instead of all walkers starting, walking and ending in step.
    """

    def __init__(
        self,
        num_envs: int,
        config: Mapping[str, Any] | str | Path | None = None,
        *,
        scenario: str | Path | None = None,
        reward: str | Path | None = None,
        reward_terms: Sequence[RewardTerm] = (),
        threads: int | None = None,
        staggered: bool = False,
        normalise_observations: bool = False,
        clip_observation: float = 10.0,
        render_mode: str | None = None,
        render_size: tuple[int, int] | None = None,
    ) -> None:
        self.envs = ProsthesisVectorEnv(
            num_envs,
            config,
            scenario=scenario,
            reward=reward,
            reward_terms=reward_terms,
            autoreset_mode=AutoresetMode.SAME_STEP,
            threads=threads,
            render_mode=render_mode,
            render_size=render_size,
        )
        #: Wall time spent in the native core since the environment was made, s.
        self.core_seconds = 0.0
        self._staggered = staggered
        self._began = time.perf_counter()
        self._infos: list[dict[str, Any]] = [{"TimeLimit.truncated": False} for _ in range(num_envs)]
        self._actions = np.zeros(self.envs.action_space.shape or ()).reshape(-1)
        self._normaliser: _Normaliser | None = None
        space = self.envs.single_observation_space
        if normalise_observations:
            if reward_terms:
                self._normaliser = _Normaliser(space.shape or (), clip_observation)
            else:
                self.envs.batch.normalise_observations(clip_observation, OBSERVATION_EPSILON)
            space = Box(-clip_observation, clip_observation, space.shape, np.float32)
        super().__init__(num_envs, space, self.envs.single_action_space)
        self.metadata["render_fps"] = self.envs.metadata["render_fps"]

    @property
    def observation_moments(self) -> ObservationMoments:
        """Statistics of the observations so far.

        Raises:
            ValueError: observations are not normalised.

        """
        if self._normaliser is not None:
            return self._normaliser.moments()
        return ObservationMoments(*self.envs.batch.moments())

    def set_observation_moments(self, moments: ObservationMoments, *, learns: bool = True) -> None:
        """Replace the statistics; without `learns` they stay as they are from now on."""
        if self._normaliser is not None:
            self._normaliser.set_moments(moments, learns)
        else:
            self.envs.batch.set_moments(*moments, learns)

    def reset(self) -> NDArray[np.float32]:
        """Return first observations (N, D) of new episodes; takes the seeds of the last call of `seed`."""
        seeded = any(seed is not None for seed in self._seeds)
        observations, _ = self.envs.reset(seed=list(self._seeds) if seeded else None)
        self._reset_seeds()
        self._reset_options()
        self.reset_infos = [{} for _ in range(self.num_envs)]
        if self._staggered:
            observations = self._stagger()
            if self.envs.rendering is not None:
                self.envs.rendering.reset()
        return observations if self._normaliser is None else self._normaliser.see(observations)

    def _stagger(self) -> NDArray[np.float32]:
        """Spread the ages of the walkers evenly over the length of an episode, with action 0."""
        limits = self.envs.config
        steps = round(limits["scenario"]["duration_s"] / CONTROL_PERIOD_S / limits["action"]["hold"])
        starts = np.arange(self.num_envs) * steps // self.num_envs
        actions = np.zeros_like(self._actions)
        for step in range(steps):
            self.envs.walkers.step(actions)
            self.envs.walkers.reset(None, starts == step)
        return self.envs.walkers.step(actions).observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions (N, action size) for `step_wait`."""
        self._actions = np.asarray(actions, dtype=np.float64).reshape(self._actions.shape)

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Advance every walker by `action.hold` control periods."""
        began = time.perf_counter()
        step = self.envs.walkers.step(self._actions)
        now = time.perf_counter()
        self.core_seconds += now - began
        if self.envs.rendering is not None:
            self.envs.rendering.step()
        observations, truncated = step.observations, step.truncated
        if self._normaliser is not None:
            observations = self._normaliser.see(observations)
        dones = step.terminated | truncated
        infos = self._infos.copy()
        ended = np.flatnonzero(dones)
        if ended.size:
            returns, steps, terms = step.episode_returns, step.episode_steps, step.episode_terms
            final, reasons = step.final_observations, step.reasons
            assert final is not None  # autoreset "same_step" always hands it out
            if self._normaliser is not None:
                final = self._normaliser.normalised(final)
            for index in ended:
                infos[index] = {
                    "TimeLimit.truncated": bool(truncated[index]),
                    "terminal_observation": final[index].copy(),
                    "episode": {
                        "r": round(float(returns[index]), 6),
                        "l": int(steps[index]),
                        "t": round(now - self._began, 6),
                    },
                    "episode_terms": dict(zip(self.envs.walkers.terms.names, terms[index].tolist(), strict=True)),
                    "termination_reason": _core.REASONS[reasons[index]],
                }
        return observations, step.rewards.astype(np.float32), dones, infos

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
        """Return a picture (height, width, 3) uint8 of each of the first 16 walkers; None for all without a mode."""
        return [None] * self.num_envs if self.envs.rendering is None else self.envs.rendering.frames()

    def _selected(self, indices: VecEnvIndices) -> list[int]:
        selected = list(self._get_indices(indices))
        for index in selected:
            if not -self.num_envs <= index < self.num_envs:
                raise ValueError(f"index = {index} is outside its allowed range [0, {self.num_envs - 1}]")
        return [index % self.num_envs for index in selected]
