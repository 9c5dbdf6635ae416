//! What the agent sees: groups of channels, each in a unit that keeps it near 1.

use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantNames};

use crate::closed_loop::simulation::Sampled;
use crate::human::gait_fsm::ResidualState;
use crate::prosthesis::knee::kind::DeviceKind;
use crate::schema::error::{Error, Result};
use crate::schema::params::{Parameter, Range, params, within};
use crate::signals::{GRAVITY, Readings, ReadingsLanes};

/// Channels that belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, IntoStaticStr, VariantNames)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Group {
    /// Encoder of the knee.
    Knee,
    /// Load cells of the tube.
    Load,
    /// Inclination and gyroscope of the shank.
    Shank,
    /// Accelerometer of the shank.
    ShankForce,
    /// Gyroscope and accelerometer of the thigh.
    Thigh,
    /// Load cell of the ankle.
    Ankle,
    /// What was commanded and what the state machine would command.
    Command,
    /// Speed and current of the motor; no channels in a leg without.
    Motor,
    /// Gait phase of the state machine.
    Phase,
    /// What only a simulator knows, for critics and teachers.
    Privileged,
}

/// The groups of an observation, in order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Groups(pub Vec<Group>);

impl Default for Groups {
    fn default() -> Self {
        Self(vec![Group::Knee, Group::Load, Group::Shank, Group::Command, Group::Motor])
    }
}

impl Parameter for Groups {
    fn numbers(&self) -> [f64; 2] {
        [1.0; 2]
    }
    fn text(&self) -> String {
        format!("[{}]", self.0.iter().map(<&str>::from).collect::<Vec<_>>().join(", "))
    }
    fn allowed(_: Range) -> String {
        format!("list of {}", Group::VARIANTS.join(", "))
    }
    fn check(&self, key: &str) -> Result<()> {
        let twice = self.0.iter().enumerate().find(|(index, group)| self.0[..*index].contains(group));
        let reason = match twice {
            Some((_, group)) => format!("names {group:?} twice"),
            None if self.0.is_empty() => "must name at least one group".to_owned(),
            None => return Ok(()),
        };
        Err(Error::Schema { key: key.to_owned(), reason })
    }
}

params! {
    /// What the agent sees.
    pub struct ObservationParams {
        /// Groups of channels in a frame, in order; `motor` is left out of a leg without one, `privileged` is what only a simulator knows.
        groups: Groups = Groups::default(), "", within(0.0, 1.0);
        /// Frames in an observation: the newest and `frames - 1` before it, one per env step.
        frames: usize = 1, "", within(1.0, 64.0);
    }
}

/// One entry of an observation frame.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    /// Group that it belongs to.
    pub group: Group,
    /// Name with unit.
    pub name: &'static str,
    /// Bounds that values are limited to.
    pub bounds: [f32; 2],
    /// Meaning and sensor.
    pub doc: &'static str,
}

/// What the channels of a walker are taken from.
#[derive(Clone, Copy, Debug)]
pub struct Sight<'a, const L: usize> {
    /// Lane of the walker.
    pub lane: usize,
    /// Readings of the sensors.
    pub readings: &'a ReadingsLanes<L>,
    /// Last command over that of a full action.
    pub last_command: f64,
    /// Command of the state machine over that of a full action.
    pub state_machine: f64,
    /// Gait phase of the state machine.
    pub phase: u8,
    /// What only a simulator knows.
    pub truth: &'a Truth,
}

impl<const L: usize> Sight<'_, L> {
    #[inline(always)]
    fn readings(&self) -> Readings {
        self.readings.get(self.lane)
    }
}

/// True state of a walker.
#[derive(Clone, Copy, Debug, Default)]
pub struct Truth {
    hip_height_m: f64,
    hip_vx_m_s: f64,
    hip_vy_m_s: f64,
    trunk_angle_rad: f64,
    thigh_angle_rad: f64,
    thigh_rate_rad_s: f64,
    knee_angle_rad: f64,
    knee_speed_rad_s: f64,
    ankle_angle_rad: f64,
    heel_force_bw: f64,
    ball_force_bw: f64,
    pendulum_force_bw: f64,
    push_force_bw: f64,
    step_phase: f64,
    intent: f64,
    intended_speed_m_s: f64,
    ambulation_speed_m_s: f64,
}

