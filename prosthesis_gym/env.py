"""Single environment: the vector environment's walker, one at a time."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Space
from gymnasium.wrappers import TimeLimit
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.callers import limit_of_make, wrappers_of_reset
from prosthesis_gym.limited import Limited
from prosthesis_gym.reasons import TerminationReason
from prosthesis_gym.rendering.canvas import Frame
from prosthesis_gym.rendering.gym import RENDER_MODES, BatchRendering, check_render_mode
from prosthesis_gym.reward_terms import RewardTerm, groups_seen
from prosthesis_gym.seeding import check_seed, core_seed, first_seed
from prosthesis_gym.time_limit import UNLIMITED, set_limit
from prosthesis_gym.vector_env import check_actions, env_steps_per_s
from prosthesis_gym.walkers import Observations, Walkers, environment_config, observation_groups, spaces


class ProsthesisEnv(Limited, gymnasium.Env[Observations, NDArray[np.floating[Any]]]):
    """One walker with a prosthetic knee, stepped at 200 Hz.

    Seeded with s, it gives bit for bit the trajectory of any environment of `ProsthesisVectorEnv` seeded with s.

    The info of a step is flat: `reward_<term>` (float64, unweighted) of each term of the reward, and
    `termination_reason` (int64, a `TerminationReason`: 0 while the episode goes on).

    `copy.deepcopy` and pickles go on bit for bit, without what has been drawn or recorded.

    Args:
        config: TOML file, nested mapping or None; overrides scenario and reward.
        scenario: what the walker meets: one of `prosthesis_gym.SCENARIOS`, or the path of a file.
        reward: weights of the reward's terms: one of `prosthesis_gym.REWARDS`, or the path of a file.
        reward_terms: terms of one's own beside the core's; their functions get arrays of one entry.
        device: knee unit (a key of `prosthesis_gym.devices.DEVICES`); None leaves it to the configuration.
        max_episode_steps: replaces `scenario.duration_s`, in env steps; -1 for no limit. So does that of
            `gymnasium.make`, or a TimeLimit around the environment.
        render_mode: None; "rgb_array", pictures when `render` is called; or "human", a window that follows every
            reset and step. Needs the extra `render`, from the first picture on; trajectories do not depend on it.
        render_size: width and height in pixels, by default 640x360, of a window 960x540. From a height of 480 on,
            pictures have plots of the last 3 s.

    Raises:
        ValueError: impossible configuration; names key, value and range.

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
        mode = check_render_mode(render_mode, render_size)
        self.config = environment_config(
            config, device, scenario=scenario, reward=reward, seen=groups_seen(reward_terms)
        )
        self.walkers = Walkers(1, self.config, reward_terms, "disabled", 1, max_episode_steps=max_episode_steps)
        observation_space, action_space = spaces(self.config)
        self.observation_space = cast("Space[Observations]", observation_space)
        self.action_space = cast("Space[NDArray[np.floating[Any]]]", action_space)
        self.render_mode = mode
        self.metadata = {"render_modes": RENDER_MODES, "render_fps": env_steps_per_s(self.config)}
        self._rendering = None if mode is None else BatchRendering(self.walkers, self.config, mode, render_size)
        #: The limit where no TimeLimit is around, and whether it was asked for.
        self._own_limit = self.batch.max_episode_steps
        self._limited = max_episode_steps not in (None, UNLIMITED)
        self._time_limits: list[TimeLimit[Any, Any]] = []

    @property
    def batch(self) -> _core.Batch:
        """The core's walker."""
        return self.walkers.batch

    @property
    def spec(self) -> EnvSpec | None:
        """What `gymnasium.make` made this of, with `max_episode_steps` as it is."""
        return super().spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        limit = limit_of_make()
        if limit is not None:
            set_limit(self.batch, limit)
            self._own_limit, self._limited = self.batch.max_episode_steps, limit != UNLIMITED
        if spec is not None and limit == UNLIMITED:  # which a specification cannot say
            spec.kwargs["max_episode_steps"] = UNLIMITED
        self._spec = spec

    @property
    def observation_groups(self) -> dict[str, NDArray[np.intp]]:
        """Indices of each group of channels in an observation, over all frames."""
        return observation_groups(self.config)

    @property
    def difficulty(self) -> float:
        """Share of disturbances and randomisation, in [0, 1], that episodes have from their next start on.

        Set on a wrapper (as stable-baselines3's `set_attr` does), it moves here at the next reset.
        """
        return self.walkers.difficulty

    @difficulty.setter
    def difficulty(self, difficulty: float) -> None:
        self.walkers.difficulty = difficulty

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
        if self._rendering is not None:
            self._rendering.reset()
        return observation

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start an episode: the first of `seed`, or the next one. There are no options.

        Without any seed so far, it is the first of `np_random_seed`, which replays it.

        Raises:
            ValueError: a seed that is not an integer, or negative.

        """
        if options:
            raise ValueError(f"unknown reset option {next(iter(options))!r}; there are none")
        if seed is not None:
            seed = check_seed(seed)
        self.walkers.check_open()
        super().reset(seed=seed)
        if seed is None and not self.walkers.was_reset[0]:
            seed = first_seed(self)
        self._heed(wrappers_of_reset(self))
        seeds = None if seed is None else np.array([core_seed(seed)], dtype=np.uint64)
        observation = self.walkers.reset(seeds)[0]
        if self._rendering is not None:
            self._rendering.reset()
        return observation, {}

    def _heed(self, wrappers: list[gymnasium.Wrapper[Any, Any, Any, Any]]) -> None:
        """Take over what the wrappers around say: limits of time, and a difficulty meant for this environment."""
        for wrapper in wrappers:
            own = vars(wrapper)
            if "difficulty" in own:
                self.difficulty = own["difficulty"]
                del own["difficulty"]  # which would hide this environment's
        self._time_limits = [wrapper for wrapper in wrappers if isinstance(wrapper, TimeLimit)]
        limits = [limit._max_episode_steps for limit in self._time_limits]
        if self._own_limit is not None and (self._limited or not limits):
            limits.append(self._own_limit)
        self.batch.max_episode_steps = min(limits, default=None)

    def step(self, action: NDArray[np.floating[Any]]) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Advance by one action of `action.hold` control periods: (1,) float32 or float64, (3,) in mode "impedance".

        Numbers beyond [-1, 1] are limited, infinite ones too.

        Raises:
            ValueError: wrong shape or dtype, NaN, or the episode has ended.

        """
        step = self.walkers.step(check_actions(action, self.action_space.shape or ()))
        if self._rendering is not None:
            self._rendering.step()
        info: dict[str, Any] = dict(zip(self.walkers.terms.keys, step.terms[0], strict=True))
        reason = np.int64(step.reasons[0])
        # A walker put in place has another age than the TimeLimits around count.
        if not reason and any(_is_over(limit) for limit in self._time_limits):
            reason = np.int64(TerminationReason.TIME_LIMIT)
        info["termination_reason"] = reason
        return step.observations[0], float(step.rewards[0]), bool(step.terminated[0]), bool(step.truncated[0]), info

    def render(self) -> Frame | None:
        """Return a picture (height, width, 3) uint8 in mode "rgb_array"; draw into the window in mode "human".

        Raises:
            ValueError: before the first reset, or after `close`.
            ModuleNotFoundError: the extra `render` is not installed.

        """
        self.walkers.check_open()
        if self._rendering is None:
            gymnasium.logger.warn("render() without a render_mode draws nothing; choose one when making the env")
            return None
        if self.render_mode == "human":
            self._rendering.show()
            return None
        return self._rendering.frames()[0]

    def close(self) -> None:
        """Close the window, if there is one; whatever is asked of the environment afterwards is an error."""
        self.walkers.close()
        if self._rendering is not None:
            self._rendering.close()


def _is_over(limit: TimeLimit[Any, Any]) -> bool:
    """Whether a TimeLimit truncates the step that is under way."""
    elapsed = limit._elapsed_steps
    return elapsed is not None and elapsed + 1 >= limit._max_episode_steps
