"""Contracts over every environment, scenario and autoreset mode: what an agent may rely on wherever it is trained."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from comparing import assert_same_steps, play, random_actions
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

from prosthesis_gym import SCENARIOS, ProsthesisVectorEnv, TerminationReason

WALKERS, STEPS, EPISODE = 8, 300, 120
#: An env step is 20 ms. Gymnasium's TimeLimit is not used: it truncates what falls in the last step too.
CONFIG: dict[str, Any] = {"action": {"hold": 4}, "scenario": {"duration_s": 0.02 * EPISODE}}


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_gymnasium_check_env_passes(env_id: str, scenario: str) -> None:
    check_env(gymnasium.make(env_id, scenario=scenario).unwrapped, skip_render_check=True)


def walkers(env_id: str, scenario: str, mode: AutoresetMode, count: int) -> VectorEnv[Any, Any, Any]:
    return gymnasium.make_vec(env_id, count, scenario=scenario, config=CONFIG, autoreset_mode=mode)


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_random_walkers_stay_in_their_spaces_and_repeat_by_seed(
    env_id: str, scenario: str, mode: AutoresetMode
) -> None:
    envs = walkers(env_id, scenario, mode, WALKERS)

    def played(seed: int) -> list[Any]:
        rng = np.random.default_rng(seed)
        return play(envs, STEPS, seed=seed, act=lambda: random_actions(rng, WALKERS))

    first = played(3)
    ages, ends = np.zeros(WALKERS, dtype=int), 0
    resetting = np.zeros(WALKERS, dtype=bool)
    for step in first[1:]:
        assert envs.observation_space.contains(step[0])
        if len(step) == 3:  # a reset by mask
            ages[step[2]] = 0
            continue
        _, rewards, terminated, truncated, infos = step
        assert np.isfinite(rewards).all()
        assert not (terminated & truncated).any()
        assert not (resetting & (terminated | truncated)).any()
        ages = np.where(resetting, 0, ages + 1)
        assert (ages <= EPISODE).all()
        np.testing.assert_array_equal(truncated, (ages == EPISODE) & ~terminated)
        ended = terminated | truncated
        told = infos.get("final_info", infos)["termination_reason"] != TerminationReason.NONE
        np.testing.assert_array_equal(told, ended)
        ends += int(ended.sum())
        if mode == AutoresetMode.NEXT_STEP:
            resetting = ended
        elif mode == AutoresetMode.SAME_STEP:
            ages[ended] = 0
    assert ends >= 2 * WALKERS
    assert_same_steps(first, played(3))


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_batch_is_its_single_environments(env_id: str, scenario: str, mode: AutoresetMode) -> None:
    """Two walkers of a batch that is stepped in lanes, and two single environments with their seeds."""
    count, steps = 16, 150
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (steps, count, 1)).astype(np.float32)
    batch = walkers(env_id, scenario, mode, count)
    assert isinstance(batch, ProsthesisVectorEnv)
    chosen = [4, 11]
    makers = [lambda: gymnasium.make(env_id, scenario=scenario, config=CONFIG)] * 2
    singles = SyncVectorEnv(makers, autoreset_mode=mode)
    ours: Any = batch.reset(seed=10)[0]
    theirs, _ = singles.reset(seed=[10 + index for index in chosen])
    np.testing.assert_array_equal(ours[chosen], theirs)
    ends = 0
    for action in actions:
        mine: Any = batch.step(action)
        reference = singles.step(action[chosen])
        for part in range(4):
            np.testing.assert_array_equal(mine[part][chosen], reference[part])
        ended = mine[2] | mine[3]
        ends += int(ended[chosen].sum())
        if mode == AutoresetMode.DISABLED and ended.any():
            ours = batch.reset(options={"reset_mask": ended})[0]
            if ended[chosen].any():
                theirs, _ = singles.reset(options={"reset_mask": ended[chosen]})
                np.testing.assert_array_equal(ours[chosen], theirs)
    assert ends >= 2
