//! Termination: what ends an episode early, each with a reason.

use strum::VariantNames;

use crate::numerics::lanes::lanes;
use crate::schema::params::{params, within};

params! {
    /// Limits beyond which an episode ends.
    pub struct TerminationParams {
        /// Hip height above the ground below which the walker has fallen.
        hip_height_m: f64 = 0.6, "m", within(0.0, 1.5);
        /// Knee hyperextension that ends an episode (the stop's rubber is gone).
        knee_hyperextension_deg: f64 = 5.0, "deg", within(0.0, 90.0);
        /// Knee flexion that ends an episode.
        knee_flexion_deg: f64 = 125.0, "deg", within(30.0, 180.0);
        /// Ankle deflection from rest, either way, that ends an episode.
        ankle_deg: f64 = 60.0, "deg", within(5.0, 180.0);
    }
}

/// Why an episode ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, VariantNames)]
#[strum(serialize_all = "snake_case")]
#[repr(u8)]
pub enum Reason {
    /// It has not ended.
    #[default]
    None,
    /// The hip fell below its limit.
    HipHeight,
    /// Knee or ankle went beyond its limit.
    JointLimit,
    /// The integration diverged, by the reference too: the state is not finite, or a segment or the knee's stop does what none can.
    NonFinite,
    /// Its time is over (truncation, not failure).
    TimeLimit,
}

lanes! {
    /// What termination looks at.
    pub struct Posture, PostureLanes {
        /// Hip height above that which counts as a fall, m.
        hip_clearance: f64,
        /// Knee flexion, rad.
        knee_flexion: f64,
        /// Ankle angle from rest, rad.
        ankle: f64,
        /// Whether the integration has diverged.
        diverged: bool,
    }
}

impl TerminationParams {
    /// Whether the posture is beyond a limit, or diverged.
    #[inline(always)]
    pub fn ends(&self, posture: &Posture) -> bool {
        posture.diverged | Self::falls(posture) | self.over_bends(posture)
    }

    #[inline(always)]
    fn falls(posture: &Posture) -> bool {
        posture.hip_clearance < 0.0
    }

    #[inline(always)]
    fn over_bends(&self, posture: &Posture) -> bool {
        (posture.knee_flexion < -self.knee_hyperextension_deg.to_radians())
            | (posture.knee_flexion > self.knee_flexion_deg.to_radians())
            | (posture.ankle.abs() > self.ankle_deg.to_radians())
    }

    /// Why the posture ends the episode.
    pub fn reason(&self, posture: &Posture) -> Reason {
        if posture.diverged {
            Reason::NonFinite
        } else if Self::falls(posture) {
            Reason::HipHeight
        } else if self.over_bends(posture) {
            Reason::JointLimit
        } else {
            Reason::None
        }
    }
}
