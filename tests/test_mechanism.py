"""Walkers with other joints than the paper's eight, or other ones driven: socket, trunk, hip, tube, sole.

The socket's targets are those of section 5.2.3 of Driessen, Laffranchi, De Michieli 2023, Wearable Technologies 4, e10,
doi:10.1017/wtc.2023.6, on the reference solver.
"""

import numpy as np
import pytest
import reference_walks
from reference_walks import BASE, trial40

from prosthesis_gym.config import apply_settings, resolve
from prosthesis_gym.gait import stride_table, summary
from prosthesis_gym.trial import STAND, Trial

SOCKET = "socket.connection=compliant"
STIFF_STANCE = "state_machine.stance_damping_nms2_rad2=20"


def walk(*settings: str, duration_s: float = 10.0) -> Trial:
    return reference_walks.walk(*settings, duration_s=duration_s)


def last_stride(trial: Trial) -> dict[str, float]:
    return {name: entry["mean"] for name, entry in summary(stride_table(trial)[-1:]).items()}


def test_40_s_trial_is_walked_on_a_compliant_socket() -> None:
    """Section 5.2.3: the model did not fall for the full duration of the 40 s trial."""
    trial = trial40(SOCKET)
    assert not trial.fell
    assert trial["hip_x_m"][-1] > 40.0


def test_walker_on_a_compliant_socket_stops_with_more_stance_damping() -> None:
    """Target: with c = 20 the stop completes."""
    trial = trial40(SOCKET, STIFF_STANCE)
    assert trial.outcome == "standing"
    assert trial["human_state"][-1] == STAND


def test_socket_lowers_the_peaks_of_the_tube_force() -> None:
    """Section 5.2.3: visibly smoother, peaks reduced by up to 20 %. Target: 10 to 20 % lower in the first 8 s."""

    def peak(trial: Trial) -> float:
        return float(trial["tube_force_bw"][trial["time_s"] <= 8.0].max())

    assert 0.80 <= peak(trial40(SOCKET)) / peak(trial40()) <= 0.90


def test_socket_of_half_the_stiffness_ends_in_a_fall_after_the_speed_step() -> None:
    """Section 5.2.3: a fall around 11 s, after the step to 1.4 m/s at 10 s. Target: at 11 to 14 s."""
    trial = trial40(SOCKET, "socket.pistoning_m=0.02", "socket.tilt_rad=0.02")
    assert trial.fell
    assert 11.0 <= trial.end_s <= 14.0


def test_standing_presses_the_stump_into_the_socket_by_the_weight_it_carries() -> None:
    """k_5 = m g / 1 cm: the displacement in cm is the force in body weights."""
    trial = walk(SOCKET, "scenario.walk_s=100")
    still = trial["time_s"] > 8.0
    force = trial["socket_force_bw"][still]
    assert 0.2 < force.min() < force.max() < 0.6
    assert trial["socket_displacement_m"][still] == pytest.approx(0.01 * force, rel=1e-3)
    moment = trial["socket_moment_nm_kg"][still]
    assert trial["socket_tilt_rad"][still] == pytest.approx(0.01 * moment / 0.5, rel=1e-2, abs=1e-6)


def test_rigid_socket_has_no_motion_and_no_reading() -> None:
    trial = walk()
    for column in ("socket_displacement_m", "socket_tilt_rad", "socket_force_bw", "socket_moment_nm_kg"):
        assert not trial[column].any()


@pytest.mark.parametrize("settings", [("mechanism.trunk=forward",), ("mechanism.hip=inverse",), (SOCKET,)])
@pytest.mark.parametrize("device", ["damper", "motor"])
def test_every_choice_of_joints_walks_at_the_intended_speed(settings: tuple[str, ...], device: str) -> None:
    trial = walk(*settings, f"device.kind={device}", duration_s=15.0)
    assert trial.outcome == "walking"
    assert last_stride(trial)["speed_m_s"] == pytest.approx(1.1, abs=0.02)


