//! Impedance of hip and trunk about their smooth references, limited (section 4.1; sign so that it attracts).

use crate::numerics::lanes::lanes;
use crate::numerics::math::{FusedSum, clamp, select};

lanes! {
    /// Torque of an impedance with its derivatives.
    pub struct ImpedanceTorque, ImpedanceTorqueLanes {
        /// N m.
        torque: f64,
        /// Damping, N m s/rad; 0 where the torque is at its limit.
        damping: f64,
        /// Stiffness, N m/rad; 0 where the torque is at its limit.
        stiffness: f64,
        /// Joint velocity relative to its reference, rad/s.
        error_rate: f64,
    }
}

/// Torque at a joint that is `error` (rad) short of its reference, which moves away at `error_rate` (rad/s).
#[inline(always)]
pub fn impedance(stiffness: f64, damping: f64, limit: f64, error: f64, error_rate: f64) -> ImpedanceTorque {
    let free = (stiffness * error).plus(damping, error_rate);
    let acts = free.abs() < limit;
    ImpedanceTorque {
        torque: clamp(free, -limit, limit),
        damping: select(acts, damping, 0.0),
        stiffness: select(acts, stiffness, 0.0),
        error_rate: -error_rate,
    }
}
