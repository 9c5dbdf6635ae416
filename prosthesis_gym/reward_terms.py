"""Reward terms of one's own: functions of what the walkers' channels say, beside the core's terms.

A term may need channels that the agent must not see. Their groups are added to the core's observation, behind the
others, and cut off before observations are handed out.
"""

import copy
import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cloudpickle
import numpy as np
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.channels import call_with_channels
from prosthesis_gym.config import Config, merge, resolve


@dataclass(frozen=True)
class RewardTerm:
    """A term of the reward, computed in Python from the newest frame of N walkers at once.

    >>> RewardTerm("upright", -0.1, lambda channels: channels["true_trunk_angle_rad"] ** 2, groups=("privileged",))

    Pickled with whatever its function needs (by cloudpickle); copies share plain functions.

    Raises:
        ValueError: no name, one that begins with an underscore, or a weight that is not finite.

    """

    #: Infos have its unweighted values as `reward_<name>`.
    name: str
    #: The reward gains weight * value in every env step.
    weight: float
    #: Takes name -> (N,) float64 of every channel of the newest frame (`prosthesis-gym parameters observation`) and
    #: returns (N,). A step that ends an episode is judged by its final observation.
    function: Callable[[Mapping[str, NDArray[np.float64]]], NDArray[Any]]
    #: Observation groups whose channels the function needs beside those that the agent sees.
    groups: Sequence[str] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name or self.name.startswith("_"):
            raise ValueError(f"name = {self.name!r} of a reward term must not be empty, nor begin with an underscore")
        if isinstance(self.groups, str):
            message = f"groups = {self.groups!r} of reward term {self.name!r} must be a list of names"
            raise ValueError(message)  # noqa: TRY004 - bad input is a ValueError throughout
        if not callable(self.function):
            message = f"function = {self.function!r} of reward term {self.name!r} must be a function of the channels"
            raise ValueError(message)  # noqa: TRY004 - bad input is a ValueError throughout
        if not isinstance(self.weight, int | float | np.number) or not np.isfinite(self.weight):
            raise ValueError(f"weight = {self.weight} of reward term {self.name!r} must be finite")

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the function by value where its name alone would not do: a lambda, or one of `__main__`."""
        try:
            function = cloudpickle.dumps(self.function)
        except Exception as error:  # whatever the objects it refers to may raise
            raise pickle.PicklingError(f"{self._uncopied}: {error}") from error
        return _unpickled, (self.name, self.weight, function, self.groups)

    def __deepcopy__(self, memo: dict[int, Any]) -> "RewardTerm":
        try:
            return replace(self, function=copy.deepcopy(self.function, memo))
        except Exception as error:  # the same
            raise TypeError(f"{self._uncopied}: {error}") from error

    @property
    def _uncopied(self) -> str:
        return (
            f"the function of reward term {self.name!r} cannot be copied (get_state and set_state carry walkers "
            f"to another environment with the same term)"
        )

    def values(self, channels: Mapping[str, NDArray[np.float64]], counted: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the term (N,) where `counted` is True, 0 elsewhere."""
        remedy = f"add groups=[{{group!r}}] to RewardTerm({self.name!r}, ...)"
        returned = call_with_channels(self.function, channels, f"reward term {self.name!r}", remedy)
        values = np.asarray(returned)
        if values.shape != counted.shape or values.dtype.kind not in "fiub":
            raise ValueError(
                f"reward term {self.name!r} gave shape {values.shape} and dtype {values.dtype}, "
                f"must be numbers of shape {counted.shape}"
            )
        values = np.where(counted, values, 0.0)
        if not np.isfinite(values).all():
            index = int(np.flatnonzero(~np.isfinite(values))[0])
            raise ValueError(f"reward term {self.name!r} gave {values[index]} for walker {index}, must be finite")
        return values


def _unpickled(name: str, weight: float, function: bytes, groups: Sequence[str]) -> RewardTerm:
    return RewardTerm(name, weight, cloudpickle.loads(function), groups)


@dataclass(frozen=True)
class Step:
    """A step of the core with the terms of `RewardTerms` and without their hidden channels; as `_core.Step`."""

    observations: NDArray[np.float32]
    rewards: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    terms: NDArray[np.float64]
    reasons: NDArray[np.uint8]
    started: NDArray[np.bool_]
    eventful: bool
    final_observations: NDArray[np.float32] | None
    episode_returns: NDArray[np.float64]
    episode_steps: NDArray[np.uint32]
    episode_terms: NDArray[np.float64]


def groups_seen(terms: Sequence[RewardTerm]) -> tuple[str, ...]:
    """Return the groups of channels that the terms ask for.

    Raises:
        ValueError: `terms` is no sequence of them.

    """
    if not isinstance(terms, Sequence) or isinstance(terms, str):
        raise ValueError(f"reward_terms = {terms!r} must be a list of RewardTerms")  # noqa: TRY004 - as all bad values
    for term in terms:
        if not isinstance(term, RewardTerm):
            raise ValueError(f"reward term {term!r} must be a RewardTerm")  # noqa: TRY004
    return tuple(dict.fromkeys(group for term in terms for group in term.groups))


