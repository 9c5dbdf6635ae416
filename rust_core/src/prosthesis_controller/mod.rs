//! Prosthesis controllers, run at 200 Hz on sensor readings.

pub mod agent;
pub mod damper_fsm;
pub mod motor_fsm;

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::prosthesis_device::DeviceKind;
use crate::signals::Readings;
use damper_fsm::DamperFsmParams;
use motor_fsm::MotorFsmParams;

/// Phase of the gait as the prosthesis sees it (numbers of Figures 6 and 10).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum Phase {
    /// 1: knee flexes under load.
    #[default]
    EarlyStance = 1,
    /// 2: knee extends under load.
    MidStance,
    /// 3: push-off.
    LateStance,
    /// 4: swing, knee flexing.
    SwingFlexion,
    /// 5: swing, knee extending.
    SwingExtension,
}

/// What a reference controller remembers of its walker between samples. All of them share it, so that none can meet the memory
/// of another; one that needs less leaves the rest as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GaitMemory {
    /// Present phase; always early stance where there is but one.
    pub phase: Phase,
    /// Samples since the phase began.
    in_phase: u32,
    /// Samples for which the knee has been extended, counted from the first.
    extended: u32,
}

impl GaitMemory {
    /// Number of the phase, 1 to 5.
    pub fn phase(&self) -> u8 {
        self.phase as u8
    }
}

/// The reference controllers of a block of walkers: those that belong to their knee unit.
#[derive(Clone, Debug)]
pub enum ReferenceController<const L: usize> {
    /// Figure 6.
    Damper(DamperFsmParams),
    /// Figure 10, and each motor's current limit, A.
    Motor(MotorFsmParams, [f64; L]),
    /// A command that never changes: the friction that each knee is set to, N m.
    Constant([f64; L]),
}

impl<const L: usize> ReferenceController<L> {
    /// The controllers of equal walkers.
    pub fn new(config: &Config) -> Self {
        match config.device.kind {
            DeviceKind::Damper => Self::Damper(config.state_machine.clone()),
            DeviceKind::Motor => Self::Motor(config.motor_state_machine.clone(), [config.motor.current_limit_a; L]),
            DeviceKind::Friction => Self::Constant([config.friction_knee.set_friction_nm; L]),
        }
    }

    /// Gives the walker in `lane`, whose knee unit is of the same kind, what its controller takes from that unit.
    pub fn set(&mut self, lane: usize, config: &Config) {
        match self {
            Self::Damper(_) => {}
            Self::Motor(_, current_limit) => current_limit[lane] = config.motor.current_limit_a,
            Self::Constant(friction) => friction[lane] = config.friction_knee.set_friction_nm,
        }
    }

    /// Takes one sample of the walker in `lane` and returns the command to its knee unit, in the unit's own unit.
    pub fn update(&self, lane: usize, memory: &mut GaitMemory, readings: &Readings) -> f64 {
        match self {
            Self::Damper(params) => params.update(memory, readings),
            Self::Motor(params, current_limit) => params.update(&mut memory.phase, current_limit[lane], readings),
            Self::Constant(friction) => friction[lane],
        }
    }
}
