"""What Gymnasium asks of an environment about the length of its episodes."""

from __future__ import annotations

import copy

from gymnasium.envs.registration import EnvSpec

from prosthesis_gym.walkers import Walkers


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
