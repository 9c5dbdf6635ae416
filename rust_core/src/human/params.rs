//! Parameters of the human controller.

use crate::schema::params::{above, params, within};

params! {
    /// Human controller (sections 4.1 to 4.3; values of the supplementary material where the paper gives none).
    pub struct HumanParams {
        /// Thigh angle at heel strike and in late swing (Figure 4).
        thigh_flexion_deg: f64 = 25.0, "deg", within(5.0, 60.0);
        /// Thigh angle in late stance (Figure 4).
        thigh_extension_deg: f64 = -10.0, "deg", within(-40.0, 5.0);
        /// Thigh angle that a start from standing pushes off with (Figure 4).
        start_extension_deg: f64 = -15.0, "deg", within(-40.0, 5.0);
        /// Trunk angle while walking; forward lean is negative (section 4.1).
        trunk_lean_deg: f64 = -4.0, "deg", within(-30.0, 30.0);
        /// Delay of the smoothing filter as a share of the expected cycle time (section 4.1).
        filter_delay_share: f64 = 0.1, "1", above(0.0, 1.0);
        /// Delay of the smoothing filter while standing (section 4.1).
        standing_filter_delay_s: f64 = 0.2, "s", above(0.0, 5.0);
        /// Hip stiffness while walking (section 4.1).
        hip_stiffness_nm_rad: f64 = 2000.0, "N m/rad", within(0.0, 1e5);
        /// Hip damping (section 4.1).
        hip_damping_nms_rad: f64 = 100.0, "N m s/rad", within(0.0, 1e4);
        /// Hip stiffness while standing (section 4.1).
        standing_hip_stiffness_nm_rad: f64 = 500.0, "N m/rad", within(0.0, 1e5);
        /// Largest hip torque per body mass while walking.
        hip_limit_nm_kg: f64 = 4.0, "N m/kg", above(0.0, 100.0);
        /// Largest hip torque per body mass while standing.
        standing_hip_limit_nm_kg: f64 = 2.0, "N m/kg", above(0.0, 100.0);
        /// Trunk stiffness while walking, where the trunk is a forward joint.
        trunk_stiffness_nm_rad: f64 = 5000.0, "N m/rad", within(0.0, 1e5);
        /// Trunk damping while walking.
        trunk_damping_nms_rad: f64 = 500.0, "N m s/rad", within(0.0, 1e4);
        /// Largest trunk torque per body mass while walking.
        trunk_limit_nm_kg: f64 = 5.0, "N m/kg", above(0.0, 100.0);
        /// Trunk stiffness while standing.
        standing_trunk_stiffness_nm_rad: f64 = 500.0, "N m/rad", within(0.0, 1e5);
        /// Trunk damping while standing.
        standing_trunk_damping_nms_rad: f64 = 100.0, "N m s/rad", within(0.0, 1e4);
        /// Largest trunk torque per body mass while standing.
        standing_trunk_limit_nm_kg: f64 = 2.5, "N m/kg", above(0.0, 100.0);
        /// Expected length of the first stride (section 4.1).
        first_stride_m: f64 = 1.333_333_333_333_333_3, "m", above(0.0, 5.0);
        /// Shortest stride that is expected of the next step, however little the last one led on, or back. The paper's human expects the last one's, whose cycle would vanish or run backwards.
        shortest_stride_m: f64 = 0.2, "m", within(0.05, 2.0);
        /// Damping ratio zeta of the pendulum leg (section 4.2).
        slip_damping_ratio: f64 = 0.2, "1", within(0.0, 0.95);
        /// Knee flexion of the posture at touch-down, which sets the pendulum's touch-down height (Figure 2).
        touch_down_knee_deg: f64 = 6.0, "deg", within(0.0, 40.0);
        /// Gain K_thrust to start with (section 4.3).
        thrust_gain_ns2_m2: f64 = 50.0, "N s^2/m^2", within(-1e4, 1e4);
        /// Factor on the forward thrust; 0 removes it. The braking of the stopping step stays (section 5.2.2).
        thrust_scale: f64 = 1.0, "1", within(0.0, 10.0);
        /// Factor on the lift forces of slow walking and stopping; 0 removes them (section 5.2.2).
        lift_scale: f64 = 1.0, "1", within(0.0, 10.0);
        /// Lift per speed deficit as a share of the pendulum stiffness (section 4.3).
        lift_gain_m_per_m_s: f64 = 0.1, "m/(m/s)", within(0.0, 1.0);
        /// Speed below which the hip is lifted (section 4.3).
        lift_speed_m_s: f64 = 1.1, "m/s", within(0.0, 5.0);
        /// Additional lift in the stopping step as a share of the pendulum stiffness.
        stop_lift_m: f64 = 0.04, "m", within(0.0, 1.0);
        /// Horizontal damping at the hip while standing on both legs (section 4.3).
        standing_damping_ns_m: f64 = 50.0, "N s/m", within(0.0, 1e4);
        /// Shortest time in a state of the intact leg (Figure 3).
        shortest_state_s: f64 = 0.2, "s", within(0.0, 2.0);
        /// Share of the expected cycle before the next heel strike counts.
        shortest_step_share: f64 = 0.9, "1", within(0.0, 2.0);
        /// Heel force that counts as heel strike.
        heel_strike_force_n: f64 = 1.0, "N", within(0.0, 1e3);
        /// How far the hip may be from passing mid-foot to stand still.
        stop_distance_m: f64 = 0.01, "m", within(-0.5, 0.5);
    }
}
