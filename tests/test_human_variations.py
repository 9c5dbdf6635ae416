"""Variations of the human (sections 4.3 and 6 of the paper): each does what its name says, all at once or none."""

import re
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.config import REFERENCE_SOLVER, apply_settings, merge, resolve
from prosthesis_gym.gait import residual_contact, stride_table, summary
from prosthesis_gym.scenarios import load_scenario
from prosthesis_gym.trial import INTACT, RESIDUAL, Trial, run_trial

BASE = MappingProxyType(
    {
        "action": {"mode": "state_machine"},
        "scenario": {"start": "standing", "speed_m_s": 1.1, "walk_s": 1.0, "push_n": 0.0},
    }
)
PAPER = resolve({})["scenario"]["human"]
VARIED = load_scenario("human_variations")["scenario"]["human"]


@cache
def walk(*settings: str, duration_s: float = 20.0) -> Trial:
    """Walk at 1.1 m/s; settings are of the section `scenario.human`."""
    config = apply_settings(BASE, [f"scenario.human.{setting}" for setting in settings])
    return run_trial(config, duration_s=duration_s, progress=False)


def measure(name: str, *settings: str) -> float:
    """Mean of a gait measure over the last strides of a walk that must not end early."""
    trial = walk(*settings)
    assert trial.outcome == "walking"
    return summary(stride_table(trial)[-8:])[name]["mean"]


def rising(values: list[float], least: float) -> bool:
    """Whether each value lies above the one before it by `least` or more."""
    return bool((np.diff(values) >= least).all())


def test_hip_lift_raises_the_hip_over_the_intact_leg_alone() -> None:
    """Section 4.3: lifting the hip of the residual leg. Target: 12 mm (+-3) per 10 mm of lift."""
    lifts = ["hip_lift_m=0", "hip_lift_m=0.01", "hip_lift_m=0.02", "hip_lift_m=0.03"]
    heights = [measure("hip_peak_intact_stance_m", lift) for lift in lifts]
    assert np.diff(heights) == pytest.approx(0.012, abs=0.003)
    others = [measure("hip_peak_residual_stance_m", lift) for lift in lifts]
    assert others == pytest.approx([others[0]] * 4, abs=0.003)


