//! Knee units: what turns the command into knee torque. Each has a folder of its own with its parameters, branch-free equations
//! and reference controller, and one arm in each `match` of [`KneeUnit`].

use crate::prosthesis::knee::damper::variable_damper::{
    self, VariableDamper, VariableDamperLanes, VariableDamperParams,
};
use crate::prosthesis::knee::friction::constant_friction::{
    self, ConstantFriction, ConstantFrictionLanes, ConstantFrictionParams,
};
use crate::prosthesis::knee::joint::{JointMotionLanes, UnitTorque, UnitTorqueLanes};
use crate::prosthesis::knee::kind::DeviceKind;
use crate::prosthesis::knee::motor::geared_motor::{
    self, GearedMotor, GearedMotorLanes, GearedMotorParams, MotorSignals, MotorSignalsLanes, Rotor, RotorLanes,
};

/// Parameters of the knee units, of which the leg has one.
#[derive(Clone, Copy, Debug)]
pub struct KneeParams<'a> {
    /// The one that it has.
    pub kind: DeviceKind,
    /// Variable damper.
    pub damper: &'a VariableDamperParams,
    /// Motor and strain-wave gear.
    pub motor: &'a GearedMotorParams,
    /// Constant friction.
    pub friction: &'a ConstantFrictionParams,
}

impl KneeParams<'_> {
    /// Largest command that the unit carries out, in its own unit.
    pub fn most_command(&self) -> f64 {
        match self.kind {
            DeviceKind::Damper => self.damper.max_damping_nms2_rad2,
            DeviceKind::Motor => self.motor.current_limit_a,
            DeviceKind::Friction => self.friction.max_friction_nm,
        }
    }
}

/// What a knee unit of a block of walkers works on.
#[derive(Clone, Copy, Debug)]
pub struct UnitInputs<'a, const L: usize> {
    /// Motion of the knee.
    pub joint: &'a JointMotionLanes<L>,
    /// State of the rotor.
    pub rotor: &'a RotorLanes<L>,
    /// Direction of its rotation (-1, 0, 1); 0 at rest.
    pub direction: &'a [f64; L],
    /// Signals that [`KneeUnit::sense`] has left for them.
    pub motor: &'a MotorSignalsLanes<L>,
    /// Command, in the unit's own unit.
    pub command: &'a [f64; L],
}

/// Constants of the knee units of a block of walkers.
#[derive(Clone, Debug)]
pub enum KneeUnit<const L: usize> {
    /// Variable damper.
    Damper(VariableDamperLanes<L>),
    /// Motor and strain-wave gear.
    Motor(GearedMotorLanes<L>),
    /// Constant friction with extension assist.
    Friction(ConstantFrictionLanes<L>),
}

impl<const L: usize> KneeUnit<L> {
    /// The unit that `params` choose.
    pub fn new(params: &KneeParams<'_>) -> Self {
        match params.kind {
            DeviceKind::Damper => Self::Damper(VariableDamperLanes::splat(VariableDamper::from(params.damper))),
            DeviceKind::Motor => Self::Motor(GearedMotorLanes::splat(GearedMotor::from(params.motor))),
            DeviceKind::Friction => {
                Self::Friction(ConstantFrictionLanes::splat(ConstantFriction::from(params.friction)))
            }
        }
    }

    /// Gives the walker in `lane` the constants of `params`, whose unit must be of the same kind.
    pub fn set(&mut self, lane: usize, params: &KneeParams<'_>) {
        match self {
            Self::Damper(damper) => damper.set(lane, VariableDamper::from(params.damper)),
            Self::Motor(motor) => motor.set(lane, GearedMotor::from(params.motor)),
            Self::Friction(knee) => knee.set(lane, ConstantFriction::from(params.friction)),
        }
    }

    /// Whether the unit's rotor has a state of its own.
    pub fn has_rotor(&self) -> bool {
        matches!(self, Self::Motor(_))
    }

    /// State of the unit's rotor at the start of a trial with the knee at rest at `flexion` (rad).
    pub fn start(&self, lane: usize, flexion: f64) -> Rotor {
        match self {
            Self::Damper(_) | Self::Friction(_) => Rotor::default(),
            Self::Motor(motor) => Rotor { angle: flexion / motor.inverse_ratio[lane], ..Rotor::default() },
        }
    }

    /// Evaluates the signals that guards, torques and rates depend on.
    #[inline(always)]
    pub fn sense(
        &self,
        joint: &JointMotionLanes<L>,
        rotor: &RotorLanes<L>,
        command: &[f64; L],
        signals: &mut MotorSignalsLanes<L>,
    ) {
        match self {
            Self::Damper(_) | Self::Friction(_) => {}
            Self::Motor(motor) => {
                for lane in 0..L {
                    let motor = motor.get(lane);
                    signals.set(lane, geared_motor::signals(&motor, &joint.get(lane), &rotor.get(lane), command[lane]));
                }
            }
        }
    }

