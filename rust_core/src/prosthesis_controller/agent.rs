//! Command pass-through for the agent: from its action to a command, from readings to its observation.

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::math::clamp;
use crate::params::{ANY, Parameter, Range, above, params, within};
use crate::prosthesis_device::DeviceKind;
use crate::signals::Readings;

/// What the action means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ActionMode {
    /// The command itself.
    #[default]
    Direct,
    /// A correction, added to the state machine's command.
    Residual,
    /// None: the state machine alone drives the knee.
    StateMachine,
    /// None: the command is constant.
    Constant,
}

impl Parameter for ActionMode {
    fn numbers(&self) -> [f64; 2] {
        [0.0; 2]
    }
    fn text(&self) -> String {
        format!("{self:?}").to_lowercase()
    }
    fn allowed(_: Range) -> String {
        "direct | residual | state_machine | constant".to_owned()
    }
}

params! {
    /// How actions become commands.
    pub struct ActionParams {
        /// What the action means: the command itself (direct), a correction added to the state machine's (residual), nothing (state_machine, constant).
        mode: ActionMode = ActionMode::Direct, "", ANY;
        /// Damper knee: coefficient at action +1 in mode `direct`, and upper limit in mode `residual`.
        max_command_nms2_rad2: f64 = 20.0, "N m s^2/rad^2", above(0.0, 1e4);
        /// Damper knee: correction at action +1 in mode `residual`.
        residual_nms2_rad2: f64 = 10.0, "N m s^2/rad^2", above(0.0, 1e4);
        /// Damper knee: coefficient of mode `constant`.
        constant_nms2_rad2: f64 = 0.0, "N m s^2/rad^2", within(0.0, 1e4);
        /// Motor knee: correction at action +1 in mode `residual`.
        residual_a: f64 = 2.0, "A", above(0.0, 1e3);
        /// Motor knee: current of mode `constant`, flexing positive.
        constant_a: f64 = 0.0, "A", within(-1e3, 1e3);
        /// Friction knee: correction at action +1 in mode `residual`.
        residual_nm: f64 = 5.0, "N m", above(0.0, 1e3);
        /// Friction knee: friction torque of mode `constant`.
        constant_nm: f64 = 0.0, "N m", within(0.0, 1e3);
        /// Control periods of 5 ms that one action holds for; one env step advances that many.
        hold: usize = 1, "samples", within(1.0, 200.0);
    }
}

/// From actions in [-1, 1] to commands of one knee unit.
#[derive(Clone, Copy, Debug)]
pub struct ActionMap {
    mode: ActionMode,
    /// Whether commands have a sign (current) or none (damping, friction).
    signed: bool,
    /// Command at action +1.
    full: f64,
    residual: f64,
    constant: f64,
    /// What the unit can do at most.
    limit: f64,
}

impl ActionMap {
    /// The map of the configured knee unit.
    pub fn new(config: &Config) -> Self {
        let action = &config.action;
        match config.device.kind {
            DeviceKind::Damper => Self {
                mode: action.mode,
                signed: false,
                full: action.max_command_nms2_rad2,
                residual: action.residual_nms2_rad2,
                constant: action.constant_nms2_rad2,
                limit: config.knee.max_damping_nms2_rad2,
            },
            DeviceKind::Motor => Self {
                mode: action.mode,
                signed: true,
                full: config.motor.current_limit_a,
                residual: action.residual_a,
                constant: action.constant_a,
                limit: config.motor.current_limit_a,
            },
            DeviceKind::Friction => Self {
                mode: action.mode,
                signed: false,
                full: config.friction_knee.max_friction_nm,
                residual: action.residual_nm,
                constant: action.constant_nm,
                limit: config.friction_knee.max_friction_nm,
            },
        }
    }

