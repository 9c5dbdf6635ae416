"""Gymnasium's vector wrappers do around the native vector environment what they promise."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from comparing import random_actions
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.wrappers import vector as wrappers
from numpy.typing import NDArray

from prosthesis_gym.config import merge

MODES = list(AutoresetMode)
WALKERS, STEPS = 32, 400
CONFIG: dict[str, Any] = {"action": {"hold": 4}, "scenario": {"duration_s": 3.0, "push_n": 400.0, "push_s": [0.5, 2.0]}}
GYMNASIUM = tuple(int(part) for part in gymnasium.__version__.split(".")[:2])
Envs = VectorEnv[Any, Any, Any]


def walkers(env_id: str, mode: AutoresetMode = AutoresetMode.NEXT_STEP, **scenario: float) -> Envs:
    config = merge(CONFIG, {"scenario": scenario})
    return gymnasium.make_vec(env_id, WALKERS, config=config, autoreset_mode=mode)


def play(envs: Envs, steps: int = STEPS, seed: int = 0) -> list[tuple[Any, ...]]:
    rng = np.random.default_rng(seed)
    envs.reset(seed=seed)
    return [envs.step(random_actions(rng, WALKERS)) for _ in range(steps)]


def stack(played: list[tuple[Any, ...]], part: int) -> NDArray[Any]:
    return np.array([step[part] for step in played])


@pytest.mark.parametrize("mode", MODES)
def test_episode_returns_and_lengths_are_sums_over_the_steps(env_id: str, mode: AutoresetMode) -> None:
    if mode == AutoresetMode.SAME_STEP and GYMNASIUM < (1, 4):
        pytest.skip(
            "RecordEpisodeStatistics of Gymnasium before 1.4 leaves out the first step after an end in the same step"
        )
    envs = wrappers.RecordEpisodeStatistics(walkers(env_id, mode), buffer_length=10_000)
    rng = np.random.default_rng(0)
    envs.reset(seed=0)
    returns, lengths, counted = np.zeros(WALKERS), np.zeros(WALKERS, dtype=int), 0
    resetting = np.zeros(WALKERS, dtype=bool)
    for _ in range(STEPS):
        _, rewards, terminated, truncated, infos = envs.step(random_actions(rng, WALKERS))
        returns += rewards
        lengths += ~resetting
        ended = terminated | truncated
        assert ("episode" in infos) == ended.any()
        if ended.any():
            np.testing.assert_array_equal(infos["_episode"], ended)
            np.testing.assert_allclose(infos["episode"]["r"][ended], returns[ended], atol=1e-9)
            np.testing.assert_array_equal(infos["episode"]["l"][ended], lengths[ended])
            counted += int(ended.sum())
        returns[ended], lengths[ended] = 0.0, 0
        if mode == AutoresetMode.NEXT_STEP:
            resetting = ended
        elif mode == AutoresetMode.DISABLED and ended.any():
            envs.reset(options={"reset_mask": ended})
    assert counted == envs.episode_count == len(envs.return_queue) > WALKERS


def test_normalize_observation_gives_mean_0_and_variance_1(env_id: str) -> None:
    envs = wrappers.NormalizeObservation(walkers(env_id))
    play(envs)
    envs.update_running_mean = False
    raw = stack(play(walkers(env_id)), 0)
    seen = stack(play(envs), 0)
    moving = raw.std(axis=(0, 1)) > 1e-3
    assert moving.sum() >= 6
    np.testing.assert_allclose(seen.mean(axis=(0, 1))[moving], 0.0, atol=0.05)
    np.testing.assert_allclose(seen.std(axis=(0, 1))[moving], 1.0, atol=0.05)


@pytest.mark.parametrize("mode", MODES)
def test_normalize_reward_divides_by_the_spread_of_discounted_returns(env_id: str, mode: AutoresetMode) -> None:
    """Before any episode ends: what counts at its end differs between versions of Gymnasium."""
    steps = 40
    scaled = play(wrappers.NormalizeReward(walkers(env_id, mode, push_n=0.0), gamma=0.9), steps)
    plain = play(walkers(env_id, mode, push_n=0.0), steps)
    assert not any((step[2] | step[3]).any() for step in plain)
    returns = np.zeros((steps, WALKERS))
    for step in range(steps):
        returns[step] = 0.9 * returns[max(step - 1, 0)] + plain[step][1]
    np.testing.assert_allclose(scaled[-1][1], plain[-1][1] / returns.std(), rtol=1e-3)


def test_transformations_are_functions_of_the_plain_steps(env_id: str) -> None:
    low, high = np.full(1, -2.0, dtype=np.float32), np.full(1, 2.0, dtype=np.float32)
    space = gymnasium.spaces.Box(-np.inf, np.inf, walkers(env_id).single_observation_space.shape, np.float32)
    changed: Envs = wrappers.TransformObservation(
        walkers(env_id), lambda rows: 2.0 * rows, single_observation_space=space
    )
    changed = wrappers.ClipReward(wrappers.TransformReward(changed, lambda rewards: rewards + 1.0), 0.5, 1.01)
    changed = wrappers.RescaleAction(changed, low, high)
    plain = walkers(env_id)
    changed.reset(seed=3)
    plain.reset(seed=3)
    rng = np.random.default_rng(0)
    for _ in range(100):
        actions = random_actions(rng, WALKERS)
        ours, theirs = changed.step(2.0 * actions), plain.step(actions)
        np.testing.assert_array_equal(ours[0], 2.0 * theirs[0])
        np.testing.assert_array_equal(ours[1], np.clip(theirs[1] + 1.0, 0.5, 1.01))
        np.testing.assert_array_equal(ours[2], theirs[2])


def test_clip_action_takes_any_action_and_acts_its_edge(env_id: str) -> None:
    clipped, plain = wrappers.ClipAction(walkers(env_id)), walkers(env_id)
    clipped.reset(seed=1)
    plain.reset(seed=1)
    rng = np.random.default_rng(0)
    for _ in range(50):
        actions = rng.uniform(-3.0, 3.0, (WALKERS, 1)).astype(np.float32)
        np.testing.assert_array_equal(clipped.step(actions)[0], plain.step(np.clip(actions, -1.0, 1.0))[0])


@pytest.mark.parametrize("mode", MODES[:2])
def test_infos_as_a_list_are_those_of_single_environments(env_id: str, mode: AutoresetMode) -> None:
    listed = wrappers.DictInfoToList(walkers(env_id, mode))
    makers = [lambda: gymnasium.make(env_id, config=CONFIG)] * WALKERS
    peers = wrappers.DictInfoToList(gymnasium.vector.SyncVectorEnv(makers, autoreset_mode=mode))
    finals = 0
    for ours, theirs in zip(play(listed, 200), play(peers, 200), strict=True):
        for mine, expected in zip(ours[4], theirs[4], strict=True):
            assert {key: value for key, value in mine.items() if key != "final_obs"} == {
                key: value for key, value in expected.items() if key != "final_obs"
            }
            finals += mine.get("termination_reason", 0) != 0 or "final_info" in mine
    assert finals > WALKERS // 2


def test_torch_tensors_go_in_and_out(env_id: str) -> None:
    torch = pytest.importorskip("torch")
    envs = wrappers.NumpyToTorch(walkers(env_id))
    plain = walkers(env_id)
    first, _ = envs.reset(seed=0)
    np.testing.assert_array_equal(first.numpy(), plain.reset(seed=0)[0])
    actions = torch.linspace(-1.0, 1.0, WALKERS)[:, None]
    observations, rewards, terminated, truncated, _ = envs.step(actions)
    theirs = plain.step(actions.numpy())
    for tensor, array in zip((observations, rewards, terminated, truncated), theirs, strict=False):
        assert isinstance(tensor, torch.Tensor)
        np.testing.assert_array_equal(tensor.numpy(), array)
