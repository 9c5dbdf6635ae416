"""Rewards: presets of weights, and terms of one's own in every kind of environment."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecNormalize

from prosthesis_gym import REWARDS, ProsthesisEnv, ProsthesisVectorEnv, RewardTerm, TerminationReason, _core
from prosthesis_gym.rewards import load_reward
from prosthesis_gym.sb3 import ProsthesisVecEnv, ProsthesisVecNormalize

WALKERS = 6
#: Random walkers fall, or run out of time, within it.
CONFIG: dict[str, Any] = {
    "action": {"hold": 4},
    "scenario": {"duration_s": 1.5, "push_n": 600.0, "push_s": [0.3, 1.0], "start": "cyclic"},
    "observation": {"frames": 2},
}
HEIGHT = RewardTerm("hip_height", 0.5, lambda channels: channels["true_hip_height_m"], groups=("privileged",))
BEND = RewardTerm("bend", -0.1, lambda channels: channels["knee_angle_rad"] ** 2)
TERMS = (HEIGHT, BEND)
Channels = Mapping[str, NDArray[np.float64]]


def actions_of(seed: int, steps: int, count: int = WALKERS) -> NDArray[np.float32]:
    return np.random.default_rng(seed).uniform(-1, 1, (steps, count, 1)).astype(np.float32)


@pytest.mark.parametrize("name", REWARDS)
def test_presets_set_the_weights_of_all_terms(name: str, env_id: str) -> None:
    weights = load_reward(name)["reward"]
    assert set(weights) == set(_core.TERMS)
    made: Any = gymnasium.make(env_id, reward=name).unwrapped
    assert made.config["reward"] == weights
    vector: Any = gymnasium.make_vec(env_id, 2, reward=name, config={"reward": {"fall": -3.0}})
    assert vector.config["reward"] == weights | {"fall": -3.0}


def test_reward_files_hold_the_section_reward_alone(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("[reward]\nfall = -1.0\n")
    assert load_reward(path) == {"reward": {"fall": -1.0}}
    for text, complaint in (
        ("[reward]\nspeed = 1.0", r"reward\.speed"),
        ("[scenario]\npush_n = 0.0", "sections scenario"),
        ("", "must be reward alone"),
    ):
        path.write_text(text)
        with pytest.raises(ValueError, match=complaint):
            load_reward(path)
    with pytest.raises(ValueError, match=r"'fast': neither one of economy, gait_quality, safety"):
        load_reward("fast")


def test_hidden_channels_are_seen_by_terms_alone() -> None:
    seen: list[Channels] = []

    def look(channels: Channels) -> NDArray[np.float64]:
        seen.append(channels)
        return np.zeros(WALKERS)

    ours = ProsthesisVectorEnv(WALKERS, CONFIG, reward_terms=[RewardTerm("look", 1.0, look, ("privileged", "knee"))])
    plain = ProsthesisVectorEnv(WALKERS, CONFIG)
    whole = ProsthesisVectorEnv(
        WALKERS, CONFIG | {"observation": {"groups": ["knee", "load", "shank", "command", "privileged"]}}
    )
    assert ours.observation_space == plain.observation_space
    assert ours.config == plain.config
    np.testing.assert_array_equal(ours.reset(seed=1)[0], plain.reset(seed=1)[0])
    whole.reset(seed=1)
    names = [channel[0] for channel in _core.channels(whole.config)]
    for actions in actions_of(0, 100):
        observations, rewards, *_ = ours.step(actions)
        theirs, expected, *_ = plain.step(actions)
        everything = whole.step(actions)[0]
        np.testing.assert_array_equal(observations, theirs)
        np.testing.assert_array_equal(rewards, expected)
        assert list(seen[-1]) == names
        np.testing.assert_array_equal(np.array(list(seen[-1].values())).T, everything.astype(np.float64))


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_vector_environments_give_what_single_ones_do(mode: AutoresetMode) -> None:
    ours = ProsthesisVectorEnv(WALKERS, CONFIG, reward_terms=TERMS, autoreset_mode=mode)
    theirs = SyncVectorEnv([lambda: ProsthesisEnv(CONFIG, reward_terms=TERMS)] * WALKERS, autoreset_mode=mode)
    np.testing.assert_array_equal(ours.reset(seed=3)[0], theirs.reset(seed=3)[0])
    ends = 0
    for actions in actions_of(1, 200):
        mine, reference = ours.step(actions), theirs.step(actions)
        for ours_part, theirs_part in zip(mine[:4], reference[:4], strict=True):
            np.testing.assert_array_equal(ours_part, theirs_part)
        ended = mine[2] | mine[3]
        ends += int(ended.sum())
        infos = [(mine[4], reference[4])]
        if mode == AutoresetMode.SAME_STEP and ended.any():
            infos.append((mine[4]["final_info"], reference[4]["final_info"]))
        for own, other in infos:
            for term in TERMS:
                if f"reward_{term.name}" in other:
                    np.testing.assert_array_equal(own[f"reward_{term.name}"], other[f"reward_{term.name}"])
        if mode == AutoresetMode.DISABLED and ended.any():
            for envs in (ours, theirs):
                envs.reset(options={"reset_mask": ended})
    assert ends > WALKERS


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_term_judges_the_final_observation_of_an_episode_that_ends(mode: AutoresetMode) -> None:
    """The hip of a fallen walker is low; that of the first observation of the next episode is not."""
    envs = ProsthesisVectorEnv(32, CONFIG, reward_terms=[HEIGHT], autoreset_mode=mode)
    envs.reset(seed=0)
    fallen = []
    for actions in actions_of(2, 100, 32):
        _, _, terminated, truncated, infos = envs.step(actions)
        final = infos.get("final_info", infos)
        fell = terminated & (final["termination_reason"] == TerminationReason.HIP_HEIGHT)
        fallen += final["reward_hip_height"][fell].tolist()
        if mode == AutoresetMode.DISABLED and (terminated | truncated).any():
            envs.reset(options={"reset_mask": terminated | truncated})
    assert len(fallen) > 5
    assert max(fallen) < 0.6


def test_a_step_that_only_resets_counts_for_no_term() -> None:
    envs = ProsthesisVectorEnv(WALKERS, CONFIG, reward_terms=TERMS, max_episode_steps=5)
    envs.reset(seed=0)
    for actions in actions_of(0, 5):
        _, _, terminated, truncated, infos = envs.step(actions)
    assert (terminated | truncated).all()
    assert (infos["reward_hip_height"] > 0.0).all()
    _, rewards, *_, infos = envs.step(actions)
    assert (rewards == 0.0).all()
    assert (infos["reward_hip_height"] == 0.0).all()


def test_rewards_are_the_weighted_sum_of_all_terms() -> None:
    envs = ProsthesisVectorEnv(WALKERS, CONFIG, reward="economy", reward_terms=TERMS)
    weights = envs.config["reward"] | {term.name: term.weight for term in TERMS}
    envs.reset(seed=0)
    for actions in actions_of(0, 150):
        _, rewards, *_, infos = envs.step(actions)
        total = sum(weight * infos[f"reward_{name}"] for name, weight in weights.items())
        np.testing.assert_allclose(rewards, total, atol=1e-12)


def test_stable_baselines_returns_and_episode_terms_include_them() -> None:
    env = ProsthesisVecEnv(WALKERS, CONFIG, reward_terms=TERMS)
    env.seed(5)
    env.reset()
    returns, ended = np.zeros(WALKERS), 0
    weights = env.get_attr("config", 0)[0]["reward"] | {term.name: term.weight for term in TERMS}
    for actions in actions_of(3, 200):
        _, rewards, dones, infos = env.step(actions)
        returns += rewards
        for index in np.flatnonzero(dones):
            assert infos[index]["episode"]["r"] == pytest.approx(returns[index], abs=1e-4)
            terms = infos[index]["episode_terms"]
            assert terms.keys() == weights.keys()
            assert infos[index]["episode"]["r"] == pytest.approx(
                sum(weights[name] * value for name, value in terms.items()), abs=2e-6
            )
            ended += 1
        returns[dones] = 0.0
    assert ended > WALKERS


def test_the_core_does_not_normalise_observations_that_terms_look_at() -> None:
    with pytest.raises(ValueError, match="reward terms of one's own"):
        ProsthesisVecNormalize(ProsthesisVecEnv(WALKERS, CONFIG, reward_terms=TERMS))
    env = VecNormalize(ProsthesisVecEnv(WALKERS, CONFIG, reward_terms=TERMS), norm_reward=False)
    plain = ProsthesisVecEnv(WALKERS, CONFIG)
    for each in (env, plain):
        each.seed(5)
        each.reset()
    for actions in actions_of(3, 20):
        env.step(actions)
        np.testing.assert_array_equal(env.get_original_obs(), plain.step(actions)[0])


@pytest.mark.parametrize(
    ("function", "complaint"),
    [
        (lambda channels: channels["knee_angle_rad"][:2], r"'mine' gave shape \(2,\)"),
        (lambda _: 1.0, r"'mine' gave shape \(\)"),
        (lambda channels: channels["knee_angle_rad"].astype(str), r"'mine' gave .* dtype <U"),
        (lambda channels: np.full_like(channels["knee_angle_rad"], np.nan), r"'mine' gave nan for walker 0"),
        (
            lambda channels: channels["true_hip_height_m"],
            r"'mine' reads 'true_hip_height_m', .*: add groups=\['privileged'\] to RewardTerm\('mine'",
        ),
        (lambda channels: channels["motor_current_a"], r"'mine' reads 'motor_current_a', .*: only a motor knee has it"),
        (lambda channels: channels["hip"], r"'mine' reads 'hip', .*: no such channel; here are knee_angle_rad, "),
    ],
)
def test_what_a_term_must_not_give_is_refused_by_its_name(function: Callable[..., Any], complaint: str) -> None:
    envs = ProsthesisVectorEnv(3, CONFIG, reward_terms=[RewardTerm("mine", 1.0, function)])
    envs.reset(seed=0)
    with pytest.raises(ValueError, match=complaint):
        envs.step(np.zeros((3, 1)))


@pytest.mark.parametrize(
    ("terms", "complaint"),
    [
        ([("fall", 1.0, ())], "'fall' is built in"),
        ([("mine", 1.0, ()), ("mine", 2.0, ())], "'mine' is given twice"),
        ([("mine", float("inf"), ())], "weight = inf of reward term 'mine'"),
        ([("", 1.0, ())], "must not be empty"),
        ([("_fall", 1.0, ())], "name = '_fall' of a reward term must not"),
        ([("mine", 1.0, "thigh")], "groups = 'thigh' of reward term 'mine' must be a list"),
        ([("mine", 1.0, ("truth",))], "truth"),
    ],
)
def test_impossible_terms_are_refused(terms: list[tuple[str, float, Sequence[str]]], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        ProsthesisVectorEnv(
            2, reward_terms=[RewardTerm(name, weight, lambda _: np.zeros(2), groups) for name, weight, groups in terms]
        )
