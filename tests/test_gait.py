"""Gait measures of trials whose answers are known by construction."""

import json

import numpy as np
import pytest

from prosthesis_gym.gait import Stride, steady_strides, stride_json, stride_table, summary
from prosthesis_gym.trial import Trial

PERIOD_S, SPEED_M_S = 1.0, 1.2
STRIKES_S = np.array([0.5, 1.5, 2.5, 3.5])


def synthetic(**changes: np.ndarray) -> Trial:
    """Make three strides of 1 s at 1.2 m/s: residual foot down to 60 %, intact foot from 50 to 10 % of each."""
    time = np.arange(801) * 0.005
    phase = np.mod((time - 0.5) / PERIOD_S, 1.0)
    residual = phase < 0.6
    columns = {
        "time_s": time,
        "intended_speed_m_s": np.full_like(time, SPEED_M_S),
        "human_state": np.full_like(time, 2.0),
        "intact_leg_state": np.select([phase < 0.1, phase < 0.5], [3.0, 1.0], 2.0),
        "heel_force_bw": np.where(residual & (phase < 0.4), 0.8, 0.0),
        "ball_force_bw": np.where(residual & (phase > 0.2), 0.7, 0.0),
        # Peaks of 20 deg at 0.15 and 60 deg at 0.7; in between, at toe-off, 40 deg.
        "knee_angle_deg": np.interp(phase, [0.0, 0.15, 0.4, 0.6, 0.7, 1.0], [5.0, 20.0, 4.0, 40.0, 60.0, 5.0]),
        # Peaks of 0.91 m at 0.3 (intact leg swings) and 0.90 m at 0.8; 0.95 m at 0.55 with both feet on the ground.
        "hip_y_m": np.interp(phase, [0.0, 0.3, 0.5, 0.55, 0.6, 0.8, 1.0], [0.86, 0.91, 0.86, 0.95, 0.86, 0.90, 0.86]),
        "ground_height_m": np.zeros_like(time),
        "extension_stop_peak_nm": np.select(
            [np.abs(phase - 0.4) < 0.02, np.abs(phase - 0.9) < 0.02], [70.0, 12.0], 0.0
        ),
        "thigh_angle_deg": np.zeros_like(time),
    }
    intact = STRIKES_S[:-1] + 0.5
    order = np.argsort(np.concatenate([STRIKES_S, intact]))
    events = {
        "time_s": np.concatenate([STRIKES_S, intact])[order],
        "leg": np.concatenate([np.zeros(4, int), np.ones(3, int)])[order],
        "hip_x_m": SPEED_M_S * np.concatenate([STRIKES_S, intact])[order],
    }
    return Trial(columns | changes, events, "walking", {})


def test_stride_table_in_closed_form() -> None:
    strides = stride_table(synthetic())
    assert [stride.heel_strike_s for stride in strides] == [0.5, 1.5, 2.5]
    for stride in strides:
        assert stride.stride_time_s == pytest.approx(1.0)
        assert stride.stride_length_m == pytest.approx(1.2)
        assert stride.speed_m_s == pytest.approx(1.2)
        # A sample is 0.5 % of the stride.
        assert stride.residual_stance_percent == pytest.approx(60.0, abs=0.5)
        assert stride.intact_stance_percent == pytest.approx(60.0, abs=0.5)
        assert stride.peak_stance_knee_deg == pytest.approx(20.0)
        assert stride.peak_swing_knee_deg == pytest.approx(60.0)
        assert stride.hip_peak_residual_stance_m == pytest.approx(0.91)
        assert stride.hip_peak_intact_stance_m == pytest.approx(0.90)
        assert stride.peak_extension_stop_nm == 70.0
        assert stride.late_swing_extension_stop_nm == 12.0


def test_first_and_last_steps_are_no_strides() -> None:
    time = synthetic()["time_s"]
    state = np.select([time < 1.5, time < 2.5], [1.0, 2.0], 3.0)
    assert [stride.heel_strike_s for stride in stride_table(synthetic(human_state=state))] == [1.5]


def test_stride_without_a_swing_has_no_swing_peak() -> None:
    time = synthetic()["time_s"]
    trial = synthetic(heel_force_bw=np.ones_like(time))
    stride = stride_table(trial)[0]
    assert stride.residual_stance_percent == 100.0
    assert np.isnan(stride.peak_swing_knee_deg)
    assert json.loads(stride_json(trial))["strides"][0]["peak_swing_knee_deg"] is None


def test_trial_without_strides_is_empty_everywhere() -> None:
    trial = synthetic(human_state=np.zeros(801))
    assert stride_table(trial) == []
    assert summary([]) == {}
    assert json.loads(stride_json(trial)) == {"outcome": "walking", "end_s": 4.0, "strides": [], "summary": {}}


def test_summary_and_json_agree_with_the_strides() -> None:
    trial = synthetic()
    content = json.loads(stride_json(trial))
    assert [Stride(**stride) for stride in content["strides"]] == stride_table(trial)
    assert content["summary"]["speed_m_s"]["mean"] == pytest.approx(1.2)
    assert content["summary"]["speed_m_s"]["sd"] == pytest.approx(0.0, abs=1e-12)
    assert "heel_strike_s" not in content["summary"]


def test_hip_height_is_measured_from_the_ground_below() -> None:
    level = synthetic()
    climbing = np.linspace(0.0, 2.0, level["time_s"].size)
    uphill = synthetic(hip_y_m=level["hip_y_m"] + climbing, ground_height_m=climbing)
    for on_level, on_slope in zip(stride_table(level), stride_table(uphill), strict=True):
        assert on_slope.hip_peak_residual_stance_m == pytest.approx(on_level.hip_peak_residual_stance_m)
        assert on_slope.hip_peak_intact_stance_m == pytest.approx(on_level.hip_peak_intact_stance_m)


def test_steady_strides_follow_others_at_the_same_intended_speed() -> None:
    trial = synthetic()
    strides = stride_table(trial)
    assert steady_strides(trial, strides, settling=0) == strides
    assert steady_strides(trial, strides, settling=2) == strides[2:]
    assert steady_strides(trial, strides) == []
    changed = synthetic(intended_speed_m_s=np.where(trial["time_s"] < 2.0, 1.2, 1.3))
    assert steady_strides(changed, strides, settling=0) == [strides[0], strides[2]]
