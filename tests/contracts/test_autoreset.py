"""The three autoreset modes are those of Gymnasium: compared with its `SyncVectorEnv` over single environments.

After Gymnasium's own tests/vector/test_autoreset_mode.py and test_vector_env_info.py.
"""

from typing import Any

import gymnasium
import numpy as np
import pytest
from comparing import assert_same_steps, play, random_actions
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

from prosthesis_gym import TerminationReason

MODES = list(AutoresetMode)
WALKERS, STEPS = 4, 700
# Some pushes bring the walker down within the 3 s; in the other episodes, time runs out.
CONFIG: dict[str, Any] = {
    "scenario": {"duration_s": 3.0, "push_n": 400.0, "push_s": [0.5, 2.0]},
    "action": {"hold": 4},
}


def native(env_id: str, mode: AutoresetMode) -> VectorEnv[Any, Any, Any]:
    return gymnasium.make_vec(env_id, WALKERS, config=CONFIG, autoreset_mode=mode)


def peer(env_id: str, mode: AutoresetMode) -> VectorEnv[Any, Any, Any]:
    return SyncVectorEnv([lambda: gymnasium.make(env_id, config=CONFIG)] * WALKERS, autoreset_mode=mode)


@pytest.mark.parametrize("mode", MODES)
def test_every_step_and_info_is_that_of_sync_vector_env(env_id: str, mode: AutoresetMode) -> None:
    def played(envs: VectorEnv[Any, Any, Any]) -> list[Any]:
        rng = np.random.default_rng(5)
        return play(envs, STEPS, seed=11, act=lambda: random_actions(rng, WALKERS))

    ours, theirs = played(native(env_id, mode)), played(peer(env_id, mode))
    assert_same_steps(ours, theirs)
    steps = [step for step in ours if len(step) == 5]
    terminations, truncations = (sum(int(step[part].sum()) for step in steps) for part in (2, 3))
    assert min(terminations, truncations) >= 1
    assert terminations + truncations > WALKERS
    # Episodes ended one by one, not only all together: masks had something to tell.
    assert any(0 < (step[2] | step[3]).sum() < WALKERS for step in steps)


@pytest.mark.parametrize("mode", MODES)
def test_metadata_tell_the_mode(env_id: str, mode: AutoresetMode) -> None:
    assert native(env_id, mode).metadata["autoreset_mode"] is mode
    assert gymnasium.make_vec(env_id, 2, autoreset_mode=mode.value).metadata["autoreset_mode"] is mode


def test_next_step_is_the_default(env_id: str) -> None:
    assert gymnasium.make_vec(env_id, 2).metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP


def test_next_step_ignores_the_action_of_the_step_that_resets(env_id: str) -> None:
    outcomes = []
    for last_action in (-1.0, 1.0):
        envs = gymnasium.make_vec(env_id, 2, max_episode_steps=20)
        envs.reset(seed=3)
        for _ in range(20):
            truncated = envs.step(np.zeros((2, 1), dtype=np.float32))[3]
        assert truncated.all()
        observations, rewards, terminated, truncated, infos = envs.step(np.full((2, 1), last_action))
        assert not (terminated | truncated | infos["_reward_alive"]).any()
        assert (rewards == 0.0).all()
        outcomes.append(observations)
    np.testing.assert_array_equal(*outcomes)


def test_same_step_keeps_the_last_observation_of_the_old_episode_and_gives_the_first_of_the_new(env_id: str) -> None:
    envs = gymnasium.make_vec(env_id, 2, autoreset_mode=AutoresetMode.SAME_STEP, max_episode_steps=20)
    twin = gymnasium.make_vec(env_id, 2, autoreset_mode=AutoresetMode.DISABLED, max_episode_steps=20)
    for one in (envs, twin):
        one.reset(seed=3)
    for _ in range(20):
        actions = np.full((2, 1), 0.3, dtype=np.float32)
        observations, *_, infos = envs.step(actions)
        last = twin.step(actions)[0]
    np.testing.assert_array_equal(infos["final_obs"], last)
    np.testing.assert_array_equal(observations, twin.reset()[0])
    assert infos["final_info"]["termination_reason"].tolist() == [TerminationReason.TIME_LIMIT] * 2


def test_disabled_wants_a_reset_of_what_has_ended_and_of_nothing_else(env_id: str) -> None:
    config = {"scenario": {"duration_s": 20.0}}
    envs = gymnasium.make_vec(env_id, num_envs=6, autoreset_mode=AutoresetMode.DISABLED, config=config)
    rng = np.random.default_rng(2)
    observations, _ = envs.reset(seed=3)
    ended = np.zeros(6, dtype=bool)
    while not ended.any():
        observations, _, terminated, truncated, _ = envs.step(random_actions(rng, 6))
        ended = terminated | truncated
    with pytest.raises(ValueError, match="has ended"):
        envs.step(random_actions(rng, 6))
    after, _ = envs.reset(options={"reset_mask": ended})
    np.testing.assert_array_equal(after[~ended], observations[~ended])
    assert (after[ended] != observations[ended]).any(axis=1).all()
    envs.step(random_actions(rng, 6))


def test_what_a_step_handed_out_may_be_changed_without_consequence(env_id: str) -> None:
    spoilt, kept = (native(env_id, AutoresetMode.SAME_STEP) for _ in range(2))
    for envs in (spoilt, kept):
        envs.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(300):
        actions = random_actions(rng, WALKERS)
        ours, theirs = spoilt.step(actions), kept.step(actions)
        assert_same_steps([ours], [theirs])
        observations, rewards, terminated, truncated, infos = ours
        for array in (observations, rewards, terminated, truncated, infos["_reward_alive"]):
            array[...] = 1
        for key, array in infos.items():
            if key.startswith("reward_") or key == "termination_reason":
                array[...] = 1
