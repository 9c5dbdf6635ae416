//! Variations of the human: what a user does otherwise than the paper's (sections 4.3 and 6), drawn anew for every episode.
//!
//! Every variation is a number whose default changes nothing, bit for bit. Changes of parameters and factors on them act
//! through [`HumanParams::varied`]; the formulas read the others where they apply.

use crate::human::params::HumanParams;
use crate::schema::distribution::Distribution;
use crate::schema::params::{params, within};

/// Makes of one list the parameters, the numbers drawn from them, and the draw itself.
macro_rules! variations {
    ($($(#[doc = $doc:literal])* $field:ident = $paper:expr, $unit:literal, $range:expr;)+) => {
        params! {
            /// Distributions of the human's variations; the defaults are the paper's human.
            pub struct HumanVariationParams {
                $($(#[doc = $doc])* $field: Distribution = Distribution::Fixed($paper), $unit, $range;)+
            }
        }

        /// The variations of one episode.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct HumanVariation {
            $($(#[doc = $doc])* #[doc = concat!("\n\nUnit: ", $unit)] pub $field: f64,)+
        }

        impl Default for HumanVariation {
            /// The paper's human.
            fn default() -> Self { Self { $($field: $paper,)+ } }
        }

        impl HumanVariation {
            /// Names of the variations, in the order of [`values`](Self::values).
            pub const NAMES: &[&str] = &[$(stringify!($field)),+];

            /// So much of the way from the paper's human: none at `difficulty` 0, all at 1.
            pub fn eased(&self, difficulty: f64) -> Self {
                Self { $($field: crate::schema::distribution::eased($paper, self.$field, difficulty),)+ }
            }

            /// The variations as numbers.
            pub fn values(&self) -> [f64; Self::NAMES.len()] { [$(self.$field),+] }
        }

        impl HumanVariationParams {
            /// The variations of which each is `fraction()` of the way through its distribution.
            pub fn at(&self, mut fraction: impl FnMut() -> f64) -> HumanVariation {
                HumanVariation { $($field: self.$field.at(fraction()),)+ }
            }

            /// The smallest value of every variation (`end` 0) or the largest (1).
            pub fn end(&self, end: usize) -> HumanVariation {
                HumanVariation { $($field: self.$field.bounds()[end],)+ }
            }
        }
    };
}

variations! {
    /// Lift of the hip while the intact leg stands, as a share of the pendulum's stiffness, at any speed (section 4.3: hip hiking for ground clearance).
    hip_lift_m = 0.0, "m", within(0.0, 0.1);
    /// Thigh flexion in swing beyond that of heel strike, as in stepping over an obstacle (section 6).
    swing_flexion_deg = 0.0, "deg", within(0.0, 60.0);
    /// Change of the template's `human.thigh_flexion_deg`; the pendulum's angle of attack stays.
    thigh_flexion_change_deg = 0.0, "deg", within(-20.0, 35.0);
    /// Change of the template's `human.thigh_extension_deg`.
    thigh_extension_change_deg = 0.0, "deg", within(-30.0, 15.0);
    /// Change of the phase at which the thigh swings forward, 0.5 in Figure 4.
    swing_start_change = 0.0, "1", within(-0.1, 0.1);
    /// Share by which the residual leg's part of the thigh template, Figure 4 up to 0.5, is shorter: positive favours the intact leg.
    stance_asymmetry = 0.0, "1", within(-0.2, 0.5);
    /// Time from the residual heel strike to the new step that it initiates (Figure 3).
    step_delay_s = 0.0, "s", within(0.0, 0.5);
    /// Time from the hip's fall to the height of touch-down to the touch-down of the intact leg (section 4.2).
    touch_down_delay_s = 0.0, "s", within(0.0, 0.5);
    /// Factor on the hip's stiffness, walking and standing.
    hip_stiffness_factor = 1.0, "1", within(0.0, 10.0);
    /// Factor on the hip's damping.
    hip_damping_factor = 1.0, "1", within(0.0, 10.0);
    /// Factor on the largest hip torque, walking and standing.
    hip_limit_factor = 1.0, "1", within(0.01, 10.0);
    /// Factor on the damping at the hip while standing on both legs.
    standing_damping_factor = 1.0, "1", within(0.0, 10.0);
    /// Factor on the pendulum's stiffness; its damping ratio stays (section 4.2).
    pendulum_stiffness_factor = 1.0, "1", within(0.1, 10.0);
    /// Factor on the forward thrust.
    thrust_factor = 1.0, "1", within(0.0, 10.0);
    /// Factor on the update of K_thrust (equation 2); 0 keeps it as it is.
    thrust_adaptation_factor = 1.0, "1", within(0.0, 5.0);
}

impl HumanParams {
    /// Parameters of a human with the given variation.
    pub fn varied(&self, variation: &HumanVariation) -> Self {
        Self {
            thigh_flexion_deg: self.thigh_flexion_deg + variation.thigh_flexion_change_deg,
            thigh_extension_deg: self.thigh_extension_deg + variation.thigh_extension_change_deg,
            hip_stiffness_nm_rad: self.hip_stiffness_nm_rad * variation.hip_stiffness_factor,
            standing_hip_stiffness_nm_rad: self.standing_hip_stiffness_nm_rad * variation.hip_stiffness_factor,
            hip_damping_nms_rad: self.hip_damping_nms_rad * variation.hip_damping_factor,
            hip_limit_nm_kg: self.hip_limit_nm_kg * variation.hip_limit_factor,
            standing_hip_limit_nm_kg: self.standing_hip_limit_nm_kg * variation.hip_limit_factor,
            standing_damping_ns_m: self.standing_damping_ns_m * variation.standing_damping_factor,
            thrust_scale: self.thrust_scale * variation.thrust_factor,
            ..self.clone()
        }
    }
}

/// The human of one walker in one episode.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Individual {
    /// Parameters, with changes and factors of the variation in them.
    pub params: HumanParams,
    /// What this human does otherwise than the paper's.
    pub variation: HumanVariation,
}

impl Individual {
    /// A human of the given parameters, varied.
    pub fn new(params: &HumanParams, variation: HumanVariation) -> Self {
        Self { params: params.varied(&variation), variation }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_variation_is_the_papers_human_exactly() {
        assert_eq!(HumanParams::default().varied(&HumanVariation::default()), HumanParams::default());
        assert_eq!(HumanVariationParams::default().at(|| 0.3), HumanVariation::default());
    }

    #[test]
    fn every_variation_is_drawn_for_itself() {
        let params = HumanVariationParams {
            hip_lift_m: Distribution::Uniform([0.0, 0.02]),
            thrust_adaptation_factor: Distribution::Uniform([0.5, 1.5]),
            ..HumanVariationParams::default()
        };
        let mut draws = 0;
        let variation = params.at(|| {
            draws += 1;
            if draws == 1 { 0.25 } else { 0.75 }
        });
        assert_eq!(draws, HumanVariation::NAMES.len());
        assert_eq!((variation.hip_lift_m, variation.thrust_adaptation_factor), (0.005, 1.25));
    }

    #[test]
    fn factors_act_on_walking_and_standing_gains() {
        let params = HumanParams::default();
        let weak = params.varied(&HumanVariation {
            hip_stiffness_factor: 0.5,
            hip_limit_factor: 0.25,
            ..HumanVariation::default()
        });
        assert_eq!((weak.hip_stiffness_nm_rad, weak.standing_hip_stiffness_nm_rad), (1000.0, 250.0));
        assert_eq!((weak.hip_limit_nm_kg, weak.standing_hip_limit_nm_kg), (1.0, 0.5));
        assert_eq!(weak.hip_damping_nms_rad, params.hip_damping_nms_rad);
    }
}
