"""Scenarios: presets, files that hold them, and what environments, commands and evaluations make of them."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from prosthesis_gym import SCENARIOS, ProsthesisEnv, _core
from prosthesis_gym.bodies import scaled_body
from prosthesis_gym.cli import main
from prosthesis_gym.config import merge, resolve
from prosthesis_gym.evaluation import evaluate
from prosthesis_gym.sb3 import ProsthesisVecEnv
from prosthesis_gym.scenarios import load_scenario, scenario_description
from prosthesis_gym.trial import run_trial

USER_SCENARIO = Path(__file__).parents[1] / "configs" / "scenario" / "icy_morning.toml"
KNOTS = [{"time_s": 0.0, "speed_m_s": 1.2, "walk": False}, {"time_s": 0.5, "speed_m_s": 1.2, "walk": True}]
#: Scenarios whose episodes are all the same.
FIXED = ("start_stop", "steady", "trial40")


def drawn(name: str, count: int = 64) -> dict[str, Any]:
    batch = _core.Batch(count, load_scenario(name), "disabled", 1)
    batch.reset(np.arange(count, dtype=np.uint64))
    return batch.episodes()


@pytest.mark.parametrize("name", SCENARIOS)
def test_presets_begin_with_what_they_are_for(name: str) -> None:
    description = scenario_description(name)
    assert description.endswith(".")
    assert 40 < len(description) < 200


@pytest.mark.parametrize("name", SCENARIOS)
def test_presets_are_walked_by_most_and_none_but_the_fixed_ones_repeats(name: str) -> None:
    result = evaluate(None, load_scenario(name), episodes=64)
    assert result.fall_rate < 0.35
    others = evaluate(None, load_scenario(name), episodes=64, seed=7)
    assert (result.mean_terms == others.mean_terms) == (name in FIXED)


@pytest.mark.parametrize("name", FIXED)
def test_fixed_presets_end_as_they_say(name: str) -> None:
    trial = run_trial(merge({"action": {"mode": "state_machine"}}, load_scenario(name)), progress=False)
    assert trial.outcome == ("walking" if name == "steady" else "standing")


def test_trial40_is_that_of_the_paper() -> None:
    knots = load_scenario("trial40")["scenario"]["profile"]
    time_s, speed_m_s = ([knot[name] for knot in knots] for name in ("time_s", "speed_m_s"))
    assert np.interp([5.0, 12.0, 17.0, 22.5, 25.0, 30.0, 37.0], time_s, speed_m_s) == pytest.approx(
        [1.1, 1.4, 1.1, 1.25, 1.4, 1.1, 0.8]
    )
    assert [(knot["time_s"], knot["walk"]) for knot in knots if knot["time_s"] in (0.0, 1.0, 35.0, 40.0)] == [
        (0.0, False),
        (1.0, True),
        (35.0, True),
        (40.0, False),
    ]


@pytest.mark.parametrize("name", ["rough_ground", "slopes", "sensor_faults", "everything"])
def test_every_randomised_parameter_differs_between_episodes(name: str) -> None:
    episodes = drawn(name)
    randomised = load_scenario(name)["scenario"]["randomise"]
    assert randomised
    for key, distribution in randomised.items():
        low, high = next(iter(distribution.values())) if isinstance(distribution, dict) else distribution
        assert ((episodes[key] >= low) & (episodes[key] <= high)).all(), key
        assert len(set(episodes[key])) > 1, key


def test_body_sizes_are_scaled_bodies_and_most_of_them_are_met() -> None:
    variants = load_scenario("body_sizes")["scenario"]["variants"]
    assert scaled_body(45, 1.5) in variants
    assert scaled_body(120, 1.95) in variants
    assert len(set(drawn("body_sizes", 512)["variant"])) == len(variants) == 60


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.csv", "time_s,speed_m_s,walk\n0,1.2,0\n0.5,1.2,1\n"),
        ("b.csv", "walk, time_s, speed_m_s\nfalse, 0, 1.2\nTRUE, 0.5, 1.2\n"),
        (
            "c.toml",
            "profile = [{time_s = 0.0, speed_m_s = 1.2, walk = false}, {time_s = 0.5, speed_m_s = 1.2, walk = true}]",
        ),
    ],
)
def test_a_profile_alone_is_an_undisturbed_walk_from_standing(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    scenario = {"start": "standing", "push_n": 0.0, "profile": KNOTS, "duration_s": 5.5}
    assert load_scenario(tmp_path / name) == {"scenario": scenario}


def test_a_file_may_hold_any_section_of_what_is_met(tmp_path: Path) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text(
        '[scenario]\nstart = "cyclic"\npush_n = 50.0\nduration_s = 7.0\n'
        "profile = [{time_s = 0.0, speed_m_s = 1.2, walk = true}]\n[ground]\nslope_deg = 1.0\n"
    )
    config = load_scenario(path)
    assert config["scenario"].items() >= {"start": "cyclic", "push_n": 50.0, "duration_s": 7.0}.items()
    assert config["ground"] == {"slope_deg": 1.0}


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "time_s,speed\n0,1\n", "columns are"),
        ("b.csv", "time_s,speed_m_s,walk\n0,1.1,1\n1,fast,1\n", "line 3: speed_m_s = 'fast'"),
        ("c.csv", "time_s,speed_m_s,walk\n0,1.1,maybe\n", "line 2: walk = 'maybe'"),
        ("d.csv", "time_s,speed_m_s,walk\n", "is not a list of"),
        ("e.csv", "time_s,speed_m_s,walk\n0,1.1\n", "walk = None"),
        ("f.toml", "profile = ", r"f\.toml: "),
        ("g.toml", "profiles = []", "profiles"),
        ("h.toml", "[scenario]\nduration_s = -3.0", r"h\.toml: scenario\.duration_s = -3"),
        ("i.toml", "profile = [{speed_m_s = 1.1, walk = true}]", "no number time_s"),
        ("j.txt", "", "neither one of"),
        ("k.toml", "[reward]\nfall = 1.0", "section 'reward' is not a scenario's"),
        ("l.toml", "[bodies]\nmass_kg = [60]", "must be a table of mass_kg and height_m"),
        ("m.toml", "[bodies]\nmass_kg = [60]\nheight_m = []", r"bodies\.height_m = \[\]"),
        ("n.toml", "[bodies]\nmass_kg = [600]\nheight_m = [1.8]", "mass_kg = 600 is outside"),
        ("o.toml", "[bodies]\nmass_kg = [60]\nheight_m = [1.8]\n[scenario]\nvariants = []", "exclude each other"),
        ("p.toml", '[scenario.randomise]\n"ground.slope" = [0, 1]', r"ground\.slope"),
    ],
)
def test_bad_files_are_explained(tmp_path: Path, name: str, text: str, message: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=message):
        load_scenario(tmp_path / name)


def test_unknown_scenario_lists_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"trial41.*pushes, rough_ground, .*, steady, trial40"):
        load_scenario("trial41")


@pytest.mark.parametrize("scenario", ["pushes", USER_SCENARIO])
def test_environments_take_a_scenario_and_the_configuration_overrides_it(env_id: str, scenario: str | Path) -> None:
    whole = resolve(merge(load_scenario(scenario), {"scenario": {"duration_s": 3.0}}))
    config = {"scenario": {"duration_s": 3.0}}
    device = gymnasium.spec(env_id).kwargs["device"]
    made: list[Any] = [
        gymnasium.make(env_id, scenario=scenario, config=config).unwrapped,
        gymnasium.make_vec(env_id, 2, scenario=scenario, config=config),
        ProsthesisVecEnv(2, merge(config, {"device": {"kind": device}}), scenario=scenario).envs,
    ]
    for env in made:
        assert env.config["scenario"] == whole["scenario"]
        assert env.config["ankle"] == whole["ankle"]
        assert env.config["device"]["kind"] == device


def test_a_distribution_of_the_configuration_replaces_another_kind_of_the_scenario() -> None:
    config = {"scenario": {"randomise": {"ground.roughness_length_m": {"choice": [1.0, 2.0]}}}}
    env = ProsthesisEnv(config, scenario="rough_ground")
    randomised = env.config["scenario"]["randomise"]
    assert randomised["ground.roughness_length_m"] == {"choice": [1.0, 2.0]}
    assert randomised["ground.roughness_m"] == [0.0, 0.008]


def test_evaluation_of_a_scenario_is_that_of_its_configuration() -> None:
    ours = evaluate(None, {"device": {"kind": "motor"}}, scenario="pushes", episodes=16)
    assert ours == evaluate(None, merge(load_scenario("pushes"), {"device": {"kind": "motor"}}), episodes=16)
    assert ours != evaluate(None, {"device": {"kind": "motor"}}, episodes=16)


def test_scenarios_command_lists_and_measures_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenarios"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in SCENARIOS)
    assert main(["scenarios", "steady", "gusts", "--episodes", "16", "--device", "friction"]) == 0
    measured = capsys.readouterr().out
    falls = evaluate(None, {"device": {"kind": "friction"}}, scenario="gusts", episodes=16).falls
    assert falls > 0
    assert f"{falls / 16:.1%}" in measured
    assert "friction" in measured
    assert "everything" not in measured
    assert main(["scenarios", "nowhere"]) == 2
    assert "nowhere" in capsys.readouterr().err
