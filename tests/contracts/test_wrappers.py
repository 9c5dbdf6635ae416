"""Gymnasium's wrappers do around a single walker what they promise."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from comparing import random_actions
from gymnasium import wrappers
from numpy.typing import NDArray

#: Long enough for random walkers to fall or not, in 4 control periods per step.
CONFIG: dict[str, Any] = {"action": {"hold": 4}, "scenario": {"duration_s": 3.0, "push_n": 400.0, "push_s": [0.5, 2.0]}}
Env = gymnasium.Env[Any, Any]


def walker(env_id: str, **arguments: Any) -> Env:  # noqa: ANN401 - whatever gymnasium.make takes
    return gymnasium.make(env_id, config=CONFIG, **arguments)


def episodes(env: Env, count: int, seed: int = 0) -> list[list[tuple[Any, ...]]]:
    """Return the steps of `count` episodes of random actions."""
    rng = np.random.default_rng(seed)
    played = []
    env.reset(seed=seed)
    for index in range(count):
        if index:
            env.reset()
        steps = [env.step(random_actions(rng, 1)[0])]
        while not (steps[-1][2] or steps[-1][3]):
            steps.append(env.step(random_actions(rng, 1)[0]))
        played.append(steps)
    return played


def observations_of(played: list[list[tuple[Any, ...]]]) -> NDArray[Any]:
    return np.array([step[0] for steps in played for step in steps])


def test_record_episode_statistics_sums_what_the_steps_gave(env_id: str) -> None:
    env = wrappers.RecordEpisodeStatistics(walker(env_id))
    played = episodes(env, 30)
    assert {bool(steps[-1][3]) for steps in played} == {False, True}
    for steps in played:
        assert steps[-1][4]["episode"]["r"] == pytest.approx(sum(step[1] for step in steps), abs=1e-5)
        assert steps[-1][4]["episode"]["l"] == len(steps)
    assert list(env.length_queue) == [len(steps) for steps in played]


def test_time_limit_truncates_and_changes_nothing_else(env_id: str) -> None:
    limited = episodes(wrappers.TimeLimit(walker(env_id), max_episode_steps=30), 3)
    free = episodes(walker(env_id), 1)
    assert [len(steps) for steps in limited] == [30] * 3
    assert all(step[3] == (index == 29) for steps in limited for index, step in enumerate(steps))
    np.testing.assert_array_equal(observations_of(limited[:1]), observations_of(free)[:30])


def test_normalize_observation_gives_mean_0_and_variance_1(env_id: str) -> None:
    env = wrappers.NormalizeObservation(walker(env_id))
    raw = observations_of(episodes(walker(env_id), 20))
    episodes(env, 20)
    env.update_running_mean = False
    seen = (raw - env.obs_rms.mean) / np.sqrt(env.obs_rms.var + env.epsilon)
    # A channel that never changes (the state machine's command of the friction knee) stays at its mean.
    moving = raw.std(axis=0) > 1e-3
    assert moving.sum() >= 6
    np.testing.assert_allclose(seen.mean(axis=0)[moving], 0.0, atol=0.05)
    np.testing.assert_allclose(seen.std(axis=0)[moving], 1.0, atol=0.05)


def test_normalize_reward_divides_by_the_spread_of_discounted_returns(env_id: str) -> None:
    """Over the beginning of one episode: what counts at its end differs between versions of Gymnasium."""
    plain, scaled = episodes(walker(env_id), 1)[0], episodes(wrappers.NormalizeReward(walker(env_id), gamma=0.9), 1)[0]
    returns, discounted = [], 0.0
    for step, mine in zip(plain[:60], scaled, strict=False):
        discounted = discounted * 0.9 + step[1]
        returns.append(discounted)
        if len(returns) >= 30:
            assert mine[1] == pytest.approx(step[1] / np.std(returns), rel=0.01)
    assert len(returns) == 60


def test_frame_stack_equals_frames_of_the_environment_itself(env_id: str) -> None:
    stacked = wrappers.FrameStackObservation(walker(env_id), 3)
    own = gymnasium.make(env_id, config=CONFIG | {"observation": {"frames": 3}})
    rng = np.random.default_rng(0)
    theirs, ours = stacked.reset(seed=2)[0], own.reset(seed=2)[0]
    for _ in range(20):
        # Gymnasium pads the first frames with zeros or copies, newest last; ours are copies, newest first.
        action = random_actions(rng, 1)[0]
        theirs, ours = stacked.step(action)[0], own.step(action)[0]
    np.testing.assert_array_equal(theirs[::-1].reshape(-1), ours)


def test_clip_action_takes_any_action_and_acts_its_edge(env_id: str) -> None:
    clipped, plain = wrappers.ClipAction(walker(env_id)), walker(env_id)
    clipped.reset(seed=1)
    plain.reset(seed=1)
    for value, edge in ((7.0, 1.0), (-7.0, -1.0), (0.5, 0.5)):
        action, limited = np.full(1, value, dtype=np.float32), np.full(1, edge, dtype=np.float32)
        np.testing.assert_array_equal(clipped.step(action)[0], plain.step(limited)[0])


def test_rescale_action_maps_its_range_onto_ours(env_id: str) -> None:
    low, high = np.zeros(1, dtype=np.float32), np.full(1, 10.0, dtype=np.float32)
    rescaled, plain = wrappers.RescaleAction(walker(env_id), low, high), walker(env_id)
    rescaled.reset(seed=1)
    plain.reset(seed=1)
    for value, meant in ((0.0, -1.0), (10.0, 1.0), (5.0, 0.0), (7.5, 0.5)):
        actions = [np.full(1, number, dtype=np.float32) for number in (value, meant)]
        np.testing.assert_array_equal(rescaled.step(actions[0])[0], plain.step(actions[1])[0])


def test_transformed_rewards_and_observations_are_functions_of_the_plain_ones(env_id: str) -> None:
    changed: Env = wrappers.TransformReward(walker(env_id), lambda reward: 3.0 * float(reward) + 1.0)
    changed = wrappers.TransformObservation(wrappers.ClipReward(changed, -2.0, 2.0), lambda row: row[:2], None)
    for mine, plain in zip(episodes(changed, 3), episodes(walker(env_id), 3), strict=True):
        for ours, theirs in zip(mine, plain, strict=True):
            assert ours[1] == np.clip(3.0 * theirs[1] + 1.0, -2.0, 2.0)
            np.testing.assert_array_equal(ours[0], theirs[0][:2])


def test_autoreset_goes_on_with_the_next_episode(env_id: str) -> None:
    env = wrappers.Autoreset(walker(env_id, max_episode_steps=10))
    twin = walker(env_id)
    env.reset(seed=5)
    twin.reset(seed=5)
    action = np.zeros(1, dtype=np.float32)
    for _ in range(10):
        *_, truncated, _ = env.step(action)
    assert truncated
    observation, reward, terminated, truncated, _ = env.step(action)
    assert (reward, terminated, truncated) == (0.0, False, False)
    np.testing.assert_array_equal(observation, twin.reset()[0])


def test_flatten_and_time_aware_observations_keep_the_space(env_id: str) -> None:
    env = wrappers.FlattenObservation(wrappers.TimeAwareObservation(walker(env_id, max_episode_steps=50)))
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    for step in range(1, 5):
        observation = env.step(np.zeros(1, dtype=np.float32))[0]
        assert env.observation_space.contains(observation)
        assert observation[-1] == pytest.approx(step / 50) or observation[-1] == step
