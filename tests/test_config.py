"""The schema: errors name the key, the value and what is allowed."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from prosthesis_gym import _core
from prosthesis_gym.config import Config, apply_settings, load_config, merge, resolve
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.vector_env import ProsthesisVectorEnv


@pytest.mark.parametrize(
    ("config", "complaint"),
    [
        ({"knee": {"sprin_nm_rad": 1.0}}, "knee.sprin_nm_rad: unknown field"),
        ({"reward": {"style": 1.0}}, "reward.style: unknown field `style`, expected one of `alive`"),
        ({"knees": {}}, "knees: unknown field"),
        ({"body": {"thigh_mass_kg": -1.0}}, "body.thigh_mass_kg = -1 is outside its allowed range (0, 100] kg"),
        ({"body": {"thigh_mass_kg": float("nan")}}, "body.thigh_mass_kg = NaN is outside"),
        ({"body": {"trunk_mass_kg": float("inf")}}, "body.trunk_mass_kg = inf is outside"),
        ({"ground": {"friction": 0.0}}, "ground.friction = 0 is outside its allowed range (0, 10]"),
        ({"ground": {"damping_ns_m15": 0.0}}, "ground.damping_ns_m15 = 0 is outside its allowed range (0, "),
        ({"ground": {"slope_deg": 45.0}}, "ground.slope_deg = 45 is outside its allowed range [-30, 30] deg"),
        ({"ground": {"stair_rise_m": 0.1, "edge_m": 0.5}}, "ground.edge_m = 0.5 must not be longer than"),
        ({"scenario": {"speed_m_s": [1.5, 0.8]}}, "scenario.speed_m_s = [1.5, 0.8] is outside"),
        ({"scenario": {"speed_m_s": [0.8, 9.0]}}, "scenario.speed_m_s = 9 is outside"),
        ({"scenario": {"profile": [{"time_s": 0.0, "speed_m_s": 1.0}]}}, "scenario.profile[0]: missing field `walk`"),
        ({"action": {"mode": "torque"}}, "action.mode = 'torque' must be direct | residual"),
        ({"action": {"hold": 0}}, "action.hold = 0 is outside its allowed range [1, 200] samples"),
        ({"solver": {"stepper": "rk4", "steps": 5}}, "solver.steps = 5 is outside its allowed range [20, "),
        ({"end_stop": {"extension_angle_deg": 59.0, "flexion_angle_deg": 60.0}}, "end_stop.flexion_angle_deg = 60"),
        (
            {"sensors": {"tube_force": {"drop_out": 1.5}}},
            "sensors.tube_force.drop_out = 1.5 is outside its allowed range",
        ),
        (
            {"sensors": {"shank_rate": {"noise": -1.0}}},
            "sensors.shank_rate.noise = -1 is outside its allowed range [0, ",
        ),
        ({"sensors": {"shank_rate": {"delay_s": 1.0}}}, "sensors.shank_rate.delay_s: unknown field"),
        ({"device": {"kind": "piston"}}, "device.kind = 'piston' must be damper | motor | friction"),
        (
            {"friction_knee": {"set_friction_nm": -1.0}},
            "friction_knee.set_friction_nm = -1 is outside its allowed range [0, 1000] N m",
        ),
        ({"body": {"ball_x_m": -0.1}}, "body.ball_x_m = -0.1 must lie ahead"),
        ({"ground": {"friction": True}}, "ground.friction = true must be a number in (0, 10]"),
        ({"ground": {"friction": np.True_}}, "ground.friction = true must be a number"),
        ({"action": {"hold": True}}, "action.hold = true must be a number in [1, 200] samples"),
        ({"scenario": {"speed_m_s": [True, 1.2]}}, "scenario.speed_m_s: expected a number, [low, high], or one of"),
        (
            {"scenario": {"profile": [{"time_s": False, "speed_m_s": 1.0, "walk": True}]}},
            "scenario.profile[0].time_s = false must be a number",
        ),
    ],
)
def test_bad_configurations_are_named(config: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValueError, match=re.escape(complaint)):
        resolve(config)


def test_numbers_of_numpy_and_flags_of_the_schema_are_taken() -> None:
    config = resolve(
        {
            "ground": {"friction": np.float32(0.5)},
            "action": {"hold": np.int64(2)},
            "state_machine": {"recovery": False},
            "scenario": {"profile": [{"time_s": 0.0, "speed_m_s": 1.0, "walk": True}]},
        }
    )
    assert (config["ground"]["friction"], config["action"]["hold"]) == (0.5, 2)
    assert config["state_machine"]["recovery"] is False


def dotted_keys(section: Config) -> Iterator[str]:
    """Keys of all values in a nested configuration."""
    for key, value in section.items():
        if isinstance(value, dict) and value:
            yield from (f"{key}.{rest}" for rest in dotted_keys(value))
        else:
            yield key


def test_python_knows_the_knee_units_of_the_core() -> None:
    ranges = {row["key"]: row["range"] for row in _core.parameters()}
    assert ranges["device.kind"].split(" | ") == list(DEVICES)
    for device in DEVICES.values():
        assert f"action.{device.constant_key}" in ranges
        assert device.full_key is None or f"action.{device.full_key}" in ranges


def test_the_parameter_table_is_the_schema() -> None:
    """Every row's key exists in the resolved configuration, and every key of that has a row."""
    assert set(dotted_keys(resolve({}))) == {row["key"] for row in _core.parameters()}
    assert all(row["doc"] for row in _core.parameters())


