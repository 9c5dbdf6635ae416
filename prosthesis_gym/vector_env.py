"""Native vector environment: thousands of walkers in one call of the Rust core."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.config import CONTROL_PERIOD_S
from prosthesis_gym.limited import Limited
from prosthesis_gym.rendering.canvas import Frame
from prosthesis_gym.rendering.gym import RENDER_MODES, BatchRendering, check_render_mode
from prosthesis_gym.reward_terms import RewardTerm, Step, groups_seen
from prosthesis_gym.seeding import check_seed, core_seed, core_seeds, first_seed
from prosthesis_gym.walkers import Autoreset, Observations, Walkers, environment_config, observation_groups, spaces

_AUTORESET: dict[AutoresetMode, Autoreset] = {
    AutoresetMode.NEXT_STEP: "next_step",
    AutoresetMode.SAME_STEP: "same_step",
    AutoresetMode.DISABLED: "disabled",
}


def env_steps_per_s(config: Mapping[str, Any]) -> int:
    """Return the env steps in a second of simulated time, rounded."""
    hold: int = config["action"]["hold"]
    return round(1.0 / (CONTROL_PERIOD_S * hold))


def check_actions(actions: object, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return actions as a flat float64 array; that none is NaN, the core checks.

    Raises:
        ValueError: wrong shape or not floating point.

    """
    array = np.asarray(actions)
    if array.dtype.kind != "f":
        raise ValueError(f"actions have dtype {array.dtype}, must be float32 or float64")
    if array.shape != shape:
        raise ValueError(f"actions have shape {array.shape}, must be {shape}")
    return array.astype(np.float64).reshape(-1)


