//! The arrows of the block diagram: what one block hands to another, in SI units.

use crate::numerics::lanes::lanes;

/// Gravitational acceleration, m/s^2.
pub const GRAVITY: f64 = 9.81;

/// Control period of the prosthesis: 200 Hz (section 5.2).
pub const CONTROL_PERIOD_S: f64 = 0.005;

lanes! {
    /// True quantities at the places where the leg's sensors sit (input of the sensors).
    pub struct Measurand, MeasurandLanes {
        /// Knee flexion, rad.
        knee_angle: f64,
        /// Tube force F_u, body weights, compression positive.
        tube_force_bw: f64,
        /// Tube moment M_u, N m/kg, positive when the ball carries the load.
        tube_moment_nm_kg: f64,
        /// Shank angle to the vertical, rad, positive when the ankle is ahead of the knee.
        shank_angle: f64,
        /// Shank angular velocity, rad/s.
        shank_rate: f64,
        /// Specific force at the shank's inertial sensor, forward across the shank, m/s^2.
        shank_force_x: f64,
        /// Same, up along the shank, m/s^2.
        shank_force_y: f64,
        /// Thigh angular velocity, rad/s.
        thigh_rate: f64,
        /// Specific force at the thigh's inertial sensor, forward across the thigh, m/s^2.
        thigh_force_x: f64,
        /// Same, up along the thigh, m/s^2.
        thigh_force_y: f64,
        /// Ankle moment, N m/kg, plantarflexing positive.
        ankle_moment_nm_kg: f64,
        /// Motor position, rad, flexing positive; zero without a motor.
        motor_position: f64,
        /// Motor speed, rad/s, flexing positive; zero without a motor.
        motor_speed: f64,
        /// Motor current, A; zero without a motor.
        motor_current: f64,
    }
}

lanes! {
    /// What the prosthesis controller receives at a sample (output of the sensors).
    pub struct Readings, ReadingsLanes {
        /// Knee flexion from the encoder, rad.
        knee_angle: f64,
        /// Filtered backward difference of the encoder, rad/s, flexion positive.
        knee_speed: f64,
        /// Tube force F_u, body weights.
        tube_force_bw: f64,
        /// Tube moment M_u, N m/kg.
        tube_moment_nm_kg: f64,
        /// Shank inclination, rad.
        shank_angle: f64,
        /// Shank angular velocity, rad/s.
        shank_rate: f64,
        /// Specific force (acceleration less gravity) at the shank's inertial sensor, forward across the shank, m/s^2.
        shank_force_x: f64,
        /// Same, up along the shank, m/s^2.
        shank_force_y: f64,
        /// Thigh angular velocity, rad/s.
        thigh_rate: f64,
        /// Specific force at the thigh's inertial sensor, forward across the thigh, m/s^2.
        thigh_force_x: f64,
        /// Same, up along the thigh, m/s^2.
        thigh_force_y: f64,
        /// Ankle moment, N m/kg, plantarflexing positive.
        ankle_moment_nm_kg: f64,
        /// Its filtered rate, N m/kg/s.
        ankle_moment_rate: f64,
        /// Motor position, rad, flexing positive.
        motor_position: f64,
        /// Motor speed, rad/s, flexing positive.
        motor_speed: f64,
        /// Motor current, A.
        motor_current: f64,
    }
}
