//! Torques of hip, knee and ankle: what human and device put into the mechanism.

use crate::human::drive::Drive;
use crate::human::impedance::{ImpedanceTorque, impedance};
use crate::human::reference::Reference;
use crate::numerics::lanes::lanes;
use crate::prosthesis::ankle::passive_ankle::{Ankle, ankle_torque};
use crate::prosthesis::end_stop::{EndStop, Stop, extension_stop, flexion_stop};
use crate::prosthesis::knee::joint::{JointMotion, UnitTorque};

lanes! {
    /// Motion of hip and ankle relative to their proximal segments.
    pub struct EndJoints, EndJointsLanes {
        /// Hip angle q4 to the trunk, rad.
        hip: f64,
        /// Its rate, rad/s.
        hip_rate: f64,
        /// Ankle angle q8, rad, 0 at the spring's rest.
        ankle: f64,
        /// Its rate, rad/s.
        ankle_rate: f64,
    }
}

lanes! {
    /// Torques at the knee and ankle by origin, N m (joint signs: q5 extension positive).
    pub struct DeviceTorque, DeviceTorqueLanes {
        /// Knee flexion, rad.
        knee_angle: f64,
        /// Knee torque of the unit, end stops apart.
        unit: f64,
        /// T_D, the damping or friction that the command sets.
        damper: f64,
        /// Extension stop, resisting, never negative.
        extension_stop: f64,
        /// Flexion stop, resisting, never negative.
        flexion_stop: f64,
        /// Knee torque tau_5.
        knee: f64,
        /// -d tau_5 / d q5'.
        knee_damping: f64,
        /// -d tau_5 / d q5.
        knee_stiffness: f64,
        /// Ankle torque tau_8.
        ankle: f64,
    }
}

/// Impedance of the hip about its smooth reference (section 4.1).
#[inline(always)]
pub(super) fn hip_torque(drive: &Drive, joints: &EndJoints, smooth: &Reference) -> ImpedanceTorque {
    let (error, error_rate) = (smooth.hip - joints.hip, smooth.hip_rate - joints.hip_rate);
    impedance(drive.hip_stiffness, drive.hip_damping, drive.hip_limit, error, error_rate)
}

/// Impedance of a trunk that is a forward joint, about its smooth reference.
pub(super) fn trunk_torque(drive: &Drive, angle: f64, rate: f64, smooth: &Reference) -> ImpedanceTorque {
    let (error, error_rate) = (smooth.trunk - angle, smooth.trunk_rate - rate);
    impedance(drive.trunk_stiffness, drive.trunk_damping, drive.trunk_limit, error, error_rate)
}

/// Knee torque of unit and end stops, and ankle torque (section 5.2.1); without `FLEXED` the flexion stop is out of reach.
#[inline(always)]
pub(super) fn device_torque<const FLEXED: bool>(
    unit: &UnitTorque,
    joint: &JointMotion,
    stop: &EndStop,
    ankle: &Ankle,
    joints: &EndJoints,
) -> DeviceTorque {
    let extension = extension_stop(stop, joint.flexion, joint.flexion_rate);
    let flexion = if FLEXED { flexion_stop(stop, joint.flexion, joint.flexion_rate) } else { Stop::NONE };
    DeviceTorque {
        knee_angle: joint.flexion,
        unit: unit.torque,
        damper: unit.damper,
        extension_stop: extension.torque,
        flexion_stop: flexion.torque,
        knee: unit.torque - extension.torque + flexion.torque,
        knee_damping: unit.damping + extension.damping + flexion.damping,
        knee_stiffness: unit.stiffness + extension.stiffness + flexion.stiffness,
        ankle: ankle_torque(ankle, joints.ankle, joints.ankle_rate),
    }
}
