"""Evaluation counts each walker once, whatever the batch looks like, and knows how sure it is."""

import dataclasses
import re
from io import StringIO
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from prosthesis_gym import ProsthesisEnv
from prosthesis_gym.config import merge
from prosthesis_gym.evaluation import HELD_OUT_SEED, VALIDATION_SEED, comparison_table, evaluate, wilson_interval
from prosthesis_gym.policy import Normalisation, Policy
from prosthesis_gym.trial import run_trial

SHORT = {
    "scenario": {"duration_s": 5.0, "push_s": [1.0, 3.0], "push_n": [0.0, 600.0]},
    "action": {"mode": "residual", "hold": 4},
}


def make_policy(gain: float = 0.3) -> Policy:
    weights = np.full((8, 1), gain, dtype=np.float32)
    config = {"action": {"mode": "residual", "hold": 4}, "observation": {"frames": 1}}
    return Policy([(weights, np.zeros(1, np.float32))], Normalisation(np.zeros(8), np.ones(8)), config)


@pytest.mark.parametrize(
    ("count", "total", "low", "high"),
    [  # Newcombe (1998), table I, and the limits where the rate is 0 or 1
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
        (20, 20, 0.8389, 1.0),
    ],
)
def test_wilson_interval_has_published_values(count: int, total: int, low: float, high: float) -> None:
    assert wilson_interval(count, total) == pytest.approx((low, high), abs=5e-5)


def test_wilson_interval_refuses_impossible_counts() -> None:
    for count, total in ((-1, 3), (4, 3), (0, 0)):
        with pytest.raises(ValueError, match="count"):
            wilson_interval(count, total)


@pytest.mark.parametrize("controller", [None, make_policy()])
def test_same_seeds_give_the_same_result_whatever_the_threads(controller: Policy | None) -> None:
    results = [evaluate(controller, SHORT, episodes=100, threads=threads) for threads in (1, 1, 2)]
    assert results[0] == results[1] == results[2]
    assert evaluate(controller, SHORT, episodes=100, seed=VALIDATION_SEED) != results[0]


def test_a_batch_is_the_sum_of_its_parts() -> None:
    """Each episode depends on its seed alone, so halves add up to the whole."""
    policy = make_policy()
    whole = evaluate(policy, SHORT, episodes=120)
    halves = [evaluate(policy, SHORT, episodes=60, seed=HELD_OUT_SEED + first) for first in (0, 60)]
    assert 0 < whole.falls < 120
    assert whole.falls == sum(half.falls for half in halves)
    assert whole.mean_return == pytest.approx(sum(half.mean_return for half in halves) / 2, abs=1e-12)
    for part in ("from standing", "from a cyclic step"):
        assert whole.parts[part] == tuple(map(sum, zip(*(half.parts[part] for half in halves), strict=True)))


def test_a_policy_is_evaluated_with_the_knee_it_was_trained_with() -> None:
    policy = dataclasses.replace(make_policy(), device="friction")
    friction = {**SHORT, "device": {"kind": "friction"}}
    assert evaluate(policy, SHORT, episodes=20) == evaluate(policy, friction, episodes=20)
    assert evaluate(policy, SHORT, episodes=20) != evaluate(make_policy(), SHORT, episodes=20)
    with pytest.raises(ValueError, match="contradicts the policy"):
        evaluate(make_policy(), friction, episodes=20)


def test_evaluation_is_the_single_environment_played_seed_by_seed() -> None:
    policy = make_policy()
    result = evaluate(policy, SHORT, episodes=12)
    env = ProsthesisEnv(SHORT)
    returns, falls, energy = [], 0, 0.0
    for episode in range(12):
        observation, _ = env.reset(seed=HELD_OUT_SEED + episode)
        total, done = 0.0, False
        while not done:
            observation, reward, terminated, truncated, info = env.step(policy.act(observation[None]))
            total += reward
            energy += info["reward_energy"]
            done = terminated or truncated
        falls += terminated
        returns.append(total)
    assert result.falls == falls
    assert result.mean_return == pytest.approx(np.mean(returns), abs=1e-12)
    assert result.mean_terms["energy"] == pytest.approx(energy / 12, abs=1e-12)


def test_parts_cover_all_episodes_and_falls() -> None:
    result = evaluate(None, SHORT, episodes=300)
    thirds = [part for name, part in result.parts.items() if "third" in name]
    starts = [part for name, part in result.parts.items() if name.startswith("from")]
    assert [episodes for _, episodes in thirds] == [100, 100, 100]
    for parts in (thirds, starts):
        assert sum(falls for falls, _ in parts) == result.falls
        assert sum(episodes for _, episodes in parts) == 300
    assert thirds[0][0] < thirds[2][0]
    assert result.interval[0] < result.fall_rate < result.interval[1]


