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

/// Phases of the inner knots of every template (Figure 4).
const QUARTER: f64 = 0.25;
const HALF: f64 = 0.5;
const AFTER_HALF: f64 = 0.51;

/// Rough thigh angle at `time`: the template of the current step, piecewise linear in phase, held after its last knot.
#[inline(always)]
pub fn rough_thigh(drive: &Drive, time: f64) -> f64 {
    let phase = (time - drive.step_start) * drive.inverse_cycle;
    let ramp = |from: f64, to: f64| clamp((phase - from) / (to - from), 0.0, 1.0);
    drive.thigh_0
        + (drive.thigh_1 - drive.thigh_0) * ramp(0.0, QUARTER)
        + (drive.thigh_2 - drive.thigh_1) * ramp(QUARTER, HALF)
        + (drive.thigh_3 - drive.thigh_2) * ramp(HALF, AFTER_HALF)
        + (drive.thigh_4 - drive.thigh_3) * ramp(AFTER_HALF, drive.last_knot)
}

/// Acceleration of a filtered reference (equation 1 with zeta = 1/sqrt 2), mean over an implicit step.
#[inline(always)]
pub fn filter_acceleration(rough: f64, smooth: f64, rate: f64, delay: f64, step: f64) -> f64 {
    let stiffness = 2.0 / (delay * delay);
    let damping = 2.0 / delay;
    (stiffness * (rough - smooth - step * rate) - damping * rate) / (1.0 + step * (damping + step * stiffness))
}
