//! Termination: what ends an episode early, each with a reason.

use crate::lanes::lanes;
use crate::params::{params, within};

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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Reason {
    /// It has not ended.
    #[default]
    None,
    /// The hip fell below its limit.
    HipHeight,
    /// Knee or ankle went beyond its limit.
    JointLimit,
    /// The integration diverged: the state is not finite, or a segment or the knee's stop does what none can.
    NonFinite,
    /// Its time is over (truncation, not failure).
    TimeLimit,
}

/// Names of [`Reason`], by its number.
pub const REASONS: [&str; 5] = ["none", "hip_height", "joint_limit", "non_finite", "time_limit"];

lanes! {
    /// What termination looks at.
    pub struct Posture, PostureLanes {
        /// Hip height above ground, m.
        hip_height: f64,
        /// Knee flexion, rad.
        knee_flexion: f64,
        /// Ankle angle from rest, rad.
        ankle: f64,
        /// Fastest rotation of a segment, rad/s.
        fastest_rad_s: f64,
        /// Largest torque of the extension stop, N m.
        extension_stop_nm: f64,
        /// Sum of all state variables: not finite if any of them is not.
        checksum: f64,
    }
}

/// Torque of the extension stop that only a diverged integration reaches: impacts of walking stay below 200.
const DIVERGED_NM: f64 = 5000.0;
/// Rotation that only a diverged integration reaches: walking stays below 20 rad/s, impacts in a fall below 100.
const DIVERGED_RAD_S: f64 = 300.0;

impl TerminationParams {
    /// Whether the posture is one that only a diverged integration reaches.
    #[inline(always)]
    pub fn diverged(posture: &Posture) -> bool {
        !posture.checksum.is_finite()
            | (posture.fastest_rad_s > DIVERGED_RAD_S)
            | (posture.extension_stop_nm > DIVERGED_NM)
    }

    /// Whether the posture is beyond a limit, or diverged.
    #[inline(always)]
    pub fn ends(&self, posture: &Posture) -> bool {
        Self::diverged(posture) | self.falls(posture) | self.over_bends(posture)
    }

    #[inline(always)]
    fn falls(&self, posture: &Posture) -> bool {
        posture.hip_height < self.hip_height_m
    }

    #[inline(always)]
    fn over_bends(&self, posture: &Posture) -> bool {
        (posture.knee_flexion < -self.knee_hyperextension_deg.to_radians())
            | (posture.knee_flexion > self.knee_flexion_deg.to_radians())
            | (posture.ankle.abs() > self.ankle_deg.to_radians())
    }

    /// Why the posture ends the episode.
    pub fn reason(&self, posture: &Posture) -> Reason {
        if Self::diverged(posture) {
            Reason::NonFinite
        } else if self.falls(posture) {
            Reason::HipHeight
        } else if self.over_bends(posture) {
            Reason::JointLimit
        } else {
            Reason::None
        }
    }
}
