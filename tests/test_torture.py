"""The torture finds no fault in the walkers, and would find one."""

from typing import Any

import numpy as np
import pytest

from prosthesis_gym import ProsthesisVectorEnv, _core
from prosthesis_gym.cli import main
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.torture import GROUNDS, SCENARIOS, SENSOR_FAULTS, adversaries, find_violations, torture


def test_walkers_bear_it() -> None:
    called: list[int] = []
    report = torture(150_000, walkers=64, progress=called.append)
    assert report.violations == {}
    assert report.env_steps == called[-1] >= 150_000
    assert len(called) == report.rounds
    for ends in report.ends.values():
        assert ends["time_limit"] > 0
        assert sum(ends.values()) > 64
    assert any(ends["hip_height"] > 0 for ends in report.ends.values())


def test_the_same_seed_tortures_in_the_same_way() -> None:
    first, again, other = (torture(40_000, walkers=64, seed=seed).ends for seed in (1, 1, 2))
    assert first == again != other


def test_adversaries_watch_the_leg() -> None:
    channels = [channel[0] for channel in _core.channels({})]
    observations = np.zeros((26, len(channels)), dtype=np.float32)
    observations[13:, channels.index("tube_force_bw")] = 1.0
    actions = adversaries(observations, 0, channels, np.random.default_rng(0))
    assert actions.shape == (26, 1)
    changed = actions[:13, 0] != actions[13:, 0]
    # White noise, and the two that toggle with stance and swing.
    assert changed.sum() == 3
    watching = changed & (np.abs(actions[:13, 0]) == 1.0)
    np.testing.assert_array_equal(actions[:13, 0][watching], -actions[13:, 0][watching])


@pytest.mark.parametrize("conditions", [SENSOR_FAULTS, GROUNDS, SCENARIOS])
@pytest.mark.parametrize("device", DEVICES)
def test_every_condition_is_a_possible_configuration(device: str, conditions: dict[str, Any]) -> None:
    for config in conditions.values():
        ProsthesisVectorEnv(1, config, device=device)


#: What to look for -> parts of a step's outcome, and a value that spoils them.
FAULTS: dict[str, tuple[list[int], float]] = {
    "observations are not finite": ([0], np.nan),
    "observations leave their space": ([0], 1e6),
    "rewards are not finite": ([1], np.inf),
    "terminated and truncated at once": ([2, 3], True),
    "an end without a reason, or the reverse": ([2], True),
    "a time limit that does not truncate, or the reverse": ([3], True),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_found(fault: str) -> None:
    envs = ProsthesisVectorEnv(4)
    envs.reset(seed=0)
    outcome: Any = envs.step(np.zeros((4, 1)))
    assert find_violations(envs, outcome) == []
    parts, value = FAULTS[fault]
    for part in parts:
        outcome[part][1] = value
    assert fault in find_violations(envs, outcome)


def test_a_fault_in_the_terms_is_found() -> None:
    envs = ProsthesisVectorEnv(4)
    envs.reset(seed=0)
    outcome = envs.step(np.zeros((4, 1)))
    outcome[4]["reward_energy"][2] = np.nan
    assert find_violations(envs, outcome) == ["reward terms are not finite"]


def test_the_command_says_what_it_did(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["torture", "--steps", "20000", "--walkers", "64"]) == 0
    printed = capsys.readouterr().out
    assert "38,400 env steps in 2 rounds" in printed
    assert "no violations" in printed


def test_the_command_fails_where_something_was_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("prosthesis_gym.torture.MEMORY_NOISE_MIB", -1e6)
    with pytest.raises(SystemExit, match="resident memory grows"):
        main(["torture", "--steps", "60000", "--walkers", "64"])


@pytest.mark.parametrize("arguments", [["--steps", "0"], ["--seed", "-1"], ["--walkers", "0"], ["--threads", "5000"]])
def test_impossible_arguments_are_named(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["torture", *arguments]) == 2
    assert arguments[0].strip("-") in capsys.readouterr().err
