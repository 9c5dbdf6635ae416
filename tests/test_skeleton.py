"""Where a recording says that the parts of the walker are, and the forces on its sole."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from prosthesis_gym import _core
from prosthesis_gym.config import merge
from prosthesis_gym.trial import INTACT_BOTH, INTACT_STANCE, INTACT_SWING, Trial, run_trial

WALK: dict[str, Any] = {
    "action": {"mode": "state_machine"},
    "scenario": {"start": "cyclic", "speed_m_s": 1.1, "push_n": 0.0, "duration_s": 4.0},
}
# The second goes through the general chain: forward trunk, curved sole of five points; the third over uneven ground.
CONFIGS: list[dict[str, Any]] = [
    {},
    {"mechanism": {"trunk": "forward"}, "body": {"sole_points": 5, "sole_radius_m": 0.3, "trunk_top_m": 0.55}},
    {"ground": {"slope_deg": -2.0}},
]
RANDOM = {"ground.slope_deg": [-2.0, 2.0], "body.trunk_top_m": [0.4, 0.7]}
POWERS = {"rotor_power_w", "electrical_power_w", "joule_power_w", "gear_power_w"}


def point(trial: Trial, name: str) -> NDArray[np.float64]:
    return np.stack([trial[f"{name}_{axis}_m"] for axis in "xy"], axis=-1)


def turned(x: float, y: float, angle_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    sin, cos = np.sin(np.radians(angle_deg)), np.cos(np.radians(angle_deg))
    return np.stack([x * cos - y * sin, x * sin + y * cos], axis=-1)


@pytest.mark.parametrize("config", CONFIGS, ids=["usual", "general", "slope"])
def test_points_lie_at_the_ends_of_segments_with_the_recorded_angles(config: dict[str, Any]) -> None:
    trial = run_trial(merge(WALK, config))
    body = trial.config["body"]
    hip, knee, ankle = (point(trial, name) for name in ("hip", "knee", "ankle"))
    thigh = trial["thigh_angle_deg"]
    shank = thigh - trial["knee_angle_deg"]
    foot = shank - trial["ankle_angle_deg"]
    below_knee = body["calf_length_m"] + body["tube_length_m"]
    np.testing.assert_allclose(knee - hip, turned(0.0, -body["thigh_length_m"], thigh), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(ankle - knee, turned(0.0, -below_knee, shank), rtol=0.0, atol=1e-12)
    for end in ("heel", "ball"):
        expected = turned(body[f"{end}_x_m"], -body["foot_height_m"], foot)
        np.testing.assert_allclose(point(trial, end) - ankle, expected, rtol=0.0, atol=1e-12)
    trunk = turned(0.0, body["trunk_top_m"], trial["trunk_angle_deg"])
    np.testing.assert_allclose(point(trial, "trunk_top") - hip, trunk, rtol=0.0, atol=1e-12)
    assert np.ptp(trial["hip_x_m"]) > 3.0


def test_a_compliant_socket_moves_the_knee_off_the_thigh_by_no_more_than_it_gives_way() -> None:
    trial = run_trial(merge(WALK, {"socket": {"connection": "compliant"}}))
    body = trial.config["body"]
    rigid = point(trial, "hip") + turned(0.0, -body["thigh_length_m"], trial["thigh_angle_deg"])
    off = np.hypot(*(point(trial, "knee") - rigid).T)
    tilted = body["thigh_length_m"] * np.abs(trial["socket_tilt_rad"])
    assert (off <= np.abs(trial["socket_displacement_m"]) + tilted + 1e-9).all()
    assert off.max() > 0.003


def test_sole_forces_across_the_slope_are_the_recorded_normal_forces() -> None:
    trial = run_trial(merge(WALK, {"ground": {"slope_deg": -2.0}}))
    sin, cos = np.sin(np.radians(-2.0)), np.cos(np.radians(-2.0))
    for end in ("heel", "ball"):
        forward, up = trial[f"{end}_force_forward_bw"], trial[f"{end}_force_up_bw"]
        np.testing.assert_allclose(cos * up - sin * forward, trial[f"{end}_force_bw"], atol=1e-12)
        assert forward.min() < -0.01 or forward.max() > 0.01
    # Braking at the heel strike, propulsion at push-off.
    assert trial["heel_force_forward_bw"].min() < -0.1
    assert trial["ball_force_forward_bw"].max() > 0.1


def test_the_swinging_intact_leg_waits_where_it_touches_down() -> None:
    trial = run_trial(WALK)
    state = trial["intact_leg_state"]
    waits = np.isin(state, (INTACT_SWING, INTACT_BOTH))
    np.testing.assert_array_equal(np.isfinite(trial["touch_down_foot_x_m"]), waits)
    np.testing.assert_array_equal(np.isfinite(trial["pendulum_foot_x_m"]), ~waits)
    touch_downs = np.flatnonzero((state[:-1] == INTACT_SWING) & (state[1:] == INTACT_STANCE))
    assert len(touch_downs) >= 3
    for before in touch_downs:
        travel_m = 0.005 * 2.0
        assert abs(trial["pendulum_foot_x_m"][before + 1] - trial["touch_down_foot_x_m"][before]) < travel_m
        assert abs(trial["pendulum_foot_y_m"][before + 1] - trial["touch_down_foot_y_m"][before]) < travel_m


@pytest.mark.parametrize("config", [*CONFIGS, {"scenario": {"randomise": RANDOM}}])
def test_a_snapshot_is_the_row_that_a_recorder_would_append_less_the_powers(config: dict[str, Any]) -> None:
    batch = _core.Batch(9, merge(WALK, config))
    batch.record(4)
    batch.reset(np.arange(9, dtype=np.uint64))
    for _ in range(150):
        batch.step(np.zeros(9))
    row = {name: column[-1] for name, column in batch.recording().items()}
    snapshot = batch.snapshot(4)
    assert list(snapshot) == list(row)
    assert {name for name, value in snapshot.items() if not np.array_equal(value, row[name], equal_nan=True)} == POWERS
    assert snapshot["ground_height_m"] == batch.ground_height(4, np.array([snapshot["hip_x_m"]]))[0]
    with pytest.raises(ValueError, match=r"index = 9 .*\[0, 8\]"):
        batch.snapshot(9)


def test_every_walker_has_the_body_and_the_ground_that_its_episode_drew() -> None:
    batch = _core.Batch(12, merge(WALK, {"scenario": {"randomise": RANDOM}}))
    batch.reset(np.arange(12, dtype=np.uint64))
    for _ in range(40):
        batch.step(np.zeros(12))
    rows = [batch.snapshot(index) for index in range(12)]
    trunks = [np.hypot(row["trunk_top_x_m"] - row["hip_x_m"], row["trunk_top_y_m"] - row["hip_y_m"]) for row in rows]
    slopes = [np.degrees(np.arctan(batch.ground_height(index, np.array([1.0]))[0])) for index in range(12)]
    assert all(0.4 <= trunk <= 0.7 for trunk in trunks)
    assert all(-2.0 <= slope <= 2.0 for slope in slopes)
    assert np.ptp(trunks) > 0.1
    assert np.ptp(slopes) > 1.0


def test_ground_heights_follow_the_configured_profile() -> None:
    x = np.linspace(-3.0, 9.0, 121)
    assert (_core.Batch(1, {}).ground_height(0, x) == 0.0).all()
    slope = _core.Batch(1, {"ground": {"slope_deg": 4.0}}).ground_height(0, x)
    np.testing.assert_allclose(slope, x * np.tan(np.radians(4.0)), atol=1e-12)
    stairs = {"stair_rise_m": 0.15, "stair_run_m": 0.3, "stair_start_x_m": 2.0, "stair_count": 4}
    heights = _core.Batch(10, {"ground": stairs}).ground_height(9, np.array([1.9, 2.15, 2.45, 8.0]))
    np.testing.assert_allclose(heights, [0.0, 0.15, 0.3, 0.6], atol=1e-12)
    with pytest.raises(ValueError, match=r"index = 10 .*\[0, 9\]"):
        _core.Batch(10, {}).ground_height(10, x)
