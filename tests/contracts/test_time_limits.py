"""Episodes have one length, however it is set and whoever makes the environment, and say that time ended them."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import VectorEnv
from gymnasium.wrappers import RecordEpisodeStatistics, TimeLimit
from stable_baselines3.common.vec_env import DummyVecEnv

from prosthesis_gym import ProsthesisEnv, ProsthesisVectorEnv, TerminationReason
from prosthesis_gym.config import merge
from prosthesis_gym.sb3 import ProsthesisVecEnv

ENV_ID = "prosthesis_gym/DamperKnee-v0"
#: A walker who never falls: 12 s are 240 env steps.
WALK: dict[str, Any] = {
    "action": {"mode": "state_machine", "hold": 10},
    "scenario": {"push_n": 0.0, "start": "cyclic", "speed_m_s": 1.1, "speed_change_s": 100},
}
Env = gymnasium.Env[Any, Any]


def length(env: Env, most: int) -> int | None:
    """Return how many steps an episode has; None if more than `most`."""
    env.reset(seed=1)
    for step in range(1, most + 1):
        *_, terminated, truncated, info = env.step(np.zeros(1, dtype=np.float32))
        assert not terminated
        assert info["termination_reason"] == (TerminationReason.TIME_LIMIT if truncated else TerminationReason.NONE)
        if truncated:
            return step
    return None


def batch_length(envs: VectorEnv[Any, Any, Any], most: int) -> int | None:
    envs.reset(seed=1)
    try:
        for step in range(1, most + 1):
            _, _, terminated, truncated, infos = envs.step(np.zeros((2, 1), dtype=np.float32))
            assert not terminated.any()
            assert truncated.all() or not truncated.any()
            assert (infos["termination_reason"] == TerminationReason.TIME_LIMIT * truncated).all()
            if truncated.all():
                return step
        return None
    finally:
        envs.close()


def sb3_length(env: Any, most: int) -> int | None:  # noqa: ANN401 - any VecEnv
    env.seed(1)
    env.reset()
    for step in range(1, most + 1):
        _, _, dones, infos = env.step(np.zeros((2, 1), dtype=np.float32))
        if dones.all():
            assert all(info["TimeLimit.truncated"] for info in infos)
            assert all(info["termination_reason"] == TerminationReason.TIME_LIMIT for info in infos)
            return step
    return None


def sb3_of(**arguments: Any) -> DummyVecEnv:  # noqa: ANN401
    return DummyVecEnv([lambda: gymnasium.make(ENV_ID, **arguments)] * 2)


MODES: dict[str, Callable[..., int | None]] = {
    "made": lambda most, **arguments: length(gymnasium.make(ENV_ID, **arguments), most),
    "native": lambda most, **arguments: batch_length(gymnasium.make_vec(ENV_ID, 2, **arguments), most),
    "sync": lambda most, **arguments: batch_length(
        gymnasium.make_vec(ENV_ID, 2, vectorization_mode="sync", **arguments), most
    ),
    "async": lambda most, **arguments: batch_length(
        gymnasium.make_vec(ENV_ID, 2, vectorization_mode="async", **arguments), most
    ),
    "single": lambda most, **arguments: length(ProsthesisEnv(**arguments), most),
    "vector": lambda most, **arguments: batch_length(ProsthesisVectorEnv(2, **arguments), most),
    "sb3": lambda most, **arguments: sb3_length(ProsthesisVecEnv(2, **arguments), most),
    "sb3 of single ones": lambda most, **arguments: sb3_length(sb3_of(**arguments), most),
}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    ("limit", "duration_s", "expected"),
    [
        (None, 12.0, 240),
        (None, 3.02, 61),
        (None, 20.0, 400),
        (30, 12.0, 30),
        (300, 12.0, 300),
        (100, 3.0, 100),
        (-1, 3.0, None),
    ],
)
def test_episodes_are_as_long_in_every_mode(
    mode: str, limit: int | None, duration_s: float, expected: int | None
) -> None:
    config = merge(WALK, {"scenario": {"duration_s": duration_s}})
    arguments: dict[str, Any] = {} if limit is None else {"max_episode_steps": limit}
    assert MODES[mode](450, config=config, **arguments) == expected


@pytest.mark.parametrize("limit", [30, 300])
@pytest.mark.parametrize("between", [False, True])
def test_a_time_limit_of_ones_own_replaces_the_duration(limit: int, between: bool) -> None:
    for inner in (ProsthesisEnv(WALK), gymnasium.make(ENV_ID, config=WALK)):
        env: Env = TimeLimit(RecordEpisodeStatistics(inner) if between else inner, limit)
        assert length(env, 450) == limit
        assert length(env, 450) == limit
        # Without the wrappers there is no such limit.
        assert length(env.unwrapped, 450) == 240


def test_the_lowest_of_several_limits_counts() -> None:
    assert length(TimeLimit(gymnasium.make(ENV_ID, config=WALK, max_episode_steps=40), 300), 450) == 40
    assert length(TimeLimit(gymnasium.make(ENV_ID, config=WALK, max_episode_steps=300), 40), 450) == 40
    assert length(TimeLimit(ProsthesisEnv(WALK, max_episode_steps=40), 300), 450) == 40


def test_a_walker_of_another_age_still_says_that_a_time_limit_ended_it() -> None:
    env = gymnasium.make(ENV_ID, config=WALK, max_episode_steps=50)
    env.reset(seed=0)
    walker = env.unwrapped
    assert isinstance(walker, ProsthesisEnv)
    young = walker.get_state()
    for _ in range(20):
        env.step(np.zeros(1, dtype=np.float32))
    walker.set_state(young)
    for step in range(21, 51):
        *_, truncated, info = env.step(np.zeros(1, dtype=np.float32))
        assert truncated == (step == 50)
        assert info["termination_reason"] == (TerminationReason.TIME_LIMIT if truncated else TerminationReason.NONE)


@pytest.mark.parametrize(("limit", "told"), [(None, 240), (70, 70), (300, 300), (-1, None)])
def test_the_limit_is_told_where_wrappers_look_and_made_again_from_there(limit: int | None, told: int | None) -> None:
    arguments: dict[str, Any] = {} if limit is None else {"max_episode_steps": limit}
    env, envs = (make(ENV_ID, config=WALK, **arguments) for make in (gymnasium.make, gymnasium.make_vec))
    made: list[Any] = [env, env.unwrapped, envs]
    for one in made:
        assert one.spec.max_episode_steps == told
    assert [one.unwrapped.max_episode_steps for one in made] == [told] * 3
    assert env.spec is not None
    again = gymnasium.make(gymnasium.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert length(again, 450) == told
    assert envs.spec is not None
    assert gymnasium.make_vec(envs.spec).unwrapped.max_episode_steps == told  # type: ignore[attr-defined] # ours
    assert ProsthesisVecEnv(2, WALK, **arguments).get_attr("max_episode_steps") == [told] * 2


@pytest.mark.parametrize("limit", [0, -2, 1.5, True, "10", np.float64(3.0)])
def test_impossible_limits_are_refused(limit: Any) -> None:  # noqa: ANN401
    for make in (ProsthesisEnv, ProsthesisVectorEnv, lambda **given: ProsthesisVecEnv(2, **given)):
        with pytest.raises(ValueError, match="max_episode_steps"):
            make(max_episode_steps=limit)
    with pytest.raises(ValueError, match="max_episode_steps"):
        gymnasium.make_vec(ENV_ID, 2, max_episode_steps=limit)


def test_states_go_between_environments_of_different_limits() -> None:
    short, long = (ProsthesisVectorEnv(2, WALK, max_episode_steps=limit) for limit in (20, 100))
    observations, _ = short.reset(seed=0)
    np.testing.assert_array_equal(long.set_state(short.get_state()), observations)
    steps = [long.step(np.zeros((2, 1), dtype=np.float32))[3].all() for _ in range(100)]
    assert steps == [False] * 99 + [True]
