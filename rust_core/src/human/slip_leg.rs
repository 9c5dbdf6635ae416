//! Intact leg: spring-loaded inverted pendulum with thrust and lift on the trunk (sections 4.2 and 4.3).

use crate::human::drive::Drive;
use crate::human::geometry::Human;
use crate::numerics::lanes::lanes;
use crate::numerics::math::{FusedSum, angle_of_half_tangent, clamp, cos_up_to_quarter_turn, select};

lanes! {
    /// Force of the human's intact leg on the trunk.
    pub struct TrunkForce, TrunkForceLanes {
        /// Forward, N.
        x: f64,
        /// Up, N.
        y: f64,
        /// Force along the pendulum F_p, N, positive in compression; 0 while it swings.
        pendulum: f64,
    }
}

/// Force on the trunk for a hip at (x, y) moving with (vx, vy) at `time`.
///
/// F_p carries the sign that resists compression (the paper prints the opposite).
#[inline(always)]
pub fn trunk_force(human: &Human, drive: &Drive, x: f64, y: f64, vx: f64, vy: f64, time: f64) -> TrunkForce {
    let (dx, dy) = (x - drive.slip_foot_x, y - drive.slip_foot_y);
    let length = (dx * dx).plus(dy, dy).sqrt();
    let inverse = 1.0 / length;
    let (sine, cosine) = (dx * inverse, dy * inverse);
    let length_rate = (sine * vx).plus(cosine, vy);
    let pendulum = (drive.slip_stiffness * (human.leg_length - length)).minus(drive.slip_damping, length_rate);

    let angle = angle_of_half_tangent(dx / (length + dy));
    let bump = cos_up_to_quarter_turn(angle * human.lift_phase);
    let fade = clamp(2.0_f64.minus(time - drive.touch_down, drive.fade_rate), 0.0, 1.0);
    let lift = select(angle.abs() < human.touch_down_angle, drive.lift.plus(drive.stop_lift, fade) * bump, 0.0);
    TrunkForce {
        x: drive.thrust.plus(pendulum, sine).minus(drive.brake, vx),
        y: (drive.support + lift).plus(pendulum, cosine),
        pendulum,
    }
}

/// Stiffness k_p and damping c_p of the pendulum for an expected stride time (section 4.2, with the factor 4 that the print
/// lacks, and the user's own factor on the stiffness).
pub fn stiffness_and_damping(mass: f64, stride_time: f64, damping_ratio: f64, factor: f64) -> (f64, f64) {
    let period = 0.25 * stride_time * (1.0 - damping_ratio * damping_ratio).sqrt();
    let stiffness = factor * mass * (2.0 * std::f64::consts::PI / period).powi(2);
    (stiffness, 2.0 * damping_ratio * (stiffness * mass).sqrt())
}
