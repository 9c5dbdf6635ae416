//! Variable-damping knee: a perfect quadratic damper beside spring, viscous and dry friction (section 5.2.1).

use crate::numerics::lanes::lanes;
use crate::numerics::math::{FusedSum, tanh};
use crate::prosthesis::knee::command::Command;
use crate::prosthesis::knee::joint::{JointMotion, UnitTorque};
use crate::schema::params::{params, within};

/// Command of the unit: a damping coefficient.
pub const COMMAND: Command = Command { quantity: "damping", unit: "N m s²/rad²", signed: false };

params! {
    /// Hydraulic knee with a commanded quadratic damping coefficient (section 5.2.1).
    pub struct VariableDamperParams {
        /// Parallel extension spring k_k. The paper prints 1, its supplementary material uses 2; with 1 the step to 1.4 m/s ends in a fall.
        spring_nm_rad: f64 = 2.0, "N m/rad", within(0.0, 1e3);
        /// Viscous friction c_k.
        viscous_nms_rad: f64 = 0.2, "N m s/rad", within(0.0, 1e3);
        /// Dry friction (stiction), reached at a few times the transition speed.
        dry_friction_nm: f64 = 0.1, "N m", within(0.0, 1e3);
        /// Slope factor of tanh in the dry friction.
        dry_friction_slope_s_rad: f64 = 100.0, "s/rad", within(0.0, 1e4);
        /// Largest damping coefficient that the valve can set: limit of every command.
        max_damping_nms2_rad2: f64 = 50.0, "N m s^2/rad^2", within(0.0, 1e4);
    }
}

lanes! {
    /// Damper constants of one walker, SI.
    pub struct VariableDamper, VariableDamperLanes {
        /// k_k, N m/rad.
        spring: f64,
        /// c_k, N m s/rad.
        viscous: f64,
        /// Dry friction, N m.
        dry: f64,
        /// Slope of its tanh, s/rad.
        dry_slope: f64,
    }
}

impl From<&VariableDamperParams> for VariableDamper {
    fn from(p: &VariableDamperParams) -> Self {
        Self {
            spring: p.spring_nm_rad,
            viscous: p.viscous_nms_rad,
            dry: p.dry_friction_nm,
            dry_slope: p.dry_friction_slope_s_rad,
        }
    }
}

/// Torque of the damper on the knee under the commanded coefficient (N m s^2/rad^2).
#[inline(always)]
pub fn damper_torque(damper: &VariableDamper, joint: &JointMotion, coefficient: f64) -> UnitTorque {
    let (angle, rate) = (-joint.flexion, -joint.flexion_rate);
    let controlled = -coefficient * rate * rate.abs();
    let dry = tanh(damper.dry_slope * rate);
    UnitTorque {
        damper: controlled,
        torque: controlled.minus(damper.spring, angle).minus(damper.viscous, rate).minus(damper.dry, dry),
        damping: damper
            .viscous
            .plus(2.0 * coefficient, rate.abs())
            .plus(damper.dry * damper.dry_slope, 1.0_f64.minus(dry, dry)),
        stiffness: damper.spring,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Torque at joint rate `rate` (extension positive).
    fn at(angle: f64, rate: f64, coefficient: f64) -> UnitTorque {
        let damper = VariableDamper::from(&VariableDamperParams::default());
        damper_torque(&damper, &JointMotion { flexion: -angle, flexion_rate: -rate }, coefficient)
    }

    #[test]
    fn the_controlled_part_never_adds_energy_and_is_quadratic() {
        for rate in [-8.0, -0.3, 0.0, 0.2, 5.0] {
            let torque = at(0.0, rate, 3.0);
            assert!(torque.damper * rate <= 0.0);
            assert!((torque.damper.abs() - 3.0 * rate * rate).abs() < 1e-12);
        }
    }

    #[test]
    fn damping_is_the_derivative_of_the_total() {
        for rate in [-3.0, -0.004, 0.002, 1.0] {
            let e = 1e-7;
            let difference = (at(-0.3, rate + e, 4.0).torque - at(-0.3, rate - e, 4.0).torque) / (2.0 * e);
            let damping = at(-0.3, rate, 4.0).damping;
            assert!((damping + difference).abs() < 1e-5 * damping, "{rate}");
        }
    }
}
