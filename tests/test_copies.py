"""Copies and pickles of environments go on bit for bit, and change nothing of the first."""

import copy
import pickle
import threading
from collections.abc import Callable
from typing import Any

import cloudpickle
import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import vector as vector_wrappers
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecNormalize

from prosthesis_gym import ProsthesisEnv, ProsthesisVectorEnv, RewardTerm
from prosthesis_gym.sb3 import ProsthesisVecEnv, ProsthesisVecNormalize

ENV_ID = "prosthesis_gym/DamperKnee-v0"
#: As much as a walker may carry along; episodes of 50 env steps.
CONFIG: dict[str, Any] = {
    "sensors": {"knee_encoder": {"delay_samples": 7, "noise": 0.01, "drop_out": 0.1}},
    "action": {"hold": 4, "delay_samples": 3, "filter_s": 0.02},
    "scenario": {
        "duration_s": 1.0,
        "push_n": [100.0, 600.0],
        "push_s": [0.2, 0.6],
        "gust": {"force_n": [-60.0, 60.0], "pause_s": [0.1, 0.3]},
        "randomise": {"ground.slope_deg": [-1.0, 1.0]},
    },
}
TERM = RewardTerm("low", -1.0, lambda channels: 1.0 - channels["true_hip_height_m"], groups=("privileged",))
COPIERS: dict[str, Callable[[Any], Any]] = {
    "deepcopy": copy.deepcopy,
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
    "cloudpickle": lambda env: pickle.loads(cloudpickle.dumps(env)),
}
COUNT = 9


@pytest.fixture(params=COPIERS)
def copier(request: pytest.FixtureRequest) -> Callable[[Any], Any]:
    return COPIERS[request.param]


def walk(env: Any, steps: int, seed: int = 0) -> list[tuple[Any, ...]]:  # noqa: ANN401 - single and vector environments
    """Return all that steps and resets hand out."""
    rng = np.random.default_rng(seed)
    shape = env.action_space.shape
    walked: list[tuple[Any, ...]] = []
    for _ in range(steps):
        walked.append(env.step(rng.uniform(-1.0, 1.0, shape).astype(np.float32)))
        ended = np.asarray(walked[-1][2]) | np.asarray(walked[-1][3])
        if ended.ndim == 0 and ended:
            walked.append(env.reset())
        elif ended.any() and env.metadata.get("autoreset_mode") == AutoresetMode.DISABLED:
            walked.append(env.reset(options={"reset_mask": ended}))
    return walked


def assert_same(ours: Any, theirs: Any) -> None:  # noqa: ANN401
    if isinstance(ours, dict):
        assert ours.keys() == theirs.keys()
        ours, theirs = list(ours.values()), list(theirs.values())
    if isinstance(ours, list | tuple):
        assert len(ours) == len(theirs)
        for mine, reference in zip(ours, theirs, strict=True):
            assert_same(mine, reference)
    else:
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("terms", [(), (TERM,)])
def test_single_environments_go_on_through_gymnasiums_wrappers(copier: Any, terms: tuple[RewardTerm, ...]) -> None:  # noqa: ANN401
    env = gymnasium.wrappers.NormalizeObservation(
        gymnasium.make(ENV_ID, config=CONFIG, reward_terms=terms, max_episode_steps=30)
    )
    env.unwrapped.difficulty = 0.4  # type: ignore[attr-defined] # ours
    env.reset()
    walk(env, 50)
    copied = copier(env)
    assert copied.unwrapped is not env.unwrapped
    assert copied.unwrapped.difficulty == 0.4
    assert copied.spec is not None
    assert copied.spec.max_episode_steps == 30
    assert copied.unwrapped.np_random_seed == env.unwrapped.np_random_seed
    once, again = walk(env, 80), walk(copied, 80)
    assert_same(once, again)
    assert env.unwrapped.np_random.random() == copied.unwrapped.np_random.random()


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("terms", [(), (TERM,)])
def test_vector_environments_go_on(copier: Any, mode: AutoresetMode, terms: tuple[RewardTerm, ...]) -> None:  # noqa: ANN401
    envs = gymnasium.make_vec(
        ENV_ID, COUNT, config=CONFIG, reward_terms=terms, autoreset_mode=mode, max_episode_steps=30
    )
    envs.unwrapped.difficulty = 0.4  # type: ignore[attr-defined] # ours
    envs.reset(seed=3)
    walk(envs, 50)
    copied = copier(envs)
    before = envs.unwrapped.get_state()  # type: ignore[attr-defined] # ours
    walked = walk(copied, 80)
    assert envs.unwrapped.get_state() == before  # type: ignore[attr-defined] # a copy's steps change nothing
    assert_same(walk(envs, 80), walked)
    assert_same(envs.reset(), copied.reset())
    assert copied.unwrapped.max_episode_steps == 30


