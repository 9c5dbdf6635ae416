"""The published results of the damper knee, each with its tolerance, on the reference solver.

Driessen, Laffranchi, De Michieli 2023, Wearable Technologies 4, e10, doi:10.1017/wtc.2023.6, whose sections and figures
are cited. Walks start from standing with the intent to walk from 1 s, unless they say otherwise.
"""

import numpy as np
import pytest
from numpy.typing import NDArray
from reference_walks import trial40, walk

from prosthesis_gym.gait import Stride, residual_contact, stride_table, summary
from prosthesis_gym.trial import RESIDUAL, STEP_STOP, Trial

NO_DAMPING = "action.mode=constant"
NO_LIFT = "human.lift_scale=0"
NO_THRUST = "human.thrust_scale=0"


def settled(trial: Trial) -> list[Stride]:
    return stride_table(trial)[-10:]


def mean(strides: list[Stride], measure: str) -> float:
    return summary(strides)[measure]["mean"]


def peak_stop_nm(trial: Trial, begin_s: float, end_s: float) -> float:
    rows = (trial["time_s"] >= begin_s) & (trial["time_s"] < end_s)
    return float(trial["extension_stop_peak_nm"][rows].max())


def scuffs_s(trial: Trial) -> NDArray[np.float64]:
    """Return the times (s) at which the foot touches the ground under a knee flexed as only in swing."""
    times: NDArray[np.float64] = trial["time_s"][residual_contact(trial) & (trial["knee_angle_deg"] > 50.0)]
    return times


# Section 5.2.2, Main results and Figure 8: 1.1 m/s.


def test_walk_converges_to_the_intended_speed() -> None:
    """Target: 1.100 m/s."""
    assert mean(settled(walk()), "speed_m_s") == pytest.approx(1.100, abs=5e-4)


def test_hip_peaks_are_symmetric() -> None:
    """Section 5.2.2, Symmetry. Target: hip peaks 902/900 mm (+-2) in residual and intact stance."""
    strides = settled(walk())
    assert mean(strides, "hip_peak_residual_stance_m") == pytest.approx(0.902, abs=0.002)
    assert mean(strides, "hip_peak_intact_stance_m") == pytest.approx(0.900, abs=0.002)


@pytest.mark.parametrize(
    ("measure", "low", "high"), [("peak_swing_knee_deg", 60, 66), ("peak_stance_knee_deg", 15, 21)]
)
def test_knee_flexes_in_swing_and_bounces_in_stance(measure: str, low: float, high: float) -> None:
    """Figure 8, third plot. Target: peaks of 60 to 66 deg in swing, 15 to 21 deg in stance."""
    assert all(low <= getattr(stride, measure) <= high for stride in settled(walk()))


def test_swing_ends_without_impact_on_the_extension_stop() -> None:
    """Section 5.2.2, Intermediate results. Target: below 20 N m in every stride."""
    assert max(stride.late_swing_extension_stop_nm for stride in stride_table(walk())) < 20.0


def test_stance_loads_the_extension_stop_in_the_first_step_and_at_the_speed_step() -> None:
    """Figure 8. Target: stance loads of up to 125 N m in the first step and at the step to 1.4 m/s alone."""
    trial = trial40()
    assert 100.0 < peak_stop_nm(trial, 1.0, 2.0) <= 125.0
    assert 100.0 < peak_stop_nm(trial, 10.0, 12.0) <= 125.0
    assert max(peak_stop_nm(trial, 2.0, 10.0), peak_stop_nm(trial, 12.0, 40.0)) < 50.0


@pytest.mark.parametrize(("column", "peak_nm_kg"), [("knee_torque_nm_kg", 1.0), ("ankle_torque_nm_kg", 1.5)])
def test_torque_peaks_are_those_of_human_gait(column: str, peak_nm_kg: float) -> None:
    """Section 5.2.2, Main results. Target: about 1 N m/kg at the knee and 1.5 N m/kg at the ankle (+-15 %)."""
    trial = walk()
    rows = trial["time_s"] > stride_table(trial)[0].heel_strike_s
    assert trial[column][rows].max() == pytest.approx(peak_nm_kg, rel=0.15)


# Section 5.2.2, Main results and Figure 8: the 40 s trial.


def test_40_s_trial_is_walked_and_ends_standing() -> None:
    """Figure 8, second plot. Target: no fall, speed tracked within several steps, standing in the end."""
    trial = trial40()
    assert trial.outcome == "standing"
    for until_s, speed_m_s in ((10.0, 1.1), (15.0, 1.4), (20.0, 1.1), (40.0, 0.8)):
        assert trial["ambulation_speed_m_s"][trial["time_s"] < until_s][-1] == pytest.approx(speed_m_s, abs=0.02)


