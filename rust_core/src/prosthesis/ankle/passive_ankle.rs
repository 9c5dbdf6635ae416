//! Passive ankle: linear spring and damper about the toe-up rest angle (section 5.2.1).

use crate::numerics::lanes::lanes;
use crate::numerics::math::FusedSum;
use crate::schema::params::{params, within};

params! {
    /// Passive prosthetic ankle (section 5.2.1; the printed 6 N m/rad is per kg of body mass).
    pub struct AnkleParams {
        /// Stiffness, 6 N m/rad/kg times 75 kg.
        stiffness_nm_rad: f64 = 450.0, "N m/rad", within(0.0, 1e5);
        /// Damping.
        damping_nms_rad: f64 = 1.0, "N m s/rad", within(0.0, 1e4);
    }
}

lanes! {
    /// Ankle constants of one walker, SI.
    pub struct Ankle, AnkleLanes {
        /// N m/rad.
        stiffness: f64,
        /// N m s/rad.
        damping: f64,
    }
}

impl From<&AnkleParams> for Ankle {
    fn from(p: &AnkleParams) -> Self {
        Self { stiffness: p.stiffness_nm_rad, damping: p.damping_nms_rad }
    }
}

/// tau_8 at joint angle q8 (rad, 0 at rest) and rate (rad/s).
#[inline(always)]
pub fn ankle_torque(ankle: &Ankle, angle: f64, rate: f64) -> f64 {
    (-ankle.stiffness * angle).minus(ankle.damping, rate)
}
