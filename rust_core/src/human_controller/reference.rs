//! References of trunk and hip: rough templates, smoothed by a second-order filter (section 4.1, equation 1).

use crate::human_controller::Drive;
use crate::lanes::{integrable, lanes};
use crate::math::clamp;

lanes! {
    /// Smooth references: state of the filter of equation 1.
    pub struct Reference, ReferenceLanes {
        /// Trunk angle q_3r, rad.
        trunk: f64,
        /// Its rate, rad/s.
        trunk_rate: f64,
        /// Hip angle relative to the trunk q_4r, rad.
        hip: f64,
        /// Its rate, rad/s.
        hip_rate: f64,
    }
}
integrable!(ReferenceLanes { trunk, trunk_rate, hip, hip_rate });

/// Phase at which the thigh reaches its extension in Figure 4.
pub const EXTENSION_END: f64 = 0.25;
/// Phase at which it swings forward in Figure 4.
pub const SWING_START: f64 = 0.5;
/// The thigh's reference swings forward within this share of the cycle (Figure 4).
const SWING_RAMP: f64 = 0.01;
/// Phases between which further flexion in swing fades: the filter's delay later the thigh is back for heel strike.
const RETURN: [f64; 2] = [0.7, 0.85];

/// Rough thigh angle at `time`: the template of the current step, piecewise linear in phase, held after its last knot.
#[inline(always)]
pub fn rough_thigh(drive: &Drive, time: f64) -> f64 {
    let phase = (time - drive.step_start) * drive.inverse_cycle;
    let ramp = |from: f64, to: f64| clamp((phase - from) / (to - from), 0.0, 1.0);
    let swings = drive.swing_start + SWING_RAMP;
    let swing = ramp(drive.swing_start, swings);
    drive.thigh_0
        + (drive.thigh_1 - drive.thigh_0) * ramp(0.0, drive.extension_end)
        + (drive.thigh_2 - drive.thigh_1) * ramp(drive.extension_end, drive.swing_start)
        + (drive.thigh_3 - drive.thigh_2) * swing
        + (drive.thigh_4 - drive.thigh_3) * ramp(swings, drive.last_knot)
        + drive.swing_flexion * (swing - ramp(RETURN[0], RETURN[1]))
}

/// Acceleration of a filtered reference (equation 1 with zeta = 1/sqrt 2), mean over an implicit step.
#[inline(always)]
pub fn filter_acceleration(rough: f64, smooth: f64, rate: f64, delay: f64, step: f64) -> f64 {
    let stiffness = 2.0 / (delay * delay);
    let damping = 2.0 / delay;
    (stiffness * (rough - smooth - step * rate) - damping * rate) / (1.0 + step * (damping + step * stiffness))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::human_controller::gait_fsm::{Memory, ResidualState};
    use crate::human_controller::variation::HumanVariation;
    use crate::human_controller::{Human, HumanParams, Individual};

    /// Rough thigh angle (deg) at `phase` of a cyclic step of the given variation.
    fn thigh(variation: HumanVariation, phase: f64) -> f64 {
        let memory = Memory { residual: ResidualState::StepCycle, cycle: 2.0, step_start: 3.0, ..Memory::default() };
        let drive = memory.drive(&Human::default(), &Individual::new(&HumanParams::default(), variation));
        rough_thigh(&drive, 3.0 + 2.0 * phase).to_degrees()
    }

    fn assert_knots(variation: HumanVariation, knots: &[(f64, f64)]) {
        for &(phase, angle) in knots {
            let rough = thigh(variation, phase);
            assert!((rough - angle).abs() < 1e-9, "{rough} at {phase}, not {angle}");
        }
    }

    #[test]
    fn the_cyclic_template_is_that_of_figure_4() {
        let knots = [(0.0, 25.0), (0.125, 7.5), (0.25, -10.0), (0.5, -10.0), (0.51, 25.0), (1.0, 25.0), (1.2, 25.0)];
        assert_knots(HumanVariation::default(), &knots);
    }

    #[test]
    fn further_flexion_in_swing_is_gone_before_heel_strike() {
        let variation = HumanVariation { swing_flexion_deg: 20.0, ..HumanVariation::default() };
        let knots = [(0.25, -10.0), (0.5, -10.0), (0.51, 45.0), (0.7, 45.0), (0.775, 35.0), (0.85, 25.0), (1.0, 25.0)];
        assert_knots(variation, &knots);
    }

    #[test]
    fn asymmetry_shortens_the_stance_part_of_the_template() {
        let variation = HumanVariation { stance_asymmetry: 0.2, ..HumanVariation::default() };
        assert_knots(variation, &[(0.1, 7.5), (0.2, -10.0), (0.4, -10.0), (0.41, 25.0), (1.0, 25.0)]);
        let variation = HumanVariation { swing_start_change: 0.05, ..HumanVariation::default() };
        assert_knots(variation, &[(0.25, -10.0), (0.55, -10.0), (0.56, 25.0), (1.0, 25.0)]);
    }

    #[test]
    fn changes_of_the_angles_move_the_knots() {
        let variation = HumanVariation {
            thigh_flexion_change_deg: 3.0,
            thigh_extension_change_deg: -2.0,
            ..HumanVariation::default()
        };
        assert_knots(variation, &[(0.0, 28.0), (0.25, -12.0), (0.5, -12.0), (0.51, 28.0)]);
    }
}