def test_stance_fractions_are_nearly_symmetric() -> None:
    """Section 5.2.2, Symmetry (printed in swapped order). Target: residual 57 %, intact 53 % of the cycle (+-1)."""
    strides = stride_table(trial40())
    assert mean(strides, "residual_stance_percent") == pytest.approx(57.0, abs=1.0)
    assert mean(strides, "intact_stance_percent") == pytest.approx(53.0, abs=1.0)


def test_stopping_raises_the_hip() -> None:
    """Section 4.3, stop lift. Target: about 948 mm (+-4); the paper has 911 mm."""
    trial = trial40()
    stopping = (trial["time_s"] > 40.0) & (trial["human_state"] == STEP_STOP)
    assert trial["hip_y_m"][stopping].max() == pytest.approx(0.948, abs=0.004)


def test_without_lift_the_slow_walker_scuffs_and_falls() -> None:
    """Section 5.2.2, lift force. Target: a scuff at about 33 s, a fall at 33 to 37 s, while slowing down."""
    trial = trial40(NO_LIFT)
    assert trial.outcome == "fell: hip_height"
    assert 33.0 < trial.end_s < 37.0
    assert 32.0 < scuffs_s(trial)[0] < 34.0
    assert not scuffs_s(trial40()).size


def test_without_thrust_the_walker_limps() -> None:
    """Section 5.2.2, Symmetry. Target: no fall before stopping, residual 45 %, intact 65 % (+-2), speed not tracked."""
    trial = trial40(NO_THRUST, "state_machine.stance_damping_nms2_rad2=20")
    assert trial.end_s > 40.0
    strides = stride_table(trial)
    assert mean(strides, "residual_stance_percent") == pytest.approx(45.0, abs=2.0)
    assert mean(strides, "intact_stance_percent") == pytest.approx(65.0, abs=2.0)
    assert max(stride.speed_m_s for stride in strides if 11.0 < stride.heel_strike_s < 14.0) < 1.1  # of 1.4 intended


def test_twice_the_stance_damping_walks_the_trial_too() -> None:
    """Figure 6 prints c = 10, the supplementary material has 20. Target: no fall, standing in the end."""
    assert trial40("state_machine.stance_damping_nms2_rad2=20").outcome == "standing"


def test_printed_knee_spring_falls_at_the_speed_step() -> None:
    """Section 5.2.1 prints 1 N m/rad. Target: a fall at 14.6 s (+-0.2)."""
    trial = trial40("knee.spring_nm_rad=1")
    assert trial.fell
    assert trial.end_s == pytest.approx(14.6, abs=0.2)


@pytest.mark.parametrize("speed_m_s", [0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4])
def test_speed_range_of_steady_walking(speed_m_s: float) -> None:
    """Section 5.2.2, Main results. Target: stable walking for at least 0.8 to 1.4 m/s."""
    trial = walk(f"scenario.speed_m_s={speed_m_s}", duration_s=60.0)
    assert trial.outcome == "walking"
    assert mean(settled(trial), "speed_m_s") == pytest.approx(speed_m_s, abs=0.005)


@pytest.mark.parametrize("speed_m_s", [0.7, 1.5])
def test_speeds_out_of_that_range_fall_from_standing(speed_m_s: float) -> None:
    """Target: a fall."""
    assert walk(f"scenario.speed_m_s={speed_m_s}").fell


# Section 5.2.2, Intermediate results and Figure 7: the steps of tuning, from the cyclic start at 1.1 m/s.

CYCLIC = "scenario.start=cyclic"


def test_end_stops_alone_fall_after_a_few_steps() -> None:
    """Figure 7, top. Target: with no spring, friction or damping, a fall after 2 to 4 steps."""
    bare = ("knee.spring_nm_rad=0", "knee.viscous_nms_rad=0", "knee.dry_friction_nm=0")
    trial = walk(CYCLIC, NO_DAMPING, *bare)
    assert trial.fell
    assert 2 <= trial.strikes_s(RESIDUAL).size <= 4


def test_spring_and_friction_walk_but_hit_the_extension_stop() -> None:
    """Figure 7, bottom left. Target: no fall; more than 100 N m on the extension stop at the end of every swing."""
    trial = walk(CYCLIC, NO_DAMPING)
    assert trial.outcome == "walking"
    assert min(stride.late_swing_extension_stop_nm for stride in stride_table(trial)) > 100.0


def test_soft_stops_of_swing_settle_the_gait_without_impacts() -> None:
    """Figure 7, bottom right. Target: with the swing terms alone, a limit cycle without impacts (below 20 N m)."""
    trial = walk(CYCLIC, "state_machine.stance_damping_nms2_rad2=0")
    assert trial.outcome == "walking"
    assert max(stride.late_swing_extension_stop_nm for stride in stride_table(trial)) < 20.0
    assert np.std([stride.stride_time_s for stride in settled(trial)]) < 0.005
