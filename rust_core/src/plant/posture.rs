//! Postures that trials start in.

use crate::human::params::HumanParams;
use crate::mechanics::body::Body;
use crate::mechanics::motion::Motion;
use crate::numerics::math::sin_cos;

/// Knee flexion when a trial starts from standing.
pub const STANDING_KNEE_DEG: f64 = 3.0;

/// A point of the foot from the ankle, world axes, with the foot at `angle` (rad).
pub(super) fn foot_arm(angle: f64, [x, y]: [f64; 2]) -> [f64; 2] {
    let (sin, cos) = sin_cos(angle);
    [x * cos - y * sin, x * sin + y * cos]
}

/// Posture with the given thigh angle and knee flexion (rad), ankle at rest, hip at the origin.
pub(super) fn posture(body: &Body, thigh: f64, knee_flexion: f64) -> Motion {
    let shank = thigh - knee_flexion;
    Motion { thigh, shank, foot: shank + body.foot_mount, ..Motion::default() }
}

/// Posture at touch-down, which also fixes the pendulum's angle of attack (Figure 2).
pub(super) fn touch_down_posture(body: &Body, human: &HumanParams) -> Motion {
    posture(body, human.thigh_flexion_deg.to_radians(), human.touch_down_knee_deg.to_radians())
}