def test_resolving_twice_changes_nothing() -> None:
    once = resolve({"knee": {"spring_nm_rad": 1.0}, "scenario": {"speed_m_s": [0.9, 1.1], "push_n": 5.0}})
    assert once["knee"]["spring_nm_rad"] == 1.0
    assert resolve(once) == once


def test_settings_are_read_as_toml_and_do_not_touch_their_base() -> None:
    base = {"knee": {"spring_nm_rad": 2.0}}
    settings = ["knee.spring_nm_rad=1.5", "scenario.speed_m_s=[0.9, 1.2]", "action.mode=residual"]
    changed = apply_settings(base, [*settings, "state_machine.recovery=false"])
    assert changed == {
        "knee": {"spring_nm_rad": 1.5},
        "scenario": {"speed_m_s": [0.9, 1.2]},
        "action": {"mode": "residual"},
        "state_machine": {"recovery": False},
    }
    assert base == {"knee": {"spring_nm_rad": 2.0}}
    for bad in ("knee.spring_nm_rad", "=1", "knee.=1"):
        with pytest.raises(ValueError, match=r"section\.key=value"):
            apply_settings({}, [bad])


def test_merge_replaces_values_and_keeps_the_rest() -> None:
    merged = merge({"a": {"x": 1, "y": 2}, "b": {"z": 3}}, {"a": {"y": 5}, "c": {"w": 1}})
    assert merged == {"a": {"x": 1, "y": 5}, "b": {"z": 3}, "c": {"w": 1}}


def test_files_are_checked_when_they_are_read(tmp_path: Path) -> None:
    good = tmp_path / "good.toml"
    good.write_text("[knee]\nspring_nm_rad = 1.0\n")
    assert load_config(good) == {"knee": {"spring_nm_rad": 1.0}}
    broken = tmp_path / "broken.toml"
    broken.write_text("[knee\n")
    with pytest.raises(ValueError, match=r"broken\.toml"):
        load_config(broken)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ((0, {}), "num_envs = 0 is outside"),
        ((1, {}, "later"), 'autoreset = "later"'),
        ((1, {}, "disabled", 100_000), "threads = 100000 is outside"),
    ],
)
def test_bad_batch_arguments_are_named(arguments: tuple[Any, ...], complaint: str) -> None:
    with pytest.raises(ValueError, match=re.escape(complaint)):
        _core.Batch(*arguments)


def test_a_negative_number_of_environments_is_named() -> None:
    with pytest.raises(ValueError, match=re.escape("num_envs = -3 is outside its allowed range [1, 16777216]")):
        ProsthesisVectorEnv(-3)


@pytest.mark.parametrize("value", ["no", "off", "false", 2.5, None, "", [], 1])
def test_flags_are_true_or_false_and_nothing_else(value: object) -> None:
    for config in (
        {"state_machine": {"recovery": value}},
        {"scenario": {"profile": [{"time_s": 0.0, "speed_m_s": 1.0, "walk": value}]}},
    ):
        with pytest.raises(ValueError, match=r"(recovery|walk) = .* must be true or false"):
            resolve(config)


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"action": {"hold": -1}}, r"action\.hold = -1 must be a number in \[1, 200\]"),
        ({"action": {"hold": 2.5}}, r"action\.hold = 2\.5 must be"),
        ({"solver": {"steps": -1}}, r"solver\.steps = -1 must be"),
        ({"knee": {"spring_nm_rad": "abc"}}, r"knee\.spring_nm_rad = 'abc' must be a number in .* N m/rad"),
        ({"knee": {"spring_nm_rad": None}}, r"knee\.spring_nm_rad = None must be a number"),
    ],
)
def test_values_of_a_wrong_type_are_named_with_what_is_allowed(config: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        resolve(config)
