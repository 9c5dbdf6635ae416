"""Contracts of Gymnasium and stable-baselines3, over every registered environment."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from comparing import random_actions
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray
from stable_baselines3.common.env_checker import check_env as sb3_check_env

from prosthesis_gym import ProsthesisVectorEnv, TerminationReason, _core
from prosthesis_gym.devices import DEVICES


def test_gymnasium_check_env_passes(env_id: str) -> None:
    check_env(gymnasium.make(env_id).unwrapped)


def test_stable_baselines3_check_env_passes(env_id: str) -> None:
    sb3_check_env(gymnasium.make(env_id).unwrapped)


def test_seeded_episodes_repeat_and_unseeded_ones_differ(env_id: str) -> None:
    env = gymnasium.make(env_id)

    def episode(seed: int | None) -> NDArray[np.float32]:
        rng = np.random.default_rng(0)
        frames = [env.reset(seed=seed)[0]]
        frames += [env.step(random_actions(rng, 1)[0])[0] for _ in range(100)]
        return np.array(frames)

    first, second, again = episode(7), episode(None), episode(7)
    np.testing.assert_array_equal(first, again)
    assert (first != second).any()


def test_every_end_has_a_reason_and_the_time_limit_truncates(env_id: str) -> None:
    config = {"scenario": {"duration_s": 0.5, "push_n": 0.0, "start": "standing"}, "action": {"mode": "state_machine"}}
    env = gymnasium.make(env_id, config=config)
    env.reset(seed=0)
    for step in range(1, 101):
        *_, terminated, truncated, info = env.step(np.zeros(1, dtype=np.float32))
        assert not terminated
        assert truncated == (step == 100)
        assert info["termination_reason"] == (TerminationReason.TIME_LIMIT if truncated else TerminationReason.NONE)

    falling = gymnasium.make(env_id, config={"action": {"mode": "constant"}})
    reasons = set()
    for seed in range(5):
        falling.reset(seed=seed)
        terminated = truncated = False
        while not (terminated or truncated):
            *_, terminated, truncated, info = falling.step(np.zeros(1, dtype=np.float32))
        reasons.add(info["termination_reason"])
        assert terminated == (info["termination_reason"] != TerminationReason.TIME_LIMIT)
    assert TerminationReason.HIP_HEIGHT in reasons


@pytest.mark.parametrize(
    ("actions", "complaint"),
    [
        (np.full((3, 1), np.nan, dtype=np.float32), r"actions\[0\] = NaN"),
        (np.zeros((3, 2), dtype=np.float32), r"shape \(3, 2\), must be \(3, 1\)"),
        (np.zeros((2, 1), dtype=np.float32), r"shape \(2, 1\), must be \(3, 1\)"),
        (np.zeros((3, 1), dtype=np.int64), "dtype int64"),
        (np.array([["a"], ["b"], ["c"]]), "dtype <U1"),
    ],
)
def test_bad_actions_are_named_and_change_nothing(env_id: str, actions: NDArray[Any], complaint: str) -> None:
    envs = gymnasium.make_vec(env_id, num_envs=3)
    twin = gymnasium.make_vec(env_id, num_envs=3)
    envs.reset(seed=1)
    twin.reset(seed=1)
    with pytest.raises(ValueError, match=complaint):
        envs.step(actions)
    good = np.zeros((3, 1), dtype=np.float32)
    np.testing.assert_array_equal(envs.step(good)[0], twin.step(good)[0])


def test_actions_beyond_the_box_count_as_its_edge(env_id: str) -> None:
    inside, outside = (gymnasium.make_vec(env_id, num_envs=2) for _ in range(2))
    inside.reset(seed=1)
    outside.reset(seed=1)
    for _ in range(50):
        a = inside.step(np.ones((2, 1), dtype=np.float32))[0]
        b = outside.step(np.full((2, 1), 3.0, dtype=np.float32))[0]
        np.testing.assert_array_equal(a, b)


def test_reward_is_the_weighted_sum_of_its_logged_terms(env_id: str) -> None:
    weights = {name: float(i + 1) for i, name in enumerate(_core.TERMS)}
    envs = gymnasium.make_vec(env_id, num_envs=8, config={"reward": weights})
    envs.reset(seed=0)
    rng = np.random.default_rng(0)
    seen = dict.fromkeys(_core.TERMS, 0.0)
    for _ in range(1500):
        _, rewards, _, _, infos = envs.step(random_actions(rng, 8))
        terms = {name: infos[f"reward_{name}"] for name in weights}
        np.testing.assert_allclose(rewards, sum(weights[name] * terms[name] for name in weights), atol=1e-12)
        for name in seen:
            seen[name] += float(np.abs(terms[name]).sum())
    motor = "Motor" in env_id
    assert {name for name, value in seen.items() if value == 0.0} == (set() if motor else {"electricity"}), seen


def test_held_actions_equal_the_same_action_given_again_and_again() -> None:
    """One env step with hold=4 passes through the same states as four with hold=1."""
    held = ProsthesisVectorEnv(3, {"action": {"hold": 4}})
    single = ProsthesisVectorEnv(3)
    held.reset(seed=9)
    single.reset(seed=9)
    rng = np.random.default_rng(1)
    for _ in range(60):
        actions = random_actions(rng, 3)
        ours, total, *_ = held.step(actions)
        parts = [single.step(actions) for _ in range(4)]
        np.testing.assert_array_equal(ours, parts[-1][0])
        np.testing.assert_allclose(total, sum(part[1] for part in parts), atol=1e-12)


def test_history_holds_the_newest_frame_first_and_the_older_ones_behind() -> None:
    stacked = ProsthesisVectorEnv(2, {"observation": {"frames": 3}})
    plain = ProsthesisVectorEnv(2)
    channels = len(_core.channels({}))
    history = [plain.reset(seed=4)[0]] * 3
    np.testing.assert_array_equal(stacked.reset(seed=4)[0], np.hstack(history))
    rng = np.random.default_rng(1)
    for _ in range(20):
        actions = random_actions(rng, 2)
        history = [plain.step(actions)[0], *history[:2]]
        observations = stacked.step(actions)[0]
        assert observations.shape == (2, 3 * channels)
        np.testing.assert_array_equal(observations, np.hstack(history))


def test_zero_residual_is_the_state_machine() -> None:
    residual = ProsthesisVectorEnv(4, {"action": {"mode": "residual"}})
    machine = ProsthesisVectorEnv(4, {"action": {"mode": "state_machine"}})
    residual.reset(seed=0)
    machine.reset(seed=0)
    for _ in range(500):
        actions = np.zeros((4, 1), dtype=np.float32)
        np.testing.assert_array_equal(residual.step(actions)[0], machine.step(actions)[0])


def test_a_configuration_of_another_knee_is_refused(env_id: str) -> None:
    env = gymnasium.make(env_id)
    kind = env.unwrapped.config["device"]["kind"]  # type: ignore[attr-defined] # ours
    for make in (gymnasium.make, gymnasium.make_vec):
        make(env_id, config={"device": {"kind": kind}})
        for other, known in DEVICES.items():
            if other != kind:
                with pytest.raises(ValueError, match=f"'{other}'.*'{kind}'.*{known.env_id}"):
                    make(env_id, config={"device": {"kind": other}})


def test_closed_environments_refuse_everything_but_to_be_closed(env_id: str) -> None:
    envs: list[Any] = [gymnasium.make(env_id, render_mode="rgb_array"), gymnasium.make_vec(env_id, 2)]
    for env in envs:
        env.reset(seed=0)
        state = env.unwrapped.get_state()
        env.close()
        env.close()
        calls: list[Any] = [
            env.reset,
            lambda env=env: env.step(np.zeros(env.action_space.shape, np.float32)),
            env.render,
            env.unwrapped.get_state,
            lambda env=env, state=state: env.unwrapped.set_state(state),
        ]
        for call in calls:
            with pytest.raises(ValueError, match="closed"):
                call()


def test_reasons_have_names() -> None:
    assert [reason.name.lower() for reason in TerminationReason] == _core.REASONS
    assert [int(reason) for reason in TerminationReason] == list(range(len(_core.REASONS)))
    assert TerminationReason(int(np.int64(4))).name == "TIME_LIMIT"
