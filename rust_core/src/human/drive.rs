//! What the continuous equations of the human run on between two transitions of its state machine.

use crate::numerics::lanes::lanes;

lanes! {
    /// What the continuous equations of the human run on between two transitions.
    pub struct Drive, DriveLanes {
        /// Start of the current residual step, s.
        step_start: f64,
        /// 1 / expected cycle time, 1/s.
        inverse_cycle: f64,
        /// Rough thigh angle at the knots of the step template, rad.
        thigh_0: f64,
        /// At the end of its extension.
        thigh_1: f64,
        /// At the start of swing.
        thigh_2: f64,
        /// Just after it.
        thigh_3: f64,
        /// At the last knot.
        thigh_4: f64,
        /// 1 / length of the template's way to its extension, in phase.
        extension_pace: f64,
        /// 1 / length of its hold there.
        hold_pace: f64,
        /// 1 / length of its last ramp.
        last_pace: f64,
        /// Phase at which the extension ends.
        extension_end: f64,
        /// Phase at which the thigh swings forward.
        swing_start: f64,
        /// Further flexion in swing, rad.
        swing_flexion: f64,
        /// Rough trunk angle, rad.
        trunk: f64,
        /// Stiffness 2 / t_d^2 of the reference filter, 1/s^2.
        filter_stiffness: f64,
        /// Its damping 2 / t_d, 1/s.
        filter_damping: f64,
        /// Hip stiffness, N m/rad.
        hip_stiffness: f64,
        /// Hip damping, N m s/rad.
        hip_damping: f64,
        /// Largest hip torque, N m.
        hip_limit: f64,
        /// Trunk stiffness where the trunk is a forward joint, N m/rad.
        trunk_stiffness: f64,
        /// Trunk damping, N m s/rad.
        trunk_damping: f64,
        /// Largest trunk torque, N m.
        trunk_limit: f64,
        /// Pendulum stiffness k_p, N/m; 0 while the intact leg swings.
        slip_stiffness: f64,
        /// Pendulum damping c_p, N s/m.
        slip_damping: f64,
        /// Pendulum foot x_p0, m.
        slip_foot_x: f64,
        /// Height of the ground under it, m.
        slip_foot_y: f64,
        /// Constant forward force, N.
        thrust: f64,
        /// Forward force per backward hip velocity, N s/m.
        brake: f64,
        /// Constant upward force, N: half the weight while standing on both legs.
        support: f64,
        /// Amplitude of the lift at pendulum mid-stance, N.
        lift: f64,
        /// Additional amplitude in the stopping step, N, fading with time.
        stop_lift: f64,
        /// Touch-down of the intact leg, s.
        touch_down: f64,
        /// 4 / expected stride time of the intact leg, 1/s: pace of that fading.
        fade_rate: f64,
    }
}
