"""What single and vector environments share: the core's batch, reward terms of one's own, and saved states."""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from gymnasium.error import ClosedEnvironmentError
from gymnasium.spaces import Box
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.arguments import check_whole, whole_number
from prosthesis_gym.config import Config, merge, read_config, resolve
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.layers import Layer, laid_over
from prosthesis_gym.reward_terms import RewardTerm, RewardTerms, Step, with_groups
from prosthesis_gym.rewards import load_reward
from prosthesis_gym.scenarios import read_scenario
from prosthesis_gym.state import seal, unseal
from prosthesis_gym.time_limit import set_limit

Autoreset = Literal["next_step", "same_step", "disabled"]
Observations = NDArray[np.float32]

MOST_THREADS = 1024


class ClosedError(ClosedEnvironmentError, ValueError):
    """An environment was used after `close`."""


def environment_config(
    source: str | Path | Mapping[str, Any] | None,
    device: str | None = None,
    *,
    scenario: str | Path | None = None,
    reward: str | Path | None = None,
    seen: Sequence[str] = (),
) -> Config:
    """Return the complete configuration of an environment; what is given later in this list counts.

    Args:
        scenario: one of `prosthesis_gym.SCENARIOS`, or a file (`prosthesis_gym.scenarios.load_scenario`).
        reward: one of `prosthesis_gym.REWARDS`, or a file (`prosthesis_gym.rewards.load_reward`).
        source: TOML file, nested mapping or None for the defaults.
        device: `device.kind`, if given.
        seen: groups of channels that somebody else than the agent looks at.

    Raises:
        ValueError: impossible configuration, one of another knee unit than `device`, or a setting of `source` that has
            no effect.

    """
    given, base = read_config(source), {} if scenario is None else read_scenario(scenario)
    if device is not None:
        _check_device(merge(base, given), device)
    config = laid_over(
        [
            Layer(base, given=False),
            Layer({} if reward is None else load_reward(reward), given=False),
            Layer(given),
            Layer({} if device is None else {"device": {"kind": device}}),
        ],
        partial(with_groups, groups=seen),
    )
    return resolve(config)