    /// Torques on the knee.
    #[inline(always)]
    pub fn torques(&self, at: &UnitInputs<'_, L>, step: &[f64; L], torques: &mut UnitTorqueLanes<L>) {
        match self {
            Self::Damper(damper) => {
                for lane in 0..L {
                    let joint = at.joint.get(lane);
                    torques.set(lane, variable_damper::damper_torque(&damper.get(lane), &joint, at.command[lane]));
                }
            }
            Self::Motor(motor) => {
                for lane in 0..L {
                    let torque = geared_motor::motor_torque(
                        &motor.get(lane),
                        &at.motor.get(lane),
                        &at.joint.get(lane),
                        &at.rotor.get(lane),
                        at.direction[lane],
                        step[lane],
                    );
                    torques.set(lane, torque);
                }
            }
            Self::Friction(knee) => {
                for lane in 0..L {
                    let joint = at.joint.get(lane);
                    torques.set(lane, constant_friction::friction_torque(&knee.get(lane), &joint, at.command[lane]));
                }
            }
        }
    }

    /// Rates of the rotors, given the knee's flexion acceleration over the step.
    #[inline(always)]
    pub fn rates(
        &self,
        at: &UnitInputs<'_, L>,
        flexion_acceleration: &[f64; L],
        step: &[f64; L],
        rates: &mut RotorLanes<L>,
    ) {
        match self {
            Self::Damper(_) | Self::Friction(_) => {}
            Self::Motor(motor) => {
                for lane in 0..L {
                    let rate = geared_motor::rotor_rates(
                        &motor.get(lane),
                        &at.motor.get(lane),
                        &at.joint.get(lane),
                        &at.rotor.get(lane),
                        at.direction[lane],
                        flexion_acceleration[lane],
                        step[lane],
                    );
                    rates.set(lane, rate);
                }
            }
        }
    }

    /// In which lanes the direction of rotation must change, at the sensed signals.
    #[inline(always)]
    pub fn fired(&self, at: &UnitInputs<'_, L>) -> [bool; L] {
        match self {
            Self::Damper(_) | Self::Friction(_) => [false; L],
            Self::Motor(motor) => {
                let mut fired = [false; L];
                for lane in 0..L {
                    let (signals, rotor) = (at.motor.get(lane), at.rotor.get(lane));
                    fired[lane] =
                        geared_motor::changes_direction(&motor.get(lane), &signals, &rotor, at.direction[lane]);
                }
                fired
            }
        }
    }

    /// Changes the direction of rotation in `lane`: the rotor's new state, its direction and the signals that follow.
    pub fn transition(&self, lane: usize, at: &UnitInputs<'_, L>) -> (Rotor, f64, MotorSignals) {
        let mut rotor = at.rotor.get(lane);
        match self {
            Self::Damper(_) | Self::Friction(_) => (rotor, 0.0, MotorSignals::default()),
            Self::Motor(motor) => {
                let motor = motor.get(lane);
                if at.direction[lane] != 0.0 {
                    rotor.rate = 0.0;
                }
                let signals = geared_motor::signals(&motor, &at.joint.get(lane), &rotor, at.command[lane]);
                (rotor, geared_motor::break_away(&motor, &signals), signals)
            }
        }
    }

    /// Power (W) of what the command sets, of springs and of friction; and kinetic energy (J) of the unit's own.
    pub fn powers(&self, lane: usize, at: &UnitInputs<'_, L>, torque: &UnitTorque) -> ([f64; 3], f64) {
        let (joint, rotor) = (at.joint.get(lane), at.rotor.get(lane));
        match self {
            Self::Damper(damper) => {
                let spring = damper.spring[lane] * joint.flexion;
                let parts = [torque.damper, spring, torque.torque - torque.damper - spring];
                (parts.map(|part| -part * joint.flexion_rate), 0.0)
            }
            Self::Motor(motor) => {
                let motor = motor.get(lane);
                let powers = geared_motor::powers(&motor, &at.motor.get(lane), &joint, &rotor, at.direction[lane]);
                (powers, 0.5 * motor.inertia * rotor.rate * rotor.rate)
            }
            Self::Friction(knee) => {
                let (assist, _) = constant_friction::extension_assist(&knee.get(lane), joint.flexion);
                let parts = [torque.damper, assist, torque.torque - torque.damper - assist];
                (parts.map(|part| -part * joint.flexion_rate), 0.0)
            }
        }
    }

    /// Current limit (A) and knee torque per ampere (N m/A) of an ideal drive train; zero for a unit without a motor.
    pub fn motor_scale(&self, lane: usize) -> (f64, f64) {
        match self {
            Self::Damper(_) | Self::Friction(_) => (0.0, 0.0),
            Self::Motor(motor) => {
                let motor = motor.get(lane);
                (motor.current_limit, motor.torque_constant / motor.inverse_ratio)
            }
        }
    }

    /// Electrical power I^2 R + k I omega and its Joule part (W).
    #[inline(always)]
    pub fn electrical_powers(&self, lane: usize, signals: &MotorSignals, rotor: &Rotor) -> [f64; 2] {
        match self {
            Self::Damper(_) | Self::Friction(_) => [0.0; 2],
            Self::Motor(motor) => {
                let joule = signals.current * signals.current * motor.resistance[lane];
                [joule + signals.torque * rotor.rate, joule]
            }
        }
    }
}
