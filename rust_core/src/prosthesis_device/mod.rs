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

/// Knee unit of a block of walkers.
#[derive(Clone, Debug)]
pub enum KneeUnit<const L: usize> {
    /// Variable damper.
    Damper(VariableDamperLanes<L>),
    /// Geared motor with its direction of rotation (-1, 0, 1) and its signals at the last evaluation.
    Motor(Box<MotorUnit<L>>),
    /// Constant friction with extension assist.
    Friction(ConstantFrictionLanes<L>),
}

/// Geared motors of a block.
#[derive(Clone, Debug)]
pub struct MotorUnit<const L: usize> {
    constants: GearedMotorLanes<L>,
    /// Direction of rotation; 0 at rest.
    direction: [f64; L],
    signals: MotorSignalsLanes<L>,
}

impl<const L: usize> KneeUnit<L> {
    /// The unit that section `device` chooses.
    pub fn new(config: &Config) -> Self {
        match config.device.kind {
            DeviceKind::Damper => Self::Damper(VariableDamperLanes::splat(VariableDamper::from(&config.knee))),
            DeviceKind::Motor => Self::Motor(Box::new(MotorUnit {
                constants: GearedMotorLanes::splat(GearedMotor::from(&config.motor)),
                direction: [0.0; L],
                signals: MotorSignalsLanes::default(),
            })),
            DeviceKind::Friction => {
                Self::Friction(ConstantFrictionLanes::splat(ConstantFriction::from(&config.friction_knee)))
            }
        }
    }

    /// Whether the unit's rotor has a state of its own.
    pub fn has_rotor(&self) -> bool {
        matches!(self, Self::Motor(_))
    }

    /// State of the unit's rotor at the start of a trial with the knee at rest at `flexion` (rad).
    pub fn start(&mut self, lane: usize, flexion: f64) -> Rotor {
        match self {
            Self::Damper(_) | Self::Friction(_) => Rotor::default(),
            Self::Motor(unit) => {
                unit.direction[lane] = 0.0;
                Rotor { angle: flexion / unit.constants.inverse_ratio[lane], ..Rotor::default() }
            }
        }
    }

    /// Evaluates the signals that guards, torques and rates depend on.
    #[inline(always)]
    pub fn sense(&mut self, joint: &JointMotionLanes<L>, rotor: &RotorLanes<L>, command: &[f64; L]) {
        match self {
            Self::Damper(_) | Self::Friction(_) => {}
            Self::Motor(unit) => {
                for lane in 0..L {
                    let motor = unit.constants.get(lane);
                    let signals = geared_motor::signals(&motor, &joint.get(lane), &rotor.get(lane), command[lane]);
                    unit.signals.set(lane, signals);
                }
            }
        }
    }

    /// Torques on the knee.
    #[inline(always)]
    pub fn torques(
        &self,
        joint: &JointMotionLanes<L>,
        rotor: &RotorLanes<L>,
        command: &[f64; L],
        step: &[f64; L],
        torques: &mut UnitTorqueLanes<L>,
    ) {
        match self {
            Self::Damper(damper) => {
                for lane in 0..L {
                    let torque = variable_damper::damper_torque(&damper.get(lane), &joint.get(lane), command[lane]);
                    torques.set(lane, torque);
                }
            }
            Self::Motor(unit) => {
                for lane in 0..L {
                    let torque = geared_motor::motor_torque(
                        &unit.constants.get(lane),
                        &unit.signals.get(lane),
                        &joint.get(lane),
                        &rotor.get(lane),
                        unit.direction[lane],
                        step[lane],
                    );
                    torques.set(lane, torque);
                }
            }
            Self::Friction(knee) => {
                for lane in 0..L {
                    let torque = constant_friction::friction_torque(&knee.get(lane), &joint.get(lane), command[lane]);
                    torques.set(lane, torque);
                }
            }
        }
    }

