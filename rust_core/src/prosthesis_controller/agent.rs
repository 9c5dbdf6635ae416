//! Command pass-through for the agent: from its action to a damping coefficient, from readings to its observation.

use serde::{Deserialize, Serialize};

use crate::math::clamp;
use crate::params::{ANY, Parameter, Range, above, params, within};
use crate::signals::Readings;

/// What the action means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ActionMode {
    /// The damping coefficient itself, quadratic from 0 at -1 to `action.max_command_nms2_rad2` at +1.
    #[default]
    Direct,
    /// A correction of up to +-`action.residual_nms2_rad2`, added to the state machine's coefficient.
    Residual,
    /// None: the state machine alone drives the knee.
    StateMachine,
    /// None: the coefficient is always `action.constant_nms2_rad2`.
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
        /// What the action means: a damping coefficient (direct), a correction added to the state machine's (residual), nothing (state_machine, constant).
        mode: ActionMode = ActionMode::Direct, "", ANY;
        /// Coefficient at action +1 in mode `direct`, and upper limit in mode `residual`.
        max_command_nms2_rad2: f64 = 20.0, "N m s^2/rad^2", above(0.0, 1e4);
        /// Correction at action +1 in mode `residual`.
        residual_nms2_rad2: f64 = 10.0, "N m s^2/rad^2", above(0.0, 1e4);
        /// Coefficient of mode `constant`.
        constant_nms2_rad2: f64 = 0.0, "N m s^2/rad^2", within(0.0, 1e4);
        /// Control periods of 5 ms that one action holds for; one env step advances that many.
        hold: usize = 1, "samples", within(1.0, 200.0);
    }
}

impl ActionParams {
    /// Damping coefficient (N m s^2/rad^2) for an action in [-1, 1], which is limited to that interval.
    #[inline(always)]
    pub fn command(&self, action: f64, state_machine: f64) -> f64 {
        let action = clamp(action, -1.0, 1.0);
        match self.mode {
            ActionMode::Direct => self.max_command_nms2_rad2 * (0.25 * (action + 1.0) * (action + 1.0)),
            ActionMode::Residual => {
                // The state machine may exceed the agent's limit; the agent must not cut it.
                let limit = state_machine.max(self.max_command_nms2_rad2);
                clamp(state_machine + self.residual_nms2_rad2 * action, 0.0, limit)
            }
            ActionMode::StateMachine => state_machine,
            ActionMode::Constant => self.constant_nms2_rad2,
        }
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

/// Observation frame, in order.
pub const CHANNELS: [Channel; 8] = [
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
    Channel {
        name: "last_command",
        bounds: [0.0, 50.0],
        doc: "Last damping coefficient over action.max_command_nms2_rad2",
    },
    Channel {
        name: "state_machine_command",
        bounds: [0.0, 50.0],
        doc: "Coefficient that the state machine would set now, over action.max_command_nms2_rad2",
    },
];

/// One observation frame from readings.
pub fn frame(
    params: &ActionParams,
    readings: &Readings,
    last_command: f64,
    state_machine: f64,
) -> [f32; CHANNELS.len()] {
    let per_command = 1.0 / params.max_command_nms2_rad2;
    let values = [
        readings.knee_angle,
        readings.knee_speed,
        readings.tube_force_bw,
        readings.tube_moment_nm_kg,
        readings.shank_angle,
        readings.shank_rate,
        last_command * per_command,
        state_machine * per_command,
    ];
    std::array::from_fn(|i| {
        let [low, high] = CHANNELS[i].bounds;
        // NaN becomes the lower bound: a diverged walker ends its episode, and its last observation stays in the space.
        (values[i] as f32).max(low).min(high)
    })
}
