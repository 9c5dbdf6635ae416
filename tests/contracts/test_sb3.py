"""The adapter keeps the contract of Stable-Baselines3: compared with SB3's own vector environment, walker by walker."""

import time
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.spaces import Box
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecNormalize

from prosthesis_gym import ProsthesisEnv, TerminationReason, _core
from prosthesis_gym.sb3 import ObservationMoments, ProsthesisVecEnv, ProsthesisVecNormalize

# Undamped walkers with pushes: of some dozen, some fall within 3 s and the others run into the time limit.
CONFIG: dict[str, Any] = {
    "scenario": {"duration_s": 3.0, "push_n": 500.0, "push_s": [0.5, 2.0]},
    "action": {"hold": 4},
    "observation": {"frames": 2},
}


Played = list[tuple[NDArray[Any], NDArray[Any], NDArray[Any], list[dict[str, Any]]]]


def play(env: VecEnv, steps: int, walkers: int) -> Played:
    rng = np.random.default_rng(0)
    played: Played = []
    for _ in range(steps):
        actions = rng.uniform(-1.0, -0.5, size=(walkers, 1)).astype(np.float32)
        observations, rewards, dones, infos = env.step(actions)
        assert isinstance(observations, np.ndarray)
        played.append((observations, rewards, dones, [dict(info) for info in infos]))
    return played


def test_the_single_environment_passes_the_checker_of_sb3() -> None:
    check_env(ProsthesisEnv(CONFIG), skip_render_check=True)


def test_every_step_equals_that_of_monitored_single_environments() -> None:
    walkers, steps = 12, 400
    ours = ProsthesisVecEnv(walkers, CONFIG)
    theirs = DummyVecEnv([lambda: Monitor(ProsthesisEnv(CONFIG)) for _ in range(walkers)])
    for env in (ours, theirs):
        env.seed(7)
    assert (ours.reset() == theirs.reset()).all()
    reasons = set()
    for mine, reference in zip(play(ours, steps, walkers), play(theirs, steps, walkers), strict=True):
        for ours_array, theirs_array in zip(mine[:3], reference[:3], strict=True):
            assert isinstance(theirs_array, np.ndarray)
            assert ours_array.dtype == theirs_array.dtype
            assert (ours_array == theirs_array).all()
        for done, info, expected in zip(mine[2], mine[3], reference[3], strict=True):
            assert info["TimeLimit.truncated"] == expected["TimeLimit.truncated"]
            assert ("terminal_observation" in info) == ("episode" in info) == done
            if done:
                assert (info["terminal_observation"] == expected["terminal_observation"]).all()
                assert info["episode"]["r"] == pytest.approx(expected["episode"]["r"], abs=2e-6)
                assert info["episode"]["l"] == expected["episode"]["l"]
                assert info["termination_reason"] == expected["termination_reason"]
                reasons.add(info["termination_reason"])
    assert {TerminationReason.HIP_HEIGHT, TerminationReason.TIME_LIMIT} <= reasons


def test_episode_terms_add_up_to_the_return() -> None:
    env = ProsthesisVecEnv(16, CONFIG)
    env.seed(3)
    env.reset()
    weights = env.get_attr("config", 0)[0]["reward"]
    ended = [info for *_, infos in play(env, 160, 16) for info in infos if "episode" in info]
    assert len(ended) >= 16
    for info in ended:
        assert set(info["episode_terms"]) == set(_core.TERMS)
        weighted = sum(weights[name] * value for name, value in info["episode_terms"].items())
        assert weighted == pytest.approx(info["episode"]["r"], abs=2e-6)


def test_observations_are_fresh_and_infos_of_ended_episodes_too() -> None:
    env = ProsthesisVecEnv(8, CONFIG)
    env.seed(0)
    kept: list[Any] = [env.reset()]
    kept += [env.step(np.zeros((8, 1), np.float32))[0] for _ in range(3)]
    assert not any(np.shares_memory(a, b) for index, a in enumerate(kept) for b in kept[:index])
    finals = []
    for _ in range(300):
        _, _, dones, infos = env.step(np.full((8, 1), -1.0, np.float32))
        finals += [infos[index] for index in np.flatnonzero(dones)]
        for index in np.flatnonzero(~dones):
            assert infos[index] == {"TimeLimit.truncated": False}
    assert len({id(info) for info in finals}) == len(finals) > 8
    assert len({info["terminal_observation"].tobytes() for info in finals}) == len(finals)


def test_seeds_fix_the_episodes_and_are_used_once() -> None:
    env = ProsthesisVecEnv(6, CONFIG)
    assert env.seed(11) == [11, 12, 13, 14, 15, 16]
    first = play_returns(env)
    again = play_returns(env)
    env.seed(11)
    assert first == play_returns(env) != again


def play_returns(env: ProsthesisVecEnv) -> list[float]:
    env.reset()
    return [float(rewards.sum()) for _, rewards, _, _ in play(env, 200, env.num_envs)]


def test_attributes_and_methods_reach_the_batch() -> None:
    env = ProsthesisVecEnv(4, CONFIG)
    assert env.get_attr("num_envs") == [4] * 4
    assert env.get_attr("render_mode", [0, 2]) == [None, None]
    assert not env.has_attr("nothing_of_that_name")
    env.set_attr("note", "kept")
    assert env.get_attr("note", -1) == ["kept"]
    with pytest.raises(ValueError, match="share the attribute 'note'"):
        env.set_attr("note", "lost", indices=[0])
    with pytest.raises(ValueError, match="index = 4"):
        env.get_attr("note", 4)
    assert env.env_is_wrapped(Monitor) == [True] * 4
    assert env.env_is_wrapped(type("Other", (Monitor.__mro__[1],), {})) == [False] * 4
    assert list(env.get_images()) == [None] * 4
    env.close()


