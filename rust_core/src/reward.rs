//! Reward: named terms times configured weights.

use crate::params::{params, within};
use crate::signals::CONTROL_PERIOD_S;

/// Names of the terms, in the order of every array over them.
pub const TERMS: [&str; 8] =
    ["alive", "fall", "end_stop", "energy", "electricity", "stance_buckling", "scuffing", "smoothness"];

params! {
    /// Weight of each term; the reward is their weighted sum.
    pub struct RewardParams {
        /// Time without a fall, s.
        alive: f64 = 1.0, "1/s", within(-1e6, 1e6);
        /// 1 where the episode ends early (fall, joint limit, diverged).
        fall: f64 = -5.0, "1", within(-1e6, 1e6);
        /// Time integral of the extension stop's peak torque above 20 N m, per body mass, N m s/kg.
        end_stop: f64 = -2.0, "kg/(N m s)", within(-1e6, 1e6);
        /// Positive work of the residual hip per body mass: what the leg costs its user, J/kg.
        energy: f64 = -0.2, "kg/J", within(-1e6, 1e6);
        /// Electrical energy that the motor draws per body mass, nothing credited for what it returns, J/kg.
        electricity: f64 = -0.2, "kg/J", within(-1e6, 1e6);
        /// Time integral of knee flexion beyond 25 deg while the leg carries more than 0.3 body weights, rad s.
        stance_buckling: f64 = -2.0, "1/(rad s)", within(-1e6, 1e6);
        /// Time integral of the ground force on a foot that moves forward faster than 0.3 m/s, in body weights, s.
        scuffing: f64 = -2.0, "1/s", within(-1e6, 1e6);
        /// Squared change of the command over that of a full action, per action.
        smoothness: f64 = -0.02, "1", within(-1e6, 1e6);
    }
}

impl RewardParams {
    /// Weights in the order of [`TERMS`].
    pub fn weights(&self) -> [f64; TERMS.len()] {
        [
            self.alive,
            self.fall,
            self.end_stop,
            self.energy,
            self.electricity,
            self.stance_buckling,
            self.scuffing,
            self.smoothness,
        ]
    }
}

/// What happened in one control period, for the reward.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcome {
    /// Whether the episode ended early.
    pub failed: bool,
    /// Whether it ended because the integration diverged: then no other quantity means anything.
    pub diverged: bool,
    /// Largest extension-stop torque, N m.
    pub extension_stop_peak: f64,
    /// Body mass, kg.
    pub mass: f64,
    /// Mechanical power of the hip, W.
    pub hip_power: f64,
    /// Electrical power drawn, W; 0 without a motor.
    pub electrical_power: f64,
    /// Knee flexion, rad.
    pub knee_angle: f64,
    /// Tube force, body weights.
    pub tube_force_bw: f64,
    /// Ground force on heel and ball, body weights.
    pub ground_force_bw: f64,
    /// Forward velocity of the fastest of heel and ball that touches the ground, m/s.
    pub sole_speed: f64,
    /// Change of command over its maximum since the last action; 0 while the action holds.
    pub command_change: f64,
}

/// Extension-stop torque that a normal stance reaches, N m.
const SOFT_STOP_NM: f64 = 20.0;
/// Knee flexion that a normal stance stays below.
const STANCE_FLEXION_DEG: f64 = 25.0;
/// Load above which the leg is in stance, body weights.
const STANCE_LOAD_BW: f64 = 0.3;
/// Forward speed of the sole above which contact is scuffing, m/s.
const SCUFF_SPEED_M_S: f64 = 0.3;

/// Terms of one control period, in the order of [`TERMS`].
pub fn terms(outcome: &Outcome) -> [f64; TERMS.len()] {
    let dt = CONTROL_PERIOD_S;
    let in_stance = outcome.tube_force_bw > STANCE_LOAD_BW;
    let scuffs = outcome.sole_speed > SCUFF_SPEED_M_S;
    let when = |condition: bool, value: f64| if condition { value } else { 0.0 };
    let terms = [
        when(!outcome.failed, dt),
        when(outcome.failed, 1.0),
        (outcome.extension_stop_peak - SOFT_STOP_NM).max(0.0) / outcome.mass * dt,
        outcome.hip_power.max(0.0) / outcome.mass * dt,
        outcome.electrical_power.max(0.0) / outcome.mass * dt,
        when(in_stance, (outcome.knee_angle - STANCE_FLEXION_DEG.to_radians()).max(0.0) * dt),
        when(scuffs, outcome.ground_force_bw * dt),
        outcome.command_change * outcome.command_change,
    ];
    // A diverged walker is charged its fall alone.
    if outcome.diverged { std::array::from_fn(|term| when(TERMS[term] == "fall", 1.0)) } else { terms }
}
