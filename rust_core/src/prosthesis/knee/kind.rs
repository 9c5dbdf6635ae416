//! Which knee unit the leg has.

use serde::{Deserialize, Serialize};
use strum::{EnumIter, IntoStaticStr, VariantNames};

use crate::prosthesis::knee::command::Command;
use crate::prosthesis::knee::damper::variable_damper;
use crate::prosthesis::knee::friction::constant_friction;
use crate::prosthesis::knee::motor::geared_motor;
use crate::schema::params::{ANY, Choice, params};

/// Which knee unit the leg has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, EnumIter, IntoStaticStr, VariantNames)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
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
    /// Id of the Gymnasium environment whose leg has the unit.
    pub fn env_id(self) -> &'static str {
        match self {
            Self::Damper => "prosthesis_gym/DamperKnee-v0",
            Self::Motor => "prosthesis_gym/MotorKnee-v0",
            Self::Friction => "prosthesis_gym/FrictionKnee-v0",
        }
    }

    /// What the unit is commanded.
    pub fn command(self) -> Command {
        match self {
            Self::Damper => variable_damper::COMMAND,
            Self::Motor => geared_motor::COMMAND,
            Self::Friction => constant_friction::COMMAND,
        }
    }

    /// Whether its reference controller tells the phases of the gait apart.
    pub fn has_phases(self) -> bool {
        self != Self::Friction
    }

    /// Whether the unit has a motor.
    pub fn has_motor(self) -> bool {
        self == Self::Motor
    }
}

impl Choice for DeviceKind {}

params! {
    /// Choice of the knee unit.
    pub struct DeviceParams {
        /// Knee unit of the leg.
        kind: DeviceKind = DeviceKind::Damper, "", ANY;
    }
}
