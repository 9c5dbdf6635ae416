//! Reward: named terms times configured weights.

use crate::numerics::lanes::lanes;
use crate::numerics::math::select;
use crate::schema::params::{params, within};
use crate::signals::CONTROL_PERIOD_S;

/// Makes of one list the weights, the terms and their names.
macro_rules! terms {
    ($($(#[doc = $doc:literal])* $term:ident = $weight:expr, $unit:literal;)+) => {
        params! {
            /// Weight of each term; the reward is their weighted sum.
            pub struct RewardParams {
                $($(#[doc = $doc])* $term: f64 = $weight, $unit, within(-1e6, 1e6);)+
            }
        }

        lanes! {
            /// The terms of one walker.
            pub struct Terms, TermsLanes {
                $($(#[doc = $doc])* $term: f64,)+
            }
        }

        /// Names of the terms, in the order of every array over them.
        pub const TERMS: [&str; [$(stringify!($term)),+].len()] = [$(stringify!($term)),+];

        impl Terms {
            /// The terms in the order of [`TERMS`].
            #[inline(always)]
            pub fn values(&self) -> [f64; TERMS.len()] {
                [$(self.$term),+]
            }

            /// Sum with those of another control period.
            #[inline(always)]
            pub fn plus(&self, other: &Self) -> Self {
                Self { $($term: self.$term + other.$term,)+ }
            }

            /// Their weighted sum.
            #[inline(always)]
            pub fn reward(&self, weights: &RewardParams) -> f64 {
                [$(self.$term * weights.$term),+].iter().sum()
            }
        }
    };
}

terms! {
    /// Time without a fall, s.
    alive = 1.0, "1/s";
    /// 1 where the episode ends early (fall, joint limit, diverged).
    fall = -5.0, "1";
    /// Time integral of the extension stop's peak torque above 20 N m, per body mass, N m s/kg.
    end_stop = -2.0, "kg/(N m s)";
    /// Positive work of the residual hip per body mass: what the leg costs its user, J/kg.
    energy = -0.2, "kg/J";
    /// Electrical energy that the motor draws per body mass, nothing credited for what it returns, J/kg.
    electricity = -0.2, "kg/J";
    /// Time integral of knee flexion beyond 25 deg while the leg carries more than 0.3 body weights, rad s.
    stance_buckling = -2.0, "1/(rad s)";
    /// Time integral of the ground force on a foot that moves forward faster than 0.3 m/s, in body weights, s.
    scuffing = -2.0, "1/s";
    /// Squared change of the command over that of a full action, per action.
    smoothness = -0.02, "1";
}

lanes! {
    /// What happened in one control period, for the reward.
    pub struct Outcome, OutcomeLanes {
        /// Largest extension-stop torque, N m.
        extension_stop_peak: f64,
        /// Body mass, kg.
        mass: f64,
        /// Mechanical power of the hip, W.
        hip_power: f64,
        /// Electrical power drawn, W; 0 without a motor.
        electrical_power: f64,
        /// Knee flexion, rad.
        knee_angle: f64,
        /// Tube force, body weights.
        tube_force_bw: f64,
        /// Ground force on heel and ball, body weights.
        ground_force_bw: f64,
        /// Forward velocity of the fastest of heel and ball that touches the ground, m/s.
        sole_speed: f64,
        /// Change of command over that of a full action since the last action; 0 while the action holds.
        command_change: f64,
    }
}

/// Extension-stop torque that a normal stance reaches, N m.
const SOFT_STOP_NM: f64 = 20.0;
/// Knee flexion that a normal stance stays below.
const STANCE_FLEXION_DEG: f64 = 25.0;
/// Load above which the leg is in stance, body weights.
const STANCE_LOAD_BW: f64 = 0.3;
/// Forward speed of the sole above which contact is scuffing, m/s.
const SCUFF_SPEED_M_S: f64 = 0.3;

/// Terms of one control period, in which the episode may have `failed`: ended early. If it did because the integration
/// `diverged`, no other quantity means anything, and the walker is charged its fall alone.
#[inline(always)]
pub fn terms(outcome: &Outcome, failed: bool, diverged: bool) -> Terms {
    let per_mass = CONTROL_PERIOD_S / outcome.mass;
    let when = |condition: bool, value: f64| select(condition & !diverged, value, 0.0);
    let positive = |value: f64| when(value > 0.0, value);
    let buckling = positive(outcome.knee_angle - STANCE_FLEXION_DEG.to_radians());
    Terms {
        alive: select(failed, 0.0, CONTROL_PERIOD_S),
        fall: select(failed, 1.0, 0.0),
        end_stop: positive(outcome.extension_stop_peak - SOFT_STOP_NM) * per_mass,
        energy: positive(outcome.hip_power) * per_mass,
        electricity: positive(outcome.electrical_power) * per_mass,
        stance_buckling: select(outcome.tube_force_bw > STANCE_LOAD_BW, buckling * CONTROL_PERIOD_S, 0.0),
        scuffing: when(outcome.sole_speed > SCUFF_SPEED_M_S, outcome.ground_force_bw * CONTROL_PERIOD_S),
        smoothness: when(true, outcome.command_change * outcome.command_change),
    }
}
