"""Difficulty reaches what episodes draw; groups say where their channels stand; actions have the size of their mode."""

from typing import Any

import numpy as np
import pytest

from prosthesis_gym import ProsthesisEnv, ProsthesisVectorEnv, _core
from prosthesis_gym.controller import SensorController
from prosthesis_gym.evaluation import evaluate
from prosthesis_gym.sb3 import ProsthesisVecEnv
from prosthesis_gym.trial import run_trial

IMPEDANCE: dict[str, Any] = {"device": {"kind": "motor"}, "action": {"mode": "impedance"}}


def test_difficulty_changes_what_the_next_episodes_draw() -> None:
    envs = ProsthesisVectorEnv(64, scenario="everything", autoreset_mode="Disabled")
    assert envs.difficulty == 1.0
    slopes, pushes = [], []
    for difficulty in (0.0, 0.5, 1.0):
        envs.difficulty = difficulty
        envs.reset(seed=0)
        episodes = envs.batch.episodes()
        slopes.append(episodes["ground.slope_deg"])
        pushes.append(np.abs(episodes["push_n"]))
    assert (slopes[0] == 0.0).all()
    assert (pushes[0] == 0.0).all()
    np.testing.assert_allclose(slopes[1], 0.5 * slopes[2])
    np.testing.assert_allclose(pushes[1], 0.5 * pushes[2])
    assert np.ptp(slopes[2]) > 1.0


def test_difficulty_waits_for_the_episode_that_runs() -> None:
    env = ProsthesisEnv(scenario="pushes")
    env.reset(seed=0)
    before = env.batch.episodes()["push_n"]
    env.difficulty = 0.0
    assert env.difficulty == 0.0
    np.testing.assert_array_equal(env.batch.episodes()["push_n"], before)
    env.reset()
    assert env.batch.episodes()["push_n"] == 0.0


def test_difficulty_reaches_the_walkers_through_stable_baselines() -> None:
    env = ProsthesisVecEnv(8, scenario="pushes")
    env.set_attr("difficulty", 0.0)
    assert env.get_attr("difficulty") == [0.0] * 8
    env.reset()
    assert (env.envs.batch.episodes()["push_n"] == 0.0).all()


@pytest.mark.parametrize("difficulty", [-0.1, 1.1, float("nan"), True, None, "1"])
def test_difficulty_outside_its_range_is_refused(difficulty: float) -> None:
    for env in (ProsthesisEnv(), ProsthesisVectorEnv(2)):
        with pytest.raises(ValueError, match=r"difficulty = .* \[0, 1\]"):
            env.difficulty = difficulty
        assert env.difficulty == 1.0


def test_groups_index_their_channels_in_every_frame() -> None:
    groups = ["load", "privileged", "knee", "motor"]
    config = {"device": {"kind": "motor"}, "observation": {"groups": groups, "frames": 3}}
    envs = ProsthesisVectorEnv(2, config)
    indices = envs.observation_groups
    assert list(indices) == groups
    assert sorted(np.concatenate(list(indices.values()))) == list(range((envs.single_observation_space.shape or ())[0]))
    names = [channel[0] for channel in _core.channels(config)] * 3
    assert [names[index] for index in indices["knee"]] == ["knee_angle_rad", "knee_speed_rad_s"] * 3
    assert {names[index][:5] for index in indices["privileged"]} == {"true_"}
    assert ProsthesisEnv(config).observation_groups["load"].tolist() == indices["load"].tolist()
    (theirs,) = ProsthesisVecEnv(2, config).get_attr("observation_groups", 0)
    assert theirs["motor"].tolist() == indices["motor"].tolist()


def test_a_group_without_channels_is_left_out() -> None:
    assert list(ProsthesisEnv().observation_groups) == ["knee", "load", "shank", "command"]


def test_impedance_actions_are_three_numbers_everywhere() -> None:
    single, envs, sb3 = ProsthesisEnv(IMPEDANCE), ProsthesisVectorEnv(2, IMPEDANCE), ProsthesisVecEnv(2, IMPEDANCE)
    assert single.action_space.shape == sb3.action_space.shape == (3,)
    assert envs.action_space.shape == (2, 3)
    single.reset(seed=4)
    envs.reset(seed=4)
    sb3.seed(4)
    sb3.reset()
    rng = np.random.default_rng(0)
    for _ in range(50):
        actions = rng.uniform(-1, 1, (2, 3)).astype(np.float32)
        observations = envs.step(actions)[0]
        np.testing.assert_array_equal(single.step(actions[0])[0], observations[0])
        np.testing.assert_array_equal(sb3.step(actions)[0], observations)
    with pytest.raises(ValueError, match=r"shape \(2, 1\), must be \(2, 3\)"):
        envs.step(np.zeros((2, 1)))


class _ThreeNumbers(SensorController):
    """A controller that asks for impedance actions, which no controller gives."""

    def configure(self, config: Any, /) -> Any:  # noqa: ANN401 - a configuration
        return super().configure(config) | {"action": {"mode": "impedance"}}


def test_controllers_of_one_number_refuse_impedance_actions() -> None:
    controller = _ThreeNumbers(lambda _: 0.0, "motor")
    for run in (evaluate, lambda policy, config: run_trial(config, policy=policy)):
        with pytest.raises(ValueError, match=r"action\.mode = 'impedance' takes 3 numbers per walker"):
            run(controller, {})


def test_evaluation_finds_standstills_without_the_shank_in_sight() -> None:
    """Whether a walker stands still is not the controller's to see."""
    scenario = {"start": "standing", "walk_s": 100.0, "push_n": 0.0, "duration_s": 3.0, "speed_change_s": 100.0}
    result = evaluate(None, {"scenario": scenario, "observation": {"groups": ["knee"]}}, episodes=4)
    assert (result.stalls, result.falls) == (4, 0)
    assert set(result.mean_terms) == set(_core.TERMS)
