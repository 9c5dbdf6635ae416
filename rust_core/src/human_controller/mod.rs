//! Human controller (section 4): intent and speed in, hip and trunk references and trunk forces out.
//!
//! Everything that changes only at steps is kept in [`gait_fsm::Memory`]; from it follow the [`Drive`] that the continuous
//! equations run on and the [`gait_fsm::Guard`] of the next transition, both without a branch on the state.

pub mod gait_fsm;
pub mod impedance;
pub mod intent;
pub mod reference;
pub mod slip_leg;
pub mod variation;

use crate::lanes::lanes;
use crate::params::{above, params, within};
use variation::HumanVariation;

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

/// The human of one walker in one episode.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Individual {
    /// Parameters, with changes and factors of the variation in them.
    pub params: HumanParams,
    /// What this human does otherwise than the paper's.
    pub variation: HumanVariation,
}

impl Individual {
    /// A human of the given parameters, varied.
    pub fn new(params: &HumanParams, variation: HumanVariation) -> Self {
        Self { params: params.varied(&variation), variation }
    }
}

lanes! {
    /// Constants of one walker's human, SI.
    pub struct Human, HumanLanes {
        /// Total mass of the system, kg.
        mass: f64,
        /// Effective mass of the pendulum leg: the trunk's, kg.
        slip_mass: f64,
        /// Rest length of the pendulum leg: that of the residual leg, m.
        leg_length: f64,
        /// Hip height at which the intact leg touches down, m.
        touch_down_height: f64,
        /// sin of the angle of attack.
        touch_down_sin: f64,
        /// Angle of attack alpha_p, rad.
        touch_down_angle: f64,
        /// pi / (2 alpha_p).
        lift_phase: f64,
        /// Heel to ball, m.
        foot_length: f64,
    }
}

/// Geometry and mass that the human controller is scheduled on.
#[derive(Clone, Copy, Debug)]
pub struct LegGeometry {
    /// Total mass, kg.
    pub mass: f64,
    /// Trunk mass, kg.
    pub trunk_mass: f64,
    /// Thigh + shank + foot height, m.
    pub leg_length: f64,
    /// Hip height above the heel in the touch-down posture, m.
    pub touch_down_height: f64,
    /// Heel to ball, m.
    pub foot_length: f64,
}

impl From<LegGeometry> for Human {
    fn from(leg: LegGeometry) -> Self {
        let angle = (leg.touch_down_height / leg.leg_length).acos();
        Self {
            mass: leg.mass,
            slip_mass: leg.trunk_mass,
            leg_length: leg.leg_length,
            touch_down_height: leg.touch_down_height,
            touch_down_sin: angle.sin(),
            touch_down_angle: angle,
            lift_phase: std::f64::consts::FRAC_PI_2 / angle,
            foot_length: leg.foot_length,
        }
    }
}

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
