"""`gymnasium.make` and `gymnasium.make_vec` in all their modes, and the specifications they leave behind.

After Gymnasium's own tests/envs/registration/test_make_vec.py.
"""

from typing import Any

import gymnasium
import numpy as np
import pytest
from comparing import assert_same_steps, play, random_actions
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv, VectorEnv

from prosthesis_gym import ProsthesisEnv, ProsthesisVectorEnv, _core

KINDS = {"vector_entry_point": ProsthesisVectorEnv, "sync": SyncVectorEnv, "async": AsyncVectorEnv}
CONFIG: dict[str, Any] = {"scenario": {"duration_s": 1.0}, "observation": {"frames": 3}}
WALKERS = 3


def played(envs: VectorEnv[Any, Any, Any], steps: int = 450) -> list[Any]:
    rng = np.random.default_rng(1)
    try:
        return play(envs, steps, seed=21, act=lambda: random_actions(rng, WALKERS))
    finally:
        envs.close()


def test_make_vec_gives_the_native_vector_env_by_default(env_id: str) -> None:
    envs = gymnasium.make_vec(env_id, num_envs=5, config=CONFIG)
    assert isinstance(envs, ProsthesisVectorEnv)
    observations, _ = envs.reset(seed=1)
    assert observations.dtype == np.float32
    assert observations.shape == (5, 3 * len(_core.channels(envs.config)))
    assert envs.observation_space.contains(observations)
    assert envs.action_space.shape == (5, 1)
    assert envs.num_envs == 5


@pytest.mark.parametrize("mode", KINDS)
def test_every_vectorization_mode_gives_the_same_walks(env_id: str, mode: str) -> None:
    envs = gymnasium.make_vec(env_id, WALKERS, vectorization_mode=mode, config=CONFIG)
    assert type(envs) is KINDS[mode]
    native = gymnasium.make_vec(env_id, WALKERS, config=CONFIG)
    assert envs.single_observation_space == native.single_observation_space
    assert envs.observation_space == native.observation_space
    assert envs.single_action_space == native.single_action_space
    assert envs.action_space == native.action_space
    assert envs.metadata["autoreset_mode"] is native.metadata["autoreset_mode"]
    assert_same_steps(played(native), played(envs))


@pytest.mark.parametrize("mode", KINDS)
def test_max_episode_steps_counts_env_steps(env_id: str, mode: str) -> None:
    config = {"action": {"hold": 4}, "scenario": {"push_n": 0.0, "start": "standing"}}
    # Native environments limit themselves, the single ones are limited by Gymnasium's TimeLimit.
    envs = gymnasium.make_vec(env_id, WALKERS, vectorization_mode=mode, config=config, max_episode_steps=7)
    envs.reset(seed=0)
    steps = [envs.step(np.zeros((WALKERS, 1), dtype=np.float32)) for _ in range(7)]
    envs.close()
    assert [step[3].tolist() for step in steps] == [[False] * WALKERS] * 6 + [[True] * WALKERS]
    assert not any(step[2].any() for step in steps)


def test_a_limited_env_walks_as_an_unlimited_one_until_its_end(env_id: str) -> None:
    """The limit draws no other episode, neither Gymnasium's nor ours."""
    native, limited, unlimited = (
        gymnasium.make_vec(env_id, WALKERS, max_episode_steps=60),
        gymnasium.make_vec(env_id, WALKERS, vectorization_mode="sync", max_episode_steps=60),
        gymnasium.make_vec(env_id, WALKERS),
    )
    rng = np.random.default_rng(0)
    observed = [np.stack([envs.reset(seed=4)[0] for envs in (native, limited, unlimited)])]
    for _ in range(60):
        actions = random_actions(rng, WALKERS)
        observed.append(np.stack([envs.step(actions)[0] for envs in (native, limited, unlimited)]))
    for ours, theirs, free in observed:
        np.testing.assert_array_equal(ours, theirs)
        np.testing.assert_array_equal(ours, free)


def test_the_specification_makes_the_same_environment_again(env_id: str) -> None:
    env = gymnasium.make(env_id, config=CONFIG)
    assert env.spec is not None
    again = gymnasium.make(gymnasium.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    np.testing.assert_array_equal(env.reset(seed=3)[0], again.reset(seed=3)[0])
    assert again.unwrapped.config == env.unwrapped.config  # type: ignore[attr-defined] # ours

    envs = gymnasium.make_vec(env_id, WALKERS, config=CONFIG)
    assert envs.spec is not None
    assert_same_steps(played(envs, 50), played(gymnasium.make_vec(envs.spec), 50))


def test_the_pieces_of_an_environment_are_within_reach(env_id: str) -> None:
    env = gymnasium.make(env_id)
    assert isinstance(env.unwrapped, ProsthesisEnv)
    assert env.get_wrapper_attr("config") is env.unwrapped.config
    assert env.spec is not None
    assert env.spec.id == env_id
    env.reset(seed=8)
    assert env.unwrapped.np_random_seed == 8
    env.close()
    env.close()

    envs = gymnasium.make_vec(env_id, WALKERS)
    envs.reset(seed=8)
    assert envs.unwrapped is envs
    assert envs.np_random_seed == 8
    assert repr(envs) == f"ProsthesisVectorEnv({env_id}, num_envs={WALKERS})"
    envs.close()
    assert envs.closed
    envs.close()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"num_envs": 0}, "num_envs = 0"),
        ({"num_envs": 2, "max_episode_steps": 0}, "max_episode_steps = 0"),
        ({"num_envs": 2, "config": {"scenario": {"duration_s": -1.0}}}, "scenario.duration_s = -1"),
        ({"num_envs": 2, "config": {"scenario": {"height": 1.0}}}, "scenario.height"),
        ({"num_envs": 2, "threads": 2000}, "threads = 2000"),
        ({"num_envs": 2, "autoreset_mode": "sometimes"}, "sometimes"),
    ],
)
def test_impossible_arguments_are_named(env_id: str, arguments: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        gymnasium.make_vec(env_id, **arguments)
