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