class ProsthesisVectorEnv(Limited, VectorEnv[Observations, NDArray[np.floating[Any]], NDArray[Any]]):
    """N walkers with a prosthetic knee, stepped together at 200 Hz.

    Environment i, seeded with s, gives bit for bit the trajectory of a single environment seeded with s, whatever N and
    the number of threads. `reset(seed=s)` seeds environment i with s + i.

    Infos are those of N single environments, laid out as Gymnasium's `SyncVectorEnv` does, each key beside its mask
    `_key` ((N,) bool): `reward_<term>` ((N,) float64, unweighted) of each term of the reward, and `termination_reason`
    ((N,) int64, a `TerminationReason`: 0 while an episode goes on); all 0 where the mask is False, that is where a step
    only reset. In steps that end episodes, `AutoresetMode.SAME_STEP` adds `final_obs` and `final_info`. Unlike there,
    the first two are always present, and `final_obs` is an array of numbers, (N, D) float32, 0 where the mask is False.

    `copy.deepcopy` and pickles go on bit for bit, without what has been drawn or recorded.

    Args:
        num_envs: number of walkers.
        config: TOML file, nested mapping or None; overrides scenario and reward.
        scenario: what the walkers meet: one of `prosthesis_gym.SCENARIOS`, or the path of a file.
        reward: weights of the reward's terms: one of `prosthesis_gym.REWARDS`, or the path of a file.
        reward_terms: terms of one's own beside the core's.
        device: knee unit (a key of `prosthesis_gym.devices.DEVICES`); None leaves it to the configuration.
        autoreset_mode: what happens after an episode's end (all three modes of Gymnasium).
        threads: worker threads; None takes all cores. Results do not depend on it.
        max_episode_steps: replaces `scenario.duration_s`, in env steps; -1 for no limit.
        render_mode: None; "rgb_array", pictures when `render` is called; or "human", a window that follows every
            reset and step. Needs the extra `render`, from the first picture on; trajectories do not depend on it. Only
            the first 16 walkers are ever drawn.
        render_size: width and height in pixels of each walker's picture, by default 640x360, or of the window.

    Raises:
        ValueError: impossible configuration or arguments; names key, value and range.

    """

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES}  # noqa: RUF012 - as Gymnasium declares it

    #: Draws the walkers, if there is a render mode.
    rendering: BatchRendering | None = None

    def __init__(
        self,
        num_envs: int = 1,
        config: str | Path | Mapping[str, Any] | None = None,
        *,
        scenario: str | Path | None = None,
        reward: str | Path | None = None,
        reward_terms: Sequence[RewardTerm] = (),
        device: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        render_size: tuple[int, int] | None = None,
    ) -> None:
        mode = check_render_mode(render_mode, render_size)
        self.config = environment_config(
            config, device, scenario=scenario, reward=reward, seen=groups_seen(reward_terms)
        )
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        autoreset = _AUTORESET[self.autoreset_mode]
        self.walkers = Walkers(
            num_envs, self.config, reward_terms, autoreset, threads, max_episode_steps=max_episode_steps
        )
        self.num_envs = num_envs
        self.render_mode = mode
        self.rendering = None if mode is None else BatchRendering(self.walkers, self.config, mode, render_size)
        self.single_observation_space, self.single_action_space = spaces(self.config)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.metadata = {
            "render_modes": RENDER_MODES,
            "render_fps": env_steps_per_s(self.config),
            "autoreset_mode": self.autoreset_mode,
        }
        self._all = np.ones(num_envs, dtype=np.bool_)
        self._masks = [f"_{key}" for key in (*self.walkers.terms.keys, "termination_reason")]

    @property
    def batch(self) -> _core.Batch:
        """The core's walkers."""
        return self.walkers.batch

    @property
    def observation_groups(self) -> dict[str, NDArray[np.intp]]:
        """Indices of each group of channels in an observation (D,), over all frames.

        An asymmetric actor sees all but "privileged", its critic everything.
        """
        return observation_groups(self.config)

    @property
    def difficulty(self) -> float:
        """Share of disturbances and randomisation, in [0, 1], that episodes have from their next start on.

        0 is the nominal walker, whom nobody disturbs, 1 the scenario as it is. A value outside is a ValueError.
        """
        return self.walkers.difficulty

    @difficulty.setter
    def difficulty(self, difficulty: float) -> None:
        self.walkers.difficulty = difficulty

    def get_state(self, indices: Sequence[int] | None = None) -> bytes:
        """Return the state of the walkers at `indices`, of all by default; put back, each goes on bit for bit.

        Included: walker, knee and sensors, the episode with all that was drawn for it, the number of the episode and
        its seed (so the next episodes too), observation, sums of the reward, whether the episode has ended. Not
        included: `difficulty` of episodes to come, statistics that normalise observations, recordings, and whatever
        the environment's wrappers keep.

        Raises:
            ValueError: an index outside [0, N - 1], or none.

        """
        return self.walkers.get_state(indices)

    def set_state(self, state: bytes, indices: Sequence[int] | None = None) -> Observations:
        """Put saved walkers at `indices`, at all by default; a single one goes to each of them.

        One whose episode has ended starts the next one, with `AutoresetMode.SAME_STEP` at once.

        The state may come from any environment, single or vector, of the same configuration and reward terms.

        Returns:
            Observations (N, D) float32 of all walkers: those of saved ones are the newest they had handed out.

        Raises:
            ValueError: an index outside [0, N - 1]; a state of another configuration, version or number of walkers,
                or a damaged one. The walkers stay as they were.

        """
        observations = self.walkers.set_state(state, indices)
        if self.rendering is not None:
            self.rendering.reset()
        return observations

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Reset all environments, or those in `options["reset_mask"]` ((N,) bool).

        Args:
            seed: s seeds environment i with s + i; a list seeds each, but where it is None; None goes on to the next
                episode of each. Environments without any seed so far get that of `np_random_seed`, which replays them.
            options: `reset_mask` is the only option.

        Returns:
            Observations (N, frames * channels) float32 and an empty info.

        Raises:
            ValueError: seeds that are not integers, or negative, or of another number; another option.

        """
        self.walkers.check_open()
        options = dict(options or {})
        mask = self._reset_mask(options.pop("reset_mask", None))
        if options:
            raise ValueError(f"unknown reset option {next(iter(options))!r}; the only one is 'reset_mask'")
        observations = self.walkers.reset(*self._seeds(seed, mask))
        if self.rendering is not None:
            self.rendering.reset()
        return observations, {}

    def _reset_mask(self, mask: object) -> NDArray[np.bool_]:
        if mask is None:
            return self._all
        array = np.asarray(mask)
        if array.dtype != np.bool_ or array.shape != (self.num_envs,):
            raise ValueError(
                f"reset_mask has dtype {array.dtype} and shape {array.shape}, must be bool and ({self.num_envs},)"
            )
        if not array.any():
            raise ValueError("reset_mask selects no environment")
        return array

    def _seeds(
        self, seed: object, mask: NDArray[np.bool_]
    ) -> tuple[NDArray[np.uint64] | None, NDArray[np.bool_], NDArray[np.bool_]]:
        """Return the core's seeds of a reset, its mask, and where in it they count."""
        if seed is not None and not (isinstance(seed, list | tuple | np.ndarray) and np.ndim(seed) > 0):
            seed = check_seed(seed)
            super().reset(seed=seed)
            return core_seeds(seed, self.num_envs), mask, mask
        never_reset = mask & ~self.walkers.was_reset
        seeds = core_seeds(first_seed(self), self.num_envs) if never_reset.any() else np.zeros(self.num_envs, np.uint64)
        if seed is None:
            return (seeds, mask, never_reset) if never_reset.any() else (None, mask, never_reset)
        if len(seed) != self.num_envs:
            raise ValueError(f"seed has {len(seed)} entries, must have one per environment: {self.num_envs}")
        given = [None if one is None else core_seed(check_seed(one)) for one in seed]
        for index, one in enumerate(given):
            if one is not None:
                seeds[index] = one
        return seeds, mask, never_reset | np.array([one is not None for one in given])

    def step(
        self, actions: NDArray[np.floating[Any]]
    ) -> tuple[Observations, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Advance all environments by one action of `action.hold` control periods.

        Args:
            actions: (N, 1), or (N, 3) in mode "impedance", float32 or float64, limited to [-1, 1],
                infinite ones too; NaN is an error.

        Returns:
            Observations (N, frames * channels) float32, rewards (N,) float64, terminated and truncated (N,) bool,
            infos.

        Raises:
            ValueError: wrong shape or dtype, NaN, or (autoreset disabled) an environment that has ended.

        """
        flat = check_actions(actions, self.action_space.shape or ())
        step = self.walkers.step(flat)
        if self.rendering is not None:
            self.rendering.step()
        infos = self._infos(step) if step.final_observations is None else self._same_step_infos(step)
        return step.observations, step.rewards, step.terminated, step.truncated, infos

    def render(self) -> tuple[Frame, ...] | None:
        """Return a picture (height, width, 3) uint8 of each of the first 16 walkers, or draw them into the window.

        Raises:
            ValueError: before the first reset, or after `close`.
            ModuleNotFoundError: the extra `render` is not installed.

        """
        self.walkers.check_open()
        if self.rendering is None:
            gymnasium.logger.warn("render() without a render_mode draws nothing; choose one when making the envs")
            return None
        if self.render_mode == "human":
            self.rendering.show()
            return None
        return self.rendering.frames()

    def _infos(self, step: _core.Step | Step) -> dict[str, Any]:
        """Lay out the infos of a step that an environment either takes, or is reset in."""
        return self._info(step.terms, step.reasons, ~step.started)

    def _same_step_infos(self, step: _core.Step | Step) -> dict[str, Any]:
        """Lay out the infos of a step whose ended environments have been reset in it: what ended is the final one."""
        ended, finals = step.started, step.final_observations
        if not step.eventful or finals is None:
            return self._infos(step)
        where = ended[:, None]
        return self._info(np.where(where, 0.0, step.terms), np.zeros_like(step.reasons), ~ended) | {
            "final_obs": np.where(where, finals, np.float32(0.0)),
            "_final_obs": ended.copy(),
            "final_info": self._info(np.where(where, step.terms, 0.0), step.reasons, ended.copy()),
            "_final_info": ended,
        }

    def _info(
        self, terms: NDArray[np.float64], reasons: NDArray[np.uint8], present: NDArray[np.bool_]
    ) -> dict[str, Any]:
        """Lay out terms of the reward (N, number of terms) and reasons (N,), 0 where the mask `present` is False."""
        # Not strict: zip would ask the array for one row too many, and that IndexError takes longer than all the rest.
        info: dict[str, Any] = dict.fromkeys(self._masks, present)
        info.update(zip(self.walkers.terms.keys, terms.T, strict=False))
        info["termination_reason"] = reasons.astype(np.int64)
        return info

    def close_extras(self, **_: object) -> None:
        """Close the window, if there is one; whatever is asked of the environments afterwards is an error."""
        if "walkers" in vars(self):  # not in what was never finished, which Gymnasium 1.2 closes too
            self.walkers.close()
        if self.rendering is not None:
            self.rendering.close()
