//! References of trunk and hip: rough templates, smoothed by a second-order filter (section 4.1, equation 1).

use crate::human::drive::Drive;
use crate::numerics::lanes::{integrable, lanes};
use crate::numerics::math::{FusedSum, clamp};

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
    let ramp = |from: f64, pace: f64| clamp((phase - from) * pace, 0.0, 1.0);
    let swing = ramp(drive.swing_start, 1.0 / SWING_RAMP);
    drive
        .thigh_0
        .plus(drive.thigh_1 - drive.thigh_0, ramp(0.0, drive.extension_pace))
        .plus(drive.thigh_2 - drive.thigh_1, ramp(drive.extension_end, drive.hold_pace))
        .plus(drive.thigh_3 - drive.thigh_2, swing)
        .plus(drive.thigh_4 - drive.thigh_3, ramp(drive.swing_start + SWING_RAMP, drive.last_pace))
        .plus(drive.swing_flexion, swing - ramp(RETURN[0], 1.0 / (RETURN[1] - RETURN[0])))
}

impl Drive {
    /// Sets the phases of the template's knots: extended, swinging forward, last.
    pub(super) fn set_knots(&mut self, extension_end: f64, swing_start: f64, last_knot: f64) {
        self.extension_end = extension_end;
        self.swing_start = swing_start;
        self.extension_pace = 1.0 / extension_end;
        self.hold_pace = 1.0 / (swing_start - extension_end);
        self.last_pace = 1.0 / (last_knot - (swing_start + SWING_RAMP));
    }

    /// Sets the filter's delay t_d (s).
    pub(super) fn set_filter_delay(&mut self, delay: f64) {
        (self.filter_stiffness, self.filter_damping) = (2.0 / (delay * delay), 2.0 / delay);
    }
}

/// The filter of equation 1 with zeta = 1/sqrt 2 over an implicit step.
#[derive(Clone, Copy, Debug)]
pub struct Filter {
    stiffness: f64,
    damping: f64,
    step: f64,
    inverse: f64,
}

impl Filter {
    /// The present filter of a walker.
    #[inline(always)]
    pub fn new(drive: &Drive, step: f64) -> Self {
        let (stiffness, damping) = (drive.filter_stiffness, drive.filter_damping);
        Self { stiffness, damping, step, inverse: 1.0 / 1.0_f64.plus(step, damping.plus(step, stiffness)) }
    }

    /// Acceleration of a filtered reference, mean over the step.
    #[inline(always)]
    pub fn acceleration(&self, rough: f64, smooth: f64, rate: f64) -> f64 {
        (self.stiffness * (rough - smooth).minus(self.step, rate)).minus(self.damping, rate) * self.inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::human::gait_fsm::{Memory, ResidualState};
    use crate::human::geometry::Human;
    use crate::human::params::HumanParams;
    use crate::human::variation::HumanVariation;
    use crate::human::variation::Individual;

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