def _check_device(config: Config, device: str) -> None:
    section = config.get("device")
    kind = section.get("kind", device) if isinstance(section, Mapping) else device
    if kind != device:
        other = f": make {DEVICES[kind].env_id} instead" if kind in DEVICES else ""
        raise ValueError(f"device.kind = {kind!r} of the configuration contradicts device = {device!r}{other}")


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
    """N walkers of the core, with reward terms of one's own. Copies and pickles go on bit for bit.

    Args:
        num_envs: N.
        config: complete configuration.
        reward_terms: their hidden channels are added to the core's observations, and cut off what is handed out.
        autoreset: what happens after an episode's end.
        threads: worker threads; None takes all cores.
        max_episode_steps: replaces `scenario.duration_s`, in env steps; -1 for no limit.

    Raises:
        ValueError: impossible configuration or terms.

    """

    def __init__(
        self,
        num_envs: int,
        config: Config,
        reward_terms: Sequence[RewardTerm] = (),
        autoreset: Autoreset = "next_step",
        threads: int | None = None,
        *,
        max_episode_steps: int | None = None,
    ) -> None:
        whole_number("num_envs", num_envs, 1, _core.MOST_ENVIRONMENTS)  # before terms of one's own make room for them
        if threads is not None:
            whole_number("threads", threads, 1, MOST_THREADS)
        self.terms = RewardTerms(config, reward_terms, num_envs)
        self.batch = _core.Batch(num_envs, self.terms.core_config, autoreset, threads)
        set_limit(self.batch, max_episode_steps)
        self.num_envs = num_envs
        #: (N,): which walkers have been reset, or put in place, at least once.
        self.was_reset = np.zeros(num_envs, dtype=np.bool_)
        self.closed = False
        self._autoreset: Autoreset = autoreset
        self._threads = threads
        self._normalised: tuple[float, float] | None = None
        self._none = np.zeros(num_envs, dtype=np.bool_)

    def __getstate__(self) -> dict[str, Any]:
        """Return what copies and pickles are made of: all but recordings."""
        batch, reset = self.batch, np.flatnonzero(self.was_reset).tolist()
        normaliser = None if self._normalised is None else (*batch.moments(), batch.learns)
        core = {
            "state": batch.get_state(reset) if reset else b"",
            "difficulty": batch.difficulty,
            "max_episode_steps": batch.max_episode_steps,
            "normaliser": normaliser,
        }
        return {name: value for name, value in vars(self).items() if name != "batch"} | {"core": core}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the core's walkers anew and put what was saved in place."""
        core = state.pop("core")
        vars(self).update(state)
        self.batch = _core.Batch(self.num_envs, self.terms.core_config, self._autoreset, self._threads)
        self.batch.difficulty = core["difficulty"]
        self.batch.max_episode_steps = core["max_episode_steps"]
        if self._normalised is not None:
            self.batch.normalise_observations(*self._normalised)
            self.batch.set_moments(*core["normaliser"])
        if self.was_reset.any():
            self.batch.set_state(core["state"], np.flatnonzero(self.was_reset).tolist())

    def normalise_observations(self, clip: float, epsilon: float) -> None:
        """Return observations less their running mean, over their running deviation, within +-clip, from now on.

        Raises:
            ValueError: reward terms of one's own, which need observations as they are.

        """
        if self.terms.terms:
            raise ValueError("the core cannot normalise observations that reward terms of one's own look at")
        if self.normalised:
            raise ValueError("the core normalises these observations already")
        self.batch.normalise_observations(clip, epsilon)
        self._normalised = (clip, epsilon)

    @property
    def normalised(self) -> bool:
        """Whether the core normalises observations."""
        return self._normalised is not None

    def reset(
        self,
        seeds: NDArray[np.uint64] | None = None,
        mask: NDArray[np.bool_] | None = None,
        seeded: NDArray[np.bool_] | None = None,
    ) -> Observations:
        """Begin episodes of the walkers in `mask`, all by default, and return the observations (N, D) of all.

        Those in `seeded`, all by default, begin the first episode of their entry of `seeds` (N,), the others, and all
        without `seeds`, their next episode.
        """
        self.check_open()
        mask = ~self._none if mask is None else mask
        if seeds is not None and seeded is not None and not seeded[mask].all():
            self.batch.reset(None, mask & ~seeded)
            observations = self.batch.reset(seeds, mask & seeded)
        else:
            observations = self.batch.reset(seeds, mask)
        self.was_reset |= mask
        self.terms.reset(mask)
        return self.terms.visible(observations)

    def observations(self, new: NDArray[np.bool_] | None = None) -> Observations:
        """Return the newest observations (N, D); statistics learn from those in the mask `new`, by default none."""
        return self.terms.visible(self.batch.observations(new))

    def step(self, actions: NDArray[np.float64]) -> _core.Step | Step:
        """Advance all walkers by one action each, flat (N * action size,) float64."""
        self.check_open()
        return self.terms.applied(self.batch.step(actions))

    def get_state(self, indices: Sequence[int] | None = None) -> bytes:
        """Return the state of the walkers at `indices`, of all by default."""
        self.check_open()
        selected = self.selected(indices)
        return seal(self.batch.get_state(selected), self.terms.sums(selected))

    def set_state(self, state: bytes, indices: Sequence[int] | None = None) -> Observations:
        """Put saved walkers at `indices`, at all by default, and return the observations (N, D) of all."""
        self.check_open()
        selected = self.selected(indices)
        core, sums = unseal(state)
        self.terms.check_sums(sums)
        restarted = self._none.copy()
        restarted[selected] = self.batch.set_state(core, selected)
        self.was_reset[selected] = True
        self.terms.set_sums(sums, selected)
        self.terms.reset(restarted)
        return self.observations(restarted)

    @property
    def difficulty(self) -> float:
        """Share of disturbances and randomisation, in [0, 1], of episodes to come."""
        return self.batch.difficulty

    @difficulty.setter
    def difficulty(self, difficulty: float) -> None:
        self.check_open()
        if isinstance(difficulty, bool | np.bool_) or not isinstance(difficulty, int | float | np.number):
            raise ValueError(f"difficulty = {difficulty!r} must be a number in [0, 1]")  # noqa: TRY004
        self.batch.difficulty = float(difficulty)

    def close(self) -> None:
        """Refuse everything from now on."""
        self.closed = True

    def check_open(self) -> None:
        """Raise a ClosedError after `close`."""
        if self.closed:
            raise ClosedError("the environment is closed: make a new one")

    def selected(self, indices: Sequence[int] | None) -> list[int]:
        """Return the indices, of all walkers by default.

        Raises:
            ValueError: none, or one outside [0, N - 1].

        """
        if indices is None:
            return list(range(self.num_envs))
        if not isinstance(indices, Iterable):
            raise ValueError(f"indices = {indices!r} must be a list of integers")  # noqa: TRY004 - as all bad values
        selected = [check_whole(index, "index") for index in indices]
        if not selected:
            raise ValueError("indices = [] must name at least one walker")
        for index in selected:
            if not 0 <= index < self.num_envs:
                raise ValueError(f"index = {index} is outside its allowed range [0, {self.num_envs - 1}]")
        return selected
