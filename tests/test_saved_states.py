"""Saved walkers: put back anywhere, they go on bit for bit."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from prosthesis_gym import ProsthesisEnv, ProsthesisVectorEnv, RewardTerm
from prosthesis_gym.config import merge
from prosthesis_gym.sb3 import ProsthesisVecEnv

HOLD: dict[str, Any] = {"action": {"hold": 4}, "scenario": {"duration_s": 2.0}}
#: What a walker may carry along.
WORLDS: dict[str, dict[str, Any]] = {
    "delays": {
        "sensors": {"knee_encoder": {"delay_samples": 7, "noise": 0.01, "bias": 0.01, "drop_out": 0.1}},
        "action": {"delay_samples": 3, "filter_s": 0.02, "rate_limit_per_s": 20.0},
        "observation": {"frames": 3, "groups": ["knee", "load", "shank", "command", "phase", "privileged"]},
    },
    "gusts": {"scenario": {"gust": {"force_n": [-60.0, 60.0], "pause_s": [0.1, 0.3]}, "push_s": [0.2, 1.0]}},
    "socket": {"socket": {"connection": "compliant"}, "solver": {"steps": 10}},
    "motor": {"device": {"kind": "motor"}, "action": {"mode": "impedance", "latch": "phase"}},
    "randomised": {"scenario": {"randomise": {"ground.slope_deg": [-1.0, 1.0], "knee.spring_nm_rad": [1.0, 3.0]}}},
}
TERM = RewardTerm("low", -1.0, lambda channels: 1.0 - channels["true_hip_height_m"], groups=("privileged",))


def environment(world: str, count: int, mode: AutoresetMode, *terms: RewardTerm) -> ProsthesisVectorEnv:
    return ProsthesisVectorEnv(count, merge(HOLD, WORLDS[world]), autoreset_mode=mode, reward_terms=terms)


def play(envs: ProsthesisVectorEnv, actions: NDArray[np.float32]) -> list[tuple[Any, ...]]:
    """Return observations, rewards, ends and terms of every step; without autoreset, what has ended is reset."""
    played: list[tuple[Any, ...]] = []
    for action in actions:
        observations, rewards, terminated, truncated, infos = envs.step(action)
        ended = terminated | truncated
        played.append((observations, rewards, terminated, truncated, infos["reward_alive"]))
        if envs.autoreset_mode == AutoresetMode.DISABLED and ended.any():
            played.append(envs.reset(options={"reset_mask": ended})[:1])
    return played


def actions_for(envs: ProsthesisVectorEnv, steps: int, seed: int = 0) -> NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (steps, *(envs.action_space.shape or ()))).astype(np.float32)


def assert_equal(ours: list[tuple[Any, ...]], theirs: list[tuple[Any, ...]]) -> None:
    assert len(ours) == len(theirs)
    for mine, reference in zip(ours, theirs, strict=True):
        for part, expected in zip(mine, reference, strict=True):
            np.testing.assert_array_equal(part, expected)


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("world", WORLDS)
def test_restored_walkers_go_on_bit_for_bit(world: str, mode: AutoresetMode) -> None:
    count, steps = (3, 60) if world == "socket" else (11, 250)
    envs = environment(world, count, mode)
    envs.reset(seed=5)
    actions = actions_for(envs, steps)
    middle = steps // 3
    before = play(envs, actions[:middle])
    state = envs.get_state()
    after = play(envs, actions[middle:])
    np.testing.assert_array_equal(envs.set_state(state), before[-1][0])
    assert_equal(play(envs, actions[middle:]), after)
    fresh = environment(world, count, mode)
    np.testing.assert_array_equal(fresh.set_state(state), before[-1][0])
    assert_equal(play(fresh, actions[middle:]), after)
    if world != "socket":
        assert sum(int((step[2] | step[3]).sum()) for step in after if len(step) > 1) > count


@pytest.mark.parametrize("world", WORLDS)
def test_one_walker_branches_to_many(world: str) -> None:
    count = 5
    envs = environment(world, count, AutoresetMode.SAME_STEP)
    envs.reset(seed=5)
    before = play(envs, actions_for(envs, 30))
    observations = envs.set_state(envs.get_state([2]), [0, 1, 4])
    source = before[-1][0]
    np.testing.assert_array_equal(observations, source[[2, 2, 2, 3, 2]])
    same = actions_for(envs, 20, seed=1)
    same[:] = same[:, :1]
    observations = play(envs, same)[-1][0]
    for index in (0, 1, 4):
        np.testing.assert_array_equal(observations[index], observations[2])
    assert (observations[3] != observations[2]).any()
    different = play(envs, actions_for(envs, 45, seed=2))
    assert any((step[0][0] != step[0][1]).any() for step in different)


def test_single_and_vector_environments_exchange_walkers() -> None:
    config = merge(HOLD, WORLDS["delays"])
    single = ProsthesisEnv(config, reward_terms=[TERM])
    single.reset(seed=1)
    envs = environment("delays", 4, AutoresetMode.DISABLED, TERM)
    actions = np.random.default_rng(0).uniform(-1, 1, (60, 1)).astype(np.float32)
    for action in actions[:20]:
        observation, *_ = single.step(action)
    envs.reset(seed=9)
    assert (envs.set_state(single.get_state()) == observation).all()
    for action in actions[20:40]:
        observation, reward, terminated, *_ = single.step(action)
        observations, rewards, *_ = envs.step(np.tile(action, (4, 1)))
        assert not terminated
        assert (observations == observation).all()
        assert (rewards == reward).all()
    other = ProsthesisEnv(config, reward_terms=[TERM])
    np.testing.assert_array_equal(other.set_state(envs.get_state([3])), observation)
    for action in actions[40:]:
        mine, theirs = other.step(action), single.step(action)
        np.testing.assert_array_equal(mine[0], theirs[0])
        assert mine[1:] == theirs[1:]


def test_a_walker_whose_episode_has_ended_starts_the_next_where_it_is_put() -> None:
    short = merge(HOLD, {"scenario": {"duration_s": 0.2}})
    single, later = (ProsthesisEnv(short, reward_terms=[TERM]) for _ in range(2))
    action = np.zeros(1, dtype=np.float32)
    single.reset(seed=1)
    truncated = False
    while not truncated:
        truncated = single.step(action)[3]
    ended = single.get_state()
    fresh = single.reset()[0]
    # At once where episodes are reset in the step that ends them; else in the next step, or by whoever resets it.
    same_step = ProsthesisVectorEnv(3, short, reward_terms=[TERM], autoreset_mode=AutoresetMode.SAME_STEP)
    same_step.reset(seed=9)
    np.testing.assert_array_equal(same_step.set_state(ended, [1])[1], fresh)
    step, expected = same_step.walkers.step(np.zeros(3)), single.step(action)
    np.testing.assert_array_equal(step.observations[1], expected[0])
    assert step.episode_returns[1] == step.rewards[1] == expected[1]
    next_step = ProsthesisVectorEnv(3, short, reward_terms=[TERM], autoreset_mode=AutoresetMode.NEXT_STEP)
    next_step.reset(seed=9)
    next_step.set_state(ended, [1])
    np.testing.assert_array_equal(next_step.step(np.zeros((3, 1), dtype=np.float32))[0][1], fresh)
    later.set_state(ended)
    with pytest.raises(ValueError, match="has ended"):
        later.step(action)
    np.testing.assert_array_equal(later.reset()[0], fresh)


@pytest.mark.parametrize("call", [lambda envs: envs.step(np.zeros((5, 1), np.float32)), lambda envs: envs.get_state()])
def test_environments_that_were_never_reset_are_named(call: Callable[[ProsthesisVectorEnv], object]) -> None:
    envs = ProsthesisVectorEnv(5)
    with pytest.raises(ValueError, match="environment 0 has not been reset yet"):
        call(envs)
    envs.reset(seed=0, options={"reset_mask": np.array([True, True, False, True, True])})
    with pytest.raises(ValueError, match="environment 2 has not been reset yet"):
        call(envs)
    envs.reset(options={"reset_mask": np.array([False, False, True, False, False])})
    call(envs)


def test_the_next_episodes_are_those_that_would_have_come() -> None:
    single, other = (ProsthesisEnv(HOLD) for _ in range(2))
    single.reset(seed=3)
    other.set_state(single.get_state())
    np.testing.assert_array_equal(other.reset()[0], single.reset()[0])


def test_episode_returns_go_on_with_terms_of_ones_own() -> None:
    env, other = (ProsthesisVecEnv(3, merge(HOLD, WORLDS["delays"]), reward_terms=[TERM]) for _ in range(2))
    env.seed(0)
    env.reset()
    other.reset()
    actions = np.random.default_rng(0).uniform(-1, 1, (120, 3, 1)).astype(np.float32)
    for action in actions[:20]:
        env.step(action)
    for walker, state in enumerate(env.env_method("get_state")):
        other.env_method("set_state", state, indices=walker)
    ends = 0
    for action in actions[20:]:
        mine, theirs = env.step(action), other.step(action)
        for index in np.flatnonzero(mine[2]):
            assert mine[3][index]["episode"]["r"] == theirs[3][index]["episode"]["r"]
            assert mine[3][index]["episode_terms"] == theirs[3][index]["episode_terms"]
            ends += 1
    assert ends >= 3


def test_a_state_that_does_not_fit_is_refused_and_changes_nothing() -> None:
    envs = environment("gusts", 3, AutoresetMode.SAME_STEP)
    observations, _ = envs.reset(seed=0)
    state = envs.get_state()
    with_term = environment("gusts", 3, AutoresetMode.SAME_STEP, RewardTerm("zero", 1.0, lambda _: np.zeros(3)))
    with_term.reset(seed=0)
    others = environment("motor", 3, AutoresetMode.SAME_STEP)
    others.reset(seed=0)
    damaged = bytearray(state)
    damaged[len(state) // 2] ^= 1
    newer = bytearray(state)
    newer[4] += 1
    for wrong, complaint in (
        (others.get_state(), "another configuration"),
        (with_term.get_state(), "reward terms"),
        (envs.get_state([0, 1]), "state holds 2 environments, must hold 1 or 3"),
        (bytes(damaged), "damaged"),
        (state[:-1], "damaged"),
        (state + b"x", "damaged"),
        (state[:3], "not one that get_state returned"),
        (b"nothing of the kind", "not one that get_state returned"),
        (bytes(newer), "version 2, must have 1"),
    ):
        with pytest.raises(ValueError, match=complaint):
            envs.set_state(wrong)
    assert envs.get_state() == state
    np.testing.assert_array_equal(envs.set_state(state), observations)


@pytest.mark.parametrize(("indices", "complaint"), [([], "at least one"), ([3], "index = 3"), ([-1], "index = -1")])
def test_impossible_indices_are_refused(indices: list[int], complaint: str) -> None:
    envs = environment("gusts", 3, AutoresetMode.SAME_STEP)
    envs.reset(seed=0)
    state = envs.get_state([0])
    with pytest.raises(ValueError, match=complaint):
        envs.get_state(indices)
    with pytest.raises(ValueError, match=complaint):
        envs.set_state(state, indices)
