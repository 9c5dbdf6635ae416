//! Geometry and mass that the human controller is scheduled on.

use crate::numerics::lanes::lanes;

lanes! {
    /// Constants of one walker's human, SI.
    pub struct Human, HumanLanes {
        /// Total mass of the system, kg.
        mass: f64,
        /// Effective mass of the pendulum leg: the trunk's, kg.
        slip_mass: f64,
        /// Rest length of the pendulum leg: that of the residual leg, m.
        leg_length: f64,
        /// Hip height at which the intact leg touches down, m.
        touch_down_height: f64,
        /// sin of the angle of attack.
        touch_down_sin: f64,
        /// Angle of attack alpha_p, rad.
        touch_down_angle: f64,
        /// pi / (2 alpha_p).
        lift_phase: f64,
        /// Heel to ball, m.
        foot_length: f64,
    }
}

/// Geometry and mass that the human controller is scheduled on.
#[derive(Clone, Copy, Debug)]
pub struct LegGeometry {
    /// Total mass, kg.
    pub mass: f64,
    /// Trunk mass, kg.
    pub trunk_mass: f64,
    /// Thigh + shank + foot height, m.
    pub leg_length: f64,
    /// Hip height above the heel in the touch-down posture, m.
    pub touch_down_height: f64,
    /// Heel to ball, m.
    pub foot_length: f64,
}

impl From<LegGeometry> for Human {
    fn from(leg: LegGeometry) -> Self {
        let angle = (leg.touch_down_height / leg.leg_length).acos();
        Self {
            mass: leg.mass,
            slip_mass: leg.trunk_mass,
            leg_length: leg.leg_length,
            touch_down_height: leg.touch_down_height,
            touch_down_sin: angle.sin(),
            touch_down_angle: angle,
            lift_phase: std::f64::consts::FRAC_PI_2 / angle,
            foot_length: leg.foot_length,
        }
    }
}
