//! What a knee unit and its joint tell each other.

use crate::numerics::lanes::lanes;

lanes! {
    /// Motion of the knee joint.
    pub struct JointMotion, JointMotionLanes {
        /// Knee flexion -q5, rad.
        flexion: f64,
        /// Flexion velocity, rad/s.
        flexion_rate: f64,
    }
}

lanes! {
    /// Torque of a knee unit on joint 5 (extension positive), end stops apart.
    pub struct UnitTorque, UnitTorqueLanes {
        /// T_D, the damping or friction that the command sets, N m.
        damper: f64,
        /// All of it, N m.
        torque: f64,
        /// -d torque / d q5', N m s/rad.
        damping: f64,
        /// -d torque / d q5, N m/rad.
        stiffness: f64,
    }
}
