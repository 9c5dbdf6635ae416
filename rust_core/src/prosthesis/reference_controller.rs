//! Reference controllers, run at 200 Hz on sensor readings: what drives a knee unit where no agent does.

use crate::prosthesis::gait::GaitMemory;
use crate::prosthesis::knee::damper::state_machine::DamperFsmParams;
use crate::prosthesis::knee::kind::DeviceKind;
use crate::prosthesis::knee::motor::state_machine::MotorFsmParams;
use crate::prosthesis::knee::unit::KneeParams;
use crate::signals::Readings;

/// Parameters of the reference controllers and of the knee units that they belong to.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceParams<'a> {
    /// Knee units.
    pub knee: KneeParams<'a>,
    /// State machine of the damper knee.
    pub damper: &'a DamperFsmParams,
    /// State machine of the motor knee.
    pub motor: &'a MotorFsmParams,
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
    pub fn new(params: &ReferenceParams<'_>) -> Self {
        match params.knee.kind {
            DeviceKind::Damper => Self::Damper(params.damper.clone()),
            DeviceKind::Motor => Self::Motor(params.motor.clone(), [params.knee.motor.current_limit_a; L]),
            DeviceKind::Friction => Self::Constant([params.knee.friction.set_friction_nm; L]),
        }
    }

    /// Gives the walker in `lane`, whose knee unit is of the same kind, what its controller takes from that unit.
    pub fn set(&mut self, lane: usize, params: &ReferenceParams<'_>) {
        match self {
            Self::Damper(_) => {}
            Self::Motor(_, current_limit) => current_limit[lane] = params.knee.motor.current_limit_a,
            Self::Constant(friction) => friction[lane] = params.knee.friction.set_friction_nm,
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