def toe_clearance_m(trial: Trial) -> float:
    """Height of the ball in the middle third of the last swing at its lowest."""
    rows = np.flatnonzero(~residual_contact(trial) & (trial["time_s"] < stride_table(trial)[-1].heel_strike_s))
    swing = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)[-1]
    return float(trial["ball_height_m"][swing][len(swing) // 3 : 2 * len(swing) // 3].min())


def test_swing_flexion_steps_over_an_obstacle() -> None:
    """Section 6: a deviating hip trajectory. Target: the thigh by what is asked (+-20 %), the toe by 20 mm each."""
    settings = ["swing_flexion_deg=0", "swing_flexion_deg=10", "swing_flexion_deg=20", "swing_flexion_deg=30"]
    flexion = [float(walk(setting)["thigh_angle_deg"].max()) for setting in settings]
    assert np.diff(flexion) == pytest.approx(10.0, rel=0.2)
    assert rising([toe_clearance_m(walk(setting)) for setting in settings], least=0.02)


def test_template_changes_are_those_of_the_human_s_parameter() -> None:
    changed = walk("thigh_extension_change_deg=4", duration_s=5.0)
    config = merge(BASE, {"human": {"thigh_extension_deg": -6.0}})
    set_so = run_trial(config, duration_s=5.0, progress=False)
    np.testing.assert_array_equal(changed["hip_x_m"], set_so["hip_x_m"])


def test_later_swing_lengthens_residual_stance() -> None:
    settings = [f"swing_start_change={change}" for change in (-0.08, -0.04, 0.0, 0.04)]
    assert rising([measure("residual_stance_percent", setting) for setting in settings], least=1.0)


ASYMMETRIES = [f"stance_asymmetry={share}" for share in (-0.1, -0.05, 0.0, 0.05, 0.1, 0.2, 0.3)]


def test_stance_asymmetry_moves_stance_from_the_residual_to_the_intact_leg() -> None:
    """From 59/52 % through the paper's near symmetry to the limp of 46/60 %, at the intended speed."""
    residual = [measure("residual_stance_percent", setting) for setting in ASYMMETRIES]
    intact = [measure("intact_stance_percent", setting) for setting in ASYMMETRIES]
    assert rising([-percent for percent in residual], least=0.5)
    assert rising(intact, least=0.5)
    assert [residual[0], residual[-1]] == pytest.approx([58.7, 46.2], abs=1.0)
    assert [intact[0], intact[-1]] == pytest.approx([52.3, 60.5], abs=1.0)
    assert [measure("speed_m_s", setting) for setting in ASYMMETRIES] == pytest.approx([1.1] * 7, abs=0.005)


def first_strike_s(leg: int, *settings: str) -> float:
    """Time of a leg's first foot strike with the reference solver, which locates it."""
    config = merge(apply_settings(BASE, settings), REFERENCE_SOLVER)
    return float(run_trial(config, duration_s=3.0, progress=False).strikes_s(leg)[0])


@pytest.mark.parametrize(("leg", "parameter"), [(INTACT, "touch_down_delay_s"), (RESIDUAL, "step_delay_s")])
@pytest.mark.parametrize("delay_s", [0.02, 0.0333])
def test_reactions_come_later_by_their_delay(leg: int, parameter: str, delay_s: float) -> None:
    delayed_s = first_strike_s(leg, f"scenario.human.{parameter}={delay_s}")
    assert delayed_s - first_strike_s(leg) == pytest.approx(delay_s, abs=1e-9)


def test_delays_lengthen_the_step() -> None:
    for parameter in ("step_delay_s", "touch_down_delay_s"):
        settings = [f"{parameter}={delay_s}" for delay_s in (0.0, 0.02, 0.04)]
        assert rising([measure("stride_length_m", setting) for setting in settings], least=0.01)


def test_a_stiffer_pendulum_raises_the_hip() -> None:
    settings = [f"pendulum_stiffness_factor={factor}" for factor in (0.9, 1.0, 1.5, 2.0)]
    assert rising([measure("hip_peak_intact_stance_m", setting) for setting in settings], least=0.001)


def test_slower_adaptation_of_the_thrust_keeps_a_wrong_speed_for_longer() -> None:
    """The initial K_thrust is right for 1.1 m/s; at 0.8 m/s it is too large, and 0 never corrects it."""
    slow = {"scenario": {"speed_m_s": 0.8}}
    speeds = []
    for factor in (0.0, 0.25, 1.0):
        scenario = {"scenario": {"human": {"thrust_adaptation_factor": factor}}}
        trial = run_trial(merge(merge(BASE, slow), scenario), duration_s=20.0, progress=False)
        speeds.append(summary(stride_table(trial)[-8:])["speed_m_s"]["mean"])
    assert rising(speeds[::-1], least=0.01)
    assert speeds[-1] == pytest.approx(0.8, abs=0.01)


def observations(config: dict[str, Any], seeds: NDArray[np.uint64], steps: int = 400) -> NDArray[np.float32]:
    """Observations of every step, (steps, N, size), under the state machine."""
    batch = _core.Batch(len(seeds), merge({"action": {"mode": "state_machine"}}, config), "same_step", 2)
    batch.reset(seeds)
    return np.array([batch.step(np.zeros(len(seeds))).observations for _ in range(steps)])


SEEDS = np.arange(24, dtype=np.uint64)


def test_variations_that_change_nothing_are_the_paper_exactly() -> None:
    unchanged = {"scenario": {"human": {name: [value, value] for name, value in PAPER.items()}}}
    np.testing.assert_array_equal(observations(unchanged, SEEDS), observations({}, SEEDS))


def test_every_variation_changes_the_walk() -> None:
    assert set(VARIED) | {"standing_damping_factor"} == set(PAPER)
    for name, bounds in VARIED.items():
        changed = observations({"scenario": {"human": {name: bounds[1]}}}, SEEDS[:8], steps=300)
        if name == "hip_limit_factor":
            continue  # Torques of undisturbed walking stay below their limit.
        assert (changed != observations({}, SEEDS[:8], steps=300)).any(), name


def test_variations_are_drawn_anew_for_every_episode_and_belong_to_the_seed() -> None:
    batch = _core.Batch(24, {"scenario": {"human": VARIED}}, "same_step", 1)
    batch.reset(SEEDS)
    first = batch.episodes()
    batch.reset()
    second = batch.episodes()
    batch.reset(SEEDS)
    again = batch.episodes()
    for name, (low, high) in VARIED.items():
        assert ((first[name] >= low) & (first[name] <= high)).all(), name
        assert len(set(first[name]) | set(second[name])) == 48, name
        np.testing.assert_array_equal(first[name], again[name])
        assert np.ptp(first[name]) > 0.5 * (high - low), name
    drawn = np.array([first[name] for name in VARIED])
    assert np.abs(np.corrcoef(drawn) - np.eye(len(VARIED))).max() < 0.8


def test_variations_shift_no_other_draw() -> None:
    plain, varied = (_core.Batch(24, config, "same_step", 1) for config in ({}, {"scenario": {"human": VARIED}}))
    plain.reset(SEEDS), varied.reset(SEEDS)
    for name in ("start", "first_speed_m_s", "last_speed_m_s", "push_n", "push_s"):
        np.testing.assert_array_equal(plain.episodes()[name], varied.episodes()[name])


def test_a_drawn_human_walks_like_one_that_is_configured_so() -> None:
    batch = _core.Batch(3, {"scenario": {"human": VARIED}}, "same_step", 1)
    batch.reset(SEEDS[:3])
    drawn = {name: float(batch.episodes()[name][2]) for name in VARIED}
    together = observations({"scenario": {"human": VARIED}}, SEEDS[:3])
    alone = observations({"scenario": {"human": drawn}}, SEEDS[2:3])
    np.testing.assert_array_equal(together[:, 2], alone[:, 0])


def test_varied_walkers_do_not_depend_on_their_batch() -> None:
    config = {"scenario": {"human": VARIED}}
    together = observations(config, SEEDS)
    for index in (0, 7, 13, 23):
        np.testing.assert_array_equal(together[:, index], observations(config, SEEDS[index : index + 1])[:, 0])


@pytest.mark.parametrize(
    ("config", "complaint"),
    [
        (
            {"scenario": {"human": {"hip_lift_m": [0.0, 0.5]}}},
            "scenario.human.hip_lift_m = 0.5 is outside its allowed range [0, 0.1] m",
        ),
        (
            {"scenario": {"human": {"step_delay_s": [0.2, 0.1]}}},
            "scenario.human.step_delay_s = [0.2, 0.1] is outside its allowed range [low, high]",
        ),
        (
            {"scenario": {"human": {"thigh_extension_change_deg": [0.0, 15.0]}}, "human": {"thigh_extension_deg": 0.0}},
            "human (varied by scenario.human).thigh_extension_deg = 15 is outside its allowed range [-40, 5] deg",
        ),
        ({"scenario": {"human": {"limp": 1.0}}}, "scenario.human.limp: unknown field"),
    ],
)
def test_impossible_variations_are_named(config: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValueError, match=re.escape(complaint)):
        resolve(config)
