"""Calls of the core's batch, and of the environments above it, whose meaning is easily missed."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from prosthesis_gym import ProsthesisEnv, ProsthesisVectorEnv, _core

STANDS: dict[str, Any] = {"scenario": {"start": "standing", "walk_s": 100.0, "push_n": 0.0}}


@pytest.mark.parametrize(("first", "last"), [(2, 5), (3, 17), (17, 3), (17, 17)])
def test_the_last_record_counts(first: int, last: int) -> None:
    """Of one block or another: one environment is recorded at a time."""
    batch = _core.Batch(20, {"scenario": {"speed_m_s": [0.8, 1.5]}})
    batch.record(first)
    batch.reset(np.arange(20, dtype=np.uint64))
    for _ in range(10):
        batch.step(np.zeros(20))
    assert len(batch.recording()["time_s"]) == 11
    batch.record(last)
    assert len(batch.recording()["time_s"]) == 0
    batch.reset(np.arange(20, dtype=np.uint64))
    for _ in range(5):
        batch.step(np.zeros(20))
    recording = batch.recording()
    assert len(recording["time_s"]) == 6
    snapshot = batch.snapshot(last)
    for name in ("hip_x_m", "knee_angle_deg", "intended_speed_m_s"):
        assert recording[name][-1] == snapshot[name], name


@pytest.mark.parametrize("autoreset", ["next_step", "same_step", "disabled"])
def test_infinite_actions_are_limited_and_nan_is_an_error(autoreset: Any) -> None:  # noqa: ANN401
    limited, infinite = (_core.Batch(9, {}, autoreset) for _ in range(2))
    actions = np.array([1.0, -1.0, 0.3] * 3)
    for batch in (limited, infinite):
        batch.reset(np.arange(9, dtype=np.uint64))
    for _ in range(20):
        expected = limited.step(actions)
        beyond = np.where(actions == 0.3, 0.3, actions * np.inf)
        step = infinite.step(beyond)
        np.testing.assert_array_equal(step.observations, expected.observations)
        np.testing.assert_array_equal(step.rewards, expected.rewards)
    actions[4] = np.nan
    with pytest.raises(ValueError, match=r"actions\[4\] = NaN.*limited"):
        infinite.step(actions)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_environments_limit_infinite_actions(kind: Any) -> None:  # noqa: ANN401
    told = []
    for action in (1.0, np.inf):
        single = ProsthesisEnv()
        single.reset(seed=1)
        vector = ProsthesisVectorEnv(3)
        vector.reset(seed=1)
        told.append((single.step(np.full(1, action, kind))[0], vector.step(np.full((3, 1), action, kind))[0]))
        for env, shape in ((single, (1,)), (vector, (3, 1))):
            with pytest.raises(ValueError, match="NaN"):
                env.step(np.full(shape, np.nan, kind))
    np.testing.assert_array_equal(told[0][0], told[1][0])
    np.testing.assert_array_equal(told[0][1], told[1][1])


def test_stable_baselines3_limits_infinite_actions() -> None:
    sb3 = pytest.importorskip("prosthesis_gym.sb3")
    told = []
    for action in (-1.0, -np.inf):
        envs = sb3.ProsthesisVecEnv(2)
        envs.seed(1)
        envs.reset()
        told.append(envs.step(np.full((2, 1), action, np.float32))[0])
        with pytest.raises(ValueError, match="NaN"):
            envs.step(np.full((2, 1), np.nan, np.float32))
    np.testing.assert_array_equal(told[0], told[1])


def test_an_observation_without_channels_names_its_key() -> None:
    config = {"observation": {"groups": ["motor"]}}
    with pytest.raises(ValueError, match=r"observation\.groups.*motor"):
        gymnasium.make("prosthesis_gym/DamperKnee-v0", config=config)
    assert gymnasium.make("prosthesis_gym/MotorKnee-v0", config=config).observation_space.shape == (2,)
