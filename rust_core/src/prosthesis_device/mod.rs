//! Prosthesis device: what turns the command into knee and ankle torque.
//!
//! A knee unit is a file of its own with parameters and branch-free equations, and one arm in each `match` of [`KneeUnit`].

pub mod constant_friction;
pub mod end_stop;
pub mod geared_motor;
pub mod passive_ankle;
pub mod socket;
pub mod spring_damper;
pub mod tube;
pub mod variable_damper;

use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::lanes::lanes;
use crate::params::{ANY, Parameter, Range, params};
use constant_friction::{ConstantFriction, ConstantFrictionLanes};
use geared_motor::{GearedMotor, GearedMotorLanes, MotorSignals, MotorSignalsLanes, Rotor, RotorLanes};
use variable_damper::{VariableDamper, VariableDamperLanes};

/// Which knee unit the leg has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeviceKind {
    /// Variable damper (section 5.2).
    #[default]
    Damper,
    /// Motor and strain-wave gear (section 5.3).
    Motor,
    /// Constant friction with extension assist.
    Friction,
}

impl DeviceKind {
    /// Whether the unit has a motor.
    pub fn has_motor(self) -> bool {
        self == Self::Motor
    }
}

impl Parameter for DeviceKind {
    fn numbers(&self) -> [f64; 2] {
        [0.0; 2]
    }
    fn text(&self) -> String {
        format!("{self:?}").to_lowercase()
    }
    fn allowed(_: Range) -> String {
        "damper | motor | friction".to_owned()
    }
}

params! {
    /// Choice of the knee unit.
    pub struct DeviceParams {
        /// Knee unit of the leg.
        kind: DeviceKind = DeviceKind::Damper, "", ANY;
    }
}

lanes! {
    /// Motion of the knee joint.
    pub struct JointMotion, JointMotionLanes {
        /// Knee flexion -q5, rad.
        flexion: f64,
        /// Flexion velocity, rad/s.
        flexion_rate: f64,
    }
}

lanes! {
    /// Torque of a knee unit on joint 5 (extension positive), end stops apart.
    pub struct UnitTorque, UnitTorqueLanes {
        /// T_D, the damping or friction that the command sets, N m.
        damper: f64,
        /// All of it, N m.
        torque: f64,
        /// -d torque / d q5', N m s/rad.
        damping: f64,
        /// -d torque / d q5, N m/rad.
        stiffness: f64,
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
    /// The unit that section `device` chooses.
    pub fn new(config: &Config) -> Self {
        match config.device.kind {
            DeviceKind::Damper => Self::Damper(VariableDamperLanes::splat(VariableDamper::from(&config.knee))),
            DeviceKind::Motor => Self::Motor(GearedMotorLanes::splat(GearedMotor::from(&config.motor))),
            DeviceKind::Friction => {
                Self::Friction(ConstantFrictionLanes::splat(ConstantFriction::from(&config.friction_knee)))
            }
        }
    }

    /// Gives the walker in `lane` the constants of `config`, whose unit must be of the same kind.
    pub fn set(&mut self, lane: usize, config: &Config) {
        match self {
            Self::Damper(damper) => damper.set(lane, VariableDamper::from(&config.knee)),
            Self::Motor(motor) => motor.set(lane, GearedMotor::from(&config.motor)),
            Self::Friction(knee) => knee.set(lane, ConstantFriction::from(&config.friction_knee)),
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
