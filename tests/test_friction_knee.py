"""Measured facts of the friction knee, on the reference solver: which speeds it walks, and at what price.

Nothing is published of this knee in this walker; docs/model.md has the full table. Walks start from standing, intent to
walk from 1 s.
"""

from functools import cache

import numpy as np
import pytest

from prosthesis_gym.config import REFERENCE_SOLVER, apply_settings, merge
from prosthesis_gym.gait import stride_table
from prosthesis_gym.trial import Trial, run_trial


@cache
def walk(speed_m_s: float, *settings: str) -> Trial:
    base = {
        "device": {"kind": "friction"},
        "action": {"mode": "state_machine"},
        "scenario": {"start": "standing", "speed_m_s": speed_m_s, "walk_s": 1.0, "push_n": 0.0, "duration_s": 15.0},
    }
    return run_trial(apply_settings(merge(base, REFERENCE_SOLVER), settings), progress=False)


def hardest_impact_nm(trial: Trial) -> float:
    """Largest torque of the extension stop at the end of the last four swings."""
    return max(stride.late_swing_extension_stop_nm for stride in stride_table(trial)[-4:])


@pytest.mark.parametrize("speed_m_s", [0.9, 1.1, 1.4, 1.6])
def test_as_set_it_walks_at_every_usual_speed_and_slams_the_extension_stop(speed_m_s: float) -> None:
    trial = walk(speed_m_s)
    assert trial.outcome == "walking"
    last = stride_table(trial)[-1]
    assert last.speed_m_s == pytest.approx(speed_m_s, rel=0.02)
    assert 50.0 < last.peak_swing_knee_deg < 65.0
    assert hardest_impact_nm(trial) > 50.0


def test_slow_walking_fails() -> None:
    assert walk(0.6).fell


def test_a_tighter_screw_swings_softly_but_at_one_cadence_only() -> None:
    assert hardest_impact_nm(walk(1.4, "friction_knee.set_friction_nm=8")) < 40.0 < hardest_impact_nm(walk(1.4)) / 2
    assert walk(1.0, "friction_knee.set_friction_nm=8").fell


def test_without_its_extension_assist_it_falls_in_the_first_steps() -> None:
    trial = walk(1.1, "friction_knee.assist_preload_nm=0", "friction_knee.assist_stiffness_nm_rad=0")
    assert trial.fell
    assert trial.end_s < 4.0


def test_friction_is_what_the_command_sets_and_only_takes_energy() -> None:
    trial = walk(1.1)
    assert set(trial["command"][1:]) == {5.0}
    assert set(trial["controller_state"]) == {1.0}
    friction_nm = trial["damper_torque_nm_kg"] * 75.0
    # 0.2 rad/s is beyond the creep of the smooth friction law; flexing is resisted by an extending torque.
    speed_rad_s = np.gradient(np.radians(trial["knee_angle_deg"]), trial["time_s"])
    moves = np.abs(speed_rad_s) > 1.0
    assert np.abs(friction_nm).max() <= 5.0 + 1e-9
    assert np.all(friction_nm[moves] * speed_rad_s[moves] > 0.0)


def test_holding_the_screw_constant_is_the_reference_controller() -> None:
    constant = walk(1.1, "action.mode=constant", "action.constant_nm=5")
    np.testing.assert_array_equal(constant["knee_angle_deg"], walk(1.1)["knee_angle_deg"])