def test_thirds_of_pushes_are_counted_where_pushes_differ_alone() -> None:
    for push_n in (0.0, 100.0, {"choice": [0.0, 300.0]}):
        result = evaluate(None, {"scenario": {"duration_s": 2.0, "push_n": push_n}}, episodes=30)
        assert not [name for name in result.parts if "push" in name]
        assert sum(episodes for _, episodes in result.parts.values()) == 30
    steady = evaluate(None, {}, scenario="steady", episodes=8)
    text = StringIO()
    Console(file=text, width=120).print(comparison_table({"state machine": steady}))
    assert "push" not in text.getvalue()


DIVERGING: list[dict[str, Any]] = [
    # Explicit steps that are too long for such a ground, and stops that no walker can compress.
    {"ground": {"damping_ns_m15": 1e7}, "solver": {"stepper": "rk4", "steps": 20}},
    {"end_stop": {"half_compression_torque_nm": 1e4, "thickness_deg": 0.01}},
    {"scenario": {"push_n": [0.0, 1e4], "push_s": [0.0, 1.0], "push_duration_s": [0.1, 5.0]}},
]


def test_a_divergence_is_no_fall_and_in_no_other_count() -> None:
    found = 0
    for config in DIVERGING:
        whole = merge(config, {"scenario": {"duration_s": 2.0}})
        result = evaluate(None, whole, episodes=24)
        envs = ProsthesisEnv(merge(whole, {"action": {"mode": "state_machine"}}))
        reasons = []
        for episode in range(24):
            envs.reset(seed=HELD_OUT_SEED + episode)
            done = False
            while not done:
                _, _, terminated, truncated, _ = envs.step(np.zeros(1, dtype=np.float32))
                done = terminated or truncated
            reasons.append(reason(whole, HELD_OUT_SEED + episode) if terminated else "")
        diverged = reasons.count("non_finite")
        found += diverged
        falls = sum(reasons.count(name) for name in ("hip_height", "joint_limit"))
        assert (result.diverged, result.falls, result.judged) == (diverged, falls, 24 - diverged)
        assert "non_finite" not in result.reasons
        if result.judged:
            assert result.fall_rate == falls / (24 - diverged)
            assert result.interval == wilson_interval(falls, 24 - diverged)
            assert np.isfinite(result.mean_return)
        else:
            assert np.isnan(result.fall_rate)
            assert result.interval == (0.0, 1.0)
        assert result.failure_rate >= (falls + diverged) / 24
        text = StringIO()
        Console(file=text, width=120).print(comparison_table({"state machine": result}))
        assert re.search(rf"diverged, not counted\W+{diverged}\W", text.getvalue())
    assert found > 0


def reason(config: dict[str, Any], seed: int) -> str:
    outcome = run_trial(config, seed=seed, progress=False).outcome
    return "non_finite" if outcome == "diverged" else outcome.removeprefix("fell: ")


def test_constant_damping_is_evaluated_as_such() -> None:
    constant = {**SHORT, "action": {"mode": "constant", "constant_nms2_rad2": 0.0}}
    assert evaluate(None, constant, episodes=64) != evaluate(None, SHORT, episodes=64)


def test_progress_is_reported_up_to_the_end() -> None:
    seen: list[tuple[int, int]] = []
    config = {"scenario": {"duration_s": 1.0, "push_n": 0.0}, "action": {"hold": 4}}
    evaluate(None, config, episodes=5, progress=lambda done, most: seen.append((done, most)))
    assert seen == [(step + 1, 50) for step in range(50)]


def test_impossible_arguments_are_named() -> None:
    with pytest.raises(ValueError, match="episodes = 0"):
        evaluate(None, {}, episodes=0)
    with pytest.raises(ValueError, match="seed = -1"):
        evaluate(None, {}, seed=-1)
    with pytest.raises(ValueError, match="speed"):
        evaluate(None, {"scenario": {"speed": 1.0}})


def test_comparison_table_shows_every_controller_and_part() -> None:
    results = {"reference": evaluate(None, SHORT, episodes=60), "policy": evaluate(make_policy(), SHORT, episodes=60)}
    text = StringIO()
    Console(file=text, width=120).print(comparison_table(results))
    for wanted in (
        "reference",
        "policy",
        "95 % interval",
        "strongest third of pushes",
        "from standing",
        "hip power",
        "energy",
    ):
        assert wanted in text.getvalue()
    assert f"{results['policy'].fall_rate:.1%}" in text.getvalue()
