"""Bodies of other sizes: scaling laws, and the table of which of them walk."""

import csv
from pathlib import Path

import pytest

from prosthesis_gym.bodies import HEIGHT_M, scaled_body
from prosthesis_gym.body_walks import walk_bodies
from prosthesis_gym.cli import main, trial_options
from prosthesis_gym.config import merge, resolve

TABLE_1 = resolve({})
HUMAN_INERTIAS = ("trunk_inertia_kg_m2", "thigh_inertia_kg_m2")
SIZES = [(45.0, 1.5), (60.0, 1.65), (90.0, 1.9), (120.0, 2.0)]


def segment_masses(body: dict[str, float]) -> list[float]:
    return [body[f"{segment}_mass_kg"] for segment in ("trunk", "thigh", "calf", "foot")]


def knee_height(body: dict[str, float]) -> float:
    return body["calf_length_m"] + body["tube_length_m"] + body["foot_height_m"]


def test_the_body_of_table_1_is_scaled_to_itself() -> None:
    assert resolve(scaled_body()) == TABLE_1
    assert resolve(scaled_body(75.0, HEIGHT_M)) == TABLE_1


@pytest.mark.parametrize(("mass", "height"), SIZES)
def test_masses_add_up_and_human_parts_keep_their_proportions(mass: float, height: float) -> None:
    trunk, thigh, calf, foot = segment_masses(resolve(scaled_body(mass, height))["body"])
    assert trunk + thigh + calf + foot == pytest.approx(mass)
    assert trunk / thigh == pytest.approx(62.5 / 9.0)
    assert (calf, foot) == (2.8, 0.7)


@pytest.mark.parametrize(("mass", "height"), SIZES)
def test_lengths_follow_height_and_the_tube_makes_up_for_what_the_prosthesis_does_not(
    mass: float, height: float
) -> None:
    body, table = resolve(scaled_body(mass, height))["body"], TABLE_1["body"]
    scale = height / HEIGHT_M
    for name in ("thigh_length_m", "thigh_com_y_m", "trunk_com_y_m"):
        assert body[name] == pytest.approx(scale * table[name])
    assert knee_height(body) == pytest.approx(scale * knee_height(table))
    assert body["thigh_length_m"] + knee_height(body) == pytest.approx(0.92 * scale)
    changed = {key for key in body if body[key] != table[key]}
    assert all(key.startswith(("trunk_", "thigh_")) or key == "tube_length_m" for key in changed)


@pytest.mark.parametrize(("mass", "height"), SIZES)
def test_inertias_follow_mass_and_height_and_the_ankle_follows_mass(mass: float, height: float) -> None:
    config = resolve(scaled_body(mass, height))
    scale = (mass - 3.5) / 71.5 * (height / HEIGHT_M) ** 2
    for name in HUMAN_INERTIAS:
        assert config["body"][name] == pytest.approx(scale * TABLE_1["body"][name])
    assert config["ankle"]["stiffness_nm_rad"] == pytest.approx(6.0 * mass)
    assert config["human"]["first_stride_m"] == pytest.approx(4.0 / 3.0 * height / HEIGHT_M)
    assert config["termination"]["hip_height_m"] == pytest.approx(0.6 * height / HEIGHT_M)


@pytest.mark.parametrize(
    ("mass", "height", "complaint"),
    [(40.0, 1.7, "mass_kg = 40"), (75.0, 2.1, r"height_m = 2\.1"), (float("nan"), 1.7, "mass")],
)
def test_sizes_out_of_range_are_named(mass: float, height: float, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        scaled_body(mass, height)


def test_the_body_of_table_1_walks_and_the_table_says_how() -> None:
    config = merge(
        trial_options.DEFAULTS, {"scenario": {"duration_s": 8.0}, "solver": trial_options.SOLVERS["fast"]["solver"]}
    )
    (result,) = walk_bodies([75.0], [HEIGHT_M], config)
    assert result.walks
    assert result.speed_m_s == pytest.approx(1.1, abs=0.02)
    assert result.end_s == pytest.approx(8.0)
    slow = merge(config, {"scenario": {"speed_m_s": 0.5, "duration_s": 20.0}})
    (result,) = walk_bodies([75.0], [HEIGHT_M], slow)
    assert result.outcome == "fell: hip_height"
    assert not result.walks


def test_bodies_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bodies.csv"
    command = ["bodies", "--mass", "60", "75", "--height", "1.77", "--duration", "6", "--solver", "fast"]
    assert main([*command, "--out", str(path)]) == 0
    output = capsys.readouterr().out
    assert "of 2 bodies walk for 6 s" in output
    rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
    assert [(row["mass_kg"], row["height_m"]) for row in rows] == [("60.0", "1.77"), ("75.0", "1.77")]
    assert rows[1]["outcome"] == "walking"
    assert main([*command, "--out", str(path)]) == 2
    assert "--force" in capsys.readouterr().err
    assert main([*command, "--out", str(tmp_path / "bodies.txt")]) == 2
    assert main(["bodies", "--mass", "10"]) == 2
    assert "mass_kg = 10" in capsys.readouterr().err


def test_walk_takes_mass_and_height(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["walk", "--mass", "60", "--height", "1.65", "--duration", "2"]) == 0
    assert "after 2.00 s" in capsys.readouterr().out
    assert main(["walk", "--mass", "200", "--duration", "2"]) == 2
    assert "mass_kg = 200" in capsys.readouterr().err