impl Truth {
    /// True state of the walker in `lane`.
    pub fn of<const L: usize>(sampled: &Sampled<'_, L>, lane: usize) -> Self {
        let (plant, simulation) = (sampled.plant(), sampled.simulation);
        let (motion, walkers) = (plant.motion(lane), &simulation.walkers);
        let (memory, time) = (walkers.memory(lane), simulation.state.rest.time[lane]);
        let weight = plant.body(lane).mass * GRAVITY;
        let trunk = plant.trunk_force(lane);
        let stands = memory.residual == ResidualState::Stand;
        Self {
            hip_height_m: plant.hip_height(lane),
            hip_vx_m_s: motion.hip_vx,
            hip_vy_m_s: motion.hip_vy,
            trunk_angle_rad: plant.trunk_angle(lane),
            thigh_angle_rad: motion.thigh,
            thigh_rate_rad_s: motion.thigh_rate,
            knee_angle_rad: plant.knee_flexion(lane),
            knee_speed_rad_s: motion.thigh_rate - motion.shank_rate,
            ankle_angle_rad: plant.joints(lane).ankle,
            heel_force_bw: plant.contact_force(0, lane) / weight,
            ball_force_bw: plant.contact_force(1, lane) / weight,
            pendulum_force_bw: trunk.x.hypot(trunk.y) / weight,
            push_force_bw: walkers.push_x[lane] / weight,
            step_phase: if stands { 0.0 } else { (time - memory.step_start) / memory.cycle },
            intent: walkers.intent[lane],
            intended_speed_m_s: walkers.profile[lane].speed(time),
            ambulation_speed_m_s: memory.ambulation_speed,
        }
    }
}

