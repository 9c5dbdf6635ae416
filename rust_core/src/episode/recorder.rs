//! Recording of one walker at 200 Hz: the columns of a trial, in the units and signs of section 3.2 of the paper.
//! Powers are means since the previous row; everything else is sampled.

use crate::closed_loop::simulation::Sampled;
use crate::human::gait_fsm::IntactState;
use crate::prosthesis::knee::motor::geared_motor::Rotor;
use crate::schema::record::record;
use crate::signals::{CONTROL_PERIOD_S, GRAVITY};

record! {
    /// One sample of a walker: the columns of a trial.
    pub struct Row {
        time_s,
        intent,
        intended_speed_m_s,
        ambulation_speed_m_s,
        hip_x_m,
        hip_y_m,
        hip_vx_m_s,
        trunk_angle_deg,
        thigh_angle_deg,
        thigh_reference_deg,
        thigh_rough_reference_deg,
        knee_angle_deg,
        ankle_angle_deg,
        trunk_force_x_bw,
        trunk_force_y_bw,
        tube_force_bw,
        tube_moment_nm_kg,
        knee_torque_nm_kg,
        damper_torque_nm_kg,
        ankle_torque_nm_kg,
        hip_torque_nm_kg,
        extension_stop_torque_nm,
        flexion_stop_torque_nm,
        heel_height_m,
        ball_height_m,
        heel_force_bw,
        ball_force_bw,
        human_state,
        intact_leg_state,
        controller_state,
        command,
        extension_stop_peak_nm,
        pendulum_foot_x_m,
        push_force_n,
        motor_current_a,
        commanded_current_a,
        motor_speed_rad_s,
        commanded_torque_nm,
        gear_torque_nm,
        rotor_power_w,
        electrical_power_w,
        joule_power_w,
        gear_power_w,
        ground_height_m,
        pendulum_foot_y_m,
        socket_displacement_m,
        socket_tilt_rad,
        socket_force_bw,
        socket_moment_nm_kg,
        thigh_rate_rad_s,
        thigh_force_x_m_s2,
        thigh_force_y_m_s2,
        shank_rate_rad_s,
        shank_force_x_m_s2,
        shank_force_y_m_s2,
        trunk_reference_deg,
        trunk_torque_nm_kg,
        push_force_up_n,
        trunk_top_x_m,
        trunk_top_y_m,
        knee_x_m,
        knee_y_m,
        ankle_x_m,
        ankle_y_m,
        heel_x_m,
        heel_y_m,
        ball_x_m,
        ball_y_m,
        heel_force_forward_bw,
        heel_force_up_bw,
        ball_force_forward_bw,
        ball_force_up_bw,
        touch_down_foot_x_m,
        touch_down_foot_y_m,
    }
}

/// A foot strike, located in time by the stepper's events; the residual one when the human reacts to it, where that takes time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FootStrike {
    /// Time, s.
    pub time_s: f64,
    /// Whether the intact leg struck (else the residual one).
    pub intact: bool,
    /// Hip position, m.
    pub hip_x_m: f64,
}

/// Rows and foot strikes of one trial.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    /// One per control period.
    pub rows: Vec<Row>,
    /// In the order of time.
    pub strikes: Vec<FootStrike>,
    heel_strikes: u32,
    rotor: Rotor,
}

impl Recorder {
    /// Appends the present sample of `lane`.
    pub fn push<const L: usize>(&mut self, sampled: &Sampled<'_, L>, lane: usize) {
        self.push_strikes(sampled, lane);
        let rotor = sampled.simulation.state.rotor.get(lane);
        let since_last = |now: f64, last: f64| (now - last) / CONTROL_PERIOD_S;
        let rotor_power = since_last(rotor.rotor_work, self.rotor.rotor_work);
        let joule_power = since_last(rotor.joule_heat, self.rotor.joule_heat);
        let powers =
            [rotor_power, rotor_power + joule_power, joule_power, since_last(rotor.knee_work, self.rotor.knee_work)];
        self.rotor = rotor;
        self.rows.push(row(sampled, lane, powers));
    }

    fn push_strikes<const L: usize>(&mut self, sampled: &Sampled<'_, L>, lane: usize) {
        let memory = sampled.simulation.walkers.memory(lane);
        let mut new = Vec::new();
        if memory.heel_strikes > self.heel_strikes {
            self.heel_strikes = memory.heel_strikes;
            new.push(FootStrike { time_s: memory.step_start, intact: false, hip_x_m: memory.step_start_x });
        }
        let grounded = matches!(memory.intact, IntactState::Stance | IntactState::Double);
        let last_touch_down =
            self.strikes.iter().rev().find(|strike| strike.intact).map_or(0.0, |strike| strike.time_s);
        if grounded && memory.touch_down > last_touch_down {
            new.push(FootStrike { time_s: memory.touch_down, intact: true, hip_x_m: memory.touch_down_x });
        }
        new.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        self.strikes.extend(new);
    }
}

/// The present row of `lane`, which lacks (NaN) the mean powers since the previous one.
pub fn snapshot<const L: usize>(sampled: &Sampled<'_, L>, lane: usize) -> Row {
    row(sampled, lane, [f64::NAN; 4])
}

