"""Stable-Baselines3 on the native batch: `ProsthesisVecEnv`, without a Python loop over the environments that go on."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from inspect import signature
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from prosthesis_gym.arguments import check_whole
from prosthesis_gym.extras import missing
from prosthesis_gym.reward_terms import RewardTerm
from prosthesis_gym.seeding import check_seed
from prosthesis_gym.vector_env import ProsthesisVectorEnv, check_actions

try:
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import VecEnv
    from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

    from prosthesis_gym.sb3_normalisation import OBSERVATION_EPSILON, ObservationMoments, ProsthesisVecNormalize
except ModuleNotFoundError as error:
    raise missing(error.name or "stable_baselines3", "train") from error

__all__ = ["OBSERVATION_EPSILON", "ObservationMoments", "ProsthesisVecEnv", "ProsthesisVecNormalize"]

#: What `get_attr` answers with another attribute of the batch, because each walker has it.
_OF_ONE = {"observation_space": "single_observation_space", "action_space": "single_action_space"}
#: Attributes that can be set after the environment has been made.
_SETTABLE = frozenset({"difficulty"})
#: What walkers have of their own and the batch does not tell.
_UNTOLD = frozenset({"np_random", "np_random_seed"})


class ProsthesisVecEnv(VecEnv):
    """Many walkers as one Stable-Baselines3 environment.

    `config`, `scenario`, `reward`, `reward_terms` and `max_episode_steps` are those of `ProsthesisVectorEnv`, whose
    attributes and methods `get_attr`, `set_attr` and `env_method` reach: `set_attr("difficulty", 0.5)`. What walkers
    can do alone, `env_method` has those at `indices` do: `env_method("reset", seed=3, indices=[1])`, `get_state`,
    `set_state`, `render`. What all walkers share must be asked for of all; otherwise it is a ValueError.

    Where an episode ends, the info says what a wrapper per environment would: `terminal_observation`,
    `TimeLimit.truncated`, `episode` (return "r", env steps "l", seconds "t" since the environment was made: no
    VecMonitor is needed), `termination_reason` (int, a `TerminationReason`), and beyond that `episode_terms` (sum of
    each reward term before its weight). The other environments hand out the same info dict every step, because
    thousands of fresh ones would cost more than the step itself.

    `ProsthesisVecNormalize` around it normalises observations and rewards.

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
        max_episode_steps: int | None = None,
        staggered: bool = False,
        normalise_observations: bool = False,
        render_mode: str | None = None,
        render_size: tuple[int, int] | None = None,
    ) -> None:
        if normalise_observations:  # Statistics that only the environment knew of, callbacks evaluated without.
            raise ValueError(
                "normalise_observations = True: put ProsthesisVecNormalize(env, norm_reward=False) around the "
                "environment, and one around that of an EvalCallback, which then takes over the statistics"
            )
        self.envs = ProsthesisVectorEnv(
            num_envs,
            config,
            scenario=scenario,
            reward=reward,
            reward_terms=reward_terms,
            autoreset_mode=AutoresetMode.SAME_STEP,
            threads=threads,
            max_episode_steps=max_episode_steps,
            render_mode=render_mode,
            render_size=render_size,
        )
        if staggered and self.envs.max_episode_steps is None:
            raise ValueError("staggered walkers need a limit of time: max_episode_steps = -1 takes it away")
        #: Wall time spent in the native core since the environment was made, s.
        self.core_seconds = 0.0
        self._staggered = staggered
        self._began = time.perf_counter()
        self._infos: list[dict[str, Any]] = [{"TimeLimit.truncated": False} for _ in range(num_envs)]
        self._actions = np.zeros(self.envs.action_space.shape or ()).reshape(-1)
        arguments = signature(ProsthesisVectorEnv).parameters
        self._fixed = (frozenset(dir(self.envs)) | frozenset(arguments)) - _SETTABLE
        super().__init__(num_envs, self.envs.single_observation_space, self.envs.single_action_space)
        self.metadata["render_fps"] = self.envs.metadata["render_fps"]

    @property
    def observation_moments(self) -> ObservationMoments:
        """Statistics of the observations so far.

        Raises:
            ValueError: observations are not normalised.

        """
        return ObservationMoments(*self.envs.batch.moments())

    def set_observation_moments(self, moments: ObservationMoments) -> None:
        """Replace the statistics.

        Raises:
            ValueError: observations are not normalised; another number of entries, or impossible ones.

        """
        self.envs.batch.set_moments(*moments, self.envs.batch.learns)

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Have walker i begin with seed + i at the next reset; None draws one.

        Raises:
            ValueError: not an integer, or negative.

        """
        return super().seed(None if seed is None else check_seed(seed))

    def set_options(self, options: list[dict[str, Any]] | dict[str, Any] | None = None) -> None:
        """Refuse options for resets: the environments have none."""
        if isinstance(options, list) and len(options) != self.num_envs:
            raise ValueError(f"options has {len(options)} entries, must have one per environment: {self.num_envs}")
        for one in options if isinstance(options, list) else [options]:
            if one:
                raise ValueError(f"unknown reset option {next(iter(one))!r}; there are none")

    def reset(self) -> NDArray[np.float32]:
        """Return first observations (N, D) of new episodes; takes the seeds of the last call of `seed`."""
        seeds = list(self._seeds) if any(seed is not None for seed in self._seeds) else None
        observations = self._spread(seeds) if self._staggered else self.envs.reset(seed=seeds)[0]
        self._reset_seeds()
        self.reset_infos = [{} for _ in range(self.num_envs)]
        return observations

    def _spread(self, seeds: list[int | None] | None) -> NDArray[np.float32]:
        """Begin episodes, and spread the ages of the walkers evenly over their length, with action 0."""
        walkers, batch = self.envs.walkers, self.envs.batch
        learns = walkers.normalised and batch.learns
        if learns:  # from what the agent meets, and from nothing else
            batch.learns = False
        try:
            self.envs.reset(seed=seeds)
            steps = self.envs.max_episode_steps or 0
            starts = np.arange(self.num_envs) * steps // self.num_envs
            actions = np.zeros_like(self._actions)
            for step in range(steps):
                walkers.step(actions)
                if (starting := starts == step).any():
                    walkers.reset(mask=starting)
            walkers.step(actions)
        finally:
            if learns:
                batch.learns = True
        if self.envs.rendering is not None:
            self.envs.rendering.reset()
        return walkers.observations(np.ones(self.num_envs, dtype=np.bool_))

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions (N, action size), floating point, for `step_wait`.

        Raises:
            ValueError: wrong shape or dtype.

        """
        self._actions = check_actions(actions, self.envs.action_space.shape or ())

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Advance every walker by `action.hold` control periods."""
        began = time.perf_counter()
        step = self.envs.walkers.step(self._actions)
        now = time.perf_counter()
        self.core_seconds += now - began
        if self.envs.rendering is not None:
            self.envs.rendering.step()
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
                    "episode_terms": dict(zip(self.envs.walkers.terms.names, terms[index].tolist(), strict=True)),
                    "termination_reason": int(reasons[index]),
                }
        return step.observations, step.rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        """Close the window, if there is one; whatever is asked of the environment afterwards is an error."""
        self.envs.close()

    def has_attr(self, attr_name: str) -> bool:
        """Return whether there is an attribute of that name."""
        return hasattr(self.envs, attr_name)

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return the attribute once per index.

        Raises:
            AttributeError: no such attribute.
            ValueError: an index outside [0, N - 1], or what differs from walker to walker and is not kept.

        """
        selected = self._selected(indices)
        if attr_name in _UNTOLD:
            raise ValueError(f"{attr_name} of single walkers is not kept: their seeds are what `seed` returned")
        return [getattr(self.envs, _OF_ONE.get(attr_name, attr_name))] * len(selected)

    def set_attr(self, attr_name: str, value: object, indices: VecEnvIndices = None) -> None:
        """Set an attribute that all walkers share: `difficulty`, or one of the caller's own.

        Raises:
            ValueError: `indices` that do not name all walkers, or what is fixed when the environment is made.

        """
        self._check_all(indices, f"attribute {attr_name!r}")
        if attr_name in self._fixed:
            raise ValueError(
                f"attribute {attr_name!r} is fixed when the environment is made; {', '.join(_SETTABLE)} is not"
            )
        setattr(self.envs, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: object, indices: VecEnvIndices = None, **method_kwargs: object
    ) -> list[Any]:
        """Call a method for the walkers at `indices` and return its result for each of them.

        Raises:
            AttributeError: no such method.
            ValueError: an index outside [0, N - 1]; some walkers alone, where only all can do it.

        """
        of_some: dict[str, Callable[..., list[Any]]] = {
            "reset": self._reset_some,
            "get_state": self._states,
            "set_state": self._set_states,
            "render": self._render_some,
            "get_wrapper_attr": lambda indices, name: self.get_attr(name, indices),
            "set_wrapper_attr": self._set_wrapper_attr,
        }
        selected = self._selected(indices)
        if method_name in of_some:
            return of_some[method_name](selected, *method_args, **method_kwargs)
        if method_name == "step":
            raise ValueError("walkers cannot be stepped one by one: call step with the actions of all")
        self._check_all(indices, f"method {method_name!r}")
        return [getattr(self.envs, method_name)(*method_args, **method_kwargs)] * len(selected)

    def _reset_some(
        self, selected: list[int], *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> list[tuple[NDArray[np.float32], dict[str, Any]]]:
        self.set_options(options)
        mask = np.zeros(self.num_envs, dtype=np.bool_)
        mask[selected] = True
        seeds = None if seed is None else [seed if own else None for own in mask]
        observations, _ = self.envs.reset(seed=seeds, options={"reset_mask": mask})
        return [(observations[index], {}) for index in selected]

    def _states(self, selected: list[int]) -> list[bytes]:
        return [self.envs.get_state([index]) for index in selected]

    def _set_states(self, selected: list[int], state: bytes) -> list[NDArray[np.float32]]:
        observations = self.envs.set_state(state, selected)
        return [observations[index] for index in selected]

    def _render_some(self, selected: list[int]) -> list[Any]:
        pictures = self.envs.render()
        if pictures is None:
            return [None] * len(selected)
        if max(selected) >= len(pictures):
            raise ValueError(f"index = {max(selected)}: only the first {len(pictures)} walkers are drawn")
        return [pictures[index] for index in selected]

    def _set_wrapper_attr(self, selected: list[int], name: str, value: object, *, force: bool = True) -> list[bool]:
        if not force and not self.has_attr(name):
            return [False] * len(selected)
        self.set_attr(name, value, selected)
        return [True] * len(selected)

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Return True for SB3's Monitor alone: infos hold what it would add."""
        return [issubclass(wrapper_class, Monitor)] * len(self._selected(indices))

    def get_images(self) -> Sequence[NDArray[Any] | None]:
        """Return a picture (height, width, 3) uint8 of each of the first 16 walkers; None for all without a mode."""
        return [None] * self.num_envs if self.envs.rendering is None else self.envs.render() or []

    def _check_all(self, indices: VecEnvIndices, what: str) -> None:
        if set(self._selected(indices)) != set(range(self.num_envs)):
            raise ValueError(f"indices must name all {self.num_envs} walkers, or be left out: they share the {what}")

    def _selected(self, indices: VecEnvIndices) -> list[int]:
        if indices is None:
            return list(range(self.num_envs))
        listed = indices if isinstance(indices, Iterable) else [indices]
        selected = [check_whole(index, "index") for index in listed]
        if not selected:
            raise ValueError("indices = [] must name at least one walker")
        for index in selected:
            if not -self.num_envs <= index < self.num_envs:
                raise ValueError(f"index = {index} is outside its allowed range [0, {self.num_envs - 1}]")
        return [index % self.num_envs for index in selected]