macro_rules! channels {
    ($($group:ident { $($name:ident: [$low:literal, $high:literal], $doc:literal, $value:expr;)+ })+) => {
        /// Every channel there is, group by group.
        const CHANNELS: &[Channel] = &[$($(Channel {
            group: Group::$group,
            name: stringify!($name),
            bounds: [$low, $high],
            doc: $doc,
        }),+),+];

        impl Group {
            /// Writes the group's channels to the start of `frame`, and returns how many they are.
            #[inline(always)]
            fn write<const L: usize>(self, sight: &Sight<'_, L>, frame: &mut [f32]) -> usize {
                let mut written = 0;
                match self {
                    $(Self::$group => {
                        $(
                            let value: fn(&Sight<'_, L>) -> f64 = $value;
                            // NaN becomes the lower bound: a diverged walker ends its episode, and its last observation stays
                            // in the space.
                            frame[written] = (value(sight) as f32).max($low).min($high);
                            written += 1;
                        )+
                    })+
                }
                written
            }
        }
    };
}

channels! {
    Knee {
        knee_angle_rad: [-1.0, 4.0], "Knee flexion from the quantised encoder", |s| s.readings().knee_angle;
        knee_speed_rad_s: [-50.0, 50.0], "Knee flexion velocity: filtered difference of the encoder", |s| s.readings().knee_speed;
    }
    Load {
        tube_force_bw: [-20.0, 20.0], "Axial load of the tube sensor in body weights, compression positive", |s| s.readings().tube_force_bw;
        tube_moment_nm_kg: [-20.0, 20.0], "Bending moment of the tube sensor per body mass, forefoot load positive", |s| s.readings().tube_moment_nm_kg;
    }
    Shank {
        shank_angle_rad: [-10.0, 10.0], "Inclination of the shank from its inertial sensor, ankle ahead of the knee positive", |s| s.readings().shank_angle;
        shank_rate_rad_s: [-50.0, 50.0], "Angular velocity of the shank from its inertial sensor", |s| s.readings().shank_rate;
    }
    ShankForce {
        shank_force_x_10_m_s2: [-100.0, 100.0], "Specific force at the shank's inertial sensor, forward across the shank, in 10 m/s^2", |s| 0.1 * s.readings().shank_force_x;
        shank_force_y_10_m_s2: [-100.0, 100.0], "Specific force at the shank's inertial sensor, up along the shank, in 10 m/s^2", |s| 0.1 * s.readings().shank_force_y;
    }
    Thigh {
        thigh_rate_rad_s: [-50.0, 50.0], "Angular velocity of the thigh from its inertial sensor", |s| s.readings().thigh_rate;
        thigh_force_x_10_m_s2: [-100.0, 100.0], "Specific force at the thigh's inertial sensor, forward across the thigh, in 10 m/s^2", |s| 0.1 * s.readings().thigh_force_x;
        thigh_force_y_10_m_s2: [-100.0, 100.0], "Specific force at the thigh's inertial sensor, up along the thigh, in 10 m/s^2", |s| 0.1 * s.readings().thigh_force_y;
    }
    Ankle {
        ankle_moment_nm_kg: [-20.0, 20.0], "Moment of the ankle per body mass, plantarflexing positive", |s| s.readings().ankle_moment_nm_kg;
        ankle_moment_rate_10_nm_kg_s: [-100.0, 100.0], "Its filtered rate, in 10 N m/kg/s", |s| 0.1 * s.readings().ankle_moment_rate;
    }
    Command {
        last_command: [-50.0, 50.0], "Last command over that of a full action", |s| s.last_command;
        state_machine_command: [-50.0, 50.0], "What the state machine would command now, over the command of a full action", |s| s.state_machine;
    }
    Motor {
        motor_speed_100_rad_s: [-20.0, 20.0], "Motor speed in 100 rad/s, flexing positive", |s| s.readings().motor_speed * 0.01;
        motor_current_a: [-50.0, 50.0], "Motor current, flexing positive", |s| s.readings().motor_current;
    }
    Phase {
        in_phase_1: [0.0, 1.0], "1 in the state machine's phase 1, early stance", |s| f64::from(u8::from(s.phase == 1));
        in_phase_2: [0.0, 1.0], "1 in the state machine's phase 2, mid stance", |s| f64::from(u8::from(s.phase == 2));
        in_phase_3: [0.0, 1.0], "1 in the state machine's phase 3, late stance", |s| f64::from(u8::from(s.phase == 3));
        in_phase_4: [0.0, 1.0], "1 in the state machine's phase 4, swing flexion", |s| f64::from(u8::from(s.phase == 4));
        in_phase_5: [0.0, 1.0], "1 in the state machine's phase 5, swing extension", |s| f64::from(u8::from(s.phase == 5));
    }
    Privileged {
        true_hip_height_m: [-10.0, 10.0], "Height of the hip above the ground below it", |s| s.truth.hip_height_m;
        true_hip_vx_m_s: [-20.0, 20.0], "Forward velocity of the hip", |s| s.truth.hip_vx_m_s;
        true_hip_vy_m_s: [-20.0, 20.0], "Upward velocity of the hip", |s| s.truth.hip_vy_m_s;
        true_trunk_angle_rad: [-10.0, 10.0], "Angle of the trunk, backward lean positive", |s| s.truth.trunk_angle_rad;
        true_thigh_angle_rad: [-10.0, 10.0], "Angle of the thigh, flexion positive", |s| s.truth.thigh_angle_rad;
        true_thigh_rate_rad_s: [-100.0, 100.0], "Angular velocity of the thigh", |s| s.truth.thigh_rate_rad_s;
        true_knee_angle_rad: [-10.0, 10.0], "Knee flexion", |s| s.truth.knee_angle_rad;
        true_knee_speed_rad_s: [-100.0, 100.0], "Knee flexion velocity", |s| s.truth.knee_speed_rad_s;
        true_ankle_angle_rad: [-10.0, 10.0], "Angle of the ankle from its rest", |s| s.truth.ankle_angle_rad;
        true_heel_force_bw: [-1.0, 50.0], "Normal force on the heel in body weights", |s| s.truth.heel_force_bw;
        true_ball_force_bw: [-1.0, 50.0], "Normal force on the ball in body weights", |s| s.truth.ball_force_bw;
        true_pendulum_force_bw: [-1.0, 50.0], "Force of the intact leg in body weights", |s| s.truth.pendulum_force_bw;
        true_push_force_bw: [-50.0, 50.0], "Disturbance on the trunk, forward, in body weights", |s| s.truth.push_force_bw;
        true_step_phase: [-1.0, 10.0], "Time since the residual heel strike over the expected stride time; 0 while standing", |s| s.truth.step_phase;
        true_intent: [0.0, 1.0], "1 if the human intends to walk", |s| s.truth.intent;
        true_intended_speed_m_s: [0.0, 5.0], "Intended speed", |s| s.truth.intended_speed_m_s;
        true_ambulation_speed_m_s: [-20.0, 20.0], "Speed over the last cycle", |s| s.truth.ambulation_speed_m_s;
    }
}

/// The channels of one configuration's frame.
#[derive(Clone, Debug)]
pub struct ObservationMap {
    groups: Vec<Group>,
    channels: Vec<Channel>,
    /// Whether any of them is one that only a simulator knows.
    pub privileged: bool,
}

impl ObservationMap {
    /// The channels of the configured groups, in their order.
    pub fn new(params: &ObservationParams, kind: DeviceKind) -> Self {
        let mut groups = params.groups.0.clone();
        groups.retain(|&group| group != Group::Motor || kind.has_motor());
        let of = |&group: &Group| CHANNELS.iter().filter(move |channel| channel.group == group).copied();
        Self { channels: groups.iter().flat_map(of).collect(), privileged: groups.contains(&Group::Privileged), groups }
    }

    /// An error if there are none: nobody could learn from that.
    pub fn check(&self) -> Result<()> {
        if !self.channels.is_empty() {
            return Ok(());
        }
        Err(Error::Schema {
            key: "observation.groups".to_owned(),
            reason: "[motor] has no channels in a leg without a motor: name another group, or take device.kind = motor"
                .to_owned(),
        })
    }

    /// The channels, in order.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Writes a frame.
    #[inline(always)]
    pub fn write<const L: usize>(&self, sight: &Sight<'_, L>, frame: &mut [f32]) {
        self.groups.iter().fold(0, |written, group| written + group.write(sight, &mut frame[written..]));
    }
}