def test_inverse_joints_move_exactly_like_their_reference_and_forward_ones_about_it() -> None:
    hip_inverse = walk("mechanism.hip=inverse")
    assert np.abs(hip_inverse["thigh_angle_deg"] - hip_inverse["thigh_reference_deg"]).max() < 1e-6
    assert np.array_equal(hip_inverse["trunk_angle_deg"], hip_inverse["trunk_reference_deg"])
    both_forward = walk("mechanism.trunk=forward")
    assert 0.5 < np.abs(both_forward["thigh_angle_deg"] - both_forward["thigh_reference_deg"]).max() < 15.0
    trunk_error_deg = np.abs(both_forward["trunk_angle_deg"] - both_forward["trunk_reference_deg"])
    assert 0.1 < trunk_error_deg.max() < 15.0


def test_trunk_torque_of_a_forward_trunk_stays_within_its_limit() -> None:
    trial = walk("mechanism.trunk=forward")
    assert np.abs(trial["trunk_torque_nm_kg"]).max() <= 5.0 + 1e-12


def test_stiffer_tube_converges_to_the_rigid_one() -> None:
    """Footnote 1 of section 3.1: tube joints as stiff spring-dampers. Knee angle beyond the first heel strike."""
    rigid = walk(duration_s=3.0)["knee_angle_deg"]

    def error(stiffness_n_m: float) -> float:
        bending = f"tube.bending_stiffness_nm_rad={0.01 * stiffness_n_m}"
        tube = ("tube.connection=compliant", f"tube.stiffness_n_m={stiffness_n_m}", bending, "solver.steps=100")
        return float(np.abs(walk(*tube, duration_s=3.0)["knee_angle_deg"] - rigid).max())

    errors = [error(stiffness) for stiffness in (1e5, 1e6, 1e7)]
    assert errors[0] > 4 * errors[1] > 16 * errors[2]
    assert errors[2] < 0.2


def test_tube_force_of_a_stiff_tube_is_that_of_the_rigid_one() -> None:
    tube = ("tube.connection=compliant", "tube.stiffness_n_m=1e7", "tube.bending_stiffness_nm_rad=1e5")
    stiff = walk(*tube, "solver.steps=100")
    rigid = walk()
    loaded = (rigid["time_s"] < 1.9) & (rigid["tube_force_bw"] > 0.3)
    assert stiff["tube_force_bw"][loaded] == pytest.approx(rigid["tube_force_bw"][loaded], abs=0.01)


def load_off_the_ends(trial: Trial) -> float:
    """Return the largest load (body weights) on the sole while neither heel nor ball touches the ground."""
    off = (trial["heel_height_m"] > 0.0) & (trial["ball_height_m"] > 0.0)
    return float((trial["heel_force_bw"] + trial["ball_force_bw"])[off].max())


def test_curved_sole_rolls_over_points_between_heel_and_ball() -> None:
    curved = ("body.sole_points=7", "body.sole_radius_m=0.3")
    trial = walk(*curved, duration_s=15.0)
    assert trial.outcome == "walking"
    # The arc's middle lies 13 mm below heel and ball: it can carry the foot alone.
    assert load_off_the_ends(trial) > 0.3
    assert load_off_the_ends(walk(duration_s=15.0)) == 0.0


def test_sole_is_as_stiff_with_many_points_as_with_two() -> None:
    """Standing still, the weight sinks a straight sole of 9 points as deep as one of 2 (K z^1.5 shared equally)."""
    standing = "scenario.walk_s=100"
    two, nine = walk(standing), walk(standing, "body.sole_points=9")
    assert nine["hip_y_m"][-1] == pytest.approx(two["hip_y_m"][-1], abs=2e-3)


def test_radius_that_no_arc_through_heel_and_ball_can_have_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"body\.sole_radius_m = 0\.05"):
        resolve({"body": {"sole_points": 5, "sole_radius_m": 0.05}})


@pytest.mark.parametrize(
    "settings", [("tube.connection=compliant", "tube.stiffness_n_m=1e8"), (SOCKET, "socket.damping_ratio=2")]
)
def test_step_that_stiff_dampers_make_unstable_is_an_error(settings: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match=r"solver\.steps = 50 must be at least"):
        resolve(apply_settings(BASE, settings))


@pytest.mark.parametrize("key", ["socket.connection", "tube.connection", "mechanism.trunk"])
def test_unknown_choice_is_an_error_that_names_the_key(key: str) -> None:
    section, name = key.split(".")
    with pytest.raises(ValueError, match=key.replace(".", r"\.")):
        resolve({section: {name: "elastic"}})
