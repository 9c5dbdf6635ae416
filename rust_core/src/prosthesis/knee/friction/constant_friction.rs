//! Constant-friction knee with extension assist: the commonest low-cost knee, a single axis in an adjustable clamp.
//!
//! Nothing in it acts by gait phase. The clamp resists both directions alike, whatever the speed, a preloaded spring extends
//! the knee in swing, and in stance the knee is held by its alignment alone: extended onto its stop, behind the load line.

use crate::numerics::lanes::lanes;
use crate::numerics::math::{max, select, tanh};
use crate::prosthesis::knee::command::Command;
use crate::prosthesis::knee::joint::{JointMotion, UnitTorque};
use crate::schema::params::{above, params, within};

/// Command of the unit: the clamp's friction torque.
pub const COMMAND: Command = Command { quantity: "friction", unit: "N m", signed: false };

params! {
    /// Mechanical knee with constant friction and extension assist; the command is the clamp's friction torque.
    pub struct ConstantFrictionParams {
        /// Friction torque that the screw of the clamp is set to: what the reference controller commands.
        set_friction_nm: f64 = 5.0, "N m", within(0.0, 1e3);
        /// Friction torque with the screw fully tightened: limit of every command, and that of action +1 in mode `direct`.
        max_friction_nm: f64 = 20.0, "N m", above(0.0, 1e3);
        /// Slope factor of tanh in the friction: it creeps below about 2 / slope, and is constant above.
        friction_slope_s_rad: f64 = 20.0, "s/rad", above(0.0, 1e3);
        /// Viscous friction of axis and bushings.
        viscous_nms_rad: f64 = 0.1, "N m s/rad", within(0.0, 1e3);
        /// Torque of the extension assist at full extension.
        assist_preload_nm: f64 = 3.0, "N m", within(0.0, 1e3);
        /// Its growth with flexion; negative where the spring's lever shrinks as the knee flexes. It never pulls into flexion.
        assist_stiffness_nm_rad: f64 = 2.0, "N m/rad", within(-1e2, 1e3);
    }
}

lanes! {
    /// Knee constants of one walker, SI.
    pub struct ConstantFriction, ConstantFrictionLanes {
        /// Slope of the friction's tanh, s/rad.
        slope: f64,
        /// N m s/rad.
        viscous: f64,
        /// Assist at full extension, N m.
        preload: f64,
        /// Its growth with flexion, N m/rad.
        stiffness: f64,
    }
}

impl From<&ConstantFrictionParams> for ConstantFriction {
    fn from(p: &ConstantFrictionParams) -> Self {
        Self {
            slope: p.friction_slope_s_rad,
            viscous: p.viscous_nms_rad,
            preload: p.assist_preload_nm,
            stiffness: p.assist_stiffness_nm_rad,
        }
    }
}

/// Extending torque (N m) of the assist spring at the given flexion (rad), never negative, and its derivative (N m/rad).
#[inline(always)]
pub fn extension_assist(knee: &ConstantFriction, flexion: f64) -> (f64, f64) {
    let torque = knee.preload + knee.stiffness * flexion;
    (max(torque, 0.0), select(torque > 0.0, knee.stiffness, 0.0))
}

/// Torque of the knee under a friction setting (N m).
#[inline(always)]
pub fn friction_torque(knee: &ConstantFriction, joint: &JointMotion, setting: f64) -> UnitTorque {
    let rate = -joint.flexion_rate;
    let direction = tanh(knee.slope * rate);
    let (assist, stiffness) = extension_assist(knee, joint.flexion);
    UnitTorque {
        damper: -setting * direction,
        torque: assist - setting * direction - knee.viscous * rate,
        damping: setting * knee.slope * (1.0 - direction * direction) + knee.viscous,
        stiffness,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn knee() -> ConstantFriction {
        ConstantFriction::from(&ConstantFrictionParams::default())
    }

    /// Torque at a flexion and a joint rate (extension positive).
    fn at(flexion: f64, rate: f64, setting: f64) -> UnitTorque {
        friction_torque(&knee(), &JointMotion { flexion, flexion_rate: -rate }, setting)
    }

    #[test]
    fn friction_opposes_motion_and_stays_within_its_setting_at_any_speed() {
        for rate in [-9.0, -0.5, -0.01, 0.0, 0.03, 1.0, 12.0] {
            let friction = at(0.4, rate, 3.0).damper;
            assert!(friction * rate <= 0.0 && friction.abs() <= 3.0, "{rate}");
            assert!(rate.abs() < 0.2 || (friction.abs() - 3.0).abs() < 0.01, "{rate}");
        }
    }

    #[test]
    fn the_assist_extends_and_never_flexes() {
        let slack = ConstantFriction { preload: 2.0, stiffness: -2.0, ..knee() };
        for flexion in [-0.05, 0.0, 0.3, 1.0, 1.5] {
            assert!(extension_assist(&knee(), flexion).0 > 0.0);
            assert!(extension_assist(&slack, flexion).0 >= 0.0);
        }
        assert_eq!(extension_assist(&slack, 1.5), (0.0, 0.0));
        assert_eq!(at(0.0, 0.0, 3.0).torque, knee().preload);
    }

    #[test]
    fn damping_and_stiffness_are_the_derivatives_of_the_total() {
        let e = 1e-6;
        for (flexion, rate) in [(0.3, -3.0), (0.7, -0.02), (-0.02, 0.004), (1.1, 0.5)] {
            let exact = at(flexion, rate, 4.0);
            let damping = -(at(flexion, rate + e, 4.0).torque - at(flexion, rate - e, 4.0).torque) / (2.0 * e);
            let stiffness = (at(flexion + e, rate, 4.0).torque - at(flexion - e, rate, 4.0).torque) / (2.0 * e);
            assert!((exact.damping - damping).abs() < 1e-5 * exact.damping, "{flexion} {rate}");
            assert!((exact.stiffness - stiffness).abs() < 1e-6, "{flexion} {rate}");
        }
    }

    #[test]
    fn over_a_closed_cycle_of_flexion_the_knee_only_dissipates() {
        let steps = 10_000;
        let dt = std::f64::consts::TAU / f64::from(steps);
        let work = |setting: f64| -> f64 {
            let power = |i: i32| {
                let phase = f64::from(i) * dt;
                let (flexion, flexion_rate) = (0.5 - 0.5 * phase.cos(), 0.5 * phase.sin());
                at(flexion, -flexion_rate, setting).torque * -flexion_rate
            };
            (0..steps).map(power).sum::<f64>() * dt
        };
        let (loose, tight) = (work(0.0), work(3.0));
        // Two radians of travel per cycle, against friction that is constant but for the turning points.
        assert!(loose < 0.0 && (loose - tight - 3.0 * 2.0).abs() < 0.2, "{loose} {tight}");
    }
}
