"""How long episodes are at most: `scenario.duration_s`, an argument in its place, or Gymnasium's TimeLimit."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

from gymnasium.envs.registration import EnvSpec

from prosthesis_gym import _core
from prosthesis_gym.arguments import check_whole

if TYPE_CHECKING:
    from prosthesis_gym.walkers import Walkers

#: `max_episode_steps` for episodes without a limit.
UNLIMITED = -1


def set_limit(batch: _core.Batch, max_episode_steps: object) -> None:
    """End the episodes of a batch after so many env steps; None leaves its limit, `UNLIMITED` takes it away.

    Raises:
        ValueError: another number, or none.

    """
    if max_episode_steps is None:
        return
    steps = check_whole(max_episode_steps, "max_episode_steps")
    if steps < 1 and steps != UNLIMITED:
        raise ValueError(f"max_episode_steps = {steps} must be at least 1, or {UNLIMITED} for no limit")
    batch.max_episode_steps = None if steps == UNLIMITED else min(steps, 2**63)


class Limited:
    """An environment whose specification says how long its episodes are at most."""

    walkers: Walkers
    _spec: EnvSpec | None = None

    @property
    def max_episode_steps(self) -> int | None:
        """Env steps of an episode at most; None without a limit."""
        return self.walkers.batch.max_episode_steps

    @property
    def spec(self) -> EnvSpec | None:
        """What `gymnasium.make` or `make_vec` made this of, with `max_episode_steps` as they are."""
        if self._spec is None:
            return None
        spec = copy.copy(self._spec)
        spec.max_episode_steps = self.max_episode_steps
        return spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = spec
