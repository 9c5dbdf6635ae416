"""The fast solver against the converged reference, and how both are compared."""

import csv
from pathlib import Path

import pytest

from prosthesis_gym.accuracy import CONVERGED, EPISODES, falls, gait_errors
from prosthesis_gym.cli import main
from prosthesis_gym.config import FAST_SOLVER, REFERENCE_SOLVER

#: Allowed errors of kinematics, and of loads and mean powers, %.
KINEMATICS, LOADS = 0.5, 2.0


@pytest.mark.parametrize("device", ["damper", "motor"])
@pytest.mark.parametrize("speed_m_s", [0.9, 1.1, 1.3])
def test_default_solver_walks_like_the_reference(device: str, speed_m_s: float) -> None:
    """Kinematics within 0.5 %, peaks of tube force and extension stop and mean powers within 2 %."""
    errors = list(gait_errors(FAST_SOLVER, [device], [speed_m_s]))
    assert len(errors) == (10 if device == "damper" else 13)
    for error in errors:
        limit = LOADS if error.measure.endswith(("_w", "_bw", "_nm")) else KINEMATICS
        assert abs(error.error_percent) < limit, (error.measure, error.reference, error.found)


def test_default_solver_falls_in_the_same_disturbed_episodes_as_the_reference() -> None:
    """At least 99 % of 512 episodes within the speeds that are walked undisturbed."""
    reference, found = (falls({**EPISODES["walkable"], **solver}, 512) for solver in (REFERENCE_SOLVER, FAST_SOLVER))
    assert 0.01 < reference.mean() < 0.3
    assert (reference == found).mean() >= 0.99


def test_reference_has_no_error_against_itself() -> None:
    assert all(error.error_percent == 0.0 for error in gait_errors(CONVERGED, ["damper"], [1.1]))


def test_command_prints_and_saves_every_measure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "errors.csv"
    solver = ["--solver", "linearly_implicit_euler:5"]
    assert (
        main(["accuracy", *solver, "--devices", "damper", "--speeds", "1.1", "--episodes", "4", "--out", str(out)]) == 0
    )
    printed = capsys.readouterr().out
    assert "linearly_implicit_euler:5" in printed
    assert "agrees in" in printed.replace("\n", " ") or "agrees" in printed
    with out.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["measure"] for row in rows} >= {"stride_time_s", "peak_tube_force_bw", "knee_power_w"}
    assert all(row["measure"] in printed for row in rows if row["measure"].startswith("peak_"))


@pytest.mark.parametrize("solver", ["rk4:", "rk4:x", "rk4:5", "euler:5"])
def test_impossible_solver_is_an_error(solver: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["accuracy", "--solver", solver]) == 2
    assert capsys.readouterr().err.startswith("prosthesis-gym: error: ")
