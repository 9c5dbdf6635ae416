"""The examples run as they are, only shorter."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from prosthesis_gym.policy import Normalisation, Policy

EXAMPLES = Path(__file__).parents[1] / "examples"
ARGUMENTS = {
    "train_ppo_cleanrl.py": ["--steps", "100000", "--walkers", "64", "--report-every", "40000"],
    "evaluate.py": ["--episodes", "16"],
    "write_a_controller.py": ["--seconds", "3", "--out", "walk.png"],
}


def run(name: str, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(EXAMPLES / name), *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)


def test_every_example_is_run() -> None:
    assert {path.name for path in EXAMPLES.glob("*.py")} == set(ARGUMENTS)


@pytest.mark.parametrize("name", ARGUMENTS)
def test_help_shows_how_to_call_it(name: str, tmp_path: Path) -> None:
    result = run(name, tmp_path, "--help")
    assert result.returncode == 0, result.stderr
    assert f"python examples/{name}" in result.stdout


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("evaluate.py", ["--episodes", "0"], "episodes = 0 is outside its allowed range"),
        ("evaluate.py", ["--scenario", "nowhere"], "scenario = 'nowhere'"),
        ("evaluate.py", ["--policy", "nothing"], "no policy in nothing"),
        ("evaluate.py", ["--constant", "-1"], "action.constant_nms2_rad2 = -1"),
        ("write_a_controller.py", ["--seconds", "0"], "scenario.duration_s = 0"),
        ("write_a_controller.py", ["--out", "walk.bmp"], "walk.bmp: a figure is saved as .png"),
        ("write_a_controller.py", ["--out", "file/walk.png", "--seconds", "1"], "Not a directory: 'file'"),
        ("train_ppo_cleanrl.py", ["--steps", "0"], "--steps = 0 must be at least 1"),
        ("train_ppo_cleanrl.py", ["--report-every", "0"], "--report-every = 0 must be at least 1"),
        ("train_ppo_cleanrl.py", ["--env", "Ant-v9"], "--env = 'Ant-v9' must be one of prosthesis_gym/DamperKnee-v0"),
        ("train_ppo_cleanrl.py", ["--seed", "-1"], "--seed = -1 must be 0 or more"),
    ],
)
def test_mistakes_end_in_one_line(name: str, arguments: list[str], message: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    result = run(name, tmp_path, *arguments)
    assert result.returncode == 2
    assert message in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def test_ppo_reports_returns_and_falls(tmp_path: Path) -> None:
    result = run("train_ppo_cleanrl.py", tmp_path, *ARGUMENTS["train_ppo_cleanrl.py"])
    assert result.returncode == 0, result.stderr
    reports = re.findall(
        r"([\d,]+) steps.*?([\d.]+)% of ([\d,]+) episodes fell, mean return +(-?[\d.]+)", result.stdout
    )
    numbers = np.array([[float(number.replace(",", "")) for number in report] for report in reports])
    steps, fell, episodes, mean_returns = numbers.T
    assert len(steps) == 2
    assert (np.diff(steps) >= 40_000 - 2048).all()
    assert fell[0] == 100.0
    assert 0.0 < fell[1] < 100.0
    assert (episodes >= 32).all()
    assert np.isfinite(mean_returns).all()


def test_evaluation_compares_state_machine_constant_damping_and_a_policy(tmp_path: Path) -> None:
    weights = np.zeros((8, 1), dtype=np.float32)
    policy = Policy(
        [(weights, np.zeros(1, dtype=np.float32))],
        Normalisation(np.zeros(8), np.ones(8)),
        {"action": {"mode": "residual", "hold": 4}, "observation": {"frames": 1}},
    )
    policy.save(tmp_path / "policy")
    result = run("evaluate.py", tmp_path, *ARGUMENTS["evaluate.py"], "--policy", "policy")
    assert result.returncode == 0, result.stderr
    assert all(name in result.stdout for name in ("state machine", "constant 5", "policy", "fall rate"))


def test_a_controller_of_ones_own_walks_and_is_drawn(tmp_path: Path) -> None:
    arguments = ARGUMENTS["write_a_controller.py"]
    result = run("write_a_controller.py", tmp_path, *arguments)
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith("walking after 3.00 s")
    assert (tmp_path / "walk.png").read_bytes().startswith(b"\x89PNG")
    again = run("write_a_controller.py", tmp_path, *arguments)
    assert again.returncode == 2
    assert "--force overwrites it" in again.stderr