    /// Rates of the rotors, given the knee's flexion acceleration over the step.
    #[inline(always)]
    pub fn rates(
        &self,
        joint: &JointMotionLanes<L>,
        rotor: &RotorLanes<L>,
        flexion_acceleration: &[f64; L],
        step: &[f64; L],
        rates: &mut RotorLanes<L>,
    ) {
        match self {
            Self::Damper(_) | Self::Friction(_) => {}
            Self::Motor(unit) => {
                for lane in 0..L {
                    let rate = geared_motor::rotor_rates(
                        &unit.constants.get(lane),
                        &unit.signals.get(lane),
                        &joint.get(lane),
                        &rotor.get(lane),
                        unit.direction[lane],
                        flexion_acceleration[lane],
                        step[lane],
                    );
                    rates.set(lane, rate);
                }
            }
        }
    }

    /// In which lanes a discrete state of the unit must change, at the sensed signals.
    #[inline(always)]
    pub fn fired(&self, rotor: &RotorLanes<L>) -> [bool; L] {
        match self {
            Self::Damper(_) | Self::Friction(_) => [false; L],
            Self::Motor(unit) => std::array::from_fn(|lane| {
                geared_motor::changes_direction(
                    &unit.constants.get(lane),
                    &unit.signals.get(lane),
                    &rotor.get(lane),
                    unit.direction[lane],
                )
            }),
        }
    }

    /// Changes the discrete state of `lane`; returns the rotor's new state.
    pub fn transition(&mut self, lane: usize, joint: &JointMotion, mut rotor: Rotor, command: f64) -> Rotor {
        match self {
            Self::Damper(_) | Self::Friction(_) => {}
            Self::Motor(unit) => {
                let motor = unit.constants.get(lane);
                if unit.direction[lane] != 0.0 {
                    rotor.rate = 0.0;
                }
                let signals = geared_motor::signals(&motor, joint, &rotor, command);
                unit.direction[lane] = geared_motor::break_away(&motor, &signals);
                unit.signals.set(lane, signals);
            }
        }
        rotor
    }

    /// Power (W) of what the command sets, of springs and of friction; and kinetic energy (J) of the unit's own.
    pub fn powers(&self, lane: usize, joint: &JointMotion, rotor: &Rotor, torque: &UnitTorque) -> ([f64; 3], f64) {
        match self {
            Self::Damper(damper) => {
                let spring = damper.spring[lane] * joint.flexion;
                let parts = [torque.damper, spring, torque.torque - torque.damper - spring];
                (parts.map(|part| -part * joint.flexion_rate), 0.0)
            }
            Self::Motor(unit) => {
                let motor = unit.constants.get(lane);
                let powers = geared_motor::powers(&motor, &unit.signals.get(lane), joint, rotor, unit.direction[lane]);
                (powers, 0.5 * motor.inertia * rotor.rate * rotor.rate)
            }
            Self::Friction(knee) => {
                let (assist, _) = constant_friction::extension_assist(&knee.get(lane), joint.flexion);
                let parts = [torque.damper, assist, torque.torque - torque.damper - assist];
                (parts.map(|part| -part * joint.flexion_rate), 0.0)
            }
        }
    }

    /// Motor signals of `lane` at the last evaluation; zero for a unit without a motor.
    pub fn motor_signals(&self, lane: usize) -> MotorSignals {
        match self {
            Self::Damper(_) | Self::Friction(_) => MotorSignals::default(),
            Self::Motor(unit) => unit.signals.get(lane),
        }
    }

    /// Current limit (A) and knee torque per ampere (N m/A) of an ideal drive train; zero for a unit without a motor.
    pub fn motor_scale(&self, lane: usize) -> (f64, f64) {
        match self {
            Self::Damper(_) | Self::Friction(_) => (0.0, 0.0),
            Self::Motor(unit) => {
                let motor = unit.constants.get(lane);
                (motor.current_limit, motor.torque_constant / motor.inverse_ratio)
            }
        }
    }

    /// Electrical power I^2 R + k I omega and its Joule part (W).
    pub fn electrical_powers(&self, lane: usize, rotor: &Rotor) -> [f64; 2] {
        match self {
            Self::Damper(_) | Self::Friction(_) => [0.0; 2],
            Self::Motor(unit) => {
                let signals = unit.signals.get(lane);
                let joule = signals.current * signals.current * unit.constants.resistance[lane];
                [joule + signals.torque * rotor.rate, joule]
            }
        }
    }
}