def with_groups(config: Config, groups: Sequence[str]) -> Config:
    """Return `config` with these groups behind its own `observation.groups`, where they are not among them."""
    section = config.get("observation")
    given = isinstance(section, Mapping) and "groups" in section
    present = config["observation"]["groups"] if given else resolve(config)["observation"]["groups"]
    if not isinstance(present, list):
        return config  # which is refused as such
    added = [group for group in groups if group not in present]
    return merge(config, {"observation": {"groups": [*present, *added]}}) if added else config


class RewardTerms:
    """The terms of one's own of N walkers, with their sums over the present episodes.

    Args:
        config: complete configuration of the environment, without the hidden groups.
        terms: in the order of their columns, behind the core's.
        num_envs: N.

    Raises:
        ValueError: two terms of one name, or one of the core's names; an unknown group.

    """

    def __init__(self, config: Config, terms: Sequence[RewardTerm], num_envs: int) -> None:
        names = list(_core.TERMS)
        for term in terms:
            if term.name in names:
                taken = "built in" if term.name in _core.TERMS else "given twice"
                raise ValueError(f"reward term {term.name!r} is {taken}; names must differ")
            names.append(term.name)
        self.terms = tuple(terms)
        #: Names of all terms, in the order of their columns.
        self.names = tuple(names)
        #: The keys of infos that they stand under.
        self.keys = tuple(f"reward_{name}" for name in names)
        #: Configuration of the core's batch.
        self.core_config = with_groups(config, groups_seen(terms))
        self._channels = [channel[0] for channel in _core.channels(self.core_config)]
        self._seen = len(_core.channels(config))
        self._frames: int = config["observation"]["frames"]
        self._sums = np.zeros((num_envs, len(terms)))
        self._returns = np.zeros(num_envs)

    def visible(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the core's observations (N, D') without hidden channels, (N, D)."""
        if self._seen == len(self._channels):
            return observations
        frames = observations.reshape(len(observations), self._frames, len(self._channels))
        return np.ascontiguousarray(frames[:, :, : self._seen]).reshape(len(observations), -1)

    def reset(self, mask: NDArray[np.bool_]) -> None:
        """Begin new episodes of the walkers in `mask`."""
        self._sums[mask], self._returns[mask] = 0.0, 0.0

    def applied(self, step: _core.Step) -> "_core.Step | Step":
        """Return a step of the core with these terms and without hidden channels."""
        if not self.terms:
            return step
        started, finals = step.started, step.final_observations
        # A walker that was reset in this step judges its old episode's end, or (reset late) nothing at all.
        counted = ~started if finals is None else np.ones_like(started)
        judged = step.observations if finals is None else np.where(started[:, None], finals, step.observations)
        newest = judged[:, : len(self._channels)].T.astype(np.float64)
        newest.flags.writeable = False
        channels = dict(zip(self._channels, newest, strict=True))
        values = np.stack([term.values(channels, counted) for term in self.terms], axis=1)
        # Not a matrix product, whose rounding depends on how many walkers there are.
        gained = np.zeros(len(started))
        for term, column in zip(self.terms, values.T, strict=True):
            gained += term.weight * column
        self._sums += values
        self._returns += gained
        ended = step.terminated | step.truncated
        own = np.where(ended[:, None], self._sums, 0.0)
        applied = Step(
            observations=self.visible(step.observations),
            rewards=step.rewards + gained,
            terminated=step.terminated,
            truncated=step.truncated,
            terms=np.hstack([step.terms, values]),
            reasons=step.reasons,
            started=started,
            eventful=step.eventful,
            final_observations=None if finals is None else self.visible(finals),
            episode_returns=step.episode_returns + self._returns,
            episode_steps=step.episode_steps,
            episode_terms=np.hstack([step.episode_terms, own]),
        )
        self.reset(started)
        return applied

    def sums(self, indices: Sequence[int]) -> dict[str, Any]:
        """Return what these terms have gathered in the episodes of some walkers, as JSON has it."""
        return {
            "names": [term.name for term in self.terms],
            "sums": self._sums[indices].tolist(),
            "returns": self._returns[indices].tolist(),
        }

    def check_sums(self, saved: Mapping[str, Any]) -> None:
        """Raise a ValueError unless `saved` are sums of these terms."""
        names = [term.name for term in self.terms]
        if saved["names"] != names:
            raise ValueError(f"state has the reward terms {saved['names']}, must have {names}")

    def set_sums(self, saved: Mapping[str, Any], indices: Sequence[int]) -> None:
        """Put back what `sums` returned, for as many walkers or for one that goes to all of them."""
        self._sums[indices] = np.array(saved["sums"]).reshape(len(saved["sums"]), len(self.terms))
        self._returns[indices] = np.array(saved["returns"])
