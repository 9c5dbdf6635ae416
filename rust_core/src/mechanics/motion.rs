//! How the walker moves, and what acts on it: the quantities of the equations of motion.

use crate::numerics::lanes::{integrable, lanes};
use crate::numerics::math::FusedSum;

lanes! {
    /// Positions and velocities of the forward-dynamics coordinates, SI; angles of segments to the vertical.
    pub struct Motion, MotionLanes {
        /// Hip, forward, m.
        hip_x: f64,
        /// Hip, up, m.
        hip_y: f64,
        /// Thigh angle, rad (flexion positive).
        thigh: f64,
        /// Shank angle, rad.
        shank: f64,
        /// Foot angle, rad (0: sole level).
        foot: f64,
        /// Hip velocity forward, m/s.
        hip_vx: f64,
        /// Hip velocity up, m/s.
        hip_vy: f64,
        /// Thigh angular velocity, rad/s.
        thigh_rate: f64,
        /// Shank angular velocity, rad/s.
        shank_rate: f64,
        /// Foot angular velocity, rad/s.
        foot_rate: f64,
    }
}
integrable!(MotionLanes { hip_x, hip_y, thigh, shank, foot, hip_vx, hip_vy, thigh_rate, shank_rate, foot_rate });

lanes! {
    /// Prescribed rotation of the trunk: an inverse-dynamics joint.
    pub struct Prescribed, PrescribedLanes {
        /// Angle, rad.
        angle: f64,
        /// Angular velocity, rad/s.
        rate: f64,
        /// Angular acceleration, rad/s^2.
        acceleration: f64,
    }
}

lanes! {
    /// Segment vectors in world axes.
    pub struct Kinematics, KinematicsLanes {
        /// Trunk first moment about the hip, x, kg m.
        trunk_mx: f64,
        /// Trunk first moment, y.
        trunk_my: f64,
        /// Hip to knee, x, m.
        thigh_x: f64,
        /// Hip to knee, y, m.
        thigh_y: f64,
        /// Knee to ankle, x, m.
        shank_x: f64,
        /// Knee to ankle, y, m.
        shank_y: f64,
        /// Thigh first moment, x, kg m.
        thigh_mx: f64,
        /// Thigh first moment, y, kg m.
        thigh_my: f64,
        /// Shank first moment, x, kg m.
        shank_mx: f64,
        /// Shank first moment, y, kg m.
        shank_my: f64,
        /// Foot first moment, x, kg m.
        foot_mx: f64,
        /// Foot first moment, y, kg m.
        foot_my: f64,
        /// Ankle to heel, x, m.
        heel_x: f64,
        /// Ankle to heel, y, m.
        heel_y: f64,
        /// Ankle to ball, x, m.
        ball_x: f64,
        /// Ankle to ball, y, m.
        ball_y: f64,
    }
}

lanes! {
    /// Height and velocity of a point of the walker.
    pub struct Point, PointLanes {
        /// Forward position, m.
        x: f64,
        /// Height, m.
        y: f64,
        /// Forward velocity, m/s.
        vx: f64,
        /// Upward velocity, m/s.
        vy: f64,
    }
}

lanes! {
    /// Torque of a joint (positive on the distal segment) with its derivatives, for implicit steps.
    pub struct JointTorque, JointTorqueLanes {
        /// Torque, N m.
        torque: f64,
        /// -d torque / d joint velocity, N m s/rad; never negative.
        damping: f64,
        /// -d torque / d joint angle, N m/rad; never negative.
        stiffness: f64,
    }
}

lanes! {
    /// Force on a point with its derivatives along (x) and across (y) the surface that it touches, for implicit steps.
    pub struct PointForce, PointForceLanes {
        /// Forward, N.
        x: f64,
        /// Up, N.
        y: f64,
        /// Damping along the surface, N s/m.
        damping_x: f64,
        /// Damping across the surface, N s/m.
        damping_y: f64,
        /// Stiffness along the surface, N/m.
        stiffness_x: f64,
        /// Stiffness across the surface, N/m.
        stiffness_y: f64,
        /// Sine of the surface's angle, positive uphill.
        sin: f64,
        /// Its cosine.
        cos: f64,
    }
}

lanes! {
    /// Accelerations of the forward-dynamics coordinates.
    pub struct Acceleration, AccelerationLanes {
        /// Hip, forward, m/s^2.
        hip_x: f64,
        /// Hip, up, m/s^2.
        hip_y: f64,
        /// Thigh, rad/s^2.
        thigh: f64,
        /// Shank, rad/s^2.
        shank: f64,
        /// Foot, rad/s^2.
        foot: f64,
    }
}

impl Acceleration {
    /// Rates of `motion`: its own velocities (at the end of an implicit step of length `step`) and these accelerations.
    #[inline(always)]
    pub fn rates(&self, motion: &Motion, step: f64) -> Motion {
        Motion {
            hip_x: motion.hip_vx.plus(step, self.hip_x),
            hip_y: motion.hip_vy.plus(step, self.hip_y),
            thigh: motion.thigh_rate.plus(step, self.thigh),
            shank: motion.shank_rate.plus(step, self.shank),
            foot: motion.foot_rate.plus(step, self.foot),
            hip_vx: self.hip_x,
            hip_vy: self.hip_y,
            thigh_rate: self.thigh,
            shank_rate: self.shank,
            foot_rate: self.foot,
        }
    }
}

/// All that acts on the mechanism besides gravity.
#[derive(Clone, Copy, Debug)]
pub struct Loads {
    /// Force on the trunk at the hip, forward, N.
    pub trunk_x: f64,
    /// Force on the trunk at the hip, up, N.
    pub trunk_y: f64,
    /// Force at the knee, forward, N (a fall's contact).
    pub knee_x: f64,
    /// Force at the knee, up, N.
    pub knee_y: f64,
    /// Hip torque, relative to the prescribed hip motion.
    pub hip: JointTorque,
    /// Angular velocity of the hip relative to its reference, rad/s: what the hip's stiffness acts on.
    pub hip_error_rate: f64,
    /// Knee torque.
    pub knee: JointTorque,
    /// Ankle torque.
    pub ankle: JointTorque,
    /// Ground on the heel.
    pub heel: PointForce,
    /// Ground on the ball.
    pub ball: PointForce,
}