    /// Command for an action, which is limited to [-1, 1]. A current is proportional to it, damping and friction are
    /// quadratic from 0 at -1.
    #[inline(always)]
    pub fn command(&self, action: f64, state_machine: f64) -> f64 {
        let action = clamp(action, -1.0, 1.0);
        let command = match self.mode {
            ActionMode::Direct if self.signed => self.full * action,
            ActionMode::Direct => self.full * (0.25 * (action + 1.0) * (action + 1.0)),
            // The state machine may exceed the agent's range; the agent must not cut it.
            ActionMode::Residual => (state_machine + self.residual * action).min(state_machine.max(self.full)),
            ActionMode::StateMachine => state_machine,
            ActionMode::Constant => self.constant,
        };
        clamp(command, if self.signed { -self.limit } else { 0.0 }, self.limit)
    }

    /// A command over that of a full action, for observations and rewards.
    pub fn relative(&self, command: f64) -> f64 {
        command / self.full
    }
}

params! {
    /// What the agent sees.
    pub struct ObservationParams {
        /// Frames in an observation: the newest and `frames - 1` before it, one per env step.
        frames: usize = 1, "", within(1.0, 64.0);
    }
}

/// One entry of an observation frame.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    /// Name with unit.
    pub name: &'static str,
    /// Bounds that readings are limited to.
    pub bounds: [f32; 2],
    /// Meaning and sensor.
    pub doc: &'static str,
}

/// Observation frame, in order; the last [`MOTOR_CHANNELS`] exist only in a leg with a motor.
const CHANNELS: [Channel; 10] = [
    Channel { name: "knee_angle_rad", bounds: [-1.0, 4.0], doc: "Knee flexion from the quantised encoder" },
    Channel {
        name: "knee_speed_rad_s",
        bounds: [-50.0, 50.0],
        doc: "Knee flexion velocity: filtered difference of the encoder",
    },
    Channel {
        name: "tube_force_bw",
        bounds: [-20.0, 20.0],
        doc: "Axial load of the tube sensor in body weights, compression positive",
    },
    Channel {
        name: "tube_moment_nm_kg",
        bounds: [-20.0, 20.0],
        doc: "Bending moment of the tube sensor per body mass, forefoot load positive",
    },
    Channel {
        name: "shank_angle_rad",
        bounds: [-10.0, 10.0],
        doc: "Inclination of the shank from its inertial sensor, ankle ahead of the knee positive",
    },
    Channel {
        name: "shank_rate_rad_s",
        bounds: [-50.0, 50.0],
        doc: "Angular velocity of the shank from its inertial sensor",
    },
    Channel { name: "last_command", bounds: [-50.0, 50.0], doc: "Last command over that of a full action" },
    Channel {
        name: "state_machine_command",
        bounds: [-50.0, 50.0],
        doc: "What the state machine would command now, over the command of a full action",
    },
    Channel { name: "motor_speed_100_rad_s", bounds: [-20.0, 20.0], doc: "Motor speed in 100 rad/s, flexing positive" },
    Channel { name: "motor_current_a", bounds: [-50.0, 50.0], doc: "Motor current, flexing positive" },
];
const MOTOR_CHANNELS: usize = 2;

/// Longest frame of any knee unit.
pub const LONGEST_FRAME: usize = CHANNELS.len();

/// Observation frame of a leg with the given knee unit, in order.
pub fn channels(device: DeviceKind) -> &'static [Channel] {
    match device {
        DeviceKind::Damper | DeviceKind::Friction => &CHANNELS[..CHANNELS.len() - MOTOR_CHANNELS],
        DeviceKind::Motor => &CHANNELS,
    }
}

/// One observation frame; the first `channels(..).len()` values count.
pub fn frame(map: &ActionMap, readings: &Readings, last_command: f64, state_machine: f64) -> [f32; LONGEST_FRAME] {
    let values = [
        readings.knee_angle,
        readings.knee_speed,
        readings.tube_force_bw,
        readings.tube_moment_nm_kg,
        readings.shank_angle,
        readings.shank_rate,
        map.relative(last_command),
        map.relative(state_machine),
        readings.motor_speed * 0.01,
        readings.motor_current,
    ];
    std::array::from_fn(|i| {
        let [low, high] = CHANNELS[i].bounds;
        // NaN becomes the lower bound: a diverged walker ends its episode, and its last observation stays in the space.
        (values[i] as f32).max(low).min(high)
    })
}