@pytest.mark.parametrize(
    "actions",
    [np.full((3, 1), np.nan), np.zeros((2, 1)), np.zeros((3, 2)), np.zeros((1, 3)), np.zeros(3), np.zeros((3, 1), int)],
)
def test_impossible_actions_are_refused(actions: NDArray[Any]) -> None:
    env = ProsthesisVecEnv(3, CONFIG)
    env.reset()
    with pytest.raises(ValueError, match="actions"):
        env.step(actions)


def test_staggered_walkers_end_their_episodes_one_after_the_other() -> None:
    config = {**CONFIG, "scenario": {"duration_s": 2.0, "push_n": 0.0, "start": "cyclic", "speed_m_s": 1.1}}
    env = ProsthesisVecEnv(50, config, staggered=True)
    env.seed(0)
    env.reset()
    ends = [int(dones.sum()) for _, _, dones, _ in play(env, 100, 50)]
    assert sum(ends) >= 50
    assert max(ends) <= 3
    lengths = [info["episode"]["l"] for *_, infos in play(env, 100, 50) for info in infos if "episode" in info]
    assert max(lengths) == 100


def test_sb3_learns_on_it_and_evaluates_it_without_a_monitor() -> None:
    torch.set_num_threads(1)
    env = VecNormalize(ProsthesisVecEnv(8, CONFIG))
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, n_epochs=1, device="cpu", seed=0)
    model.learn(1024)
    assert model.num_timesteps == 1024
    assert model.ep_info_buffer
    plain = ProsthesisVecEnv(8, CONFIG)
    untrained = PPO("MlpPolicy", plain, n_steps=64, batch_size=64, device="cpu", seed=0)
    returns, lengths = evaluate_policy(untrained, plain, n_eval_episodes=8, return_episode_rewards=True)
    assert isinstance(returns, list)
    assert isinstance(lengths, list)
    assert len(returns) == len(lengths) == 8
    assert max(lengths) <= 150


def test_core_time_is_part_of_wall_time() -> None:
    env = ProsthesisVecEnv(64, CONFIG)
    env.reset()
    began = time.perf_counter()
    play(env, 50, 64)
    assert 0.0 < env.core_seconds < time.perf_counter() - began


def test_normalised_observations_are_those_of_vec_normalize() -> None:
    ours = ProsthesisVecNormalize(ProsthesisVecEnv(12, CONFIG), clip_obs=3.0, gamma=0.9)
    theirs = VecNormalize(ProsthesisVecEnv(12, CONFIG), clip_obs=3.0, gamma=0.9)
    for env in (ours, theirs):
        env.seed(7)
        env.reset()
    # VecNormalize starts from 0.0001 observations of its own, which count as long as ours hardly vary.
    play(ours, 60, 12)
    play(theirs, 60, 12)
    ended = 0
    for mine, reference in zip(play(ours, 150, 12), play(theirs, 150, 12), strict=True):
        assert isinstance(reference[0], np.ndarray)
        np.testing.assert_allclose(mine[0], reference[0], atol=2e-3)
        np.testing.assert_array_equal(mine[1], reference[1])
        np.testing.assert_array_equal(ours.get_original_reward(), theirs.get_original_reward())
        for info, reference_info in zip(mine[3], reference[3], strict=True):
            if "terminal_observation" in info:
                ended += 1
                terminal, theirs_terminal = info["terminal_observation"], reference_info["terminal_observation"]
                np.testing.assert_allclose(terminal, theirs_terminal, atol=2e-3)
    assert ended > 5
    assert np.abs(mine[0]).max() <= 3.0
    np.testing.assert_array_equal(ours.get_original_obs(), theirs.get_original_obs())
    np.testing.assert_allclose(np.asarray(ours.normalize_obs(ours.get_original_obs())), mine[0], atol=1e-6)
    assert ours.observation_space == Box(-3.0, 3.0, (16,), np.float32)


def test_observation_moments_are_those_of_all_observations_and_can_be_frozen() -> None:
    inner, raw = ProsthesisVecEnv(12, CONFIG), ProsthesisVecEnv(12, CONFIG)
    env = ProsthesisVecNormalize(inner)
    for each in (env, raw):
        each.seed(7)
    env.reset()
    seen = [raw.reset(), *(step[0] for step in play(raw, 100, 12))]
    play(env, 100, 12)
    moments = inner.observation_moments
    rows = np.concatenate(seen).astype(np.float64)
    assert moments.number == len(rows)
    np.testing.assert_allclose(moments.mean, rows.mean(axis=0), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(moments.variance, rows.var(axis=0), rtol=1e-9, atol=1e-12)
    inner.env_method("reset", indices=range(5))
    assert env.obs_rms.count == len(rows) + 5
    inner.envs.set_state(inner.envs.get_state())
    assert env.obs_rms.count == len(rows) + 5
    inner.set_observation_moments(moments)
    env.training = False
    play(env, 10, 12)
    env.reset()
    assert inner.observation_moments.number == len(rows)
    with pytest.raises(ValueError, match="mean has 3 entries"):
        inner.set_observation_moments(ObservationMoments(1.0, np.zeros(3), np.ones(3)))
    with pytest.raises(ValueError, match=r"variance\[0\]"):
        inner.set_observation_moments(ObservationMoments(1.0, np.zeros(16), -np.ones(16)))
    with pytest.raises(ValueError, match="not normalised"):
        _ = raw.observation_moments
    with pytest.raises(ValueError, match="clip"):
        ProsthesisVecNormalize(raw, clip_obs=0.0)