/// `powers`: means since the previous row of rotor, electrical, Joule and knee power, W.
fn row<const L: usize>(
    sampled: &Sampled<'_, L>,
    lane: usize,
    [rotor_power, electrical_power, joule_power, knee_power]: [f64; 4],
) -> Row {
    let Sampled { model, simulation, scratch } = *sampled;
    let (plant, walkers) = (sampled.plant(), &simulation.walkers);
    let motion = simulation.state.motion.get(lane);
    let smooth = simulation.state.reference.get(lane);
    let time = simulation.state.rest.time[lane];
    let body = plant.body(lane);
    let memory = walkers.memory(lane);
    let device = plant.device(lane);
    let trunk = plant.trunk_force(lane);
    let reactions = plant.reactions(lane);
    let (pendulum_foot_x, grounded) = walkers.pendulum_foot(lane);
    let [rear_load, front_load] = plant.sole_load(lane);
    let [rear_force, front_force] = plant.sole_force(lane);
    let skeleton = plant.skeleton(lane);
    let waiting_foot = plant.touch_down_foot(lane);
    let socket = plant.socket(lane);
    let truth = scratch.truth.get(lane);
    let weight = body.mass * GRAVITY;
    let rotor = simulation.state.rotor.get(lane);
    let motor = plant.motor_signals(lane);
    let (motor_limit, torque_per_ampere) = model.plant.unit.motor_scale(lane);
    let commanded_current = if motor_limit > 0.0 { walkers.command[lane] } else { 0.0 };
    Row {
        time_s: time,
        intent: walkers.intent[lane],
        intended_speed_m_s: walkers.profile[lane].speed(time),
        ambulation_speed_m_s: memory.ambulation_speed,
        hip_x_m: motion.hip_x,
        hip_y_m: motion.hip_y,
        hip_vx_m_s: motion.hip_vx,
        trunk_angle_deg: plant.trunk_angle(lane).to_degrees(),
        thigh_angle_deg: motion.thigh.to_degrees(),
        thigh_reference_deg: (smooth.trunk + smooth.hip).to_degrees(),
        thigh_rough_reference_deg: plant.rough_thigh(lane).to_degrees(),
        knee_angle_deg: device.knee_angle.to_degrees(),
        // -q8 - 4 deg: plantarflexion is positive, a right angle between foot and shank is 0.
        ankle_angle_deg: -(plant.joints(lane).ankle + body.foot_mount).to_degrees(),
        trunk_force_x_bw: trunk.x / weight,
        trunk_force_y_bw: trunk.y / weight,
        tube_force_bw: -reactions.tube_force / weight,
        tube_moment_nm_kg: -reactions.tube_torque / body.mass,
        knee_torque_nm_kg: device.knee / body.mass,
        damper_torque_nm_kg: device.damper / body.mass,
        ankle_torque_nm_kg: -device.ankle / body.mass,
        hip_torque_nm_kg: plant.hip_torque(lane) / body.mass,
        extension_stop_torque_nm: device.extension_stop,
        flexion_stop_torque_nm: device.flexion_stop,
        heel_height_m: plant.foot_height(0, lane),
        ball_height_m: plant.foot_height(1, lane),
        heel_force_bw: rear_load / weight,
        ball_force_bw: front_load / weight,
        human_state: f64::from(memory.residual as u8),
        intact_leg_state: f64::from(memory.intact as u8),
        controller_state: f64::from(simulation.state_machine[lane].phase()),
        command: walkers.command[lane],
        extension_stop_peak_nm: walkers.extension_stop_peak[lane],
        pendulum_foot_x_m: if grounded { pendulum_foot_x } else { f64::NAN },
        push_force_n: walkers.push_x[lane],
        motor_current_a: motor.current,
        commanded_current_a: commanded_current,
        motor_speed_rad_s: rotor.rate,
        // In the sign of joint 5, like the knee torque: extension is positive.
        commanded_torque_nm: -commanded_current.clamp(-motor_limit, motor_limit) * torque_per_ampere,
        gear_torque_nm: -motor.gear_torque,
        rotor_power_w: rotor_power,
        electrical_power_w: electrical_power,
        joule_power_w: joule_power,
        gear_power_w: knee_power,
        ground_height_m: model.plant.ground_height(lane, motion.hip_x),
        pendulum_foot_y_m: if grounded { memory.slip_foot_y } else { f64::NAN },
        socket_displacement_m: socket.pistoning,
        socket_tilt_rad: socket.tilt,
        socket_force_bw: socket.force / weight,
        socket_moment_nm_kg: socket.moment / body.mass,
        thigh_rate_rad_s: truth.thigh_rate,
        thigh_force_x_m_s2: truth.thigh_force_x,
        thigh_force_y_m_s2: truth.thigh_force_y,
        shank_rate_rad_s: truth.shank_rate,
        shank_force_x_m_s2: truth.shank_force_x,
        shank_force_y_m_s2: truth.shank_force_y,
        trunk_reference_deg: smooth.trunk.to_degrees(),
        trunk_torque_nm_kg: reactions.trunk_torque / body.mass,
        push_force_up_n: walkers.push_y[lane],
        trunk_top_x_m: skeleton.trunk_top[0],
        trunk_top_y_m: skeleton.trunk_top[1],
        knee_x_m: skeleton.knee[0],
        knee_y_m: skeleton.knee[1],
        ankle_x_m: skeleton.ankle[0],
        ankle_y_m: skeleton.ankle[1],
        heel_x_m: skeleton.heel[0],
        heel_y_m: skeleton.heel[1],
        ball_x_m: skeleton.ball[0],
        ball_y_m: skeleton.ball[1],
        heel_force_forward_bw: rear_force[0] / weight,
        heel_force_up_bw: rear_force[1] / weight,
        ball_force_forward_bw: front_force[0] / weight,
        ball_force_up_bw: front_force[1] / weight,
        touch_down_foot_x_m: if grounded { f64::NAN } else { waiting_foot[0] },
        touch_down_foot_y_m: if grounded { f64::NAN } else { waiting_foot[1] },
    }
}
