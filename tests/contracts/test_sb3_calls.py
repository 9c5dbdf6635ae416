"""What Stable-Baselines3 and its users call reaches what they name, or is refused."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback, CallbackList, EvalCallback
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import (
    DummyVecEnv,
    SubprocVecEnv,
    VecEnv,
    VecNormalize,
    sync_envs_normalization,
)

from prosthesis_gym import ProsthesisEnv
from prosthesis_gym.sb3 import ProsthesisVecEnv, ProsthesisVecNormalize

ENV_ID = "prosthesis_gym/DamperKnee-v0"
CONFIG: dict[str, Any] = {
    "scenario": {"duration_s": 3.0, "push_n": 500.0, "push_s": [0.5, 2.0]},
    "action": {"hold": 4},
    "observation": {"frames": 2},
}
WALKERS = 5


def dummy() -> DummyVecEnv:
    return DummyVecEnv([lambda: ProsthesisEnv(CONFIG)] * WALKERS)


def step(env: VecEnv, count: int, seed: int = 0) -> list[NDArray[Any]]:
    rng = np.random.default_rng(seed)
    actions = rng.uniform(-1.0, -0.5, (count, env.num_envs, 1)).astype(np.float32)
    return [np.asarray(env.step(action)[0]) for action in actions]


def test_methods_of_some_walkers_are_those_of_dummy_vec_env() -> None:
    ours, theirs = ProsthesisVecEnv(WALKERS, CONFIG), dummy()
    for env in (ours, theirs):
        env.seed(4)
        env.reset()
        step(env, 20)
    calls: list[tuple[str, dict[str, Any], Any]] = [
        ("reset", {}, [1]),
        ("reset", {"seed": 17}, [0, 3]),
        ("reset", {"seed": 2**70}, 2),
        ("reset", {}, -1),
    ]
    for name, arguments, indices in calls:
        mine, reference = (env.env_method(name, indices=indices, **arguments) for env in (ours, theirs))
        assert len(mine) == len(reference) == np.size(indices)
        for (observation, info), (expected, expected_info) in zip(mine, reference, strict=True):
            np.testing.assert_array_equal(observation, expected)
            assert info == expected_info
        np.testing.assert_array_equal(step(ours, 10), step(theirs, 10))
    states = ours.env_method("get_state", indices=[2, 0])
    assert states == theirs.env_method("get_state", indices=[2, 0])
    for env in (ours, theirs):
        step(env, 10)
    for index, state in ((2, states[0]), (4, states[1])):
        (mine,), (reference,) = (env.env_method("set_state", state, indices=index) for env in (ours, theirs))
        np.testing.assert_array_equal(mine, reference)
    np.testing.assert_array_equal(step(ours, 10), step(theirs, 10))


def test_attributes_are_those_of_a_walker() -> None:
    ours, theirs = ProsthesisVecEnv(WALKERS, CONFIG), dummy()
    for name in (
        "observation_space",
        "action_space",
        "config",
        "difficulty",
        "max_episode_steps",
        "render_mode",
        "spec",
    ):
        assert ours.get_attr(name, [0, 2]) == theirs.get_attr(name, [0, 2]), name
        assert ours.has_attr(name)
    with pytest.raises(AttributeError):
        ours.get_attr("nothing_of_that_name")
    with pytest.raises(ValueError, match="single walkers"):
        ours.get_attr("np_random_seed")


def test_what_walkers_share_or_cannot_do_alone_is_refused() -> None:
    env = ProsthesisVecEnv(WALKERS, CONFIG)
    env.seed(0)
    env.reset()
    before = env.env_method("get_state")
    refused: list[tuple[Any, str]] = [
        (lambda: env.env_method("step", np.zeros(1, np.float32), indices=[0]), "call step"),
        (lambda: env.env_method("close", indices=[0]), "indices must name all 5"),
        (lambda: env.set_attr("difficulty", 0.5, indices=[0, 1]), "share the attribute 'difficulty'"),
        (lambda: env.set_attr("config", {}), "'config' is fixed"),
        (lambda: env.set_attr("walkers", None), "'walkers' is fixed"),
        (lambda: env.set_attr("max_episode_steps", 3), "'max_episode_steps' is fixed"),
        (lambda: env.set_attr("difficulty", 1.5), "difficulty = 1.5"),
        (lambda: env.env_method("reset", options={"start": 1}), "unknown reset option 'start'"),
        (lambda: env.env_method("reset", seed=1.5), "seed = 1.5"),
        (lambda: env.env_method("reset", indices=[]), "at least one"),
        (lambda: env.env_method("reset", indices=np.array([1.5])), r"index = .*1\.5"),
        (lambda: env.env_method("reset", indices=5), "index = 5"),
        (lambda: env.set_options({"start": 1}), "unknown reset option 'start'"),
        (lambda: env.set_options([{}]), "options has 1 entries"),
        (lambda: env.seed(-1), "seed = -1"),
        (lambda: env.seed(True), "seed = True"),
        (lambda: env.seed(0.5), "seed = 0.5"),  # type: ignore[arg-type] # on purpose
    ]
    for call, complaint in refused:
        with pytest.raises(ValueError, match=complaint):
            call()
    assert env.env_method("get_state") == before
    assert env.get_attr("difficulty") == [1.0] * WALKERS


@pytest.mark.parametrize("kind", [DummyVecEnv, SubprocVecEnv])
@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
def test_difficulty_set_on_wrapped_single_environments_arrives_with_the_next_episode(kind: Any) -> None:  # noqa: ANN401
    easy = {"config": CONFIG | {"scenario": {"push_n": [300.0, 500.0]}}}
    env = make_vec_env(f"prosthesis_gym:{ENV_ID}", 3, vec_env_cls=kind, env_kwargs=easy)
    native = ProsthesisVecEnv(3, easy["config"])
    for each in (env, native):
        each.set_attr("difficulty", 0.25)
        each.seed(3)
    np.testing.assert_array_equal(env.reset(), native.reset())
    assert env.get_attr("difficulty") == [0.25] * 3
    assert env.env_method("get_wrapper_attr", "difficulty") == [0.25] * 3
    np.testing.assert_array_equal(step(env, 150), step(native, 150))
    # Once it has arrived, nothing hides what is set on the environments themselves.
    for each in (env, native):
        each.env_method("set_wrapper_attr", "difficulty", 0.75)
        each.seed(4)
        each.reset()
    assert env.get_attr("difficulty") == native.get_attr("difficulty") == [0.75] * 3
    np.testing.assert_array_equal(step(env, 150), step(native, 150))
    env.set_attr("difficulty", 1.5)
    with pytest.raises((ValueError, EOFError), match=r"difficulty = 1.5|^$"):  # a worker process ends
        env.reset()


def test_an_own_number_between_wrappers_hides_nothing() -> None:
    env = gymnasium.make(ENV_ID)
    env.set_wrapper_attr("difficulty", 0.5)
    assert env.unwrapped.difficulty == 0.5  # type: ignore[attr-defined] # ours
    env.reset()
    assert env.get_wrapper_attr("difficulty") == 0.5


def walkers(count: int, *, staggered: bool = False) -> ProsthesisVecNormalize:
    return ProsthesisVecNormalize(ProsthesisVecEnv(count, CONFIG, staggered=staggered))


def test_eval_callback_evaluates_with_the_statistics_of_training() -> None:
    torch.set_num_threads(1)
    train, evaluated = walkers(4, staggered=True), walkers(2)
    evaluated.training = False

    class Compare(BaseCallback):
        compared = 0

        def _on_step(self) -> bool:
            if self.n_calls % 32 == 0:
                for name in ("count", "mean", "var"):
                    np.testing.assert_array_equal(getattr(evaluated.obs_rms, name), getattr(train.obs_rms, name))
                self.compared += 1
            return True

    compare = Compare()
    model = PPO("MlpPolicy", train, n_steps=32, batch_size=64, n_epochs=1, device="cpu", seed=0)
    model.learn(256, CallbackList([EvalCallback(evaluated, eval_freq=32, n_eval_episodes=2, verbose=0), compare]))
    assert compare.compared == 2
    assert train.obs_rms.count > 4 * 60


def test_statistics_that_only_the_environment_knows_are_refused() -> None:
    with pytest.raises(ValueError, match="ProsthesisVecNormalize"):
        ProsthesisVecEnv(2, CONFIG, normalise_observations=True)


def test_synchronised_statistics_are_copied_and_not_shared() -> None:
    train, evaluated = walkers(4), walkers(2)
    train.seed(0)
    train.reset()
    step(train, 30)
    sync_envs_normalization(train, evaluated)
    moments = train.obs_rms.mean.copy()
    np.testing.assert_array_equal(evaluated.obs_rms.mean, moments)
    evaluated.reset()
    step(evaluated, 30)
    np.testing.assert_array_equal(train.obs_rms.mean, moments)
    assert (evaluated.obs_rms.mean != moments).any()
    with pytest.raises(AssertionError, match="expected the eval env to be"):
        sync_envs_normalization(train, ProsthesisVecEnv(2, CONFIG))


def test_saved_statistics_are_loaded_around_another_environment(tmp_path: Path) -> None:
    train = walkers(4)
    train.seed(0)
    train.reset()
    step(train, 30)
    train.training = False
    train.save(str(tmp_path / "statistics.pkl"))
    loaded = VecNormalize.load(str(tmp_path / "statistics.pkl"), ProsthesisVecEnv(4, CONFIG))
    assert isinstance(loaded, ProsthesisVecNormalize)
    assert not loaded.training
    for env in (train, loaded):
        env.seed(9)
    np.testing.assert_array_equal(train.reset(), loaded.reset())
    np.testing.assert_array_equal(step(train, 20), step(loaded, 20))
    assert loaded.obs_rms.count == train.obs_rms.count


@pytest.mark.parametrize(
    "env", [VecNormalize(ProsthesisVecEnv(2, CONFIG)), DummyVecEnv([lambda: ProsthesisEnv(CONFIG)]), walkers(2)]
)
def test_what_the_core_cannot_normalise_is_refused(env: VecEnv) -> None:
    with pytest.raises(ValueError, match="must be a ProsthesisVecEnv"):
        ProsthesisVecNormalize(env)


def test_settings_that_would_have_no_effect_are_refused() -> None:
    env = walkers(2)
    for name, value in (("clip_obs", 3.0), ("epsilon", 0.1), ("norm_obs", False)):
        with pytest.raises(ValueError, match=f"{name} is fixed"):
            setattr(env, name, value)
    with pytest.raises(ValueError, match="read-only"):
        env.obs_rms.mean[0] = 1.0
    with pytest.raises(ValueError, match="normalises these observations already"):
        ProsthesisVecNormalize(env.venv)


def seen_moments(rows: list[NDArray[Any]]) -> tuple[int, NDArray[np.float64], NDArray[np.float64]]:
    seen = np.concatenate(rows).astype(np.float64)
    return len(seen), seen.mean(axis=0), seen.var(axis=0)


@pytest.mark.parametrize("staggered", [False, True])
def test_statistics_learn_from_what_the_agent_meets_and_from_nothing_else(staggered: bool) -> None:
    """Through resets of all and of some, states put in place, evaluation and a resumption."""
    env = walkers(WALKERS, staggered=staggered)
    inner = env.venv
    assert isinstance(inner, ProsthesisVecEnv)
    met: list[NDArray[Any]] = []

    def meet(_: object) -> None:
        met.append(env.get_original_obs())

    env.seed(5)
    meet(env.reset())
    for _ in range(40):
        meet(env.step(np.full((WALKERS, 1), -0.7, np.float32)))
    (first, _), (last, _) = inner.env_method("reset", indices=[0, 4])
    assert first.shape == last.shape
    met.append(env.get_original_obs()[[0, 4]])
    inner.env_method("set_state", inner.env_method("get_state", indices=1)[0], indices=[2, 3])
    meet(env.step(np.zeros((WALKERS, 1), np.float32)))
    env.training = False
    env.reset()
    step(env, 10)
    env.training = True
    meet(env.reset())
    number, mean, variance = seen_moments(met)
    assert env.obs_rms.count == number
    np.testing.assert_allclose(env.obs_rms.mean, mean, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(env.obs_rms.var, variance, rtol=1e-9, atol=1e-12)
    resumed = walkers(WALKERS, staggered=staggered)
    resumed_inner = resumed.venv
    assert isinstance(resumed_inner, ProsthesisVecEnv)
    resumed_inner.set_observation_moments(inner.observation_moments)
    resumed.seed(6)
    resumed.reset()
    met.append(resumed.get_original_obs())
    number, mean, _ = seen_moments(met)
    assert resumed.obs_rms.count == number
    np.testing.assert_allclose(resumed.obs_rms.mean, mean, rtol=1e-9, atol=1e-12)


def test_a_walker_that_starts_anew_where_it_is_put_is_met_for_the_first_time() -> None:
    short = ProsthesisEnv(CONFIG, max_episode_steps=3)
    short.reset(seed=1)
    for _ in range(3):
        short.step(np.zeros(1, np.float32))
    env = walkers(WALKERS)
    env.seed(5)
    env.reset()
    env.env_method("set_state", short.get_state(), indices=[1])
    assert env.obs_rms.count == WALKERS + 1


def test_closed_environments_refuse_everything() -> None:
    env = ProsthesisVecEnv(2, CONFIG, render_mode="rgb_array")
    env.reset()
    env.close()
    env.close()
    for call in (
        env.reset,
        lambda: env.step(np.zeros((2, 1), np.float32)),
        env.get_images,
        lambda: env.render("rgb_array"),
    ):
        with pytest.raises(ValueError, match="closed"):
            call()
