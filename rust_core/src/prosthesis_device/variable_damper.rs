//! Variable-damping knee: a perfect quadratic damper beside spring, viscous and dry friction (section 5.2.1).

use crate::lanes::lanes;
use crate::math::tanh;
use crate::params::{params, within};

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

lanes! {
    /// Knee torque of the damper unit without end stops; joint angle q5 (extension positive).
    pub struct DamperTorque, DamperTorqueLanes {
        /// T_D = -c q5' |q5'|, N m: the controlled part.
        controlled: f64,
        /// All parts, N m.
        total: f64,
        /// -d total / d q5', N m s/rad.
        damping: f64,
    }
}

/// Torque on the knee at joint angle `angle` (rad), rate (rad/s) and commanded coefficient (N m s^2/rad^2).
#[inline(always)]
pub fn damper_torque(damper: &VariableDamper, angle: f64, rate: f64, coefficient: f64) -> DamperTorque {
    let controlled = -coefficient * rate * rate.abs();
    let dry = tanh(damper.dry_slope * rate);
    DamperTorque {
        controlled,
        total: controlled - damper.spring * angle - damper.viscous * rate - damper.dry * dry,
        damping: 2.0 * coefficient * rate.abs() + damper.viscous + damper.dry * damper.dry_slope * (1.0 - dry * dry),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_controlled_part_never_adds_energy_and_is_quadratic() {
        let damper = VariableDamper::from(&VariableDamperParams::default());
        for rate in [-8.0, -0.3, 0.0, 0.2, 5.0] {
            let t = damper_torque(&damper, 0.0, rate, 3.0);
            assert!(t.controlled * rate <= 0.0);
            assert!((t.controlled.abs() - 3.0 * rate * rate).abs() < 1e-12);
        }
    }

    #[test]
    fn damping_is_the_derivative_of_the_total() {
        let damper = VariableDamper::from(&VariableDamperParams::default());
        for rate in [-3.0, -0.004, 0.002, 1.0] {
            let e = 1e-7;
            let difference = (damper_torque(&damper, -0.3, rate + e, 4.0).total
                - damper_torque(&damper, -0.3, rate - e, 4.0).total)
                / (2.0 * e);
            let damping = damper_torque(&damper, -0.3, rate, 4.0).damping;
            assert!((damping + difference).abs() < 1e-5 * damping, "{rate}");
        }
    }
}
