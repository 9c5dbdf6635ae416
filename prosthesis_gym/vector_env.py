"""Native vector environment: thousands of walkers in one call of the Rust core."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.config import CONTROL_PERIOD_S
from prosthesis_gym.rendering.canvas import Frame
from prosthesis_gym.rendering.gym import RENDER_MODES, BatchRendering, check_render_mode
from prosthesis_gym.reward_terms import RewardTerm, Step
from prosthesis_gym.walkers import Observations, Walkers, environment_config, observation_groups, spaces

_AUTORESET: dict[AutoresetMode, Literal["next_step", "same_step", "disabled"]] = {
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


class ProsthesisVectorEnv(VectorEnv[Observations, NDArray[np.floating[Any]], NDArray[Any]]):
    """N walkers with a prosthetic knee, stepped together at 200 Hz.

    Environment i, seeded with s, gives bit for bit the trajectory of a single environment seeded with s, whatever N and
    the number of threads. `reset(seed=s)` seeds environment i with s + i.

    Infos are those of N single environments, laid out as Gymnasium's `SyncVectorEnv` does, each key beside its mask
    `_key` ((N,) bool): `reward_terms` (name -> (N,) float64, unweighted; 0 where the mask is False, that is where a
    step only reset), in steps that end episodes `termination_reason` ((N,) object: str or None), and with
    `AutoresetMode.SAME_STEP` then also `final_obs` and `final_info`. Unlike there, `reward_terms` is always present.

    Args:
        num_envs: number of walkers.
        config: TOML file, nested mapping or None; overrides scenario and reward.
        scenario: what the walkers meet: one of `prosthesis_gym.SCENARIOS`, or the path of a file.
        reward: weights of the reward's terms: one of `prosthesis_gym.REWARDS`, or the path of a file.
        reward_terms: terms of one's own beside the core's.
        device: knee unit (a key of `prosthesis_gym.devices.DEVICES`); None leaves it to the configuration.
        autoreset_mode: what happens after an episode's end (all three modes of Gymnasium).
        threads: worker threads; None takes all cores. Results do not depend on it.
        max_episode_steps: replaces `scenario.duration_s`, in env steps.
        render_mode: None; "rgb_array", pictures when `render` is called; or "human", a window that follows every
            reset and step. Needs the extra `render`; trajectories do not depend on it. Only the first 16 walkers are
            ever drawn.
        render_size: width and height in pixels of each walker's picture, by default 640x360, or of the window.

    Raises:
        ValueError: impossible configuration or arguments; names key, value and range.
        ModuleNotFoundError: rendering without the extra `render`.

    """

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES}  # noqa: RUF012 - as Gymnasium declares it

    # Gymnasium 1.2 closes what was never finished: a refused configuration must not trip over this.
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
        mode = check_render_mode(render_mode)
        self.config = environment_config(config, device, max_episode_steps, scenario=scenario, reward=reward)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.walkers = Walkers(num_envs, self.config, reward_terms, _AUTORESET[self.autoreset_mode], threads)
        self.batch = self.walkers.batch
        self.num_envs = num_envs
        self.render_mode = mode
        #: Draws the walkers, if there is a render mode.
        self.rendering = None if mode is None else BatchRendering(self.batch, self.config, mode, render_size)
        self.single_observation_space, self.single_action_space = spaces(self.config)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.metadata = {
            "render_modes": RENDER_MODES,
            "render_fps": env_steps_per_s(self.config),
            "autoreset_mode": self.autoreset_mode,
        }
        self._seeded = False
        self._all = np.ones(num_envs, dtype=np.bool_)
        self._term_masks = [f"_{name}" for name in self.walkers.terms.names]

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
        return self.batch.difficulty

    @difficulty.setter
    def difficulty(self, difficulty: float) -> None:
        self.batch.difficulty = difficulty

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
        self._seeded |= indices is None or set(indices) == set(range(self.num_envs))
        return observations

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Reset all environments, or those in `options["reset_mask"]` ((N,) bool).

        Args:
            seed: s seeds environment i with s + i; a list seeds each; None goes on to the next episode of each.
            options: `reset_mask` is the only option.

        Returns:
            Observations (N, frames * channels) float32 and an empty info.

        """
        options = dict(options or {})
        mask = self._reset_mask(options.pop("reset_mask", None))
        if options:
            raise ValueError(f"unknown reset option {next(iter(options))!r}; the only one is 'reset_mask'")
        if isinstance(seed, int | np.integer):
            super().reset(seed=int(seed))
        seeds = self._seeds(seed)
        if seeds is not None:
            self._seeded = True
        observations = self.walkers.reset(seeds, mask)
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

    def _seeds(self, seed: int | list[int | None] | None) -> NDArray[np.uint64] | None:
        if seed is None and self._seeded:
            return None
        fresh = self.np_random.integers(2**63, size=self.num_envs, dtype=np.uint64)
        if seed is None:
            return fresh
        if isinstance(seed, int | np.integer):
            if seed < 0:
                raise ValueError(f"seed = {seed} must not be negative")
            return np.uint64(seed) + np.arange(self.num_envs, dtype=np.uint64)
        if len(seed) != self.num_envs:
            raise ValueError(f"seed has {len(seed)} entries, must have one per environment: {self.num_envs}")
        negative = [one for one in seed if one is not None and one < 0]
        if negative:
            raise ValueError(f"seed = {negative[0]} must not be negative")
        return np.array([fresh[i] if one is None else one for i, one in enumerate(seed)], dtype=np.uint64)

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
            ValueError: before the first reset.

        """
        if self.rendering is None:
            gymnasium.logger.warn("render() without a render_mode draws nothing; choose one when making the envs")
            return None
        if self.render_mode == "human":
            self.rendering.show()
            return None
        return self.rendering.frames()

    def _infos(self, step: _core.Step | Step) -> dict[str, Any]:
        """Lay out the infos of a step that an environment either takes, or is reset in."""
        infos = self._reward_terms(step.terms, ~step.started)
        if step.eventful:
            ended = step.terminated | step.truncated
            if ended.any():
                infos |= {"termination_reason": step.termination_reasons, "_termination_reason": ended}
        return infos

    def _same_step_infos(self, step: _core.Step | Step) -> dict[str, Any]:
        """Lay out the infos of a step whose ended environments have been reset in it: what ended is the final one."""
        ended, finals = step.started, step.final_observations
        if not step.eventful or finals is None:
            return self._reward_terms(step.terms, ~ended)
        where = ended[:, None]
        why = {"termination_reason": step.termination_reasons, "_termination_reason": ended.copy()}
        return self._reward_terms(np.where(where, 0.0, step.terms), ~ended) | {
            "final_obs": _rows(finals, ended),
            "_final_obs": ended.copy(),
            "final_info": self._reward_terms(np.where(where, step.terms, 0.0), ended.copy()) | why,
            "_final_info": ended,
        }

    def _reward_terms(self, terms: NDArray[np.float64], present: NDArray[np.bool_]) -> dict[str, Any]:
        """Lay out the reward's terms (N, number of terms) of the environments in the mask; 0 elsewhere."""
        # Not strict: zip would ask the array for one row too many, and that IndexError takes longer than all the rest.
        named = dict(zip(self.walkers.terms.names, terms.T, strict=False)) | dict.fromkeys(self._term_masks, present)
        return {"reward_terms": named, "_reward_terms": present}

    def close_extras(self, **_: object) -> None:
        """Close the window, if there is one."""
        if self.rendering is not None:
            self.rendering.close()


def _rows(observations: Observations, mask: NDArray[np.bool_]) -> NDArray[Any]:
    """Return an object array (N,) of the rows in `mask`, None elsewhere."""
    rows = np.full(mask.size, None, dtype=object)
    for index in np.flatnonzero(mask):
        rows[index] = observations[index]
    return rows