def test_vector_wrappers_are_copied_too(copier: Any) -> None:  # noqa: ANN401
    envs = vector_wrappers.NormalizeObservation(
        vector_wrappers.RecordEpisodeStatistics(gymnasium.make_vec(ENV_ID, COUNT, config=CONFIG))
    )
    envs.reset(seed=1)
    walk(envs, 60)
    copied = copier(envs)
    for ours, theirs in zip(walk(envs, 60), walk(copied, 60), strict=True):
        assert_same(ours[:4], theirs[:4])


def test_stable_baselines3_environments_go_on_with_their_statistics(copier: Any) -> None:  # noqa: ANN401
    env = ProsthesisVecEnv(COUNT, CONFIG, staggered=True)
    normaliser: VecNormalize = ProsthesisVecNormalize(env)
    env.seed(3)
    normaliser.reset()

    def go_on(each: ProsthesisVecEnv) -> list[NDArray[Any]]:
        rng = np.random.default_rng(1)
        steps = (each.step(rng.uniform(-1.0, 1.0, (COUNT, 1)).astype(np.float32)) for _ in range(60))
        return [
            np.column_stack([np.asarray(observations), rewards, dones]) for observations, rewards, dones, _ in steps
        ]

    go_on(env)
    copied = copier(env)
    np.testing.assert_array_equal(go_on(env), go_on(copied))
    for ours, theirs in zip(env.observation_moments, copied.observation_moments, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert_same(env.reset(), copied.reset())


def test_environments_that_were_reset_in_part_or_never_are_copied(copier: Any) -> None:  # noqa: ANN401
    fresh = ProsthesisEnv(CONFIG)
    assert_same(fresh.reset(seed=4), copier(fresh).reset(seed=4))
    envs = ProsthesisVectorEnv(COUNT, CONFIG)
    part = np.arange(COUNT) % 2 == 0
    envs.reset(seed=3, options={"reset_mask": part})
    copied = copier(envs)
    with pytest.raises(ValueError, match="has not been reset"):
        copied.step(np.zeros((COUNT, 1), dtype=np.float32))
    for each in (envs, copied):
        each.reset(options={"reset_mask": ~part})
    assert_same(walk(envs, 40), walk(copied, 40))


def test_planners_come_back_to_where_they_branched_off() -> None:
    env = gymnasium.make(ENV_ID, config=CONFIG)
    env.reset(seed=2)
    walk(env, 10)
    branches = [copy.deepcopy(env) for _ in range(3)]
    ways = [walk(branch, 20, seed) for seed, branch in enumerate(branches)]
    assert_same(walk(env, 20, 1), ways[1])
    assert (ways[0][-1][0] != ways[1][-1][0]).any()


def test_rendering_is_not_copied_and_works_after(copier: Any) -> None:  # noqa: ANN401
    pictures: dict[str, Any] = {"render_mode": "rgb_array", "render_size": (160, 90)}
    envs: list[Any] = [ProsthesisEnv(CONFIG, **pictures), ProsthesisVectorEnv(2, CONFIG, **pictures)]
    for env in envs:
        env.reset(seed=0)
        env.render()
        walk(env, 5)
        copied = copier(env)
        assert np.shape(copied.render()) == np.shape(env.render())
        walk(copied, 5)
        copied.close()
        env.render()


def test_closed_environments_stay_closed_in_copies(copier: Any) -> None:  # noqa: ANN401
    env = ProsthesisEnv(CONFIG)
    env.reset(seed=0)
    env.close()
    with pytest.raises(ValueError, match="closed"):
        copier(env).reset()


class Locked:
    """A function of channels that cannot be copied."""

    def __init__(self) -> None:
        self.lock = threading.Lock()

    def __call__(self, channels: Any) -> NDArray[np.float64]:  # noqa: ANN401
        with self.lock:
            return np.zeros_like(channels["knee_angle_rad"])


def test_a_term_that_cannot_be_copied_is_named_with_the_way_out(copier: Any) -> None:  # noqa: ANN401
    env = ProsthesisEnv(CONFIG, reward_terms=[RewardTerm("locked", 1.0, Locked())])
    env.reset(seed=0)
    with pytest.raises(
        (TypeError, pickle.PicklingError), match=r"reward term 'locked' cannot be copied.*get_state.*lock"
    ):
        copier(env)
