"""Stable-Baselines3's VecNormalize over `ProsthesisVecEnv`, with the observations' part done in the native core."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecEnv, VecNormalize
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn, VecEnvWrapper

from prosthesis_gym.vector_env import ProsthesisVectorEnv
from prosthesis_gym.walkers import Walkers

OBSERVATION_EPSILON = 1e-8
"""Added to the variance that normalised observations are divided by the root of."""

#: What the core is told once.
_FIXED = frozenset({"norm_obs", "norm_obs_keys", "clip_obs", "epsilon"})


class ObservationMoments(NamedTuple):
    """Statistics of D-dimensional observations."""

    #: How many observations.
    number: float
    #: (D,) float64.
    mean: NDArray[np.float64]
    #: (D,) float64.
    variance: NDArray[np.float64]


class _CoreStatistics(RunningMeanStd):
    """The core's statistics, as Stable-Baselines3 reads and writes them; copies are plain RunningMeanStd."""

    def __init__(self, walkers: Walkers) -> None:
        self._walkers = walkers

    def _set(self, **changes: Any) -> None:  # noqa: ANN401 - numbers and arrays
        batch = self._walkers.batch
        moments = ObservationMoments(*batch.moments())._replace(**changes)
        batch.set_moments(float(moments.number), np.array(moments.mean), np.array(moments.variance), batch.learns)

    @property
    def count(self) -> float:
        return self._walkers.batch.moments()[0]

    @count.setter
    def count(self, count: float) -> None:
        self._set(number=count)

    @property
    def mean(self) -> NDArray[np.float64]:
        return _fixed(self._walkers.batch.moments()[1])

    @mean.setter
    def mean(self, mean: NDArray[np.float64]) -> None:
        self._set(mean=mean)

    @property
    def var(self) -> NDArray[np.float64]:
        return _fixed(self._walkers.batch.moments()[2])

    @var.setter
    def var(self, var: NDArray[np.float64]) -> None:
        self._set(variance=var)

    def __reduce__(self) -> tuple[Any, ...]:
        number, mean, variance = self._walkers.batch.moments()
        return _plain, (number, mean, variance)


def _fixed(values: NDArray[np.float64]) -> NDArray[np.float64]:
    values.flags.writeable = False  # what is written into a copy would be lost
    return values


def _plain(count: float, mean: NDArray[np.float64], variance: NDArray[np.float64]) -> RunningMeanStd:
    statistics = RunningMeanStd(shape=mean.shape)
    statistics.count, statistics.mean, statistics.var = count, mean, variance
    return statistics


class ProsthesisVecNormalize(VecNormalize):
    """VecNormalize around a `ProsthesisVecEnv`, at a fraction of its cost: observations are normalised in the core.

    Observations (terminal ones too) come less their running mean, over their running standard deviation and within
    +-`clip_obs`; statistics (`obs_rms`) learn from what `reset` and `step` hand out, and from nothing else. Unlike
    VecNormalize they begin with no observation, not with 0.0001 of them, and the observation space has the bounds
    +-`clip_obs`. For evaluation put one around the second environment too: EvalCallback and `sync_envs_normalization`
    then copy the statistics.

    Args:
        venv: the `ProsthesisVecEnv` itself, without reward terms of one's own (which see observations as they are:
            take VecNormalize).
        training: whether statistics learn.
        norm_reward: whether rewards are divided by the running deviation of the discounted return.
        clip_obs, clip_reward: limits of what is normalised.
        gamma: discount factor of that return.

    Raises:
        ValueError: another environment, or one that is normalised already.

    """

    def __init__(
        self,
        venv: VecEnv,
        training: bool = True,
        *,
        norm_reward: bool = True,
        clip_obs: float = 10.0,
        clip_reward: float = 10.0,
        gamma: float = 0.99,
    ) -> None:
        _walkers(venv).normalise_observations(clip_obs, OBSERVATION_EPSILON)
        super().__init__(
            venv,
            training=training,
            norm_reward=norm_reward,
            clip_obs=clip_obs,
            clip_reward=clip_reward,
            gamma=gamma,
            epsilon=OBSERVATION_EPSILON,
        )
        shape = venv.observation_space.shape or ()
        self.obs_rms = _plain(0.0, np.zeros(shape), np.ones(shape))
        self.observation_space = Box(-clip_obs, clip_obs, shape, np.float32)

    def __setattr__(self, name: str, value: object) -> None:
        if name in _FIXED and vars(self).get(name, value) != value:
            raise ValueError(f"{name} is fixed when {type(self).__name__} is made")
        super().__setattr__(name, value)

    @property  # type: ignore[override] # VecNormalize's is one of each key, or this
    def obs_rms(self) -> RunningMeanStd:
        """Statistics of the observations; what is assigned to it, the core goes on with."""
        return _CoreStatistics(_walkers(self.venv))

    @obs_rms.setter
    def obs_rms(self, statistics: RunningMeanStd) -> None:
        batch = _walkers(self.venv).batch
        batch.set_moments(float(statistics.count), np.array(statistics.mean), np.array(statistics.var), batch.learns)

    @property
    def training(self) -> bool:
        """Whether statistics learn."""
        return self._training

    @training.setter
    def training(self, training: bool) -> None:
        self._training = bool(training)
        _walkers(self.venv).batch.learns = self._training

    def __getstate__(self) -> dict[str, Any]:
        """Return what VecNormalize saves: all but the environment."""
        return super().__getstate__() | {"saved_rms": _plain(*_walkers(self.venv).batch.moments())}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Wait for `set_venv`."""
        super().__setstate__(state)

    def set_venv(self, venv: VecEnv) -> None:
        """Go on around another `ProsthesisVecEnv`, with the statistics that were saved."""
        walkers = _walkers(venv)
        super().set_venv(venv)
        walkers.normalise_observations(self.clip_obs, self.epsilon)
        self.obs_rms = vars(self).pop("saved_rms")
        self.training = self._training

    def step_wait(self) -> VecEnvStepReturn:
        """Step the walkers; what they hand out is normalised, and rewards are if asked for."""
        observations, rewards, dones, infos = self.venv.step_wait()
        self.old_reward = rewards
        if self.training:
            self._update_reward(rewards)
        self.returns[dones] = 0.0
        return observations, self.normalize_reward(rewards), dones, infos

    def reset(self) -> NDArray[np.float32]:
        """Return first observations of new episodes, normalised."""
        self.returns = np.zeros(self.num_envs)
        observations = self.venv.reset()
        assert isinstance(observations, np.ndarray)
        return observations

    def get_original_obs(self) -> NDArray[np.float32]:
        """Return the newest observations as they are."""
        return _walkers(self.venv).batch.raw_observations()


def _walkers(venv: VecEnv) -> Walkers:
    envs = None if isinstance(venv, VecEnvWrapper) else getattr(venv, "envs", None)
    if isinstance(envs, ProsthesisVectorEnv):
        return envs.walkers
    raise ValueError(f"venv = {venv!r} must be a ProsthesisVecEnv; around any other, take VecNormalize")
