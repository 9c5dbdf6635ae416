//! Prosthesis controllers, run at 200 Hz on sensor readings.

pub mod agent;
pub mod damper_fsm;
pub mod motor_fsm;

use crate::config::Config;
use crate::prosthesis_device::DeviceKind;
use crate::signals::Readings;
use damper_fsm::{DamperFsm, DamperFsmParams};
use motor_fsm::{MotorFsm, MotorFsmParams};

/// Parameters of the reference controller that belongs to the knee unit.
#[derive(Clone, Debug)]
pub enum ReferenceParams {
    /// Figure 6.
    Damper(DamperFsmParams),
    /// Figure 10, and the motor's current limit, A.
    Motor(MotorFsmParams, f64),
    /// A command that never changes.
    Constant(f64),
}

impl From<&Config> for ReferenceParams {
    fn from(config: &Config) -> Self {
        match config.device.kind {
            DeviceKind::Damper => Self::Damper(config.state_machine.clone()),
            DeviceKind::Motor => Self::Motor(config.motor_state_machine.clone(), config.motor.current_limit_a),
            DeviceKind::Friction => Self::Constant(config.friction_knee.set_friction_nm),
        }
    }
}

impl ReferenceParams {
    /// A controller at its start.
    pub fn start(&self) -> ReferenceController {
        match self {
            Self::Damper(_) => ReferenceController::Damper(DamperFsm::default()),
            Self::Motor(..) => ReferenceController::Motor(MotorFsm::default()),
            Self::Constant(_) => ReferenceController::Constant,
        }
    }
}

/// Reference controller of one walker.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub enum ReferenceController {
    /// Figure 6.
    Damper(DamperFsm),
    /// Figure 10.
    Motor(MotorFsm),
    /// Of a knee that is set once.
    Constant,
}

impl ReferenceController {
    /// Takes one sample and returns the command to the knee unit, in its own unit.
    pub fn update(&mut self, params: &ReferenceParams, readings: &Readings) -> f64 {
        match (self, params) {
            (Self::Damper(machine), ReferenceParams::Damper(params)) => machine.update(params, readings),
            (Self::Motor(machine), ReferenceParams::Motor(params, limit)) => machine.update(params, *limit, readings),
            (Self::Constant, ReferenceParams::Constant(command)) => *command,
            _ => 0.0,
        }
    }

    /// Number of the phase: 1 to 5 (Figures 6 and 10), always 1 where there is but one.
    pub fn phase(&self) -> u8 {
        match self {
            Self::Damper(machine) => machine.phase as u8,
            Self::Motor(machine) => machine.phase as u8,
            Self::Constant => 1,
        }
    }
}
